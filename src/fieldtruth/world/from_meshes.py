# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Triangles of a user's own meshes with class, name and colour, checked: what ``World.from_meshes`` makes a world of.

Meshes and scenes of trimesh are known by their attributes; the library itself is not needed.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import count
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import CLASSES, NOT_OF_WORLDS, Label
from fieldtruth.core.errors import ConfigurationError, UnknownNameError, nearest_first

GREY: Final = (0.3, 0.3, 0.3)
"""Colour of meshes without one."""
FARTHEST: Final = 10_000.0
"""Distance [m] of vertices from the origin along each axis at most: a position there is single precision, 1 mm."""
TAKEN: Final = ("husky", "meshes_ground")
"""Names of the robot and of the ground, instance ids 0 and 1."""

_CLASSES: Final = {
    name.replace(" ", "_").lower(): each.label
    for each in CLASSES
    if each.label not in {*NOT_OF_WORLDS, Label.VOID, Label.SKY}
    for name in (each.name, each.label.name)
}


@dataclass(frozen=True)
class MeshPart:
    """Triangles of one class for ``World.from_meshes``. Parts of equal names are one object with one instance id."""

    mesh: Any
    """``(vertices, faces)``: (n, 3) [m] and (m, 3) rows of vertices; or a mesh or a scene of trimesh. Corners are
    counter-clockwise seen from outside, as in glTF: photographs light that side. All else does not depend on it."""
    label: str | int | Mapping[str, str | int] = ""
    """Class: a name, a ``Label`` or its id, any of those that worlds have; for a scene also by the name of its node, in
    which ``*`` stands for any text and the first match counts. Otherwise it is the mesh's ``metadata["label"]``."""
    name: str = ""
    """Name of the object. Otherwise that of the scene's node, the mesh's ``metadata["name"]``, or class and number."""
    colour: tuple[float, float, float] = GREY
    """Share of red, green and blue light that it reflects, each 0 to 1, linear."""
    pose: ArrayLike | None = None
    """world_from_mesh (4, 4), which may scale; None: the mesh is in the world's frame, x north, y west, z up."""


class Triangles(NamedTuple):
    """Triangles of one class and colour in the world."""

    corners: Array  # (m, 3, 3) [m]
    label: Label
    colour: tuple[float, float, float]


def objects_of(meshes: Iterable[Any]) -> dict[str, list[Triangles]]:
    """Return the triangles of each object by its name, in the order in which names first occur.

    Raises as ``World.from_meshes``.
    """
    if not isinstance(meshes, Iterable):
        raise ConfigurationError(f"meshes must be a list, got a {type(meshes).__name__}")
    found = [each for k, item in enumerate(meshes) for each in _triangles(item, f"meshes[{k}]")]
    if not found:
        raise ConfigurationError("meshes must hold one mesh at least, got none")
    names = {name for name, _ in found}
    objects: dict[str, list[Triangles]] = {}
    for name, triangles in found:
        kind = triangles.label.name.lower()
        key = name or next(new for k in count(1) if (new := f"{kind}_{k}") not in names)
        names.add(key)
        objects.setdefault(key, []).append(triangles)
    return objects


def _triangles(item: Any, where: str) -> Iterator[tuple[str, Triangles]]:
    """Yield names, empty where a mesh has no name, and triangles of the meshes of a part."""
    part = item if isinstance(item, MeshPart) else MeshPart(item)
    colour = _numbers(part.colour, (3,), f"{where}: colour")
    if not ((colour >= 0) & (colour <= 1)).all():
        raise ConfigurationError(f"{where}: colour must be three numbers from 0 to 1, got {part.colour}")
    outer = _pose(np.eye(4) if part.pose is None else part.pose, where)
    for node, mesh, inner in _nodes(part.mesh, where):
        metadata = getattr(mesh, "metadata", None) or {}
        name = str(part.name or node or metadata.get("name", ""))
        here = f"{where} ({node or name})" if node or name else where
        if name in TAKEN:
            raise ConfigurationError(f"{here}: name must not be {name!r}, which the robot or the ground has")
        label = _label(part.label, node or name, metadata.get("label", ""), here)
        pose = outer @ _pose(inner, here)
        corners = _corners(mesh, here) @ pose[:3, :3].T + pose[:3, 3]
        if (far := float(np.abs(corners).max())) > FARTHEST:
            raise ConfigurationError(f"{here}: vertices must be within {FARTHEST:g} m of the origin, got {far:g} m")
        if np.linalg.det(pose[:3, :3]) < 0:  # a mirror turns triangles inside out
            corners = corners[:, ::-1]
        red, green, blue = colour.tolist()
        yield name, Triangles(corners, label, (red, green, blue))


def _nodes(mesh: Any, where: str) -> Iterator[tuple[str, Any, Any]]:
    """Yield name, mesh and pose of a scene's nodes in the order of their names, or the mesh itself."""
    if hasattr(mesh, "graph") and hasattr(mesh, "geometry"):
        for node in sorted(mesh.graph.nodes_geometry):
            pose, geometry = mesh.graph[node]
            yield str(node), mesh.geometry[geometry], pose
    elif (isinstance(mesh, tuple | list) and len(mesh) == 2) or (hasattr(mesh, "vertices") and hasattr(mesh, "faces")):
        yield "", mesh, np.eye(4)
    else:
        kind = type(mesh).__name__
        raise ConfigurationError(f"{where}: expected (vertices, faces), or a mesh or scene of trimesh, got a {kind}")


def _label(given: Any, node: str, own: Any, where: str) -> Label:
    if isinstance(given, Mapping):
        given = next((value for pattern, value in given.items() if fnmatchcase(node, pattern)), "")
    value = own if isinstance(given, str) and given == "" else given
    if isinstance(value, int | np.integer) and not isinstance(value, bool) and value in _CLASSES.values():
        return Label(int(value))
    if value == "":
        raise ConfigurationError(f"{where}: label is missing; one of {', '.join(_CLASSES)}")
    found = _CLASSES.get(str(value).strip().lower().replace(" ", "_").replace("-", "_"))
    if found is None:
        raise UnknownNameError("class", str(value), nearest_first(str(value), _CLASSES), where)
    return found


def _corners(mesh: Any, where: str) -> Array:
    """Corners (m, 3, 3) of the triangles of vertices and faces."""
    vertices, faces = mesh if isinstance(mesh, tuple | list) else (mesh.vertices, getattr(mesh, "faces", ()))
    points = _numbers(vertices, (None, 3), f"{where}: vertices")
    rows = _numbers(faces, (None, 3), f"{where}: faces")
    bad = np.flatnonzero(((rows < 0) | (rows >= len(points)) | (rows != np.floor(rows))).any(axis=1))
    if len(bad):
        raise ConfigurationError(
            f"{where}: faces must be whole numbers from 0 to {len(points) - 1}, rows of the vertices; "
            f"row {bad[0]} is {np.asarray(faces)[bad[0]].tolist()}"
        )
    return points[rows.astype(np.intp)]


def _pose(pose: ArrayLike, where: str) -> Array:
    found = _numbers(pose, (4, 4), f"{where}: pose")
    if found[3].tolist() != [0, 0, 0, 1] or np.linalg.det(found[:3, :3]) == 0:
        raise ConfigurationError(f"{where}: pose must have a last row of 0, 0, 0, 1 and not be flat")
    return found


def _numbers(values: ArrayLike, shape: tuple[int | None, ...], what: str) -> Array:
    """Return finite numbers of a shape, in which None is any number but 0."""
    try:
        found: NDArray[Any] = np.asarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise ConfigurationError(f"{what} must be numbers: {error}") from error
    fits = found.ndim == len(shape) and all(
        n == s or (s is None and n) for n, s in zip(found.shape, shape, strict=True)
    )
    if not fits:
        text = ", ".join("n" if s is None else str(s) for s in shape)
        raise ConfigurationError(f"{what} must have the shape ({text}), not empty, got {found.shape}")
    bad = np.argwhere(~np.isfinite(found))
    if len(bad):
        raise ConfigurationError(f"{what} must be finite; row {bad[0][0]} is {found[bad[0][0]].tolist()}")
    return found
