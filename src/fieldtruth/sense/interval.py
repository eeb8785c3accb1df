# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What moves in a world, bodies, plants that lean, and ruts; and in the interval of a reading, for the ray tracer."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.kernels.packets import SceneRays
from fieldtruth.sense.embree import RayScene
from fieldtruth.sense.leaning import LEAN_KNOT_NS, Leaning, TracedPlants
from fieldtruth.sense.moving import KNOT_NS, MovingBody
from fieldtruth.sense.ruts import Ruts, TracedRuts

MOST_KNOTS: Final = 129
"""Knots of a reading's interval at most (Embree's RTC_MAX_TIME_STEP_COUNT): 1.27 s."""


@dataclass(frozen=True)
class Moving:
    """What moves in a world: bodies, plants that lean, and ground in which wheels leave ruts."""

    bodies: Sequence[MovingBody] = ()
    leaning: Leaning | None = None
    ruts: Ruts | None = None

    def __bool__(self) -> bool:
        """Return whether anything moves."""
        return bool(self.bodies) or self.leaning is not None or self.ruts is not None


STILL: Final = Moving()
"""Nothing moves."""


class Traced(NamedTuple):
    """A body in the ray tracer: the scene of its mesh, and the greatest distance [m] of a vertex from its origin."""

    body: MovingBody
    rays: RayScene
    radius: float


class Interval(NamedTuple):
    """Bodies, plants and ruts in the interval of a reading from ``begin_ns`` on; ``kept`` are scenes of ``rays``."""

    rays: SceneRays
    begin_ns: int
    span_ns: int
    kept: tuple[RayScene, ...] = ()

    def share(self, stamps_ns: ArrayLike) -> Array:
        """Times of rays that leave at stamps [ns] of any shape."""
        since = np.asarray(stamps_ns) - self.begin_ns
        return since / self.span_ns if self.span_ns else np.zeros(since.shape)


def interval_of(
    still: RayScene,
    bodies: Sequence[Traced],
    plants: TracedPlants | None,
    ruts: TracedRuts | None,
    span: tuple[int, int],
    near: tuple[Array, float],
) -> Interval:
    """Return the bodies, plants and ruts, beside what stands still, from one stamp [ns] to another.

    Bodies are left out that are farther than a reach [m] from a sensor's position (3,). With plants or ruts, whose
    knots are rarer, the interval begins and ends at one of these.

    Raises:
        ConfigurationError: the interval has more than MOST_KNOTS.
    """
    begin, end = span
    stamps, step = np.array([begin]), KNOT_NS if plants is None and ruts is None else LEAN_KNOT_NS
    if end > begin:
        stamps = np.arange(begin // step * step, -(-end // step) * step + 1, KNOT_NS)
    apart = KNOT_NS if bodies else step
    if int(stamps[-1] - stamps[0]) // apart >= MOST_KNOTS:
        most = ((MOST_KNOTS - 1) * apart - step) / 1e9
        raise ConfigurationError(f"among what moves, a reading must take at most {most} s, got {end - begin} ns")
    moving, (centre, reach) = RayScene(still.engine), near
    axes = np.zeros((len(stamps), len(bodies), 3, 3), np.float32)
    for number, (body, rays, radius) in enumerate(bodies):
        poses = body.at(stamps)
        if np.linalg.norm(poses[:, :3, 3] - centre, axis=1).min() < reach + radius:
            axes[:, number] = poses[:, :3, :3]
            moving.add_instance(rays, poses, number=number)
    found, kept = still.alone, list[RayScene]()
    if axes.any():
        found, kept = found._replace(moving=moving.commit().handle, axes=axes), [moving]
    if plants is not None:
        leant = plants.at(stamps[:: step // KNOT_NS])
        found, kept = found._replace(axes=axes, plants=leant.rays.handle, plant_axes=leant.axes), [*kept, leant.rays]
    if ruts is not None:
        ground = ruts.at(stamps[:: step // KNOT_NS])
        found, kept = found._replace(axes=axes, ground=ground.rays.handle, ruts=ground.table), [*kept, ground.rays]
    if not kept:
        return Interval(found, begin, 0)
    return Interval(found, int(stamps[0]), int(stamps[-1] - stamps[0]), tuple(kept))
