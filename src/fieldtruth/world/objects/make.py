# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From the file of an object to a mesh in our frame with its materials, textures and colliders."""

import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial import ConvexHull, QhullError

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import CLASSES, ClassTable
from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning, suggestion
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Collider, Material, Mesh, label_of, make_mesh
from fieldtruth.world.objects.config import UNITS, ObjectConfig
from fieldtruth.world.objects.content import FileContent, Part
from fieldtruth.world.objects.files import read_file
from fieldtruth.world.objects.surfaces import made_sound, row_keys, solid_faces
from fieldtruth.world.solids import TILE

SIZES: Final = (0.001, 200.0)
"""Least and greatest length [m] of an object; another one is in a unit that was not said."""
LARGEST: Final = 1024
"""Side of a texture [texel] at most."""
MOST_CORNERS: Final = 64
"""Of a convex hull."""
_MANY: Final = 20_000
"""Points of which the hull takes seconds."""
MOST_SOLID: Final = 2000
"""Triangles of a collider that is the mesh itself."""
THICK: Final = 0.01
"""[m] of the plates that stand for these triangles."""
_PLAIN: Final = "plain_white"
_AXES: Final[Mapping[str, Array]] = {
    "z": np.eye(3), "y": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
}  # fmt: skip
"""Rotation to z up; what glTF calls the front, +z, becomes x forward."""


class OwnObject(NamedTuple):
    """A mesh, origin below its middle, with its materials and those textures that are not ours, by name."""

    mesh: Mesh
    materials: dict[str, Material]
    textures: dict[str, NDArray[np.uint8]]
    circles: Array
    """Circles (n, 3) of x, y and radius [m] that cover it, seen from above."""


def make_object(config: ObjectConfig, where: str, classes: ClassTable = CLASSES) -> OwnObject:
    """Read an object; ``where`` is its position in the layout, for messages. A repair is stated in a warning.

    Raises:
        ConfigurationError: a file that cannot be used, an unknown class or material.
    """
    where = f"{where} ({config.file})"
    content = read_file(config.path, looks=config.material == "")
    parts, notes = _in_our_frame(content, config, where), list(content.notes)
    vertices = np.concatenate([part.vertices for part in parts])
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = np.concatenate([part.faces + start for part, start in zip(parts, starts[:-1], strict=True)])
    of_part = np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])
    solid = solid_faces(vertices, faces)
    if not solid.any():
        raise ConfigurationError(f"{where}: must have a triangle with an area, got none")
    faces, of_part = faces[solid], of_part[solid]
    sound = made_sound(vertices, faces)
    notes += _notes(sound.turned, sound.open_edges, len(faces))
    if notes:
        warnings.warn(f"{where}: {'; '.join(notes)}", FieldtruthWarning, stacklevel=2)
    own = [_material(config, part, where, classes) for part in parts]
    rows, names, materials, textures = _distinct(config, own)
    plain = [config.material != "" or part.uv is None for part in parts]
    uv = np.concatenate([np.zeros((len(part.vertices), 2)) if part.uv is None else part.uv for part in parts])
    corner_uv = np.where(np.array(plain)[of_part][:, None, None], _box_uv(vertices, sound.faces), uv[sound.faces])
    keys = np.concatenate([sound.faces[..., None], sound.group[..., None]], axis=-1).reshape(-1, 2)
    keys = np.column_stack([keys, np.repeat(_facing(vertices, sound.faces) * np.array(plain)[of_part], 3)])
    _, first, number = np.unique(row_keys(keys), return_index=True, return_inverse=True)
    mesh = make_mesh(
        config.mesh, vertices[sound.faces].reshape(-1, 3)[first], sound.normals.reshape(-1, 3)[first],
        corner_uv.reshape(-1, 2)[first], number, names, np.array(rows)[of_part],
        colliders=_colliders(config, vertices, sound.faces, where),
        passable=config.collider == "none",
        footprint=float(np.hypot(*vertices[sound.faces].reshape(-1, 3)[:, :2].T).max()),
    )  # fmt: skip
    return OwnObject(mesh, materials, textures, circles_of(vertices[sound.faces].reshape(-1, 3)))


def _notes(turned: int, open_edges: int, count: int) -> Iterator[str]:
    if turned:
        yield f"{turned:,} of {count:,} triangles showed their inside and were turned"
    if open_edges:
        yield f"the mesh is open: {open_edges:,} edges belong to one triangle only"


def _in_our_frame(content: FileContent, config: ObjectConfig, where: str) -> list[Part]:
    """Parts [m], z up, with the origin below the middle of all, of the vertices that triangles use."""
    own = [_used(part) for part in content.parts]
    unit = UNITS[config.unit] if config.unit else content.unit or 1.0
    turn = _AXES[config.up or content.up or "z"]
    moved = [part.vertices @ turn.T * (unit * config.scale) for part in own]
    used = np.concatenate(moved)
    if not np.isfinite(used).all():
        raise ConfigurationError(f"{where}: vertices must be finite numbers")
    low, high = used.min(axis=0), used.max(axis=0)
    length = float((high - low).max())
    if not SIZES[0] <= length <= SIZES[1]:
        names = ", ".join(UNITS)
        raise ConfigurationError(
            f"{where}: must be {SIZES[0]:g} m to {SIZES[1]:g} m long, got {length:.3g} m; say unit: one of {names}"
        )
    origin = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]])
    return [part._replace(vertices=at - origin) for at, part in zip(moved, own, strict=True)]


def _used(part: Part) -> Part:
    """The part without vertices that no triangle has."""
    rows, faces = np.unique(part.faces, return_inverse=True)
    uv = None if part.uv is None else part.uv[rows]
    return part._replace(vertices=part.vertices[rows], faces=faces.reshape(-1, 3), uv=uv)


# ---------------------------------------------------------------------------------------------------------------------
# Materials and textures


def _material(
    config: ObjectConfig, part: Part, where: str, classes: ClassTable
) -> tuple[Material, NDArray[np.uint8] | None]:
    """Material of a part, without its number, and its image if that is not one of ours."""
    label = _label(config.label, part, where, classes)
    if config.material:
        if config.material not in MATERIALS:
            raise ConfigurationError(f"{where}: unknown material {config.material!r}; "
                                     f"{suggestion(config.material, MATERIALS)}")  # fmt: skip
        ours = MATERIALS[config.material]
        return _named(ours.name, label, ours.texture, ours.tint, ours.gloss, config), None
    look = part.look
    texture = _PLAIN if look.image is None else f"image_{_word(look.name)}"
    image = np.full((1, 1, 3), 255, np.uint8) if look.image is None else _square(look.image)
    return _named(_word(look.name) or "plain", label, texture, look.rgb, look.gloss, config), image


def _named(
    name: str, label: int, texture: str, tint: tuple[float, float, float], gloss: float, config: ObjectConfig
) -> Material:
    return Material(name=name, label=label, texture=texture, tint=tint, gloss=gloss, reflectance=config.reflectance)


def _label(given: str | Mapping[str, str], part: Part, where: str, classes: ClassTable) -> int:
    """Class of a part, by the name of its node or its material."""
    for pattern, name in ({"*": given} if isinstance(given, str) else given).items():
        if fnmatchcase(part.name, pattern) or fnmatchcase(part.look.name, pattern):
            return label_of(name, part.name, "", where, classes)
    raise ConfigurationError(
        f"{where}: label has no class for the node {part.name!r} with the material {part.look.name!r}; "
        f"'*' stands for all others"
    )


def _word(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")[:40]


def _square(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The image as a square whose side is a power of two; rows run downwards, as in the file."""
    side = min(1 << (max(image.shape[:2]) - 1).bit_length(), LARGEST)
    if image.shape[:2] == (side, side):
        return image
    return np.asarray(Image.fromarray(image).resize((side, side), Image.Resampling.LANCZOS))


def _distinct(
    config: ObjectConfig, own: Sequence[tuple[Material, NDArray[np.uint8] | None]]
) -> tuple[list[int], list[str], dict[str, Material], dict[str, NDArray[np.uint8]]]:
    """Row of each part in the names of materials, these names, materials and images, all named after the object."""
    images: dict[str, NDArray[np.uint8]] = {}
    number: dict[Material, int] = {}
    rows = []
    for material, image in own:
        if image is not None and material.texture != _PLAIN:
            base = f"{config.title}_{material.texture}"
            texture = next(
                name for name in (f"{base}_{k}" for k in range(len(own) + 1))
                if name not in images or np.array_equal(images[name], image)
            )  # fmt: skip
            images[texture] = image
            material = replace(material, texture=texture)
        elif image is not None:
            images[_PLAIN] = image
        rows.append(number.setdefault(material, len(number)))
    names = [f"{config.title}_{material.name}_{k}" for material, k in number.items()]
    found = zip(names, number, strict=True)
    return rows, names, {name: replace(m, name=name) for name, m in found}, images


def _facing(vertices: Array, faces: NDArray[np.int64]) -> NDArray[np.intp]:
    """Axis (m,) along which each triangle is seen the widest."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return np.asarray(np.abs(np.cross(b - a, c - a)).argmax(axis=1))


def _box_uv(vertices: Array, faces: NDArray[np.int64]) -> Array:
    """Texture coordinates (m, 3, 2) of textures that are laid on from the nearest of three directions."""
    others = np.array([(1, 2), (0, 2), (0, 1)])[_facing(vertices, faces)]
    return np.asarray(np.take_along_axis(vertices[faces], others[:, None, :], axis=2) / TILE)


# ---------------------------------------------------------------------------------------------------------------------
# Colliders, and the ground that an object takes


def _colliders(config: ObjectConfig, vertices: Array, faces: NDArray[np.int64], where: str) -> tuple[Collider, ...]:
    points = vertices[np.unique(faces)]
    low, high = points.min(axis=0), points.max(axis=0)
    match config.collider:
        case "none":
            return ()
        case "box":
            return (_body(np.array([low, high]), box=True),)
        case "convex_hull":
            return (_body(_hull(points, where)),)
    if len(faces) > MOST_SOLID:
        raise ConfigurationError(
            f"{where}: collider: mesh takes at most {MOST_SOLID:,} triangles, got {len(faces):,}; "
            "choose convex_hull, or a file with fewer"
        )
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    step = THICK / 2 * across / np.linalg.norm(across, axis=1, keepdims=True)
    return tuple(_body(np.concatenate([plate + by, plate - by])) for plate, by in zip(corners, step, strict=True))


def _body(points: Array, *, box: bool = False) -> Collider:
    """Convex body of corners (n, 3), or their bounding box."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = tuple(np.maximum(high - low, 1e-3).tolist())
    x, y, _ = ((low + high) / 2).tolist()
    corners = () if box else tuple((float(a), float(b), float(c)) for a, b, c in points)
    return Collider(shape="box", size=size, position=(x, y, float(low[2])), points=corners)


def _hull(points: Array, where: str) -> Array:
    """Corners (n, 3) of the convex hull, of one with too many some of them."""
    points = points if len(points) <= _MANY else _extremes(points)
    try:
        corners: Array = points[ConvexHull(points).vertices]
    except QhullError as error:
        raise ConfigurationError(f"{where}: is flat and has no convex hull; choose collider: mesh or none") from error
    return corners if len(corners) <= MOST_CORNERS else _extremes(corners)


def _extremes(points: Array) -> Array:
    """The farthest of the points (n, 3) in ``MOST_CORNERS`` directions that are spread evenly."""
    k = np.arange(MOST_CORNERS) + 0.5
    z, turn = 1.0 - 2.0 * k / MOST_CORNERS, np.pi * (1.0 + np.sqrt(5.0)) * k  # Fibonacci's sphere
    across = np.sqrt(1.0 - z * z)
    directions = np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
    sides = np.maximum(np.ptp(points, axis=0), 1e-9)
    return np.asarray(points[np.unique([(points / sides @ direction).argmax() for direction in directions])])


def circles_of(points: Array) -> Array:
    """Circles (n, 3) over squares along the longer side of the box around some points, seen from above."""
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    sides = np.maximum(high - low, 1e-3)
    long = int(sides[1] > sides[0])
    count = min(max(1, round(float(sides[long] / sides[1 - long]))), 64)
    piece = sides[long] / count
    circles = np.zeros((count, 3))
    circles[:, long] = low[long] + (np.arange(count) + 0.5) * piece
    circles[:, 1 - long] = (low + high)[1 - long] / 2
    circles[:, 2] = np.hypot(piece, sides[1 - long]) / 2
    return circles
