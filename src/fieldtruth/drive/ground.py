# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The ground under the robot: the surface that bears it, slopes and bumps, and parts of a large world.

The bearing ground is the soil with every hard object on it that has no collider. Objects with colliders are obstacles
of the physics; swarms have none. What is hard in a swarm (stones, pebbles, edging stones) is part of the height that
the robot feels; what bends or breaks (grass, herbs, leaves, stems of saplings, fallen twigs of less than 3 cm) is not.
The foot of a trunk, whose roots spread beyond the collider, is part of it, too: up to ``FOOT`` above the soil.

A node carries the highest visible point of all these in the square of one spacing around it. So no stone is lost
between two nodes, and none is higher than it is; its outline grows by half a spacing at most. On stones of 3 and 5 cm
height the envelope of a rolling wheel keeps its peak to 0.4 mm; the bump is 2.5 cm longer than over the mesh itself.

A part is what lies in a rectangle of a world, as a world in the same coordinates: maps and physics of a large world are
made of parts, so that they cost what lies around the route and not the world.
"""

import math
import weakref
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, uniform_filter

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.classes import Label
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.kernels.soil import lay_stones
from fieldtruth.world.model import LOOSE, Collider, Heightfield, Mesh, Swarm, World

BEARING_SPACING: Final = 0.05
"""Greatest spacing [m] of the nodes in a world with stones."""
FOOT: Final = 0.165
"""Height [m] of a wheel's axle: above it the collider of an object stops the robot, not the ground."""
HARD: Final = frozenset({Label.GROUND, Label.TRAIL, Label.ROCK})
"""Classes of the surfaces of a swarm that bear; blades, leaves and stems of herbs have others."""
_FEET: Final = frozenset({Label.TRUNK})
"""Classes of the surfaces of objects with colliders that reach beyond these near the ground."""
_known: Final[dict[int, Heightfield]] = {}
_faces: Final[dict[int, dict[frozenset[Label], NDArray[np.int32]]]] = {}
_HEADINGS: Final = 8
_CHASSIS_POINTS: Final = [(x, y) for x in (-0.5, -0.25, 0.0, 0.25, 0.5) for y in (-0.35, 0.0, 0.35)]
"""In lengths and widths of the chassis."""
_AROUND: Final = 0.1
"""Half the distance [m] between the points of the chassis, less half a node of the bearing ground."""
Ground = Callable[[Array, Array], Array]
"""Heights [m] at offsets x, y [m] from the middle of the robot, in the world frame."""
WHOLE: Final = 100.0
"""Side length [m] up to which a world is one part."""


class HardSurface(NamedTuple):
    """Upper surfaces that bear: a mesh at poses (n, 4, 4), with the name of each; nothing above ``reach`` counts."""

    names: tuple[str, ...]
    vertices: Array  # (v, 3) [m]
    faces: NDArray[np.int32]  # (f, 3)
    poses: Array
    reach: float  # [m] above the soil


def bearing_field(world: World) -> Heightfield:
    """Heights of soil and stones; without stones the terrain's own field. It is computed once per world.

    Nodes are at most ``BEARING_SPACING`` apart. They divide the terrain's cells evenly, so that where no stone lies the
    surface is exactly that of ``world.terrain.field``.
    """
    key = id(world)
    if key not in _known:
        _known[key] = _with_stones(world)
        weakref.finalize(world, _known.pop, key, None)
    return _known[key]


def hard_surfaces(world: World) -> Iterator[HardSurface]:
    """Yield what is hard and has no collider inside the world: stones of swarms, and the feet of trunks."""
    for swarm in (each for each in world.swarms if each.kind not in LOOSE):
        inside = (np.abs(swarm.world_from_object[:, :2, 3]) <= np.array(world.size) / 2).all(axis=1)
        for row, name in enumerate(swarm.meshes):
            faces = _faces_of(world, world.meshes[name], HARD)
            poses = swarm.world_from_object[inside & (swarm.mesh == row)]
            if len(faces) and len(poses):
                names = (f"an object of swarm {swarm.name}",) * len(poses)
                yield HardSurface(names, world.meshes[name].vertices.astype(np.float64), faces, poses, np.inf)
    for name in dict.fromkeys(instance.mesh for instance in world.instances):
        mesh, copies = world.meshes[name], [i for i in world.instances if i.mesh == name]
        faces = _faces_of(world, mesh, _FEET)
        faces = faces[mesh.vertices[faces, 2].min(axis=1, initial=np.inf) < 2 * FOOT]
        if len(faces) and not mesh.passable:
            poses = np.array([i.world_from_object for i in copies])
            yield HardSurface(tuple(i.name for i in copies), mesh.vertices.astype(np.float64), faces, poses, FOOT)


def _faces_of(world: World, mesh: Mesh, labels: frozenset[Label]) -> NDArray[np.int32]:
    """Faces (f, 3) of the materials of some classes; they are looked for once per mesh."""
    known = _faces.get(id(mesh))
    if known is None:
        known = _faces[id(mesh)] = {}
        weakref.finalize(mesh, _faces.pop, id(mesh), None)
    if labels not in known:
        rows = [k for k, name in enumerate(mesh.materials) if world.materials[name].label in labels]
        known[labels] = np.ascontiguousarray(mesh.faces[np.isin(mesh.material, rows)])
    return known[labels]


def _with_stones(world: World) -> Heightfield:
    surfaces = list(hard_surfaces(world))
    if not surfaces:
        return world.terrain.field
    soil = divided(world.terrain.field)
    heights = soil.heights.copy()
    for surface in surfaces:
        poses = np.ascontiguousarray(surface.poses, np.float64)
        grid = (soil.x0, soil.y0, soil.spacing, surface.reach)
        lay_stones(heights, soil.heights, grid, surface.vertices, surface.faces, poses)
    return replace(soil, heights=heights)


def divided(field: Heightfield) -> Heightfield:
    """The same surface on nodes at most ``BEARING_SPACING`` apart."""
    parts = int(np.ceil(field.spacing / BEARING_SPACING - 1e-9))
    if parts == 1:
        return field
    spacing = field.spacing / parts
    x, y = (
        start + spacing * np.arange(parts * (count - 1) + 1)
        for start, count in zip((field.x0, field.y0), field.heights.shape, strict=True)
    )
    heights = np.stack([field.height_at(at, y).astype(np.float32) for at in x])
    return Heightfield(heights=heights, spacing=spacing, x0=field.x0, y0=field.y0)


def bump_height(below_wheels: Ground, below_chassis: Ground, heading: Array, robot: RobotConfig) -> Array:
    """Height [m] of the ground below the chassis above the plane through the ground below the wheels.

    ``heading`` [rad].
    """
    cos, sin = np.cos(heading), np.sin(heading)

    def at(ground: Ground, x: float, y: float) -> Array:
        return ground(cos * x - sin * y, sin * x + cos * y)

    corners, length, width = robot.corners, robot.outline[0], robot.chassis_width
    front, rear = corners[0][0], corners[3][0]
    front_left, front_right, rear_left, rear_right = (at(below_wheels, x, y) for x, y in corners)
    middle = (front_left + front_right + rear_left + rear_right) / 4  # at x of the middle between the axles
    along = (front_left + front_right - rear_left - rear_right) / (2 * (front - rear))
    across = (front_left - front_right + rear_left - rear_right) / sum(abs(y) for _, y in corners)
    bump = at(below_chassis, 0.0, 0.0) - (middle - along * ((front + rear) / 2))
    for x, y in ((share_x * length, share_y * width) for share_x, share_y in _CHASSIS_POINTS):
        plane = middle + along * (x - (front + rear) / 2) + across * y
        bump = np.maximum(bump, at(below_chassis, x, y) - plane)
    return bump


def bump_height_on_path(bearing: Heightfield, highest: Heightfield, poses: Array, robot: RobotConfig) -> Array:
    """Bump height [m], (n,), at poses (n, 3) of x, y [m] and heading [rad]; see ``highest_around``."""
    x, y, heading = poses.T

    def of(field: Heightfield) -> Ground:
        return lambda dx, dy: field.height_at(x + dx, y + dy)

    return bump_height(of(bearing), of(highest), heading, robot)


def max_bump_height(bearing: Heightfield, highest: Heightfield, x: Array, y: Array, robot: RobotConfig) -> Array:
    """Greatest bump height [m], (nx, ny), over all headings at x (nx,) and y (ny,) [m], from the nearest nodes."""

    def of(field: Heightfield) -> Ground:
        def heights(dx: Array, dy: Array) -> Array:
            rows, columns = (
                np.clip(np.rint((axis + float(shift) - start) / field.spacing).astype(np.intp), 0, count - 1)
                for axis, shift, start, count in zip(
                    (x, y), (dx, dy), (field.x0, field.y0), field.heights.shape, strict=True
                )
            )
            return np.asarray(field.heights[rows][:, columns])

        return heights

    headings = np.arange(_HEADINGS) * np.pi / _HEADINGS
    return np.asarray(np.max([bump_height(of(bearing), of(highest), heading, robot) for heading in headings], axis=0))


def highest_around(soil: Heightfield, raised: Float32Array, step: float) -> Heightfield:
    """The soil with the highest of the stones on it between neighbouring points of the chassis: these miss none.

    Args:
        soil: without stones.
        raised: (nx, ny) [m] by which stones raise it.
        step: height [m] above which a stone is an obstacle of its own and counts no further here.
    """
    nodes = 2 * round(_AROUND / soil.spacing) + 1
    stones = maximum_filter(np.minimum(raised, step), nodes, mode="nearest")
    return replace(soil, heights=(soil.heights + stones).astype(np.float32))


def slopes(field: Heightfield, length: float) -> tuple[Array, Array]:
    """Rise per metre along x and y, (nx, ny) each, of the mean ground over a square of about ``length`` [m]."""
    along_x, along_y = np.gradient(mean_ground(field, length), field.spacing)
    return np.asarray(along_x), np.asarray(along_y)


def mean_ground(field: Heightfield, length: float) -> Array:
    """Mean height [m], (nx, ny), of the ground over a square of about ``length`` [m]."""
    nodes = 2 * max(1, round(length / 2 / field.spacing)) + 1
    return np.asarray(uniform_filter(field.heights.astype(np.float64), nodes, mode="nearest"))


class WorldParts:
    """Parts of ``world``, with whatever reaches into them."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.is_one = max(world.size) <= WHOLE
        if not self.is_one:
            self._low, self._high = _extents(world)
            self._swarms = [_circles(world, swarm) for swarm in world.swarms]

    def around(self, xy: Array, reach: float) -> World:
        """The part within ``reach`` [m] of a point (2,) [m] along x and y; a world up to ``WHOLE`` itself."""
        return self.within(xy - reach, xy + reach)

    def within(self, low: Array, high: Array) -> World:
        """Return what lies or reaches between two corners (2,) [m]: terrain, colliders, feet of trunks, swarms.

        Objects and members of swarms keep their order. ``size`` stays that of the world, whose middle is the origin.
        """
        world = self._world
        if self.is_one:
            return world
        near = np.flatnonzero(((self._low <= high) & (self._high >= low)).all(axis=1))
        field, layer = world.terrain.field, world.terrain.layer
        nodes = _nodes(field, low, high)
        cut = replace(
            field,
            heights=np.ascontiguousarray(field.heights[nodes]),
            x0=field.x0 + field.spacing * nodes[0].start,
            y0=field.y0 + field.spacing * nodes[1].start,
        )
        members = [
            np.flatnonzero((np.abs(np.clip(circles[:, :2], low, high) - circles[:, :2]) <= circles[:, 2:]).all(axis=1))
            for circles in self._swarms
        ]
        return replace(
            world,
            terrain=replace(world.terrain, field=cut, layer=None if layer is None else layer[nodes]),
            instances=tuple(world.instances[k] for k in near.tolist()),
            swarms=tuple(_members(swarm, kept) for swarm, kept in zip(world.swarms, members, strict=True)),
        )


def _nodes(field: Heightfield, low: Array, high: Array) -> tuple[slice, slice]:
    """Rows and columns of the nodes around a rectangle; two at least."""
    start, last = np.array([field.x0, field.y0]), np.array(field.heights.shape) - 1
    first = np.clip(np.floor((low - start) / field.spacing).astype(int), 0, last - 1)
    end = np.clip(np.ceil((high - start) / field.spacing).astype(int), first + 1, last) + 1
    return slice(int(first[0]), int(end[0])), slice(int(first[1]), int(end[1]))


def _members(swarm: Swarm, kept: NDArray[np.intp]) -> Swarm:
    return replace(swarm, mesh=swarm.mesh[kept], world_from_object=swarm.world_from_object[kept], tint=swarm.tint[kept])


def _circles(world: World, swarm: Swarm) -> Array:
    """Circles (n, 3) around the members of a swarm: x, y, radius [m]."""
    radius = np.array(
        [np.linalg.norm(world.meshes[name].vertices, axis=1).max(initial=0.0) for name in swarm.meshes], np.float64
    )
    poses = swarm.world_from_object
    return np.column_stack([poses[:, :2, 3], radius[swarm.mesh] * np.linalg.norm(poses[:, :3, 0], axis=1)])


def _extents(world: World) -> tuple[Array, Array]:
    """Lowest and highest x, y [m], (n, 2) each, of the colliders and feet of all instances."""
    low, high = np.empty((len(world.instances), 2)), np.empty((len(world.instances), 2))
    rows: dict[str, list[int]] = {}
    for row, instance in enumerate(world.instances):
        rows.setdefault(instance.mesh, []).append(row)
    for name, own in rows.items():
        poses = np.array([world.instances[row].world_from_object for row in own])
        low[own], high[own] = poses[:, :2, 3], poses[:, :2, 3]
        for points, radius in _solids(world.meshes[name]):
            scaled = radius * np.linalg.norm(poses[:, :3, 0], axis=1)[:, None]
            placed = np.stack([poses[:, :2, :3] @ point + poses[:, :2, 3] for point in points])
            low[own] = np.minimum(low[own], placed.min(axis=0) - scaled)
            high[own] = np.maximum(high[own], placed.max(axis=0) + scaled)
    return low, high


def _solids(mesh: Mesh) -> Iterator[tuple[Array, float]]:
    """Yield points on the axis, in the object's frame, and the radius [m] around them of each collider and the foot."""
    for collider in mesh.colliders:
        x, y, z = collider.position
        yield np.array([(x, y, z), (x, y, z + collider.size[-1])]), _radius(collider)
    foot: NDArray[np.float32] = mesh.vertices[mesh.vertices[:, 2] < 4 * FOOT]
    yield np.zeros((1, 3)), float(np.linalg.norm(foot, axis=1).max(initial=0.0))


def _radius(collider: Collider) -> float:
    return collider.size[0] if collider.shape == "cylinder" else math.hypot(*collider.size[:2]) / 2
