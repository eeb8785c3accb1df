# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Prims of a USD stage: meshes with their class, and materials with a texture."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdSemantics, UsdShade, Vt

from fieldtruth.core.arrays import Float32Array, Index
from fieldtruth.core.classes import CLASSES
from fieldtruth.core.transforms import quaternion_wxyz_from_rotation
from fieldtruth.interchange.images import roughness
from fieldtruth.interchange.surfaces import Surface
from fieldtruth.world.model import Material, Swarm

INSTANCE_ID: Final = "fieldtruth:instanceId"
CLASS_ID: Final = "fieldtruth:classId"
TRANSLUCENCY: Final = "fieldtruth:translucency"
"""Share of the light that leaves transmit, on their materials: ``UsdPreviewSurface`` has no such input."""


def child(path: Sdf.Path, name: str) -> Sdf.Path:
    """Path of a prim below another; characters that USD does not allow in names become underscores."""
    return path.AppendChild(Tf.MakeValidIdentifier(name))


def add_mesh(stage: Usd.Stage, path: Sdf.Path, surface: Surface, material: Sdf.Path) -> None:
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
    add_labels(prim, "class", CLASSES[surface.label].name)
    add_number(prim, CLASS_ID, int(surface.label))
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
