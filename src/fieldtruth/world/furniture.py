# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Street furniture and poles: meshes with colliders, facing +x, of parts that are data (sections ``furniture``).

Park benches, 1.7 m wide, seat 0.45 m high: cast-iron sides, concrete sides, and one without a back. Lamp posts of 4 to
5 m: a cast-iron column with a four-paned lantern, and a steel pole with a post-top luminaire. Tables, 0.75 m high, long
side along y: planks on crossed legs, and a round chess table of concrete. Trash bins, about 0.9 m high: a slatted steel
basket around a drum, and a hooded sheet-metal bin on a post. Poles of power lines: wood with a wooden cross-arm and
brown porcelain, and concrete with a steel cross-arm and grey porcelain. Walls of
dry stone lie along x, up to 1.1 m high.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from typing import Annotated, Final, Literal, NamedTuple

import numpy as np
from pydantic import Field

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.core.transforms import pose
from fieldtruth.world.library import Entry, Section, validated
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Collider, Mesh, merge_meshes
from fieldtruth.world.rocks import laid_stones
from fieldtruth.world.solids import (
    at_length,
    bar_outline,
    make_box,
    make_extrusion,
    make_lathe,
    make_part,
    make_tube,
    path_length,
    placed,
    rounded,
)

Pose = tuple[float, ...]
"""Position [m], and roll, pitch and yaw [deg] if it is turned; two numbers are radius and height in a direction."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """A solid of one material or, without a shape, a group of parts; in one place, or several times. See ``SHAPES``."""

    shape: (
        Literal["box", "beam", "strap", "lathe", "ball", "tube", "plate", "bar", "slats", "chequers", "stones"] | None
    ) = None
    material: str = ""
    points: tuple[tuple[float, ...], ...] = ()
    size: tuple[float, ...] = ()
    rounded: float = 0.0  # radius [m] of the corners of the path
    steps: int = 5  # of each of these corners
    closed: bool = False  # the path ends at its start
    sides: Annotated[int, Field(ge=3)] = 24
    faceted: bool = False
    bevel: float = 0.004  # [m]
    count: int = 0
    bolts: float = 0.0  # [m] from the middle to those on slats; 0: none
    bolt_material: str = ""  # default: that of the slats
    uv: tuple[float, float] = (0.0, 0.0)  # shift of the texture, so that equal planks look different
    at: Pose = ()
    copies: tuple[Pose, ...] = ()
    around: int = 0  # copies about z, evenly turned
    turns: tuple[float, ...] = ()  # [deg], directions in which points of radius and height lie, one copy each
    parts: tuple["Part", ...] = ()

    def path(self, direction: float) -> Array:
        """Return the points with rounded corners, in a direction [rad] if they are those of a tube in a plane."""
        points = self.points
        if self.shape == "tube" and len(points[0]) == 2:
            points = tuple((r * np.cos(direction), r * np.sin(direction), z) for r, z in points)
        path = rounded(points, self.rounded, steps=self.steps) if self.rounded else np.array(points)
        return np.vstack([path, path[:1]]) if self.closed else path


class Shape(NamedTuple):
    """Numbers of points, of coordinates of each and of sizes that a shape has, and their meaning [m]."""

    points: range
    coordinates: tuple[int, ...]
    sizes: int
    meaning: str


_NONE, _TWO, _MANY = range(1), range(2, 3), range(2, 10_000)
SHAPES: Final[Mapping[str, Shape]] = {
    "box": Shape(_NONE, (), 3, "size (along x, y and z)"),
    "beam": Shape(_TWO, (2,), 3, "points (x, z of both ends of a box) and size (width, depth, and y)"),
    "strap": Shape(_TWO, (3,), 3, "points (two, in space; flat side along x) and size (thickness, width, overlap)"),
    "lathe": Shape(_MANY, (2,), 0, "points (radius, height)"),
    "ball": Shape(_NONE, (), 1, "size (radius)"),
    "tube": Shape(_MANY, (2, 3), 1, "points (in space, or radius and height) and size (radius, or one of each point)"),
    "plate": Shape(_MANY, (2,), 1, "points (x, z of the outline) and size (width along y)"),
    "bar": Shape(_MANY, (2,), 2, "points (x, z of a path) and size (width along y, thickness)"),
    "slats": Shape(_MANY, (2,), 3, "points (x, z, below planks), size (width along y, thickness, gap) and count"),
    "chequers": Shape(_NONE, (), 2, "size (side of a square, height) and count (0 or 1: squares of a colour)"),
    "stones": Shape(
        _NONE, (), 3, "size (along x, thickness, height) of a dry wall, and count (which of all such walls)"
    ),
}
"""Solids by name."""


@dataclass(frozen=True, kw_only=True)
class Furniture:
    """A piece of furniture: the radius of the ground that it takes [m], its colliders, and its parts."""

    footprint: float
    colliders: tuple[Collider, ...]
    parts: tuple[Part, ...]


def _furniture(_name: str, entry: Entry, source: str) -> Furniture:
    piece = validated(Furniture, entry, source)
    _check(piece.parts, f"{source}: parts")
    return piece


def _check(parts: tuple[Part, ...], source: str) -> None:
    """Check poses, materials, and the numbers that shapes have; raises ConfigurationError."""
    for where, part in ((f"{source}.{k}", part) for k, part in enumerate(parts)):
        if wrong := [each for each in (part.at, *part.copies) if len(each) not in (0, 2, 3, 6)]:
            raise ConfigurationError(f"{where}: a pose must have 2, 3 or 6 numbers, got {list(wrong[0])}")
        _check(part.parts, f"{where}.parts")
        if part.shape is None:
            continue
        for material in (part.material, part.bolt_material or part.material):
            if material not in MATERIALS:
                hint = suggestion(material, MATERIALS)
                raise ConfigurationError(f"{where}: unknown material {material!r}; {hint}")
        shape, each = SHAPES[part.shape], {len(point) for point in part.points}
        sizes = (shape.sizes, len(part.points)) if part.shape == "tube" else (shape.sizes,)
        fits = len(part.points) in shape.points and len(each) < 2 and each <= set(shape.coordinates)
        if not fits or len(part.size) not in sizes or (part.shape == "slats" and part.count < 1):
            got = f"{len(part.points)} points, size {list(part.size)} and count {part.count}"
            raise ConfigurationError(f"{where}: {part.shape} must have {shape.meaning}, got {got}")


FURNITURE: Final = Section("furniture", _furniture)
"""Every piece of furniture."""


def make_furniture(name: str) -> Mesh:
    """Make a piece of furniture with its colliders."""
    if name not in FURNITURE:
        raise ConfigurationError(f"unknown furniture {name!r}; {suggestion(name, FURNITURE)}")
    piece = FURNITURE[name]
    parts = [solid for part in piece.parts for solid in _built(part, [], 0.0)]
    return replace(merge_meshes(name, parts, footprint=piece.footprint), colliders=piece.colliders)


def _built(part: Part, outer: list[Array], direction: float) -> Iterator[Mesh]:
    """Yield the solids of a part inside groups at the poses ``outer``, in a direction [rad]."""
    for turn in np.radians(part.turns) if part.turns else [direction]:
        copies = [*part.copies, *((0.0, 0.0, 0.0, 0.0, 0.0, 360.0 * k / part.around) for k in range(part.around))]
        for copy in copies or [()]:
            poses = [*outer, *(_pose(each, turn) for each in (copy, part.at) if each)]
            for inner in part.parts:
                yield from _built(inner, poses, turn)
            for solid in _solids(part, turn) if part.shape else ():
                yield placed(solid, reduce(np.matmul, poses)) if poses else solid


def _pose(given: Pose, direction: float) -> Array:
    if len(given) == 2:
        return pose((given[0] * np.cos(direction), given[0] * np.sin(direction), given[1]))
    return pose(given[:3], given[3:] or (0.0, 0.0, 0.0))


def _solids(part: Part, direction: float) -> list[Mesh]:
    """Make the solids of a part that is no group, in its own frame."""
    material, size = part.material, part.size
    match part.shape:
        case "box":
            return [_box(part, size)]
        case "beam":
            return [_beam(part)]
        case "strap":
            return [_strap(part)]
        case "ball":
            turns = np.linspace(0, np.pi, 9)
            return [
                make_lathe(material, [(size[0] * np.sin(a), -size[0] * np.cos(a)) for a in turns], sides=part.sides)
            ]
        case "chequers":
            return [_chequers(part)]
        case "stones":
            return laid_stones(material, size, np.random.default_rng(part.count))
    path = part.path(direction)
    match part.shape:
        case "lathe":
            return [make_lathe(material, path, sides=part.sides, faceted=part.faceted)]
        case "tube":
            return [make_tube(material, path, size if len(size) > 1 else size[0], sides=part.sides)]
        case "plate":
            return [make_extrusion(material, path, size[0])]
        case "bar":
            return [make_extrusion(material, bar_outline(path, size[1]), size[0])]
    return _slats(part, path)


def _box(part: Part, size: tuple[float, ...]) -> Mesh:
    box = make_box(part.material, size, bevel=part.bevel)
    return replace(box, uv=(box.uv + np.array(part.uv)).astype(np.float32))


def _beam(part: Part) -> Mesh:
    start, stop = np.array(part.points)
    step, middle = stop - start, (start + stop) / 2
    width, depth, y = part.size
    tilt = float(np.degrees(np.arctan2(step[1], step[0])))
    return placed(
        _box(part, (float(np.hypot(*step)), width, depth)), pose((middle[0], y, middle[1]), (0.0, -tilt, 0.0))
    )


def _strap(part: Part) -> Mesh:
    a, b = np.array(part.points)
    thickness, width, overlap = part.size
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length
    across = np.cross(along, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    turned = np.eye(4)
    turned[:3, :3] = np.stack([np.cross(across, along), across, along], axis=1)
    turned[:3, 3] = (a + b) / 2
    return placed(_box(part, (thickness, width, length + overlap)), turned)


def _slats(part: Part, path: Array) -> list[Mesh]:
    width, thickness, gap = part.size
    pitch = path_length(path) / part.count
    points, slopes = at_length(path, (np.arange(part.count) + 0.5) * pitch)
    parts = []
    for k, (point, slope) in enumerate(zip(points, slopes, strict=True)):
        raised = point + thickness / 2 * np.array([-np.sin(slope), np.cos(slope)])
        turned = pose((raised[0], 0.0, raised[1]), (0.0, -np.degrees(slope), 0.0))
        plank = make_box(part.material, (pitch - gap, width, thickness), bevel=0.005)
        parts.append(placed(plank, turned, uv_shift=(0.37 * k, 0.618 * k)))
        head = make_lathe(part.bolt_material or part.material, [(0.011, 0.0), (0.009, 0.004), (0.0, 0.006)], sides=8)
        for side in (-part.bolts, part.bolts) if part.bolts else ():
            parts.append(placed(head, turned @ pose((0.0, side, thickness / 2 - 0.0005))))
    return parts


def _chequers(part: Part) -> Mesh:
    square, z = part.size
    corner = square * np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    cells = square * np.array([(i - 4, j - 4) for i in range(8) for j in range(8) if (i + j) % 2 == part.count])
    flat = (cells[:, None] + corner).reshape(-1, 2)
    faces = (4 * np.arange(len(cells))[:, None, None] + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3)
    vertices = np.column_stack([flat, np.full(len(flat), z)])
    return make_part(part.material, vertices, np.tile((0.0, 0.0, 1.0), (len(flat), 1)), flat, faces)
