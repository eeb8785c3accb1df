# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of single rays, compared with the second tracer.

Clouds and images are retraced by the engine that made them. Where the bag differs, as it may on another processor for
rays at edges, the second tracer decides whether the bag is right. It also checks some rays of every sampled cloud and
image, so that the engine is not the only reference.

A ray that grazes an edge has two right answers, as single precision may fall on either side. All candidates are listed,
up to the first triangle that the ray cannot have passed, and a reading is right if it is one of them.

Where a ray meets the robot is found without the formulas by which its sensors find it. How far a point is outside a box
or a cylinder (the largest excess over its limits) is a convex function along a ray. Its least value is searched by
sections, and then where the ray has come so near before.
"""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.core.classes import CLASSES, NO_RETURN, ClassTable, Label
from fieldtruth.drive.passability import Passability
from fieldtruth.experiment.rig import Rig
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.validation.check import Count, Rule, Spec, Tally
from fieldtruth.validation.context import Checker, Context
from fieldtruth.validation.tracer import TERRAIN, Hits, ReferenceTracer, resolution
from fieldtruth.world.model import ROBOT_ID, World

_GOLDEN: Final = (math.sqrt(5.0) - 1.0) / 2.0
_SECTIONS: Final = 60
_HALVINGS: Final = 45
"""Each divides an interval by 1.618, or by 2: together by 1e12, so that 10 m become 1e-11 m."""
_SKIN: Final = 1e-3  # [m] of air at a part from which it is not seen
_BLUR: Final = 2e-5  # [m] by which single precision may move rays and surfaces
Outside = Callable[[float, float, float], float]
"""Distance [m] of x, y, z in base_link from a part, at least: 0 at its surface, below 0 inside."""


class RobotHit(NamedTuple):
    """Range at which a ray meets a part of the robot [m]; ``sure`` unless it grazes the part and may pass."""

    range_m: float
    tolerance: float
    sure: bool


def robot_parts(rig: Rig) -> Sequence[Outside]:
    """The parts of a rig's robot that its sensors see."""
    if not rig.visible:
        return ()
    robot, wheels, mounts = rig.robot, rig.robot.wheels, rig.mounts()
    (length, _, _), deck = robot.outline, robot.chassis_top
    parts: list[Outside] = [
        lambda x, y, z: max(abs(x) - length / 2, abs(y) - robot.chassis_width / 2, -z, z - deck),
        *(_round(mounts[f"{name}_wheel"].xyz, wheels.radius, wheels.width) for name in wheels.names),
    ]
    if (caster := robot.caster) is not None:
        parts.append(_round((caster.x, 0.0, caster.radius - robot.ground_clearance), caster.radius, caster.width))
    return parts


def _round(centre: tuple[float, float, float], radius: float, width: float) -> Outside:
    a, b, c = centre
    return lambda x, y, z: max(math.hypot(x - a, z - c) - radius, abs(y - b) - width / 2)


def robot_hits(parts: Sequence[Outside], origin: Array, direction: Array) -> list[RobotHit]:
    """Return the hits on each part of a ray from ``origin`` (3,) along a unit vector (3,), both in base_link."""
    found = []
    (x, y, z), (dx, dy, dz) = origin.tolist(), direction.tolist()
    for outside in parts:

        def along(t: float, outside: Outside = outside) -> float:
            return outside(x + t * dx, y + t * dy, z + t * dz)

        if along(0.0) <= _SKIN:
            continue
        nearest = _least(along, float(np.linalg.norm(origin)) + 10.0)
        if (closest := along(nearest)) <= _BLUR:
            first, last = _reached(along, nearest, _BLUR), _reached(along, nearest, max(-_BLUR, closest))
            middle = (first + last) / 2
            found.append(RobotHit(middle, (last - first) / 2 + 1e-6 * middle, closest < -_BLUR))
    return found


def _least(along: Callable[[float], float], end: float) -> float:
    """Return the argument of the least value of a convex function between 0 and ``end`` (golden sections)."""
    low, high = 0.0, end
    for _ in range(_SECTIONS):
        left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        if along(left) <= along(right):
            high = right
        else:
            low = left
    return (low + high) / 2


def _reached(along: Callable[[float], float], end: float, level: float) -> float:
    """Return the argument at which a function that falls from 0 to ``end`` reaches a level (bisection)."""
    low, high = 0.0, end
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if along(middle) <= level else (middle, high)
    return high


SAME_RAYS: Final = Rule("rays traced in double precision hit what the bag contains (sample)")
_NO_SAMPLE: Final = "no clouds and no tag images, or no true motion"
INDEPENDENT_RAYS: Final[Spec] = Spec("independent rays", (SAME_RAYS,), "rays traced in double precision", _NO_SAMPLE)

NOTHING: Final = 0.0
"""Range of a ray that hit nothing."""
UNKNOWN: Final = -1
"""Instance or part of a ray whose sensor does not measure it."""
RAYS: Final = 16
"""Rays of a sampled cloud or image that the second tracer checks."""
DIFFERING: Final = 200
"""Most rays of a cloud or image that the second tracer checks where engine and bag differ."""
ELSEWHERE: Final = 0.05
"""Share of differing rays above which ``RAYS`` of them are enough: the sensor was at another pose."""


class RayReading(NamedTuple):
    """Measurement of a sensor along a ray."""

    where: str
    origin: Array
    direction: Array
    """(3,) of unit length, in the world."""
    range_m: float
    """NOTHING, or NaN where the sensor does not measure it."""
    label: int
    instance: int
    near: float
    """[m] below which the sensor sees nothing, though it is occluded."""
    far: float
    """[m] beyond which the sensor sees nothing."""
    pulsed: bool
    """True for a sensor of pulses, to which some classes return nothing."""
    in_base: tuple[Array, Array]
    """Origin and direction in base_link."""
    stamp_ns: int = 0
    """True time, which matters where bodies move."""
    part: int = UNKNOWN
    """``PlantPart``."""
    passing: Array | None = None
    """(2,) Passability and force [N]; None where the sensor does not measure them."""

    def __str__(self) -> str:
        if self.range_m == NOTHING:
            return f"{self.where}: {'no return' if self.pulsed else 'sky'}"
        instance = "" if self.instance == UNKNOWN else f" of object {self.instance}"
        part = "" if self.part == UNKNOWN else f", part {self.part},"
        passing = "" if self.passing is None else f", passability {self.passing[0]:g} and {self.passing[1]:g} N,"
        return f"{self.where}: class {self.label}{part}{passing}{instance} at {self.range_m:.4f} m"


class _Candidate(NamedTuple):
    labels: set[int]
    instance: int
    range_m: float
    tolerance: float
    classes: ClassTable = CLASSES
    part: int = 0
    passing: Array | None = None

    @property
    def last(self) -> float:
        """Range [m] beyond which nothing is seen, if it is opaque."""
        return self.range_m + self.tolerance

    def __str__(self) -> str:
        names = " or ".join(sorted(self.classes[label].name for label in self.labels))
        part = f", part {self.part}," if self.part else ""
        passing = "" if self.passing is None else f", passability {self.passing[0]:g} and {self.passing[1]:g} N,"
        return f"{names}{part}{passing} of object {self.instance} at {self.range_m:.4f} m"

    def agrees(self, reading: RayReading) -> bool:
        """Return whether a reading may be of this surface."""
        returning = {label for label in self.labels if not (reading.pulsed and label in NO_RETURN)}
        if reading.range_m == NOTHING:
            seen = reading.near + self.tolerance < self.range_m < reading.far - self.tolerance
            return not seen or not returning
        seen = reading.near - self.tolerance < self.range_m < reading.far + self.tolerance
        same_range = not np.isfinite(reading.range_m) or abs(reading.range_m - self.range_m) <= self.tolerance
        same = reading.instance in (self.instance, UNKNOWN) and reading.part in (self.part, UNKNOWN)
        if reading.passing is not None and self.passing is not None:
            same = same and bool(same_passing(reading.passing, self.passing))
        return seen and same_range and reading.label in returning and same


def mismatches(
    world: World,
    tracer: ReferenceTracer,
    readings: list[RayReading],
    robot: Sequence[Outside] = (),
    passability: Passability | None = None,
) -> list[str | None]:
    """Return for each reading None if it is right, else a description of what the ray hits in world and robot."""
    if not readings:
        return []
    origins, directions = np.array([r.origin for r in readings]), np.array([r.direction for r in readings])
    known, far = np.array([r.range_m for r in readings]), np.array([r.far for r in readings]) * 1.001
    limit = np.where((known > 0) & np.isfinite(known), np.minimum(known * 1.001 + 0.01, far), far)
    hits = tracer.hits(origins, directions, limit, np.array([r.stamp_ns for r in readings]))
    tolerance = np.asarray(resolution(hits.range_m, tracer.side) / hits.cosine + 1e-6 * hits.range_m)
    opaque = _opaque(hits, tolerance, tracer.side)
    result, classes = list[str | None](), world.classes
    passing = None if passability is None else passability.of(hits.top, hits.label)
    for ray, (first, last) in enumerate(pairwise(np.searchsorted(hits.ray, np.arange(len(readings) + 1)))):
        own = [(_of_robot(hit), hit.sure) for hit in robot_hits(robot, *readings[ray].in_base)]
        end = min((candidate.last for candidate, sure in own if sure), default=np.inf)
        candidates: list[_Candidate] = []
        for k in range(first, last):
            range_m = float(hits.range_m[k])
            if range_m - tolerance[k] > end:
                break
            labels = {int(hits.label[k])}
            if labels == {TERRAIN}:
                labels = _trail_labels(world, origins[ray] + range_m * directions[ray], range_m, float(hits.cosine[k]))
            own_id, part = int(hits.instance[k]), int(hits.part[k])
            passes = None if passing is None else passing[k]
            candidates.append(_Candidate(labels, own_id, range_m, float(tolerance[k]), classes, part, passes))
            if opaque[k]:
                end = min(end, candidates[-1].last)
        candidates += [candidate for candidate, _ in own if candidate.range_m - candidate.tolerance <= end]
        candidates.sort(key=lambda candidate: candidate.range_m)
        free = readings[ray].range_m == NOTHING and not np.isfinite(end)
        right = free or any(candidate.agrees(readings[ray]) for candidate in candidates)
        result.append(None if right else f"there is {candidates[0] if candidates else 'nothing up to there'}")
    return result


def _of_robot(hit: RobotHit) -> _Candidate:
    free = np.array([1.0, 0.0])
    return _Candidate({int(Label.ROBOT)}, ROBOT_ID, hit.range_m, hit.tolerance, passing=free)


def _opaque(hits: Hits, tolerance: Array, side: float) -> Mask:
    """Return the triangles that a ray cannot pass: hit far from an edge, or where a neighbour continues behind it.

    A neighbour of which the ray meets the other side does not continue: the ray clips a sharp edge and may pass beside.
    """
    near_edge = hits.margin < resolution(hits.range_m, side) / hits.cosine
    joined = (np.diff(hits.ray) == 0) & (np.diff(hits.range_m) <= tolerance[:-1] + tolerance[1:])
    joined &= (hits.instance[:-1] == hits.instance[1:]) & (hits.front[:-1] == hits.front[1:])
    joined &= np.maximum(hits.margin[:-1], hits.margin[1:]) > 0.0
    closed = np.zeros(len(near_edge), np.bool_)
    closed[:-1] |= joined
    closed[1:] |= joined
    return np.asarray(~near_edge | closed)


def _trail_labels(world: World, point: Array, range_m: float, cosine: float) -> set[int]:
    """Classes that the terrain may have at a point (3,) [m]: both near the edge of a trail."""
    distance = float(world.terrain.trail_distance.at(point[0], point[1]))
    if abs(distance) < float(resolution(np.array(range_m), max(world.size))) / cosine:
        return {int(Label.TRAIL), int(Label.GROUND)}
    return {int(Label.TRAIL if distance < 0 else Label.GROUND)}


class RayReference(Checker):
    """The second tracer in a world. Threads may share it."""

    def __init__(self, context: Context, rebuilt: SensorWorld) -> None:
        self._rebuilt, self._world = rebuilt, rebuilt.world
        self._tracer = ReferenceTracer(rebuilt.world, rebuilt.moving)
        self._robot = robot_parts(context.rig)
        self._tally = context.tally(INDEPENDENT_RAYS)
        self.tallies = [self._tally]

    def compare(
        self, count: Count, differing: Index, rays: int, reading: Callable[[int], RayReading], seed: int | None
    ) -> Tally:
        """Count the rays of a cloud or an image, and check a sample of them with the second tracer.

        Args:
            count: where all rays are counted; differing ones are right if the second tracer agrees with the bag.
            differing: rays where engine and bag differ.
            rays: number of rays.
            reading: returns the bag's reading of a ray.
            seed: of the sample; None for no sample.

        Returns:
            The check of the sample.
        """
        number = min(len(differing), RAYS if len(differing) > ELSEWHERE * rays else DIFFERING)
        chosen = differing[np.unique(np.linspace(0, len(differing) - 1, number).astype(int))].tolist()
        wrong = self._wrong([reading(k) for k in chosen])
        count.add(rays, len(wrong), "".join(wrong[:1]))
        part, sample = self._tally.part(), list[int]()
        if seed is not None:
            sample = np.random.default_rng(seed).choice(rays, min(RAYS, rays), replace=False).tolist()
        wrong = self._wrong([reading(k) for k in sample])
        part[SAME_RAYS].add(len(sample), len(wrong), "".join(wrong[:1]))
        return part

    def _wrong(self, readings: list[RayReading]) -> list[str]:
        passability = self._rebuilt.passability if any(each.passing is not None for each in readings) else None
        found = mismatches(self._world, self._tracer, readings, self._robot, passability)
        return [f"{reading}, but {hit}" for reading, hit in zip(readings, found, strict=True) if hit is not None]


def close(mine: NDArray[np.floating[Any]], theirs: NDArray[np.floating[Any]]) -> Mask:
    """Return whether lengths [m] are the same in single precision, on any processor."""
    return np.asarray(np.abs(mine - theirs) <= 2e-5 + 1e-6 * np.abs(theirs))


def same_passing(mine: NDArray[np.floating[Any]], theirs: NDArray[np.floating[Any]]) -> Mask:
    """Return whether passabilities and forces [N], (..., 2), are the same in single precision, on any processor."""
    return np.asarray(np.isclose(mine, theirs, rtol=1e-5, atol=1e-6).all(axis=-1))
