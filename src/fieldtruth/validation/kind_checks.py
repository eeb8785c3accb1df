# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of a kind of sensor, and what all checks share during the pass over the bag."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.experiment.rig import Rig
from fieldtruth.validation.check import Rule, Spec, Tally
from fieldtruth.validation.context import Checker, Context, Sampler
from fieldtruth.validation.rays import RayReference
from fieldtruth.validation.world import ObjectClasses


class LabelledPoints(NamedTuple):
    """A sensor whose messages are points with class and instance id, which other readings are compared with."""

    sensor: str
    topic: str
    decode: Callable[[Any, int], NDArray[np.void]]
    """Returns the points (n,) of a message with a stamp [ns]: x, y, z [m] in its frame, label, instance."""
    not_comparable: str = ""
    """The reason why its points are not those seen from one pose; empty if they are."""
    sweep_ns: int | None = 0
    """Time [ns] from the stamp to the last ray, whose time is the field ``t``; None if points may lie elsewhere than on
    their object."""


class Pass(NamedTuple):
    """Objects that checkers share during the pass over a bag."""

    context: Context
    objects: ObjectClasses
    calibration: Tally
    """Of the check of mounts, to which kinds add rules."""
    points: Sequence[LabelledPoints]
    """Of sensors of all kinds."""
    rays: RayReference | None
    """The second ray tracer, if the world was rebuilt."""
    full: bool
    """True if every image is retraced, not a sample."""
    samples: int
    """Approximate number of sampled stamps."""

    def sampler(self) -> Sampler:
        """Return a choice of stamps."""
        return Sampler(self.context.run.start_ns, self.context.run.end_ns, self.samples)


@dataclass(frozen=True)
class KindChecks:
    """Checks of a kind of sensor, by their position in the output."""

    make: Callable[[Pass], list[Checker]]
    """Makes the checkers of a pass."""
    calibration: tuple[Rule, ...] = ()
    """Rules that it adds to the check of mounts."""
    motion: tuple[Spec, ...] = ()
    """Of readings of the motion."""
    form: tuple[Spec, ...] = ()
    """Of the form of readings."""
    between: tuple[Spec, ...] = ()
    """Of readings that are compared with those of other kinds."""
    retraced: tuple[Spec, ...] = ()
    """Of readings that are made again in the rebuilt world."""
    signal: tuple[Spec, ...] = ()
    """Of runs with sensors that are not ideal."""
    extras: tuple[Spec, ...] = ()
    """Of what only some runs have."""
    extras_of: Callable[[Context], tuple[Spec, ...]] = lambda context: ()
    """Returns the extras that a run has."""
    points: Callable[[Rig], Sequence[LabelledPoints]] = lambda rig: ()
    """Its sensors in a rig whose readings are points with class and instance id."""
