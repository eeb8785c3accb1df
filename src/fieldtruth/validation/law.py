# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A law is a sentence that is true of every item of a stream; here is the count of those of which it is not.

For a run of this package every law is binding. For a bag from elsewhere it is not known which hold. There, a law that
nine of ten items obey to the last digit is taken for a law of that bag, and the others break it; one that fewer obey is
not judged.
"""

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.validation.check import Check

OBEYED: Final = 0.9
"""Share of items that must obey a law before the others count as wrong, where it is not known to hold."""


class Law:
    """Counts who obeys.

    Args:
        rule: what is true of every item, as a sentence without a stop.
        bound: largest residual that is allowed, in ``unit``; None for laws of yes and no.
        unit: of the residuals.
        binding: whether the law is known to hold.
        minor: whether obeying it alone says too little for a check to pass.
    """

    def __init__(
        self, rule: str, bound: float | None = None, unit: str = "", *, binding: bool = True, minor: bool = False
    ) -> None:
        self.rule = rule
        self.bound = bound
        self.unit = unit
        self.binding = binding
        self.minor = minor
        self.seen = 0
        self.broken = 0
        self.worst = 0.0
        """Largest residual of those that obey."""
        self.first = ""

    def see(self, obeyed: bool, where: str | Callable[[], str]) -> bool:
        """Count an item."""
        self.seen += 1
        if not obeyed:
            self._blame(1, where if isinstance(where, str) else where())
        return obeyed

    def measure(self, residual: float, where: str | Callable[[], str]) -> bool:
        """Count an item by its residual; what is no number breaks the law."""
        assert self.bound is not None
        obeyed = abs(residual) <= self.bound
        if obeyed:
            self.worst = max(self.worst, abs(residual))
            return self.see(True, "")
        place = where if isinstance(where, str) else where()
        return self.see(False, f"{place}: {abs(residual):.3g} {self.unit}, at most {self.bound:.3g} is allowed")

    def see_all(self, obeyed: NDArray[np.bool_], where: Callable[[int], str]) -> None:
        """Count many items; ``where`` tells the place of one by its number."""
        self.seen += obeyed.size
        if not obeyed.all():
            wrong = np.flatnonzero(~obeyed.ravel())
            self._blame(len(wrong), where(int(wrong[0])))

    def measure_all(self, residuals: NDArray[np.floating[Any]], where: Callable[[int], str]) -> None:
        """Count many items by their residuals (n,)."""
        assert self.bound is not None
        bound, sizes = self.bound, np.abs(residuals)
        obeyed = sizes <= bound
        if obeyed.any():
            self.worst = max(self.worst, float(sizes[obeyed].max()))
        self.see_all(
            obeyed, lambda k: f"{where(k)}: {sizes[k]:.3g} {self.unit}, at most {bound:.3g} is allowed"
        )  # fmt: skip

    def count(self, seen: int, broken: int, first: str) -> None:
        """Add items that somebody else counted; ``first`` counts only if some are broken."""
        self.seen += seen
        if broken:
            self._blame(broken, first)

    def merge(self, other: "Law") -> None:
        """Add what another count of the same law came to."""
        self.worst = max(self.worst, other.worst)
        self.count(other.seen, other.broken, other.first)

    def another(self) -> "Law":
        """Return the same law with nothing seen, for a thread to count by itself."""
        return Law(self.rule, self.bound, self.unit, binding=self.binding, minor=self.minor)

    @property
    def passed(self) -> bool | None:
        """False: broken. None: nothing was seen, or most do not obey a law that is not known to hold."""
        if self.broken == 0:
            return True if self.seen else None
        return False if self.binding or self.broken <= (1.0 - OBEYED) * self.seen else None

    @property
    def obeyed(self) -> int:
        """Items that obey, if the law was judged."""
        return self.seen - self.broken if self.passed is not None else 0

    @property
    def text(self) -> str:
        """What is wrong."""
        if self.seen == 1:
            return f"{self.rule}: not so: {self.first}"
        verb = "breaks" if self.broken == 1 else "break"
        return f"{self.rule}: {self.broken:,} of {self.seen:,} {verb} this, first {self.first}"

    @property
    def margin(self) -> str:
        """How near the worst of those that obey came to the bound."""
        return f"{self.worst:.1e} {self.unit} (allowed {self.bound:.2g})"

    def _blame(self, count: int, first: str) -> None:
        if not self.broken:
            self.first = first
        self.broken += count


def check_of(name: str, laws: Sequence[Law], figures: str | Callable[[], str], nothing: str) -> Check:
    """Make the check of several laws.

    Args:
        name: of the check.
        laws: a broken one fails the check; those without an item say nothing.
        figures: told if none is broken.
        nothing: why the check could not be made, if no law has an item.
    """
    wrong = [law.text for law in laws if law.passed is False]
    if wrong:
        return Check(name, False, "; ".join(wrong))
    unjudged = [law for law in laws if law.passed is None and law.seen]
    note = "".join(f"; not judged: {law.rule} ({law.broken:,} of {law.seen:,} are otherwise)" for law in unjudged)
    if any(law.passed for law in laws if not law.minor):
        return Check(name, True, (figures if isinstance(figures, str) else figures()) + note)
    return Check(name, None, note.removeprefix("; ") or nothing)
