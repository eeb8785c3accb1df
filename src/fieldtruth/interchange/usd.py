# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A world as a USD stage: ``world.usdc`` with its textures beside it, z up, in metres.

======================  ================================================================================================
``/World/Objects``      a prim per named object, an instance (scene graph instancing) of its mesh in ``Prototypes``
``/World/Swarms``       a ``PointInstancer`` per swarm, and one more for its members outside the world's edge
``/World/Ground``       tiles of the terrain, each with a mesh of class ground and one of class trail
``/World/Backdrop``     the land outside the world's edge
``/World/Prototypes``   meshes, one per material: abstract prims, which are drawn only where an object refers to them
``/World/Materials``    a ``UsdPreviewSurface`` per material
======================  ================================================================================================

Each ``Mesh`` has its class as ``semantics:labels:class`` and ``fieldtruth:classId``. Objects, swarms, ground and
backdrop have ``fieldtruth:instanceId``; objects and swarms also have ``semantics:labels:kind``, and prototypes
``semantics:labels:species``. The colour factor of an object is its primvar ``tint``, which ``UsdPreviewSurface`` cannot
multiply with a texture.
"""

import errno
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np
from pxr import Gf, Kind, Sdf, Tf, Usd, UsdGeom

from fieldtruth.core.classes import GROUND_ID, Label
from fieldtruth.core.geodesy import ORIGIN_HEIGHT, ORIGIN_LATITUDE, ORIGIN_LONGITUDE
from fieldtruth.interchange import check_scene_memory
from fieldtruth.interchange.ground import ground_tiles
from fieldtruth.interchange.ground_image import ground_images
from fieldtruth.interchange.images import encode_image
from fieldtruth.interchange.surfaces import mesh_surfaces
from fieldtruth.interchange.swarms import beyond_edge
from fieldtruth.interchange.usd_prims import (
    INSTANCE_ID,
    add_instancer,
    add_labels,
    add_material,
    add_mesh,
    add_number,
    add_tint,
    child,
)
from fieldtruth.world.model import Material, Mesh, World

STAGE: Final = "world.usdc"
TEXTURES: Final = "textures"
_VERTEX_BYTES, _FACE_BYTES, _MEMBER_BYTES = 64, 32, 300
"""Memory while a stage is saved: for a vertex and a face of a mesh that is shared, and for a member of a swarm."""
_ROOT: Final = Sdf.Path("/World")
_MATERIALS, _PROTOTYPES, _OBJECTS, _SWARMS, _GROUND, _BACKDROP = (
    _ROOT.AppendChild(name) for name in ("Materials", "Prototypes", "Objects", "Swarms", "Ground", "Backdrop")
)


def write(world: World, folder: Path, *, beyond: bool) -> None:
    """Write the stage and its textures into a new folder; ``beyond`` includes what is outside the world's edge."""
    meshes = _used_meshes(world, beyond=beyond)
    land = [world.backdrop] if beyond and world.backdrop is not None else []
    shared = sum(_VERTEX_BYTES * len(mesh.vertices) + _FACE_BYTES * len(mesh.faces) for mesh in (*meshes, *land))
    check_scene_memory(world, "usd", shared + _MEMBER_BYTES * sum(len(swarm.mesh) for swarm in world.swarms))
    (folder / TEXTURES).mkdir(parents=True)
    stage = Usd.Stage.CreateNew(str(folder / STAGE))
    _describe(stage, world)
    _add_materials(stage, world, folder, {name: None for mesh in (*meshes, *land) for name in mesh.materials})
    _add_prototypes(stage, world, meshes)
    _add_objects(stage, world)
    _add_swarms(stage, world, beyond=beyond)
    _add_ground(stage, world, folder)
    for mesh in land:
        _add_group(stage, _BACKDROP)
        _add_surfaces(stage, _BACKDROP, mesh, world)
        add_number(stage.GetPrimAtPath(_BACKDROP), INSTANCE_ID, GROUND_ID)
    _save(stage)


def _save(stage: Usd.Stage) -> None:
    """Save the stage; raises OSError, because the library's own error is pages long."""
    try:
        stage.GetRootLayer().Save()
    except Tf.ErrorException as error:
        code = next((code for code in errno.errorcode if os.strerror(code) in str(error)), errno.EIO)
        raise OSError(code, os.strerror(code), stage.GetRootLayer().realPath) from error


def _describe(stage: Usd.Stage, world: World) -> None:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, _ROOT).GetPrim()
    Usd.ModelAPI(root).SetKind(Kind.Tokens.assembly)
    stage.SetDefaultPrim(root)
    stage.GetRootLayer().customLayerData = {
        "fieldtruth": {
            "environment": world.name,
            "seed": world.seed,
            "axes": "x north, y west, z up",
            "originLatitudeDeg": ORIGIN_LATITUDE,
            "originLongitudeDeg": ORIGIN_LONGITUDE,
            "originHeightM": ORIGIN_HEIGHT,
        }
    }


def _add_group(stage: Usd.Stage, path: Sdf.Path) -> None:
    Usd.ModelAPI(UsdGeom.Xform.Define(stage, path)).SetKind(Kind.Tokens.group)


def _used_meshes(world: World, *, beyond: bool) -> list[Mesh]:
    """Meshes of the objects and swarms; those of swarms that are wholly outside the edge only if ``beyond``."""
    used = {instance.mesh for instance in world.instances}
    for swarm in world.swarms:
        if beyond or not beyond_edge(world, swarm).all():
            used |= {*swarm.meshes}
    return [mesh for name, mesh in world.meshes.items() if name in used]


def _add_materials(stage: Usd.Stage, world: World, folder: Path, names: Iterable[str]) -> None:
    UsdGeom.Scope.Define(stage, _MATERIALS)
    materials = [world.materials[name] for name in names]
    for texture in {material.texture: None for material in materials}:
        (folder / TEXTURES / f"{texture}.jpg").write_bytes(encode_image(world.textures[texture][..., :3]))
    for material in materials:
        add_material(stage, child(_MATERIALS, material.name), material, f"./{TEXTURES}/{material.texture}.jpg")


def _add_prototypes(stage: Usd.Stage, world: World, meshes: Iterable[Mesh]) -> None:
    stage.CreateClassPrim(_PROTOTYPES)
    for mesh in meshes:
        path = child(_PROTOTYPES, mesh.name)
        UsdGeom.Xform.Define(stage, path)
        _add_surfaces(stage, path, mesh, world)
        if mesh.species:
            add_labels(stage.GetPrimAtPath(path), "species", *mesh.species)


def _add_surfaces(stage: Usd.Stage, path: Sdf.Path, mesh: Mesh, world: World) -> None:
    for surface in mesh_surfaces(mesh, world.materials):
        add_mesh(stage, child(path, surface.material), surface, child(_MATERIALS, surface.material))


def _add_objects(stage: Usd.Stage, world: World) -> None:
    _add_group(stage, _OBJECTS)
    for instance in world.instances:
        xform = UsdGeom.Xform.Define(stage, child(_OBJECTS, instance.name))
        prim = xform.GetPrim()
        prim.GetReferences().AddInternalReference(child(_PROTOTYPES, instance.mesh))
        prim.SetInstanceable(True)
        Usd.ModelAPI(prim).SetKind(Kind.Tokens.component)
        # USD multiplies rows with matrices from the right.
        xform.AddTransformOp().Set(Gf.Matrix4d(*instance.world_from_object.T.ravel().tolist()))
        add_number(prim, INSTANCE_ID, instance.object_id)
        add_labels(prim, "kind", instance.kind)
        add_tint(prim, np.array([instance.tint], np.float32))


def _add_swarms(stage: Usd.Stage, world: World, *, beyond: bool) -> None:
    _add_group(stage, _SWARMS)
    for swarm in world.swarms:
        outside = beyond_edge(world, swarm)
        far = swarm.name if outside.all() else f"{swarm.name}_beyond"
        for name, members in ((swarm.name, ~outside), (far, outside & beyond)):
            if members.any():
                prototypes = [child(_PROTOTYPES, mesh) for mesh in swarm.meshes]
                path = child(_SWARMS, name)
                prim = add_instancer(stage, path, prototypes, swarm, np.flatnonzero(members)).GetPrim()
                Usd.ModelAPI(prim).SetKind(Kind.Tokens.component)
                add_number(prim, INSTANCE_ID, swarm.object_id)
                add_labels(prim, "kind", swarm.kind)


def _add_ground(stage: Usd.Stage, world: World, folder: Path) -> None:
    _add_group(stage, _GROUND)
    add_number(stage.GetPrimAtPath(_GROUND), INSTANCE_ID, GROUND_ID)
    tiles = list(ground_tiles(world))
    for tile, jpeg in zip(tiles, ground_images(world, tiles), strict=True):
        image = f"{TEXTURES}/{tile.name}.jpg"
        (folder / image).write_bytes(jpeg)
        material = child(_MATERIALS, tile.name)
        mixed = Material(name=tile.name, label=Label.GROUND, texture=tile.name)
        add_material(stage, material, mixed, f"./{image}", tiled=False)
        path = child(_GROUND, tile.name)
        UsdGeom.Xform.Define(stage, path)
        for surface in tile.surfaces:
            add_mesh(stage, child(path, surface.label.name.lower()), surface, material)
