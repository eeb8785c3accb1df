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

from pathlib import Path
from typing import Final

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom

from fieldtruth.core.classes import Label
from fieldtruth.core.geodesy import ORIGIN_HEIGHT, ORIGIN_LATITUDE, ORIGIN_LONGITUDE
from fieldtruth.interchange.ground import ground_tiles
from fieldtruth.interchange.ground_image import ground_image
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
)
from fieldtruth.render.materials import material_table
from fieldtruth.world.model import GROUND_ID, Material, Mesh, World

STAGE: Final = "world.usdc"
TEXTURES: Final = "textures"
GROUND_PIXELS: Final = 40.0
"""Pixels per metre of the ground's images."""
_ROOT: Final = Sdf.Path("/World")
_MATERIALS, _PROTOTYPES, _OBJECTS, _SWARMS, _GROUND, _BACKDROP = (
    _ROOT.AppendChild(name) for name in ("Materials", "Prototypes", "Objects", "Swarms", "Ground", "Backdrop")
)


def write(world: World, folder: Path, *, beyond: bool = False) -> None:
    """Write the stage and its textures into a new folder; ``beyond`` includes what is outside the world's edge."""
    (folder / TEXTURES).mkdir(parents=True)
    stage = Usd.Stage.CreateNew(str(folder / STAGE))
    _describe(stage, world)
    _add_materials(stage, world, folder)
    _add_prototypes(stage, world, beyond=beyond)
    _add_objects(stage, world)
    _add_swarms(stage, world, beyond=beyond)
    _add_ground(stage, world, folder)
    if beyond and world.backdrop is not None:
        _add_group(stage, _BACKDROP)
        _add_surfaces(stage, _BACKDROP, world.backdrop, world)
        add_number(stage.GetPrimAtPath(_BACKDROP), INSTANCE_ID, GROUND_ID)
    stage.GetRootLayer().Save()


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


def _add_materials(stage: Usd.Stage, world: World, folder: Path) -> None:
    UsdGeom.Scope.Define(stage, _MATERIALS)
    for name, texture in world.textures.items():
        (folder / TEXTURES / f"{name}.jpg").write_bytes(encode_image(texture))
    for name, material in world.materials.items():
        add_material(stage, _MATERIALS.AppendChild(name), material, f"./{TEXTURES}/{material.texture}.jpg")


def _add_prototypes(stage: Usd.Stage, world: World, *, beyond: bool) -> None:
    """Add the meshes that are used; those that only occur outside the edge only if ``beyond``."""
    stage.CreateClassPrim(_PROTOTYPES)
    used = {instance.mesh for instance in world.instances}
    for swarm in world.swarms:
        if beyond or not beyond_edge(world, swarm).all():
            used |= {*swarm.meshes}
    for name, mesh in world.meshes.items():
        if name in used:
            path = _PROTOTYPES.AppendChild(name)
            UsdGeom.Xform.Define(stage, path)
            _add_surfaces(stage, path, mesh, world)
            if mesh.species:
                add_labels(stage.GetPrimAtPath(path), "species", *mesh.species)


def _add_surfaces(stage: Usd.Stage, path: Sdf.Path, mesh: Mesh, world: World) -> None:
    for surface in mesh_surfaces(mesh, world.materials):
        add_mesh(stage, path.AppendChild(surface.material), surface, _MATERIALS.AppendChild(surface.material))


def _add_objects(stage: Usd.Stage, world: World) -> None:
    _add_group(stage, _OBJECTS)
    for instance in world.instances:
        xform = UsdGeom.Xform.Define(stage, _OBJECTS.AppendChild(instance.name))
        prim = xform.GetPrim()
        prim.GetReferences().AddInternalReference(_PROTOTYPES.AppendChild(instance.mesh))
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
                prototypes = [_PROTOTYPES.AppendChild(mesh) for mesh in swarm.meshes]
                path = _SWARMS.AppendChild(name)
                prim = add_instancer(stage, path, prototypes, swarm, np.flatnonzero(members)).GetPrim()
                Usd.ModelAPI(prim).SetKind(Kind.Tokens.component)
                add_number(prim, INSTANCE_ID, swarm.object_id)
                add_labels(prim, "kind", swarm.kind)


def _add_ground(stage: Usd.Stage, world: World, folder: Path) -> None:
    _add_group(stage, _GROUND)
    add_number(stage.GetPrimAtPath(_GROUND), INSTANCE_ID, GROUND_ID)
    table = material_table(world)
    for tile in ground_tiles(world):
        image = f"{TEXTURES}/{tile.name}.jpg"
        (folder / image).write_bytes(encode_image(ground_image(world, tile, GROUND_PIXELS, table)))
        material = _MATERIALS.AppendChild(tile.name)
        mixed = Material(name=tile.name, label=Label.GROUND, texture=tile.name)
        add_material(stage, material, mixed, f"./{image}", tiled=False)
        path = _GROUND.AppendChild(tile.name)
        UsdGeom.Xform.Define(stage, path)
        for surface in tile.surfaces:
            add_mesh(stage, path.AppendChild(surface.label.name.lower()), surface, material)
