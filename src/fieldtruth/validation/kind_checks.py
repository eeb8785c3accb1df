# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of a kind of sensor, and what all checks share during the pass over the bag."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from fieldtruth.validation.check import Spec
from fieldtruth.validation.context import Checker, Context, Sampler
from fieldtruth.validation.rays import RayReference
from fieldtruth.validation.world import ObjectClasses


class Pass(NamedTuple):
    """What checkers share during the pass over a bag."""

    context: Context
    objects: ObjectClasses
    rays: RayReference | None
    """The second ray tracer, if the world was rebuilt."""
    full: bool
    """Whether every image is retraced, not a sample."""
    samples: int
    """Approximate number of sampled stamps."""

    def sampler(self) -> Sampler:
        """Return a choice of stamps."""
        return Sampler(self.context.run.start_ns, self.context.run.end_ns, self.samples)


def _nothing(context: Context) -> tuple[Spec, ...]:
    return ()


@dataclass(frozen=True)
class KindChecks:
    """Checks of a kind of sensor, by their position in the output."""

    make: Callable[[Pass], list[Checker]]
    """Makes the checkers of a pass."""
    motion: tuple[Spec, ...] = ()
    """Of readings of the motion."""
    form: tuple[Spec, ...] = ()
    """Of the form of readings."""
    retraced: tuple[Spec, ...] = ()
    """Of readings that are made again in the rebuilt world."""
    signal: tuple[Spec, ...] = ()
    """Of runs with sensors that are not ideal."""
    extras: tuple[Spec, ...] = ()
    """Of what only some runs have."""
    extras_of: Callable[[Context], tuple[Spec, ...]] = _nothing
    """Which of the extras a run has."""
