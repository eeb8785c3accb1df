# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a check came to, and how all of them are told."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

_WORDS: Final = {True: "pass", False: "FAIL", None: "skipped"}


@dataclass(frozen=True)
class Check:
    """One check of a run. ``name`` is stable, for programs; ``text`` is for people.

    ``passed`` is None where the check could not be made. ``text`` holds the figures, or what is wrong and where it is
    met first, or why the check could not be made.
    """

    name: str
    passed: bool | None
    text: str


def as_text(checks: Sequence[Check]) -> str:
    """A line per check, and one with the counts."""
    width = max((len(check.name) for check in checks), default=0)
    lines = [f"{_WORDS[check.passed]:<7}  {check.name:<{width}}  {check.text}" for check in checks]
    counts = {passed: sum(check.passed is passed for check in checks) for passed in _WORDS}
    summary = f"{len(checks)} checks: {counts[True]} passed, {counts[False]} failed, {counts[None]} skipped"
    return "\n".join([*lines, summary])


def as_json(checks: Sequence[Check]) -> str:
    """One object: ``passed`` is false if any check failed; ``checks`` holds name, passed (null: skipped) and text."""
    rows = [{"name": check.name, "passed": check.passed, "text": check.text} for check in checks]
    return json.dumps({"passed": all(check.passed is not False for check in checks), "checks": rows}, indent=2)
