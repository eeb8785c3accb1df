# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Meshes of USD files, by Pixar's library: polygons as triangles, and the diffuse input of UsdPreviewSurface."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.world.objects.content import FileContent, Look, Part, gloss_of, pixels, shares


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Turn the library's error, which is long, into one line."""
    from pxr import Tf

    try:
        yield
    except Tf.ErrorException as error:
        raise ConfigurationError(f"{path}: cannot be read as USD") from error


def named_files(path: Path) -> Iterator[str]:
    """Yield the layers and images of a file that are not inside it, relative to its folder where they are below it."""
    from pxr import UsdUtils

    folder = path.parent.resolve()
    with _readable(path):
        layers, assets, missing = UsdUtils.ComputeAllDependencies(str(path.resolve()))
    for name in (*(layer.realPath for layer in layers[1:]), *assets, *missing):
        if "[" not in name:  # in a package, such as usdz
            other = folder / name
            yield str(other.relative_to(folder)) if other.is_relative_to(folder) else str(name)


def read_usd(path: Path) -> FileContent:
    """Read the visible meshes of the default time.

    Raises:
        ConfigurationError: the library cannot read it.
    """
    from pxr import Usd, UsdGeom

    with _readable(path):
        stage = Usd.Stage.Open(str(path))
    notes: list[str] = []
    cache = UsdGeom.XformCache()
    parts: list[Part] = []
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        if prim.IsA(UsdGeom.Mesh) and UsdGeom.Imageable(prim).ComputeVisibility() != UsdGeom.Tokens.invisible:
            parts += _parts(prim, np.array(cache.GetLocalToWorldTransform(prim)), notes)
    return FileContent(
        parts, float(UsdGeom.GetStageMetersPerUnit(stage)), str(UsdGeom.GetStageUpAxis(stage)).lower(), notes
    )


def _parts(prim: Any, local_to_world: Array, notes: list[str]) -> Iterator[Part]:
    """Yield the triangles of a mesh by material: corners are vertices of their own, because uv may differ at each."""
    from pxr import UsdGeom, UsdShade

    mesh = UsdGeom.Mesh(prim)
    points = np.array(mesh.GetPointsAttr().Get() or (), np.float64).reshape(-1, 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get() or (), np.int64)
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get() or (), np.int64)
    bad = (corners < 0) | (corners >= len(points))
    if not len(corners) or bad.any() or counts.min(initial=0) < 0 or counts.sum() != len(corners):
        notes.append(f"{prim.GetName()} has no triangles and is left out")
        return
    vertices = (points @ local_to_world[:3, :3] + local_to_world[3, :3])[corners]
    triangles, face = _fans(counts)
    if (mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded) != (np.linalg.det(local_to_world[:3, :3]) < 0):
        triangles = triangles[:, ::-1]
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("st")
    flat = primvar.ComputeFlattened() if primvar else None
    uv = None if flat is None else np.array(flat, np.float64)
    if uv is not None and primvar.GetInterpolation() in (UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying):
        uv = uv[corners] if len(uv) == len(points) else None
    uv = uv if uv is not None and len(uv) == len(corners) else None
    own = UsdShade.MaterialBindingAPI(prim)
    subsets = [(np.array(each.GetIndicesAttr().Get() or (), np.int64), each) for each in own.GetMaterialBindSubsets()]
    rest = ~np.isin(face, np.concatenate([rows for rows, _ in subsets])) if subsets else np.ones(len(face), np.bool_)
    groups = [(np.isin(face, rows), UsdShade.MaterialBindingAPI(each)) for rows, each in subsets]
    for chosen, binding in [(rest, own), *groups]:
        if chosen.any():
            look = _look(binding.ComputeBoundMaterial()[0], mesh, notes)
            yield Part(str(prim.GetName()), vertices, triangles[chosen], uv, look)


def _fans(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangles (m, 3) of polygons with so many corners each, by number of corner, and the polygon of each."""
    number = np.maximum(counts - 2, 0)
    face = np.repeat(np.arange(len(counts)), number)
    first = (np.cumsum(counts) - counts)[face]
    step = np.arange(len(face)) - np.repeat(np.cumsum(number) - number, number)
    return np.stack([first, first + step + 1, first + step + 2], axis=1), face


def _look(material: Any, mesh: Any, notes: list[str]) -> Look:
    """Look of a bound material, else the mesh's displayColor."""
    shader = material.ComputeSurfaceSource("")[0] if material else None
    if not shader:
        colours = mesh.GetDisplayColorAttr().Get()
        return Look("", shares(np.mean(colours, axis=0))) if colours else Look()
    rgb, image = (0.18, 0.18, 0.18), None  # the default of UsdPreviewSurface
    diffuse = shader.GetInput("diffuseColor")
    if diffuse and diffuse.HasConnectedSource():
        file = diffuse.GetConnectedSource()[0].GetInput("file")
        asset = file.Get() if file else None
        if asset is not None and asset.resolvedPath:
            image = pixels(_bytes(asset.resolvedPath), material.GetPrim().GetName(), notes)
            rgb = (1.0, 1.0, 1.0)
    elif diffuse and diffuse.Get() is not None:
        rgb = shares(np.array(diffuse.Get()))
    rough = shader.GetInput("roughness")
    value = rough.Get() if rough else None
    return Look(str(material.GetPrim().GetName()), rgb, image, gloss_of(0.5 if value is None else float(value)))


def _bytes(resolved: str) -> bytes:
    """Content of an image, which may be in a package."""
    from pxr import Ar

    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved))
    return bytes(asset.GetBuffer())
