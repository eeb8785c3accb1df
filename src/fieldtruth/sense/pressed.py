# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Plants that lean because robots push them: before the front, flat below the hull, and rising again behind it.

A plant is turned about its foot away from the hull by the least angle, FLAT at most, at which no upright point of it is
inside: each point at the distance r from the foot is ahead of the hull's front, or below its underside. For an upright
stem with the front a distance x beyond its foot at the height h that is atan(x / h), as a straight stem over an edge. A
plant that lies against the robot's way by more than _AGAINST is pressed down further instead, and below a wheel it lies
flat. What then is still inside, such as blades that sprawl towards the robot, is crushed: the plant sinks until it is
below the hull. A hull pushes forwards or backwards, whichever way it moves.

Below the hull a plant stays as it is. Behind it the lean decays towards the share that remains, with the time of the
species (``Stems.recovers``, ``Stems.seconds``; assumed): lodged grass rises in minutes to days, and not wholly. What is
crushed springs back.

The lean at a knot follows from the robot's poses until the knot before, continued for one knot beyond, so that plants
are out of the way between knots, too, and bend some centimetres early. It is a pure function of these poses.
Bushes lean by _BUSH at most and are not crushed: their twigs bend one by one, which a rigid turn does not show.

Plants lean near the planned ways; to ray tracers, others are what stands still. Where a robot that users drive comes to
the edge of these areas, another begins around it, in which plants lean from then on (``PressedPlants.until``).
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from itertools import pairwise
from threading import Lock
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.leaning import LEAN_KNOT_NS, WHOLE, Lean, Plants, bunches_of
from fieldtruth.sense.moving import KNOT_NS, KnotPoses
from fieldtruth.world.model import Mesh, World
from fieldtruth.world.stems import species_of, yields_of

REACH: Final = 2.0
"""Distance [m] from the ways of robots within which plants lean; no follower drives farther from its route."""
_AROUND: Final = 4.0
"""Radius [m] of an area in which plants lean where a robot left its way."""
_READING: Final = 4
"""Knots from a pose that is known to the end of the longest reading, in which plants lean that were found by it."""
FLAT: Final = np.radians(85.0)
"""Lean of what a wheel has rolled over, and at most of what is behind the hull."""
_BUSH: Final = np.radians(60.0)
_AGAINST: Final = np.radians(60.0)
_SPRAWLING: Final = np.radians(40.0)
"""Angle from the vertical beyond which parts of a plant are crushed and do not turn it."""
_MARGIN: Final = 0.03
"""[m] around the hull: distance of the points of a plant that are looked at."""
_STEP: Final = 0.05  # [m] between points along an edge of a triangle
_SPRINGS: Final = 2.0
"""Time [s] in which a plant that is crushed rises by 63 % of its depth (assumed)."""
_DEFAULT: Final = (0.6, 20.0)
"""Share that recovers and its time [s] of species without stems."""
_TIME: Final = LEAN_KNOT_NS / 1e9
_NEVER: Final = 1 << 62


class _Hull(NamedTuple):
    """Front (also the rear) and half the width [m] of the hull on base_link; x, y and half width of wheels."""

    front: float
    half: float
    wheels: tuple[float, float, float]


def _hull(rig: Rig) -> _Hull:
    robot, wheels = rig.robot, rig.wheels
    length, width, _ = robot.outline
    around = wheels.half_wheelbase + 0.5 * wheels.radius, wheels.half_track, wheels.width / 2
    return _Hull(length / 2 + _MARGIN, width / 2 + _MARGIN, (around[0], around[1], around[2] + _MARGIN))


class PressedPlants:
    """Lean of the plants of a world that robots of ``hulls`` (rig and poses at the knots of bodies) press.

    ``rows`` are those within REACH of ``ways``, corners (m, 2) [m] of lines. Threads may share it.
    """

    holds: Final = FLAT
    """Lean [rad] of plants that no other cause, such as wind, moves; see ``leaning.Lean``."""
    version = 0
    """Number of drives that began."""

    def __init__(
        self,
        world: World,
        plants: Plants,
        hulls: Mapping[str, tuple[Rig, KnotPoses]],
        ways: Sequence[Array],
    ) -> None:
        self._world, self._plants = world, plants
        self._hulls = [(_hull(rig), poses) for rig, poses in hulls.values()]
        kinds = {name: yields_of(world.meshes[name]) for name in np.unique(plants.mesh).tolist()}
        self._soft: Index = np.flatnonzero([kinds[name] != "solid" for name in plants.mesh.tolist()])
        self._foot = plants.foot[self._soft]
        self._ways = [(way, REACH) for way in ways]
        self.rows: Index = self._soft[beyond(self._foot[:, :2], self._ways) < 0.0]
        names, own = np.unique(plants.mesh[self._soft], return_inverse=True)
        meshes = [world.meshes[name] for name in names.tolist()]
        self._most = np.array([FLAT if mesh.tufts is not None else _BUSH for mesh in meshes])[own]
        self._recovers, self._seconds = np.array([_recovery(mesh) for mesh in meshes]).reshape(-1, 2)[own].T
        self._reach = np.hypot(plants.height[self._soft], 1.0)
        self._shapes: dict[tuple[str, int], Array] = {}
        self._points: dict[int, Array] = {}
        self._lock = Lock()
        self.restart()

    def restart(self) -> None:
        """Let all plants stand, at time 0, for other poses.

        Set ``free_ns`` to the stamp from which users drive, and ``end_ns`` to that from which the robots stand.
        """
        self.version += 1
        self._known = 0  # knots that are known, beside that at time 0
        self._pressed: dict[int, list[int]] = defaultdict(list)
        self._leans: dict[int, list[Array]] = defaultdict(list)
        self._strayed = list[tuple[int, Array]]()
        """Knots, and positions (2,) [m] of robots there, around which plants lean, too."""
        self._wider = dict[int, Lean]()
        self._yielding = np.isin(self._soft, self.rows)
        self.free_ns = self.end_ns = _NEVER

    def until(self, stamp_ns: int) -> Lean:
        """Return the lean of the plants that lean in readings which begin at a stamp [ns], or before."""
        knot = stamp_ns // LEAN_KNOT_NS
        with self._lock:
            self._advance_to(knot)
            count = sum(at <= knot for at, _ in self._strayed)
            if count and count not in self._wider:
                self._wider[count] = _Wider(self, [_area(position) for _, position in self._strayed[:count]])
        return self._wider[count] if count else self

    def wider(self, areas: Sequence["_Area"]) -> Index:
        """Return ``rows`` with those of plants in further areas."""
        return self._soft[beyond(self._foot[:, :2], [*self._ways, *areas]) < 0.0]

    def __call__(self, rows: Index, knots_ns: NDArray[np.int64]) -> Array:
        """Rotation vectors [rad] and depth [m] (k, n, 3) of plants (n,) at knots (k,) [ns]."""
        knots = np.asarray(knots_ns) // LEAN_KNOT_NS
        own = np.searchsorted(self._soft, rows)
        found = np.zeros((len(knots), len(rows), 3))
        with self._lock:
            self._advance_to(int(knots.max(initial=0)))
            touched = np.array([row in self._pressed for row in own.tolist()], np.bool_)
            for k, knot in enumerate(knots.tolist()):
                found[k, touched] = self._leans_at(own[touched], knot)
        return np.stack([-found[..., 1], found[..., 0], found[..., 2]], axis=-1)  # a lean to x is a turn about y

    def _leans_at(self, rows: Index, knot: int) -> Array:
        """Horizontal leans [rad], towards where, and depths [m] (n, 3) of own rows at a knot."""
        last, lean = np.full(len(rows), -1), np.zeros((len(rows), 3))
        for k, row in enumerate(rows.tolist()):
            at = int(np.searchsorted(self._pressed[row], knot, side="right")) - 1 if row in self._pressed else -1
            if at >= 0:
                last[k], lean[k] = self._pressed[row][at], self._leans[row][at]
        behind = (last >= 0) & (last < knot)
        gone = self._recovers[rows] * -np.expm1(-(knot - last) * _TIME / self._seconds[rows])
        left = np.where(behind, 1.0 - gone, 1.0)
        depth = np.where(behind, np.exp(-(knot - last) * _TIME / _SPRINGS), 1.0)
        return np.asarray(lean * np.stack([left, left, depth], axis=-1))

    def _advance_to(self, knot: int) -> None:
        while self._known < knot:
            self._advance(self._known + 1)

    def _advance(self, knot: int) -> None:
        """Find what is pressed at a knot, by all robots in turn."""
        for hull, poses in self._hulls:
            # A bag has no pose at time 0: that of the first knot stands for it.
            stamps = np.clip(np.array([knot - 2, knot - 1]) * LEAN_KNOT_NS, KNOT_NS, self.end_ns)
            before, now = poses(stamps)
            moved = np.linalg.inv(before) @ now
            if (knot - 1) * LEAN_KNOT_NS >= self.free_ns:
                areas = [*self._ways, *(_area(position) for _, position in self._strayed)]
                reach = np.hypot(hull.front, hull.half) + _MARGIN + _READING * abs(moved[0, 3])
                if beyond(now[None, :2, 3], areas)[0] > -reach:
                    self._strayed.append((knot, now[:2, 3]))
                    self._yielding |= beyond(self._foot[:, :2], [_area(now[:2, 3])]) < 0.0
            self._press(knot, hull, now @ moved @ moved, float(moved[0, 3]))
        self._known = knot

    def _press(self, knot: int, hull: _Hull, world_from_base: Array, ahead: float) -> None:
        """Press plants at a knot; ``ahead`` [m] is what the hull moves forwards in a knot, to this pose at last."""
        far = np.hypot(hull.front + abs(ahead), hull.half)
        gap = np.hypot(*(self._foot[:, :2] - world_from_base[:2, 3]).T)
        near = np.flatnonzero(self._yielding & (gap < far + self._reach))
        if not len(near):
            return
        before, now = self._leans_at(near, knot - 1), self._leans_at(near, knot)
        was = np.array(
            [knot - 1 in self._pressed[row][-1:] if row in self._pressed else False for row in near.tolist()]
        )
        body, foot = _Body(hull, world_from_base, ahead), self._foot[near]
        plants = (*self._points_of(near), foot)
        held = np.where(was[:, None], before, now)
        (depth, above), (rises, _) = body.hits(plants, held), body.hits(plants, now)
        inside, rolled = depth > 0.0, body.rolls(foot)
        lean = np.where(inside[:, None], body.pushed(plants, held, self._most[near]), held)
        flat = rolled & (np.linalg.norm(lean[:, :2], axis=1) < FLAT)
        lean[flat, :2] = FLAT * body.direction
        pushed = inside | flat
        lean[pushed, 2] += body.hits(plants, lean)[0][pushed] * (self._most[near] == FLAT)[pushed]
        for k in np.flatnonzero(inside | rolled | (was & (above | (rises > 0.0)))).tolist():
            self._pressed[int(near[k])].append(knot)
            self._leans[int(near[k])].append(lean[k])

    def _points_of(self, rows: Index) -> tuple[Array, Index]:
        """Points (p, 3) [m] of plants about their feet, upright, and which of the rows (p,) each belongs to."""
        for row in rows.tolist():
            if row not in self._points:
                self._points[row] = self._shape(row)
        parts = [self._points[row] for row in rows.tolist()]
        return np.concatenate(parts), np.arange(len(parts)).repeat([len(part) for part in parts])

    def _shape(self, row: int) -> Array:
        plants, number = self._plants, int(self._soft[row])
        key = str(plants.mesh[number]), int(plants.bunch[number])
        if key not in self._shapes:
            self._shapes[key] = _samples(self._world.meshes[key[0]], key[1])
        pose = plants.world_from_object[number]
        points = self._shapes[key] @ pose[:3, :3].T + (pose[:3, 3] - plants.foot[number])
        return np.asarray(points[points[:, 2] > 0.0])


_Shapes = tuple[Array, Index, Array]
"""Points (p, 3) [m] of plants about their feet, upright, the plant of each (p,), and the feet (n, 3) in the world."""


class _Body(NamedTuple):
    """A hull at a pose, which moves ``ahead`` [m] in a knot."""

    hull: _Hull
    world_from_base: Array
    ahead: float

    @property
    def sign(self) -> float:
        """1 if it moves forwards, -1 backwards."""
        return -1.0 if self.ahead < 0 else 1.0

    @property
    def direction(self) -> Array:
        """Horizontal direction (2,) of its motion, of unit length."""
        forward = self.sign * self.world_from_base[:2, 0]
        return np.asarray(forward / np.linalg.norm(forward))

    def seen(self, points: Array) -> Array:
        """Points (n, 3) of the world in the hull's frame, x in the direction of its motion."""
        local = (points - self.world_from_base[:3, 3]) @ self.world_from_base[:3, :3]
        return np.asarray(local * (self.sign, 1.0, 1.0))

    def hits(self, plants: _Shapes, lean: Array) -> tuple[Array, Mask]:
        """Return how deep [m] (n,) plants must sink to be below the hull, and which have points above or below it.

        What is above it counts as inside: on its way down it would cross the hull.

        ``lean`` (n, 3) are their horizontal leans [rad] and depths [m].
        """
        points, owner, foot = plants
        turn = Rotation.from_rotvec(np.column_stack([-lean[:, 1], lean[:, 0], np.zeros(len(lean))])).as_matrix()
        placed = np.einsum("pij,pj->pi", turn[owner], points) + foot[owner]
        placed[:, 2] -= lean[owner, 2]
        local = self.seen(placed)
        front, half, _ = self.hull
        over = (local[:, 0] < front) & (local[:, 0] > -front - abs(self.ahead)) & (np.abs(local[:, 1]) < half)
        high = over & (local[:, 2] > -_MARGIN / 2)
        depth = np.zeros(len(foot))
        np.maximum.at(depth, owner[high], local[high, 2] + _MARGIN)
        return depth, np.bincount(owner[over], minlength=len(foot)) > 0

    def pushed(self, plants: _Shapes, lean: Array, most: Array) -> Array:
        """Leans (n, 3) of plants that are pushed from a lean, to angles of at most ``most`` (n,) [rad]."""
        points, owner, foot = plants
        direction, seen = self.direction, self.seen(foot)
        local = points @ self.world_from_base[:3, :3] * (self.sign, 1.0, 1.0)
        radius, angle = np.hypot(local[:, 0], local[:, 2]), np.arctan2(local[:, 0], local[:, 2])
        mean = np.bincount(owner, angle, len(foot)) / np.maximum(np.bincount(owner, minlength=len(foot)), 1)
        counts = (np.abs(seen[owner, 1] + local[:, 1]) < self.hull.half) & (np.abs(angle) < _SPRAWLING)
        radius, angle, owner = radius[counts], angle[counts], owner[counts]
        room, low = (self.hull.front - seen[:, 0])[owner], np.maximum(-seen[:, 2] - _MARGIN / 3, 0.02)[owner]
        # Between points a stem goes on: what is nearest to the hull's edge counts, or with the edge behind it the tip.
        nearest = np.where(room > 0.0, np.hypot(room, low), np.inf)
        radius = np.maximum(np.clip(nearest, radius - _STEP / 2, radius + _STEP / 2), 1e-6)
        below = np.arccos(np.minimum(low / radius, 1.0))
        least = np.minimum(np.arcsin(np.clip(room / radius, -1.0, 1.0)), below) - angle
        over, back = np.full(len(foot), -np.pi), np.full(len(foot), np.pi)
        np.maximum.at(over, owner, least)
        np.minimum.at(back, owner, -below - angle)
        now = lean[:, :2] @ direction
        tilt = np.where(mean + now < -_AGAINST, np.minimum(back, now), np.maximum(over, now)).clip(-most, most)
        return np.column_stack([tilt[:, None] * direction, lean[:, 2]])

    def rolls(self, foot: Array) -> Mask:
        """Mask of the plants (n,) with a foot below a wheel, or between those of a side."""
        x, y, half = self.hull.wheels
        local = self.seen(foot)
        return np.asarray((np.abs(local[:, 0]) < x) & (np.abs(np.abs(local[:, 1]) - y) < half))


class _Wider:
    """The lean of plants of which more are in the ray tracer; see ``leaning.Lean``."""

    holds: Final = FLAT

    def __init__(self, pressed: PressedPlants, areas: Sequence["_Area"]) -> None:
        self.rows, self._pressed = pressed.wider(areas), pressed

    @property
    def version(self) -> int:
        """Number of drives that began."""
        return self._pressed.version

    def __call__(self, rows: Index, knots_ns: NDArray[np.int64]) -> Array:
        """Rotation vectors [rad] and depth [m] (k, n, 3) of plants (n,) at knots (k,) [ns]."""
        return self._pressed(rows, knots_ns)


_Area = tuple[Array, float]
"""Corners (m, 2) [m] of a line, and the distance [m] from it within which plants lean."""


def _area(position: Array) -> _Area:
    return np.stack([position, position]), _AROUND


def beyond(points: Array, areas: Sequence[_Area]) -> Array:
    """Distances (n,) [m] of points (n, 2) from the nearest edge of an area; negative inside of one."""
    outside = np.full(len(points), np.inf)
    for way, reach in areas:
        for start, end in pairwise(way):
            along = end - start
            share = ((points - start) @ along / max(float(along @ along), 1e-12)).clip(0.0, 1.0)
            outside = np.minimum(outside, np.hypot(*(points - start - share[:, None] * along).T) - reach)
    return outside


def _recovery(mesh: Mesh) -> tuple[float, float]:
    """Share that recovers and its time [s]: of a clump of several species, those of the first that has stems."""
    stems = next((each.stems for each in species_of(mesh) if each is not None and each.stems is not None), None)
    return _DEFAULT if stems is None else (stems.recovers, stems.seconds)


def _samples(mesh: Mesh, bunch: int) -> Array:
    """Points (p, 3) [m] along the edges of a bunch's triangles, in the mesh's frame; one in each cube of _MARGIN."""
    faces = mesh.faces if bunch == WHOLE else mesh.faces[bunches_of(mesh) == bunch]
    corners = mesh.vertices.astype(np.float64)[faces]
    edges = np.roll(corners, -1, axis=1) - corners
    longest = float(np.linalg.norm(edges, axis=-1).max(initial=0.0))
    shares = np.linspace(0.0, 1.0, 2 + int(longest / _STEP))
    points = (corners[:, :, None] + shares[:, None] * edges[:, :, None]).reshape(-1, 3)
    _, first = np.unique(np.floor(points / _MARGIN).astype(np.int64), axis=0, return_index=True)
    return np.asarray(points[np.sort(first)])
