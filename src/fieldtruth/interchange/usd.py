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
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from pxr import Gf, Kind, Sdf, Tf, Usd, UsdGeom, UsdSemantics, UsdShade, Vt

from fieldtruth.core.arrays import Float32Array, Index
from fieldtruth.core.classes import GROUND_ID, Label, SemanticClass
from fieldtruth.core.transforms import quaternion_wxyz_from_rotation
from fieldtruth.interchange import check_scene_memory
from fieldtruth.interchange.ground import ground_images, ground_tiles
from fieldtruth.interchange.surfaces import Surface, beyond_edge, encode_image, mesh_surfaces, roughness
from fieldtruth.world.model import Material, Mesh, Swarm, World

# ---------------------------------------------------------------------------------------------------------------------
# Prims

INSTANCE_ID: Final = "fieldtruth:instanceId"
CLASS_ID: Final = "fieldtruth:classId"
TRANSLUCENCY: Final = "fieldtruth:translucency"
"""Share of the light that leaves transmit, on their materials: ``UsdPreviewSurface`` has no such input."""


def child(path: Sdf.Path, name: str) -> Sdf.Path:
    """Path of a prim below another; characters that USD does not allow in names become underscores."""
    return path.AppendChild(Tf.MakeValidIdentifier(name))


def add_mesh(stage: Usd.Stage, path: Sdf.Path, surface: Surface, material: Sdf.Path, kind: SemanticClass) -> None:
    """Add the triangles of a surface with its class, bound to a material. Both sides are visible, as to our sensors."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(surface.vertices))
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(surface.normals))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(surface.faces.ravel()))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(surface.faces), 3, np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(True)
    bounds = np.stack([surface.vertices.min(axis=0), surface.vertices.max(axis=0)])
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(bounds))
    primvars = UsdGeom.PrimvarsAPI(mesh)
    coordinates = primvars.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    coordinates.Set(Vt.Vec2fArray.FromNumpy(surface.uv))
    prim = mesh.GetPrim()
    add_labels(prim, "class", kind.name)
    add_number(prim, CLASS_ID, int(kind.label))
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(UsdShade.Material(stage.GetPrimAtPath(material)))


def add_labels(prim: Usd.Prim, taxonomy: str, *labels: str) -> None:
    """Add semantic labels of a taxonomy to a prim."""
    UsdSemantics.LabelsAPI.Apply(prim, taxonomy).CreateLabelsAttr(Vt.TokenArray(list(labels)))


def add_number(prim: Usd.Prim, name: str, number: int) -> None:
    """Add a custom attribute that does not vary over time."""
    prim.CreateAttribute(name, Sdf.ValueTypeNames.Int, custom=True, variability=Sdf.VariabilityUniform).Set(number)


def add_material(stage: Usd.Stage, path: Sdf.Path, material: Material, image: str, *, tiled: bool = True) -> None:
    """Add a ``UsdPreviewSurface`` with a texture.

    Args:
        stage: the stage.
        path: of the material.
        material: its colour factor multiplies the texture in linear light.
        image: path of the texture relative to the stage.
        tiled: whether the texture repeats; otherwise its rim continues.
    """
    wrap = "repeat" if tiled else "clamp"
    made = UsdShade.Material.Define(stage, path)
    if material.translucency > 0:
        made.GetPrim().CreateAttribute(TRANSLUCENCY, Sdf.ValueTypeNames.Float).Set(material.translucency)
    reader = _shader(stage, path.AppendChild("coordinates"), "UsdPrimvarReader_float2", varname=("String", "st"))
    texture = _shader(
        stage,
        path.AppendChild("texture"),
        "UsdUVTexture",
        file=("Asset", Sdf.AssetPath(image)),
        sourceColorSpace=("Token", "sRGB"),
        wrapS=("Token", wrap),
        wrapT=("Token", wrap),
        scale=("Float4", Gf.Vec4f(*material.tint, 1.0)),
    )
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(
        reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    )
    surface = _shader(
        stage,
        path.AppendChild("surface"),
        "UsdPreviewSurface",
        roughness=("Float", roughness(material)),
        ior=("Float", 1.33 if material.mirror else 1.5),
    )
    colour = texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(colour)
    made.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", Sdf.ValueTypeNames.Token))


def _shader(stage: Usd.Stage, path: Sdf.Path, kind: str, **inputs: tuple[str, Any]) -> UsdShade.Shader:
    """A shader with inputs (type, value) by name."""
    shader = UsdShade.Shader.Define(stage, path)
    shader.CreateIdAttr(kind)
    for name, (type_name, value) in inputs.items():
        shader.CreateInput(name, getattr(Sdf.ValueTypeNames, type_name)).Set(value)
    return shader


def add_instancer(
    stage: Usd.Stage, path: Sdf.Path, prototypes: Sequence[Sdf.Path], swarm: Swarm, members: Index
) -> UsdGeom.PointInstancer:
    """Add a ``PointInstancer`` of some members (rows) of a swarm; ``prototypes`` are those of ``swarm.meshes``.

    Orientations are written in single precision, and in half precision for tools that do not know these yet.
    """
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    targets = []
    for prototype in prototypes:
        own = path.AppendPath(f"Prototypes/{prototype.name}")
        UsdGeom.Xform.Define(stage, own).GetPrim().GetReferences().AddInternalReference(prototype)
        stage.GetPrimAtPath(own).SetInstanceable(True)
        targets.append(own)
    instancer.CreatePrototypesRel().SetTargets(targets)
    poses = swarm.world_from_object[members]
    scales = np.cbrt(np.linalg.det(poses[:, :3, :3]))
    turns = quaternion_wxyz_from_rotation(poses[:, :3, :3] / scales[:, None, None])
    instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(swarm.mesh[members]))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(poses[:, :3, 3].astype(np.float32)))
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(np.repeat(scales[:, None], 3, axis=1).astype(np.float32)))
    instancer.CreateOrientationsfAttr(Vt.QuatfArray([Gf.Quatf(*turn) for turn in turns.tolist()]))
    instancer.CreateOrientationsAttr(Vt.QuathArray([Gf.Quath(*turn) for turn in turns.tolist()]))
    add_tint(instancer.GetPrim(), swarm.tint[members])
    now = Usd.TimeCode.Default()
    instancer.CreateExtentAttr(instancer.ComputeExtentAtTime(now, now))
    return instancer


def add_tint(prim: Usd.Prim, tints: Float32Array) -> None:
    """Add linear colour factors (n, 3), one or one per member, as the primvar ``tint``."""
    rate = UsdGeom.Tokens.constant if len(tints) == 1 else UsdGeom.Tokens.vertex
    primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar("tint", Sdf.ValueTypeNames.Color3fArray, rate)
    primvar.Set(Vt.Vec3fArray.FromNumpy(tints))


# ---------------------------------------------------------------------------------------------------------------------
# The stage

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
            "originLatitudeDeg": world.origin.latitude,
            "originLongitudeDeg": world.origin.longitude,
            "originHeightM": world.origin.height,
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
        kind, name = world.classes[surface.label], surface.material
        add_mesh(stage, child(path, name), surface, child(_MATERIALS, name), kind)


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
            kind = world.classes[surface.label]
            add_mesh(stage, child(path, kind.key), surface, material, kind)
