# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Growth of the skeleton, every stem of a plant as a tapering polyline, and the surface around it.

Stems are vectorized over all of an order. After Weber and Penn (1995): a stem sprouts from its parent at an angle, its
length follows from the crown's outline or from its parent's length, its radius from its length. Unlike theirs, with
fixed curvature, the direction of a stem does a random walk with a pull up or down, which gives crooked limbs and
hanging twigs. Stems that would dip below the clear height are pruned.

The surface is tapered tubes about the stems, wider at the roots, with bark that tiles at the seam.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Index
from fieldtruth.world.model import Mesh, make_mesh
from fieldtruth.world.plants.species import OUTLINES, Habit, Order

TIP_RADIUS: Final = 0.0015  # [m]
ROOT_DEPTH: Final = 0.2  # [m] of stems in the soil
JOINT_RATIO: Final = 0.85  # largest radius of a stem relative to its parent's where it sprouts


@dataclass(frozen=True, kw_only=True)
class Stems:
    """The ``n`` stems of one order, each a polyline of ``k`` segments of equal length, in the plant's frame."""

    axis: Array  # (n, k + 1, 3) [m]
    radius: Array  # (n, k + 1) [m], never growing along the stem
    length: Array  # (n,) [m]
    parent: Index  # (n,) row in the order before; -1 from the ground
    joint: Array  # (n,) where along the parent, as a fraction of its length
    limb: Index  # (n,) number of the order-1 stem that it grows on; -1 for the trunk

    @classmethod
    def alone(cls, axis: Array, radius: Array, length: Array) -> "Stems":
        """Stems that grow on no other."""
        none = np.full(len(axis), -1, np.intp)
        return cls(axis=axis, radius=radius, length=length, parent=none, joint=np.zeros(len(axis)), limb=none)

    def take(self, rows: Index) -> "Stems":
        """Some of the stems."""
        return Stems(**{key: value[rows] for key, value in vars(self).items()})

    def thinned(self, segments: int) -> "Stems":
        """The stems with at most ``segments`` segments, through the nearest of their nodes."""
        count = self.axis.shape[1] - 1
        if segments >= count:
            return self
        nodes = np.rint(np.linspace(0, count, segments + 1)).astype(np.intp)
        return replace(self, axis=self.axis[:, nodes], radius=self.radius[:, nodes])

    def at(self, row: Index, fraction: Array) -> tuple[Array, Array, Array]:
        """Position [m], unit tangent and radius [m] of stem ``row`` at a fraction of its length (all of shape (m,))."""
        segments = self.axis.shape[1] - 1
        at = np.clip(fraction, 0, 1) * segments
        i = np.minimum(at.astype(np.intp), segments - 1)
        f = (at - i)[:, None]
        a, b = self.axis[row, i], self.axis[row, i + 1]
        radius = self.radius[row, i] * (1 - f[:, 0]) + self.radius[row, i + 1] * f[:, 0]
        return a + f * (b - a), unit(b - a), radius


def unit(v: Array) -> Array:
    """Normalize vectors along the last axis."""
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12))


def grow_skeleton(habit: Habit, height: float, rng: np.random.Generator) -> tuple[Stems, ...]:
    """All stems of a plant of the given height [m]: the trunk, then order 1, 2, ..."""
    orders = [grow_trunks(habit, height, rng)]
    light = rng.uniform(0, 2 * np.pi)
    for number, order in enumerate(habit.orders, start=1):
        stems = _sprout(orders[-1], order, number, habit, height, light, rng)
        orders.append(_pruned(stems, habit.clear))
    if habit.sheared > 0:
        return _sheared(orders, habit.sheared * height, height, rng)
    return _fitted(orders, habit.clear, height)


def grow_trunks(habit: Habit, height: float, rng: np.random.Generator) -> Stems:
    """The stems that grow from the ground; they start in the soil."""
    n = habit.stems
    turn = 2 * np.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) * 0.381966 + rng.uniform(0, 2 * np.pi)
    out = np.sqrt((np.arange(n) + 0.5) / n) if n > 1 else np.zeros(1)
    tilt = np.radians(habit.stem_splay * out + habit.trunk_lean * rng.normal(0, 1, n).clip(-2, 2))
    outward = np.stack([np.cos(turn), np.sin(turn), np.zeros(n)], 1)
    direction = np.sin(tilt)[:, None] * outward + np.cos(tilt)[:, None] * [0, 0, 1]
    foot = habit.stem_circle * out[:, None] * outward - [0, 0, ROOT_DEPTH]
    length = height * habit.leader * (1 if n == 1 else rng.uniform(0.75, 1.0, n)) * np.ones(n) + ROOT_DEPTH
    radius = habit.trunk_radius * length
    form = Order(
        number=n,
        length=1,
        angle=(0, 0),
        lift=(0.15, 0.3) if n == 1 else habit.stem_lift,
        bend=0.5 * habit.trunk_wander,
        wander=habit.trunk_wander,
        segments=habit.trunk_segments,
        collar=0,
        taper=habit.trunk_taper,
    )
    axis = extend(foot, direction, length, form, rng)
    if n == 1:
        axis = _righted(axis, habit.lean_limit)
    return Stems.alone(axis, taper(radius, form), length)


def _righted(axis: Array, limit: float) -> Array:
    """Trunks sheared so that the top is at most ``limit`` [deg] off the vertical above the base."""
    foot = axis[:, :1]
    rise = axis - foot
    off = np.hypot(rise[:, -1, 0], rise[:, -1, 1])
    allowed = np.tan(np.radians(limit)) * rise[:, -1, 2]
    excess = rise[:, -1:, :2] * np.maximum(1 - allowed / np.maximum(off, 1e-9), 0)[:, None, None]
    share = (rise[..., 2] / rise[:, -1:, 2])[..., None]
    return np.concatenate([axis[..., :2] - share * excess, axis[..., 2:]], -1)


def _sprout(
    parents: Stems, order: Order, number: int, habit: Habit, height: float, light: float, rng: np.random.Generator
) -> Stems:
    """The next order of stems, before pruning."""
    start = np.full(len(parents.length), order.start)
    if number == 1:
        start = np.maximum(start, (max(habit.clear, habit.crown_base * height) + ROOT_DEPTH) / parents.length)
    parent, rank, joint = spread_along(parents, start, order.number, rng, whorl=order.whorl)
    position, tangent, radius = parents.at(parent, joint)
    depth = (joint - start[parent]) / (1 - start[parent])
    direction = _directions(tangent, parent, rank, depth, order, rng)

    if number == 1:
        length = order.length * height * OUTLINES[habit.outline](1 - depth)
        azimuth = np.arctan2(direction[:, 1], direction[:, 0]) - light
        length *= np.maximum(1 + habit.lopsided * (np.cos(azimuth) + 0.5 * np.cos(3 * azimuth + light)), 0.35)
    else:
        length = order.length * parents.length[parent] * (1 - 0.6 * joint)  # Weber and Penn, section 4.3
    length *= 1 + 0.7 * np.minimum(direction[:, 2], 0)  # shoots in the shade of their parent stay short
    length *= np.exp(order.length_spread * rng.normal(0, 1, len(length)).clip(-1.5, 1.5))

    thickness = parents.radius[parent, 0] * (length / parents.length[parent]) ** order.thickness
    thickness = np.maximum(np.minimum(thickness, JOINT_RATIO * radius), np.minimum(1.2 * TIP_RADIUS, radius))
    return Stems(
        axis=extend(position, direction, length, order, rng),
        radius=taper(thickness, order),
        length=length,
        parent=parent,
        joint=joint,
        limb=np.arange(len(parent), dtype=np.intp) if number == 1 else parents.limb[parent],
    )


def dry_branches(trunk: Stems, habit: Habit, height: float, rng: np.random.Generator) -> Stems | None:
    """Dead branches on the trunk above the clear height, below the crown and in its lowest part."""
    if habit.dead is None:
        return None
    order = habit.dead
    foot = (max(habit.clear, order.start * height) + ROOT_DEPTH) / trunk.length
    head = (max(habit.clear, habit.crown_base * height) + ROOT_DEPTH) / trunk.length
    parent, rank, joint = spread_along(trunk, foot, order.number, rng, whorl=order.whorl)
    joint = foot + (joint - foot) / (1 - foot) * (1.15 * head - foot)
    position, tangent, radius = trunk.at(parent, joint)
    direction = _directions(tangent, parent, rank, joint, order, rng)
    length = order.length * height * np.exp(order.length_spread * rng.normal(0, 1, len(joint)).clip(-2, 1.5))
    thickness = trunk.radius[parent, 0] * (length / trunk.length[parent]) ** order.thickness
    stems = Stems(
        axis=extend(position, direction, length, order, rng),
        radius=taper(np.clip(thickness, np.minimum(2 * TIP_RADIUS, radius), 0.5 * radius), order),
        length=length,
        parent=parent,
        joint=joint,
        limb=np.arange(len(parent), dtype=np.intp),
    )
    return _pruned(stems, habit.clear)


def spread_along(
    stems: Stems, start: Array, number: float, rng: np.random.Generator, *, whorl: int = 1
) -> tuple[Index, Index, Array]:
    """About ``number`` positions for shoots or leaves above each stem's ``start``, in proportion to the length there.

    ``whorl`` of them have nearly the same height. Returns (m,) each: the stem's row, the position's rank on that stem,
    and its fraction of the length.
    """
    usable = np.maximum(1 - start, 0) * stems.length
    count = np.floor(usable * (number / usable.sum()) + rng.random(len(start))).astype(np.intp)
    parent = np.repeat(np.arange(len(count), dtype=np.intp), count)
    rank = np.arange(len(parent), dtype=np.intp) - np.repeat(np.cumsum(count) - count, count)
    if whorl == 1:
        within = (rank + rng.uniform(0.15, 0.85, len(rank))) / count[parent]
    else:
        ring = np.floor(rank / whorl) * whorl + 0.5 * whorl + rng.normal(0, 0.06 * whorl, len(rank))
        within = np.clip(ring / count[parent], 0.0, 1.0)
    return parent, rank, start[parent] + (1 - start[parent]) * within


def sideways(
    tangent: Array, parent: Index, rank: Index, divergence: float, spread: float, rng: np.random.Generator
) -> Array:
    """Unit vectors (m, 3) across the ``tangent``, ``divergence`` [deg] per rank; 180: in a horizontal plane.

    Without ``spread`` [deg] shoots of an upright stem lie along x, as if tied to a wire.
    """
    across = np.cross(tangent, [0.0, 0.0, 1.0])
    across[:, 0] += 1e-6 if spread else 1.0  # a vertical stem: any direction across it
    across = unit(across)
    over = np.cross(across, tangent)
    stems = int(parent.max()) + 1 if len(parent) else 0
    first = rng.normal(0, 0.3 if spread else 0.0, stems) if divergence == 180 else rng.uniform(0, 2 * np.pi, stems)
    turn = first[parent] + np.radians(divergence * rank + rng.normal(0, spread, len(rank)))
    return np.asarray(np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * over)


def _directions(
    tangent: Array, parent: Index, rank: Index, depth: Array, order: Order, rng: np.random.Generator
) -> Array:
    """Initial unit directions of shoots."""
    side = sideways(tangent, parent, rank, order.divergence, order.divergence_spread, rng)
    low, high = order.angle
    angle = np.radians(low + (high - low) * depth + rng.normal(0, order.angle_spread, len(depth)))[:, None]
    return np.asarray(np.cos(angle) * tangent + np.sin(angle) * side)


def extend(base: Array, direction: Array, length: Array, order: Order, rng: np.random.Generator) -> Array:
    """Polylines (n, k + 1, 3) [m] from ``base`` along ``direction``, turned by the order's lift, bend and wander."""
    n, k = len(base), order.segments
    axis = np.empty((n, k + 1, 3))
    axis[:, 0] = base
    steady = rng.normal(0, order.bend / k, (n, 3))
    steps = order.wander / np.sqrt(k) * rng.normal(0, 1, (n, k, 3)).clip(-1.5, 1.5)  # no sharp bends
    heading = direction
    for i in range(k):
        axis[:, i + 1] = axis[:, i] + heading * (length / k)[:, None]
        lift = np.interp((i + 0.5) / k, [0, 1], order.lift) / k
        heading = unit(heading + steady + steps[:, i] + [0, 0, lift])
    return axis


def taper(radius: Array, order: Order) -> Array:
    """Radii (n, k + 1) [m]: a collar at the base, then as a power of the distance from the tip (``Order.taper``)."""
    s = np.linspace(0, 1, order.segments + 1)
    tip = np.minimum(TIP_RADIUS, 0.9 * radius)[:, None]
    shape = (1 - s) ** order.taper * (1 + order.collar * np.exp(-10 * s)) / (1 + order.collar)
    return np.asarray(tip + (radius[:, None] - tip) * shape)


def _pruned(stems: Stems, clear: float) -> Stems:
    """The stems that stay above the clear height [m]."""
    keep = stems.axis[:, :, 2].min(1) >= clear
    return stems.take(np.flatnonzero(keep))


def _fitted(orders: list[Stems], clear: float, height: float) -> tuple[Stems, ...]:
    """The skeleton stretched above the clear height so that its top is at ``height`` [m]; joints stay joined."""
    top = max(float(stems.axis[:, :, 2].max()) for stems in orders if len(stems.axis))
    stretch = (height - clear) / (top - clear)

    def fit(axis: Array) -> Array:
        x, y, z = np.moveaxis(axis, -1, 0)
        return np.stack([x, y, np.where(z > clear, clear + (z - clear) * stretch, z)], -1)

    return tuple(replace(stems, axis=fit(stems.axis)) for stems in orders)


def _sheared(orders: list[Stems], radius: float, height: float, rng: np.random.Generator) -> tuple[Stems, ...]:
    """The skeleton compressed into a slightly irregular dome, as in a hedge."""
    phase = rng.uniform(0, 2 * np.pi, 3)

    def shear(axis: Array) -> Array:
        x, y, z = np.moveaxis(axis, -1, 0)
        azimuth = np.arctan2(y, x)
        wide = radius * (1 + 0.06 * np.cos(2 * azimuth + phase[0]) + 0.05 * np.cos(3 * azimuth + phase[1]))
        high = height * (1 + 0.04 * np.cos(azimuth + phase[2]))
        rho = np.sqrt((x**2 + y**2) / wide**2 + np.maximum(z, 0) ** 2 / high**2)
        return np.asarray(axis / ((1 + rho**8) ** (1 / 8))[..., None])

    return tuple(replace(stems, axis=shear(stems.axis)) for stems in orders)


BARK_REPEAT: Final = 0.6  # [m] of bark per repeat of the texture on thick stems
SMALLEST_REPEAT: Final = 0.12  # [m] along thin twigs, where the repeat around is smaller than this
Surface = tuple[Array, Array, Array, NDArray[np.int32]]


def gathered(vertices: Array, normals: Array, uv: Array, pattern: list[list[int]]) -> Surface:
    """One surface of ``n`` shapes of ``k`` vertices (n, k, ...), each with the faces of ``pattern``."""
    n, k, _ = vertices.shape
    faces = k * np.arange(n)[:, None, None] + np.array(pattern)
    return vertices.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), faces.reshape(-1, 3).astype(np.int32)


def merged(
    name: str,
    surfaces: Sequence[Surface],
    rows: NDArray[np.integer],
    materials: Sequence[str],
    *,
    parts: Sequence[int] = (),
    **others: Any,
) -> Mesh:
    """One mesh of several surfaces; ``rows`` (f,) are the rows of ``materials`` of all faces, surface by surface.

    ``parts`` are the ``PlantPart`` of each surface, ``others`` further fields of ``Mesh``.
    """
    offsets = np.cumsum([0, *(len(s[0]) for s in surfaces[:-1])])
    vertices, normals, uv = (np.concatenate([s[k] for s in surfaces]) for k in range(3))
    faces = np.concatenate([s[3] + np.int32(o) for s, o in zip(surfaces, offsets, strict=True)])
    part = np.repeat(np.array(parts, np.uint8), [len(s[3]) for s in surfaces]) if parts else None
    return make_mesh(name, vertices, normals, uv, faces, materials, rows, part=part, **others)


def tubes(stems: Stems, sides: int) -> Surface:
    """Vertices (v, 3) [m], outward unit normals, uv and faces (f, 3) of one round pointed tube per stem.

    Vertices are doubled at the seam: u runs from 0 to a whole number of repeats, v along the stem at the scale of u at
    its base.
    """
    rings = stems.axis.shape[1]
    tangent, spoke = spokes(stems.axis, sides)
    vertices = stems.axis[:, :, None] + _pointed(stems.radius)[:, :, None, None] * spoke
    slope = (stems.radius[:, 0] - stems.radius[:, -1]) / stems.length
    normals = unit(spoke + slope[:, None, None, None] * tangent[:, :, None])
    return sewn(vertices, normals, stems, np.linspace(0, 1, rings))


def trunk(stems: Stems, sides: int, flare: float, rng: np.random.Generator) -> Surface:
    """As `tubes` for a single trunk: wide at the ground with root ridges, not quite round above.

    ``flare`` is the widening at the ground relative to the radius there.
    """
    near_ground = (ROOT_DEPTH + np.array([-0.08, 0.02, 0.1, 0.2, 0.32, 0.5, 0.75])) / stems.length[0]
    nodes = np.linspace(0, 1, stems.axis.shape[1])
    apart = np.abs(near_ground[:, None] - nodes).min(1) * stems.length[0] > 0.04  # [m]; no slivers
    fraction = np.union1d(nodes, near_ground[apart])
    axis, _, radius = stems.at(np.zeros(len(fraction), np.intp), fraction)
    z = np.maximum(fraction * stems.length[0] - ROOT_DEPTH, -0.08)[:, None]
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    phase = rng.uniform(0, 2 * np.pi, 4)
    ridges = 0.5 * np.cos(3 * turn + phase[0]) + 0.5 * np.cos(5 * turn + phase[1])
    flutes = 0.05 * np.cos(2 * turn + phase[2] + 0.5 * z) + 0.03 * np.cos(5 * turn + phase[3] - 0.4 * z)
    profile = 1 + flutes + flare * np.exp(-z / (1.4 * stems.radius[0, 0])) * (1 + 0.5 * ridges)
    profile[:, -1] = profile[:, 0]

    _, spoke = spokes(axis[None], sides)
    normals = grid_normals(axis[None, :, None] + (radius[:, None] * profile)[None, ..., None] * spoke)
    vertices = axis[None, :, None] + (_pointed(radius[None])[:, :, None] * profile)[..., None] * spoke
    return sewn(vertices, normals, stems, fraction)


def _pointed(radius: Array) -> Array:
    """Radii (n, k + 1) [m] with 0 at the tip."""
    return np.concatenate([radius[:, :-1], np.zeros_like(radius[:, :1])], 1)


def spokes(axis: Array, sides: int) -> tuple[Array, Array]:
    """Unit tangents (n, k + 1, 3) and unit spokes (n, k + 1, sides + 1, 3) across them; last and first are equal."""
    tangent, across, over = _frames(axis)
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    turn[-1] = 0  # bit-equal ends close the seam
    return tangent, np.cos(turn)[:, None] * across[:, :, None] + np.sin(turn)[:, None] * over[:, :, None]


def sewn(vertices: Array, normals: Array, stems: Stems, fraction: Array, *, pointed: bool = True) -> Surface:
    """Surface of tubes with vertices (n, rings, sides + 1, 3), with bark uv; the last ring is a point if ``pointed``.

    ``fraction`` (rings,) of the length gives v.
    """
    n, rings, columns, _ = vertices.shape
    around = np.maximum(np.rint(2 * np.pi * stems.radius[:, 0] / BARK_REPEAT), 1)
    repeat = np.clip(2 * np.pi * stems.radius[:, 0] / around, SMALLEST_REPEAT, 1.4 * BARK_REPEAT)
    u = around[:, None, None] * np.linspace(0, 1, columns)
    v = (stems.length / repeat)[:, None, None] * fraction[:, None]
    uv = np.stack(np.broadcast_arrays(u, v), -1)

    a = np.arange(rings - 1)[:, None] * columns + np.arange(columns - 1)
    b, c = a + 1, a + columns
    # If the last ring is a point, the second triangles of its quads have no area.
    second = np.stack([b, c + 1, c], -1)[: -1 if pointed else None]
    quads = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), second.reshape(-1, 3)])
    faces = (np.arange(n) * rings * columns)[:, None, None] + quads
    return vertices.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), faces.reshape(-1, 3).astype(np.int32)


def _frames(axis: Array) -> tuple[Array, Array, Array]:
    """Tangents and two crosswise unit vectors per node, (n, k + 1, 3) each, transported without twist."""
    step = unit(np.diff(axis, axis=1))
    tangent = unit(np.concatenate([step[:, :1], step[:, :-1] + step[:, 1:], step[:, -1:]], 1))
    helper = np.where(np.abs(tangent[:, 0, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    across = np.empty_like(tangent)
    across[:, 0] = unit(np.cross(tangent[:, 0], helper))
    for i in range(1, axis.shape[1]):
        carried = across[:, i - 1]
        across[:, i] = unit(carried - (carried * tangent[:, i]).sum(1, keepdims=True) * tangent[:, i])
    return tangent, across, np.cross(tangent, across)


def grid_normals(vertices: Array) -> Array:
    """Normals of tubes of any cross-section by central differences on the (ring, side) grid, across the seam."""
    around = np.roll(vertices[:, :, :-1], -1, 2) - np.roll(vertices[:, :, :-1], 1, 2)
    along = np.gradient(vertices[:, :, :-1], axis=1)
    normals = unit(np.cross(around, along))
    return np.concatenate([normals, normals[:, :, :1]], 2)
