# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Checks, the rules they consist of, and their output as text and JSON.

A rule is a condition on every item of a stream: a message, a point, a pixel. In a run of this package every
rule applies. In a bag from elsewhere it is unknown which rules apply: one that nine of ten items meet is applied to the
others, one that fewer items meet is not checked.
"""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Mask

MAJORITY: Final = 0.9
"""Share of items that must meet a rule before the others count as wrong, where the rule may not apply."""
SIGMAS: Final = 5.0
"""Standard deviations of a statistic that are tolerated."""
_NORMAL_CORE: Final = math.erf(math.sqrt(0.5))
"""Share of a normal distribution within one standard deviation."""
_STATUS: Final = {True: "pass", False: "FAIL", None: "skipped"}


@dataclass(frozen=True)
class Check:
    """Result of one check. ``name`` is stable, for programs; ``text`` is for people.

    ``passed`` has the value None if the check was skipped. ``text`` holds figures, the first mismatch, or the reason.
    """

    name: str
    passed: bool | None
    text: str


def as_text(checks: Sequence[Check]) -> str:
    """A line per check, and one with the counts."""
    width = max((len(check.name) for check in checks), default=0)
    lines = [f"{_STATUS[check.passed]:<7}  {check.name:<{width}}  {check.text}" for check in checks]
    counts = {passed: sum(check.passed is passed for check in checks) for passed in _STATUS}
    summary = f"{len(checks)} checks: {counts[True]} passed, {counts[False]} failed, {counts[None]} skipped"
    return "\n".join([*lines, summary])


def as_json(checks: Sequence[Check]) -> str:
    """One object: ``passed`` is false if any check failed; ``checks`` holds name, passed (null: skipped) and text."""
    rows = [{"name": check.name, "passed": check.passed, "text": check.text} for check in checks]
    return json.dumps({"passed": all(check.passed is not False for check in checks), "checks": rows}, indent=2)


@dataclass(frozen=True, eq=False)
class Rule:
    """A condition on every item. ``tolerance`` is the largest allowed residual in ``unit``; None for a yes-or-no rule.

    A check does not pass by ``minor`` rules alone.
    """

    text: str
    tolerance: float | None = None
    unit: str = ""
    minor: bool = False


@dataclass(frozen=True)
class Spec:
    """Declaration of a check: its stable name and its rules, of which docs/validate.md is generated.

    The text of a check that passes counts ``items``; ``skipped`` says why it has none.
    """

    name: str
    rules: tuple[Rule, ...]
    items: str = ""
    skipped: str = ""


class Count:
    """Number of items seen and of those that break a rule; a ``strict`` rule applies without a majority."""

    def __init__(self, rule: Rule, strict: bool = True) -> None:
        self.rule = rule
        self.strict = strict
        self.seen = self.wrong = 0
        self.worst = 0.0
        """Largest residual of the items that meet the rule."""
        self.first = ""
        """Description of the first mismatch."""

    def add(self, seen: int, wrong: int, first: str) -> None:
        """Add items counted elsewhere; ``first`` is ignored if none of them is wrong."""
        self.seen += seen
        if wrong and not self.wrong:
            self.first = first
        self.wrong += wrong

    def see(self, met: bool, mismatch: str) -> bool:
        """Count an item; returns ``met``."""
        self.add(1, int(not met), mismatch)
        return met

    def measure(self, residual: float, where: str) -> bool:
        """Count an item by its residual, where NaN breaks the rule; returns whether the rule is met."""
        wrong = self.wrong
        self.measure_all(np.array([residual]), lambda k: where)
        return self.wrong == wrong

    def see_all(self, met: Mask, mismatch: Callable[[int], str]) -> None:
        """Count items (n,); ``mismatch`` describes one by its index."""
        wrong = met.size - int(np.count_nonzero(met))
        self.add(met.size, wrong, mismatch(int(np.argmin(met))) if wrong else "")

    def measure_all(self, residuals: NDArray[np.floating[Any]], where: Callable[[int], str]) -> None:
        """Count items by their residuals (n,); ``where`` describes one by its index."""
        assert self.rule.tolerance is not None
        size, limit, unit = np.abs(residuals), self.rule.tolerance, self.rule.unit
        met = np.asarray(size <= limit)
        self.worst = float(size.max(initial=self.worst, where=met))
        self.see_all(met, lambda k: f"{where(k)}: {size[k]:.3g} {unit}, tolerance {limit:.3g}")

    @property
    def passed(self) -> bool | None:
        """False if the rule is broken; None if no item was seen or the rule does not apply to this bag."""
        if self.wrong == 0:
            return True if self.seen else None
        return False if self.strict or self.wrong <= (1.0 - MAJORITY) * self.seen else None

    @property
    def met(self) -> int:
        """Items that meet the rule; 0 if it does not apply."""
        return self.seen - self.wrong if self.passed is not None else 0

    @property
    def text(self) -> str:
        """Description of the mismatch."""
        if self.seen == 1:
            return f"{self.rule.text}: not met: {self.first}"
        return f"{self.rule.text}: {self.wrong:,} of {self.seen:,} mismatch, first {self.first}"

    @property
    def margin(self) -> str:
        """Largest residual beside its tolerance."""
        return f"{self.worst:.2g} {self.rule.unit} (tolerance {self.rule.tolerance:.2g})"


class Tally:
    """Counts of all rules of one check."""

    def __init__(self, spec: Spec, strict: bool = True) -> None:
        self.spec = spec
        self.note = ""
        """Further figures for the text of a check that passes."""
        self.skipped = spec.skipped
        self.more: list[Count] = []
        """Counts of further rules."""
        self._strict = strict
        self._counts = {rule: Count(rule, strict) for rule in spec.rules}
        self._whole: Tally | None = None

    def __getitem__(self, rule: Rule) -> Count:
        return self._counts[rule]

    def part(self) -> "Tally":
        """Return an empty tally of the same check, for another thread."""
        part = Tally(self.spec, self._strict)
        part._whole = self
        return part

    def join(self) -> None:
        """Add a part to the tally that it is a part of."""
        assert self._whole is not None
        for rule, own in self._counts.items():
            count = self._whole[rule]
            count.worst = max(count.worst, own.worst)
            count.add(own.seen, own.wrong, own.first)

    def result(self) -> Check:
        """Return the check."""
        counts = [*self._counts.values(), *self.more]
        wrong = [count.text for count in counts if count.passed is False]
        if wrong:
            return Check(self.spec.name, False, "; ".join(wrong))
        unused = [count for count in counts if count.passed is None and count.seen]
        notes = [f"does not apply: {c.rule.text} ({c.wrong:,} of {c.seen:,} mismatch)" for c in unused]
        if not any(count.passed for count in counts if not count.rule.minor):
            return Check(self.spec.name, None, "; ".join(notes) or self.skipped)
        figures = [f"{max(count.seen for count in counts):,} {self.spec.items}"] * bool(self.spec.items)
        figures += [count.margin for count in counts if count.rule.tolerance is not None and count.met]
        return Check(self.spec.name, True, "; ".join([*figures, *[self.note] * bool(self.note), *notes]))


def see_normal(tally: Tally, rules: tuple[Rule, Rule, Rule], values: Array, where: str) -> None:
    """Compare values (n,), in time order, with a standard normal distribution: mean, deviation, share within one."""
    mean, spread, shape = rules
    count = len(values)
    for part, rows in (("first half", values[: count // 2]), ("second half", values[count // 2 :])):
        tally[mean].measure(float(rows.mean()) * math.sqrt(len(rows)), f"{where}, {part}")
    tally[spread].measure((float(np.mean(values**2)) - 1.0) * math.sqrt(count / 2.0), where)
    core = float(np.mean(np.abs(values) < 1.0))
    tally[shape].measure((core - _NORMAL_CORE) / math.sqrt(_NORMAL_CORE * (1.0 - _NORMAL_CORE) / count), where)


def markdown(specs: Sequence[Spec]) -> str:
    """Table of all checks with their rules and tolerances, as in docs/validate.md."""
    rows = ["| check | rule | tolerance |", "|---|---|---|"]
    for spec in specs:
        for k, rule in enumerate(spec.rules):
            name = f"`{spec.name}`" if k == 0 else ""
            tolerance = "" if rule.tolerance is None else f"{rule.tolerance:.3g} {rule.unit}"
            rows.append(f"| {name} | {rule.text} | {tolerance} |")
    return "\n".join(rows) + "\n"
