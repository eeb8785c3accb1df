# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The second witness of a retrace: a tracer in double precision, which judges single rays.

Whole clouds and images are traced again by the engine that made them. Where it and the bag differ, as on another
processor some rays at borders do, this witness judges what the bag says. It also judges some rays of each sample for
itself, so that the engine is not the only one that is asked.
"""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.validation.check import Check
from fieldtruth.validation.claims import NOTHING, UNKNOWN, Claim, refuted
from fieldtruth.validation.exact import ExactTracer
from fieldtruth.validation.law import Law, check_of
from fieldtruth.validation.subject import Place, Subject

RAYS: Final = 16
"""Rays of a sampled cloud or image that are judged for themselves."""
JUDGED: Final = 200
"""Rays of a cloud or image that are judged at most where the engine and the bag differ."""
ELSEWHERE: Final = 0.05
"""Share of rays from which on cloud or image were made in another place, and ``RAYS`` of them are enough to tell."""


class Outcome(NamedTuple):
    """What came of a cloud or an image."""

    rays: int
    wrong: list[str]
    """What is wrong with the bag's rays."""
    differ: int
    """Other rays of which the engine says otherwise."""
    sampled: int
    """Rays that were judged for themselves."""
    sampled_wrong: list[str]
    equal: bool
    """Whether the engine gives the same to the last digit."""


class Witness:
    """Judges rays. Threads may share it."""

    def __init__(self, subject: Subject, place: Place) -> None:
        self._place = place
        self._tracer = ExactTracer(place.world)
        self._law = subject.law("rays traced in double precision meet what the bag says")

    def judge(
        self, differ: NDArray[np.intp], rays: int, claim: Callable[[int], Claim], seed: int | None, *, equal: bool
    ) -> Outcome:
        """Judge what a cloud or an image says of rays.

        Args:
            differ: numbers of the rays of which the engine says otherwise.
            rays: how many there are.
            claim: what the bag says of a ray, by its number.
            seed: of the choice of rays that are judged for themselves; None for none.
            equal: whether the engine gives the same to the last digit.
        """
        count = min(len(differ), RAYS if len(differ) > ELSEWHERE * rays else JUDGED)
        judged = differ[np.unique(np.linspace(0, len(differ) - 1, count).astype(int))].tolist()
        drawn: list[int] = []
        if seed is not None:
            drawn = np.random.default_rng(seed).choice(rays, min(RAYS, rays), replace=False).tolist()
        wrong, drawn_wrong = (self._wrong([claim(k) for k in rows]) for rows in (judged, drawn))
        return Outcome(rays, wrong, len(differ) - len(wrong), len(drawn), drawn_wrong, equal)

    def fold(self, outcome: Outcome) -> None:
        """Count what came of the rays that were judged for themselves."""
        self._law.count(outcome.sampled, len(outcome.sampled_wrong), "".join(outcome.sampled_wrong[:1]))

    def result(self) -> Check:
        """Independent rays."""
        figures = f"{self._law.seen:,} rays, traced a second time in double precision, meet what the bag says"
        return check_of("independent rays", [self._law], figures, "no clouds and no tag images, or no true motion")

    def _wrong(self, claims: list[Claim]) -> list[str]:
        answers = refuted(self._place.world, self._tracer, claims)
        return [
            f"{claim.where}: {_told(claim)}, but {answer}"
            for claim, answer in zip(claims, answers, strict=True)
            if answer is not None
        ]


def close(mine: NDArray[np.floating[Any]], theirs: NDArray[np.floating[Any]]) -> NDArray[np.bool_]:
    """Whether lengths [m] are the same in single precision, on whatever processor."""
    return np.asarray(np.abs(mine - theirs) <= 2e-5 + 1e-6 * np.abs(theirs))


class Tally:
    """Counts what came of clouds, or of images.

    Engine and processor being those that made a run, all of its clouds are equal to the last digit, and one that is not
    was changed. On another processor nearly none is, as each holds some ten thousand ranges; then that is no law.
    """

    def __init__(self, subject: Subject, rule: str, things: str) -> None:
        self.law = subject.law(rule)
        self.equal = Law(f"{things} made again are equal to the last digit", binding=False, minor=True)
        self.count = self._differ = 0

    def add(self, outcome: Outcome, place: str) -> None:
        """Count a cloud or an image."""
        self.count += 1
        self._differ += outcome.differ
        self.law.count(outcome.rays, len(outcome.wrong), outcome.wrong[0] if outcome.wrong else "")
        self.equal.see(outcome.equal, place)

    @property
    def pardoned(self) -> str:
        """Words on rays of which the engine says otherwise and which are true."""
        return f"; {self._differ:,} differ in a last digit or graze a border" if self._differ else ""


def _told(claim: Claim) -> str:
    if claim.range_m == NOTHING:
        return "nothing came back" if claim.pulse else "sky"
    thing = "" if claim.instance == UNKNOWN else f" of object {claim.instance}"
    return f"class {claim.label}{thing} at {claim.range_m:.4f} m"
