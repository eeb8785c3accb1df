# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What people built on a site: buildings as blocks with windows, walls, fences, and furniture beside the paths.

A building has the outline and the height of the map; one of four corners a gabled roof along its longer side, others a
flat one. All of them are obstacles: a building and a wall by thin boxes along each side, so that any outline is as
solid as it looks.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import pose
from fieldtruth.maps.osm import Feature
from fieldtruth.world.environments.site.sources import inside
from fieldtruth.world.furniture import make_furniture
from fieldtruth.world.model import Collider, Mesh, merge_meshes
from fieldtruth.world.placement import WorldBuilder, random_tint
from fieldtruth.world.solids import make_box, make_part, placed, signed_area, triangulate

STOREYS: Final = (4.0, 7.0)
"""Heights [m] of the walls of buildings of which the map says nothing: below and above ``HOUSE``."""
HOUSE: Final = 60.0
"""Area [m2] from which a building has two storeys."""
PITCH: Final = 38.0
"""Slope [deg] of gabled roofs."""
EAVES: Final = 0.4
"""Distance [m] by which a roof overhangs."""
WIDEST: Final = 16.0
"""Width [m] of a building up to which its roof is gabled."""
STOREY, WINDOW, APART = 2.7, (1.1, 1.35), 2.6
"""Height [m] of a storey, size of its windows, and distance between them."""
WALL_HEIGHT, FENCE_HEIGHT = 1.5, 1.1
"""Heights [m] of walls and fences of which the map says nothing."""
GATE: Final = 1.8
"""Distance [m] from a gate, and from the edge of a trail, within which a wall, a fence or a hedge has a gap."""
SECTION: Final = 2.0
"""Length [m] of a section of a wall or fence; each stands on its own ground, and has a collider."""
_DEEP: Final = 0.6  # [m] of walls in the ground
_WALLS: Final = ("wall_plaster", "wall_ochre", "wall_render")
FURNITURE: Final = {
    "bench": ("bench", 3), "lamp": ("lamp_post", 2), "waste_basket": ("trash_bin", 2), "table": ("table", 2),
    "post": ("bollard", 1),
}  # fmt: skip
"""Kind of object, and number of its meshes, by kind of the map."""
FACES: Final = 15.0
"""Distance [m] within which furniture faces the nearest trail."""


def build_structures(builder: WorldBuilder, features: Sequence[Feature], rng: np.random.Generator) -> None:
    """Add the buildings, walls and fences of the map, then its furniture; what stands in another is left out."""
    for each in features:
        if each.kind == "building" and each.closed and len(each.geometry) > 2:
            add_building(builder, each, rng)
    gaps = gates(builder, features)
    for each in features:
        if each.kind in ("wall", "fence"):
            add_barrier(builder, each, gaps, rng)
    for each in features:
        if each.kind in FURNITURE and len(each.geometry):
            add_furniture(builder, each, rng)


def gates(builder: WorldBuilder, features: Sequence[Feature]) -> "Gaps":
    """Where walls, fences and hedges have gaps."""
    return Gaps(builder, [each.geometry[0] for each in features if each.kind == "gate"])


class Gaps:
    """Gates of the map, and its trails."""

    def __init__(self, builder: WorldBuilder, points: Sequence[Array]) -> None:
        self._builder = builder
        self._points = np.array(points).reshape(-1, 2)

    def at(self, xy: Array) -> bool:
        """Whether there is a gap at a position (2,) [m]."""
        if len(self._points) and np.hypot(*(self._points - xy).T).min() < GATE:
            return True
        return bool(self._builder.trail_distance(xy[None])[0] < 0.5)


def add_building(builder: WorldBuilder, feature: Feature, rng: np.random.Generator) -> None:
    """Add a building. Its walls reach into the ground; the floor is that of the lowest corner."""
    outline = _simple(feature.geometry)
    if len(outline) < 3 or signed_area(outline) < 1.0:
        return
    middle = outline.mean(axis=0)
    own = outline - middle
    ground = builder.field.height_at(*outline.T)
    base, rise = float(ground.min()), float(np.ptp(ground))
    height = feature.height or STOREYS[int(signed_area(outline) > HOUSE)]
    material = _WALLS[int(rng.integers(len(_WALLS)))]
    ridge = _gable(own)
    top = max(height - (0.0 if ridge is None else 0.5 * ridge[2]), 2.2) + 0.5 * rise
    roof = [_flat_roof(own, top)] if ridge is None else _gabled_roof(own, top, ridge, material)
    parts = [*_walls(own, top, material), *_windows(own, rise, top), *roof]
    colliders = tuple(_side(a, b, -_DEEP, top, 0.3) for a, b in _sides(own))
    name = f"building_{len(builder.instances)}"
    mesh = merge_meshes(name, parts, footprint=float(np.hypot(*own.T).max()))
    at = np.eye(4)
    at[:3, 3] = *middle, base
    tint = random_tint(rng, 0.12)
    builder.add("building", replace(mesh, colliders=colliders), at, _discs(outline), tint=tint)


def _simple(outline: Array) -> Array:
    """An outline without corners that are nearer than 5 cm, or nearly straight."""
    ahead, behind = np.roll(outline, -1, axis=0) - outline, outline - np.roll(outline, 1, axis=0)
    bend = np.abs(ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0])
    kept = (np.hypot(*ahead.T) > 0.05) & (bend > 1e-3)
    return np.asarray(outline[kept])


def _sides(outline: Array) -> Iterator[tuple[Array, Array]]:
    return pairwise([*outline, outline[0]])


def _gable(outline: Array) -> tuple[Array, Array, float] | None:
    """Unit vectors along and across the ridge of a roof over four corners about square, and its height [m]."""
    if len(outline) != 4:
        return None
    sides = np.roll(outline, -1, axis=0) - outline
    lengths = np.hypot(*sides.T)
    first, second = sides[0] / lengths[0], sides[1] / lengths[1]
    if abs(first @ second) > 0.1 or lengths.min() > WIDEST:
        return None
    along, across = (first, second) if lengths[0] >= lengths[1] else (second, first)
    return along, across, float(np.ptp(outline @ across)) / 2.0 * np.tan(np.radians(PITCH))


_LARGER: Final = {"wall_plaster": 8.0, "wall_render": 8.0, "wall_ochre": 8.0, "roof_tiles": 2.0, "roof_flat": 8.0}
"""Factors on the size of the tiles of textures, which are those of furniture."""


def _quad(material: str, corners: Array) -> Mesh:
    """Flat quadrilateral, anticlockwise from outside, with its texture upright."""
    a, b, _, d = corners
    normal = np.cross(b - a, d - a)
    right = (b - a) / np.linalg.norm(b - a)
    up = np.cross(normal / np.linalg.norm(normal), right)
    uv = np.stack([corners @ right, corners @ up], axis=-1) / _LARGER.get(material, 1.0)
    return make_part(material, corners, np.tile(normal, (4, 1)), uv, np.array([(0, 1, 2), (0, 2, 3)]))


def _walls(outline: Array, top: float, material: str) -> Iterator[Mesh]:
    for a, b in _sides(outline):
        yield _quad(material, np.array([(*a, -_DEEP), (*b, -_DEEP), (*b, top), (*a, top)]))


def _windows(outline: Array, rise: float, top: float) -> Iterator[Mesh]:
    """Windows in rows, one for each storey that is wholly above the ground."""
    width, high = WINDOW
    for a, b in _sides(outline):
        length = float(np.hypot(*(b - a)))
        along = (b - a) / max(length, 1e-6)
        out = 0.015 * np.array([along[1], -along[0]])
        for storey in range(max(0, int((top - rise - 0.3) / STOREY))):
            low = rise + STOREY * storey + 0.9
            count = int((length - 0.8) / APART)
            for k in range(count):
                start = a + along * ((k + 0.5) * length / count - width / 2) + out
                end = start + along * width
                yield _quad("window", np.array([(*start, low), (*end, low), (*end, low + high), (*start, low + high)]))


def _flat_roof(outline: Array, top: float) -> Mesh:
    corners = np.column_stack([outline, np.full(len(outline), top)])
    up = np.tile((0.0, 0.0, 1.0), (len(outline), 1))
    return make_part("roof_flat", corners, up, outline / _LARGER["roof_flat"], triangulate(outline))


def _gabled_roof(outline: Array, top: float, ridge: tuple[Array, Array, float], material: str) -> list[Mesh]:
    """Two slopes with eaves, seen from both sides, and the walls below their ends."""
    along, across, rise = ridge
    u, v = outline @ along, outline @ across
    middle, half = (v.min() + v.max()) / 2.0, np.ptp(v) / 2.0
    slope = rise / half
    ends = (u.min() - EAVES, u.max() + EAVES)
    flip = along[0] * across[1] - along[1] * across[0] < 0

    def point(s: float, t: float, z: float) -> Array:
        return np.array([*(along * s + across * (middle + t)), z])

    parts = []
    for side in (-1.0, 1.0):
        low = top - slope * EAVES
        corners = np.array([
            point(ends[0], side * (half + EAVES), low), point(ends[1], side * (half + EAVES), low),
            point(ends[1], 0.0, top + rise), point(ends[0], 0.0, top + rise),
        ])  # fmt: skip
        corners = corners if (side < 0) != flip else corners[[1, 0, 3, 2]]
        parts += [_quad("roof_tiles", corners + np.array([0.0, 0.0, 0.04])), _quad("roof_wood", corners[[1, 0, 3, 2]])]
    for end, outwards in ((u.min(), -1.0), (u.max(), 1.0)):
        triangle = np.array([point(end, -half, top), point(end, half, top), point(end, 0.0, top + rise)])
        normal = np.array([*(outwards * along), 0.0])
        uv = np.stack([triangle[:, :2] @ across, triangle[:, 2]], axis=-1) / _LARGER.get(material, 1.0)
        facing = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0]) @ normal > 0
        face = np.array([(0, 1, 2)]) if facing else np.array([(0, 2, 1)])
        parts.append(make_part(material, triangle, np.tile(normal, (3, 1)), uv, face))
    return parts


def _side(a: Array, b: Array, low: float, high: float, thick: float) -> Collider:
    """Box along a side, inside of it if the outline is anticlockwise."""
    length = float(np.hypot(*(b - a)))
    inwards = np.array([a[1] - b[1], b[0] - a[0]]) / max(length, 1e-9)
    x, y = (a + b) / 2.0 + inwards * thick / 2.0
    yaw = float(np.degrees(np.arctan2(b[1] - a[1], b[0] - a[0])))
    return Collider(shape="box", size=(length, thick, high - low), position=(float(x), float(y), low), yaw_deg=yaw)


def _discs(outline: Array) -> list[tuple[float, float, float]]:
    """Circles (x, y, radius) [m] that fill an area, by which nothing is placed in it."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    steps = [np.arange(low[k], high[k] + 1.0, 1.0) for k in (0, 1)]
    grid = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 2)
    within = grid[inside(Feature("building", outline, True, {}), grid)]
    edge = np.concatenate(
        [a + np.linspace(0, 1, int(np.hypot(*(b - a))) + 2)[:, None] * (b - a) for a, b in _sides(outline)]
    )
    return [(float(x), float(y), 0.75) for x, y in np.concatenate([within, edge])]


def add_barrier(builder: WorldBuilder, feature: Feature, gaps: Gaps, rng: np.random.Generator) -> None:
    """Add a wall or a fence, in sections that follow the ground, with gaps at gates and trails."""
    line = np.vstack([feature.geometry, feature.geometry[:1]]) if feature.closed else feature.geometry
    is_wall = feature.kind == "wall"
    height = min(feature.height or (WALL_HEIGHT if is_wall else FENCE_HEIGHT), 4.0)
    width = max(feature.width or (0.3 if is_wall else 0.06), 0.06)
    parts: list[Mesh] = []
    sections = [(a, b) for a, b in _sections(line) if not gaps.at((a + b) / 2.0)]
    if not sections:
        return
    start = sections[0][0]
    base = float(builder.field.height_at(*start))
    discs = []
    for a, b in sections:
        ground = builder.field.height_at(*np.array([a, b]).T) - base
        own = _wall if is_wall else _fence
        parts.append(own(a - start, b - start, (float(ground[0]), float(ground[1])), height, width))
        radius = float(np.hypot(*(b - a))) / 4.0 + width / 2.0
        discs += [(*(a + share * (b - a)).tolist(), radius) for share in (0.25, 0.75)]
    at = np.eye(4)
    at[:3, 3] = *start, base
    mesh = merge_meshes(f"{feature.kind}_{len(builder.instances)}", parts, footprint=0.5)
    builder.add(feature.kind, mesh, at, discs, tint=random_tint(rng, 0.08))


def _sections(line: Array) -> Iterator[tuple[Array, Array]]:
    for a, b in pairwise(line):
        length = float(np.hypot(*(b - a)))
        if length > 0.1:
            ends = np.linspace(0.0, 1.0, max(1, round(length / SECTION)) + 1)
            yield from pairwise(a + share * (b - a) for share in ends)


def _wall(a: Array, b: Array, ground: tuple[float, float], height: float, width: float) -> Mesh:
    """Section of a wall with a coping; its top is level."""
    low, high = min(ground) - _DEEP, max(ground) + height
    length, turned = float(np.hypot(*(b - a))), _turned(a, b)
    body = placed(make_box("wall_stone", (length, width, high - low)), turned @ pose((0.0, 0.0, (low + high) / 2.0)))
    cap = make_box("wall_coping", (length + 0.02, width + 0.08, 0.07))
    parts = [body, placed(cap, turned @ pose((0.0, 0.0, high + 0.03)))]
    own = _box_at(a, b, low, high + 0.06, width)
    return replace(merge_meshes("part", parts, footprint=0.0), colliders=(own,))


def _fence(a: Array, b: Array, ground: tuple[float, float], height: float, width: float) -> Mesh:
    """Section of a fence of wood: a post at its start, and three rails along the ground."""
    length, turned, drop = float(np.hypot(*(b - a))), _turned(a, b), ground[1] - ground[0]
    post = make_box("fence_wood", (0.1, 0.1, height + 0.7))
    parts = [placed(post, pose((*a, ground[0] + (height - 0.6) / 2.0)) @ turned_only(turned))]
    tilt = -float(np.degrees(np.arctan2(drop, length)))
    rail = make_box("fence_wood", (float(np.hypot(length, drop)), 0.04, 0.11))
    for k, share in enumerate((0.25, 0.58, 0.92)):
        z = sum(ground) / 2.0 + share * height
        parts.append(placed(rail, turned @ pose((0.0, -0.06, z), (0.0, tilt, 0.0)), uv_shift=(0.37 * k, 0.618 * k)))
    own = _box_at(a, b, min(ground) - 0.2, max(ground) + height, max(width, 0.1))
    return replace(merge_meshes("part", parts, footprint=0.0), colliders=(own,))


def _turned(a: Array, b: Array) -> Array:
    """Pose in the middle between two points, x along them."""
    return pose((*((a + b) / 2.0), 0.0), (0.0, 0.0, float(np.degrees(np.arctan2(b[1] - a[1], b[0] - a[0])))))


def turned_only(turned: Array) -> Array:
    """The rotation of a pose."""
    own = np.eye(4)
    own[:3, :3] = turned[:3, :3]
    return own


def _box_at(a: Array, b: Array, low: float, high: float, width: float) -> Collider:
    x, y = ((a + b) / 2.0).tolist()
    yaw = float(np.degrees(np.arctan2(b[1] - a[1], b[0] - a[0])))
    size = (float(np.hypot(*(b - a))), width, high - low)
    return Collider(shape="box", size=size, position=(x, y, low), yaw_deg=yaw)


def add_furniture(builder: WorldBuilder, feature: Feature, rng: np.random.Generator) -> None:
    """Add a piece of furniture where the map has it, facing the nearest trail, unless something stands there."""
    kind, variants = FURNITURE[feature.kind]
    variant = int(rng.integers(variants))
    mesh = make_furniture(kind if variants == 1 else f"{kind}_{variant}")
    xy = feature.geometry.mean(axis=0) if len(feature.geometry) < 3 else feature.geometry[len(feature.geometry) // 2]
    yaw, tint = _facing(builder, xy, rng), random_tint(rng, 0.06)
    half = np.array(builder.size) / 2.0 - 0.5
    x, y = xy.tolist()
    taken = any(np.hypot(x - a, y - b) < 0.3 + r for a, b, r in builder.taken.about(x, y, 0.3))
    if (np.abs(xy) < half).all() and not taken:
        builder.add_upright(kind, mesh, (x, y), yaw=yaw, tint=tint)


def _facing(builder: WorldBuilder, xy: Array, rng: np.random.Generator) -> float:
    """Direction [rad] from a position to the nearest trail, a random one where no trail is near."""
    turn = float(rng.uniform(0.0, 2.0 * np.pi))
    nearest, best = FACES, None
    for trail in builder.trails:
        if trail.line.may_be_within(nearest, *xy.tolist()):
            away = trail.line.points - xy
            k = int(np.argmin((away**2).sum(axis=1)))
            if np.hypot(*away[k]) < nearest:
                nearest, best = float(np.hypot(*away[k])), away[k]
    return turn if best is None else float(np.arctan2(best[1], best[0]))
