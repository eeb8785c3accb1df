# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a sensor says of single rays, and whether the world, traced in double precision, bears it out.

A ray that grazes a border has two true answers, as single precision may fall on either side: all that it can truly have
met are listed, up to the first thing that it must have met. A claim is true if it is among them.
"""

from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.classes import CLASSES, NO_RETURN
from fieldtruth.validation.exact import ExactTracer, Hits, border_is_near, doubt, trail_labels
from fieldtruth.world.model import World

F8 = NDArray[np.float64]

NOTHING: Final = 0.0
"""Range of a ray that met nothing."""
UNKNOWN: Final = -1
"""Object of a ray whose sensor tells none."""


class Claim(NamedTuple):
    """What a sensor says of a ray."""

    where: str
    origin: F8
    direction: F8
    """(3,) of unit length, in the world."""
    range_m: float
    """NOTHING, or not a number where the sensor tells none."""
    label: int
    instance: int
    least: float
    """[m] below which nothing is seen, though it hides what is behind."""
    most: float
    """[m] beyond which nothing is seen."""
    pulse: bool
    """A laser's pulse, which some classes do not return."""


class _Answer(NamedTuple):
    labels: set[int]
    instance: int
    reach: float
    doubt: float

    def __str__(self) -> str:
        names = " or ".join(sorted(CLASSES[label].name for label in self.labels))
        return f"{names} of object {self.instance} at {self.reach:.4f} m"


def refuted(world: World, tracer: ExactTracer, claims: list[Claim]) -> list[str | None]:
    """For each claim None if it is true, else what would be."""
    if not claims:
        return []
    known = np.array([c.range_m for c in claims])
    most = np.array([c.most for c in claims])
    limit = np.where((known > 0) & np.isfinite(known), np.minimum(known * 1.001 + 0.01, most * 1.001), most * 1.001)
    origins, directions = np.array([c.origin for c in claims]), np.array([c.direction for c in claims])
    answers = _answers(world, tracer, origins, directions, limit)
    return [_against(claim, *answer) for claim, answer in zip(claims, answers, strict=True)]


def _answers(
    world: World, tracer: ExactTracer, origins: F8, directions: F8, limit: F8
) -> list[tuple[list[_Answer], bool]]:
    """What each ray can have met, and whether it can have met nothing up to its limit."""
    hits = tracer.hits(origins, directions, limit)
    apart = doubt(hits.reach, hits.cosine)
    sure = _sure(hits, apart)
    bounds = np.searchsorted(hits.ray, np.arange(len(origins) + 1))
    result = []
    for ray, (first, last) in enumerate(pairwise(bounds)):
        answers: list[_Answer] = []
        end = np.inf
        for k in range(first, last):
            reach, cosine = float(hits.reach[k]), float(hits.cosine[k])
            if reach - apart[k] > end:
                break
            labels = {int(hits.label[k])}
            if labels == {0}:
                labels = trail_labels(world, origins[ray] + reach * directions[ray], reach, cosine)
            answers.append(_Answer(labels, int(hits.instance[k]), reach, float(apart[k])))
            if sure[k]:
                end = min(end, reach + float(apart[k]))
        result.append((answers, not np.isfinite(end)))
    return result


def _sure(hits: Hits, apart: F8) -> NDArray[np.bool_]:
    """Which triangles a ray cannot pass: it meets them far from a border, or where another one goes on behind it."""
    near = border_is_near(hits.margin, hits.reach, hits.cosine)
    together = (np.diff(hits.ray) == 0) & (np.diff(hits.reach) <= apart[:-1] + apart[1:])
    together &= (hits.instance[:-1] == hits.instance[1:]) & (np.maximum(hits.margin[:-1], hits.margin[1:]) > 0.0)
    closed = np.zeros(len(near), np.bool_)
    closed[:-1] |= together
    closed[1:] |= together
    return np.asarray(~near | closed)


def _against(claim: Claim, answers: list[_Answer], free: bool) -> str | None:
    """None if a claim is one of the answers, else what is."""
    for answer in answers:
        returns = {label for label in answer.labels if not (claim.pulse and label in NO_RETURN)}
        surely_seen = claim.least + answer.doubt < answer.reach < claim.most - answer.doubt
        maybe_seen = claim.least - answer.doubt < answer.reach < claim.most + answer.doubt
        if claim.range_m == NOTHING:
            if not surely_seen or not returns:
                return None
            continue
        there = not np.isfinite(claim.range_m) or abs(claim.range_m - answer.reach) <= answer.doubt
        if maybe_seen and there and claim.label in returns and claim.instance in (answer.instance, UNKNOWN):
            return None
    if free and claim.range_m == NOTHING:
        return None
    if not answers:
        return "there is nothing up to there"
    return f"there is {answers[0]}"
