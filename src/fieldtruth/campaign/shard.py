# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shards: the runs of a campaign in N parts, and the numbers of those parts as a SLURM array expression."""

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeVar

from fieldtruth.core.errors import ConfigurationError

T = TypeVar("T")


class Shard(NamedTuple):
    """Part ``part`` of ``parts``, counted from 1."""

    part: int
    parts: int

    def has(self, k: int) -> bool:
        """Whether run k, counted from 0, is in this part.

        Each N runs in a row are in N different parts, in an order that moves on by one from row to row: parts differ by
        at most one run, and a product whose axes have N entries does not put one environment into one part. With as
        many parts as runs, part I is run I.
        """
        row, column = divmod(k, self.parts)
        return (column + row) % self.parts == self.part - 1

    def of(self, runs: Sequence[T]) -> list[T]:
        """Return the runs of this part."""
        return [run for k, run in enumerate(runs) if self.has(k)]


def parse_shard(text: str) -> Shard:
    """Parse "I/N", part I of N, counted from 1.

    Raises:
        ConfigurationError: another form, or a part that does not exist.
    """
    match = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text)
    if match is None:
        raise ConfigurationError(f"a shard must be I/N, part I of N, such as 3/10, got {text!r}")
    shard = Shard(int(match[1]), int(match[2]))
    if not 1 <= shard.part <= shard.parts:
        raise ConfigurationError(
            f"a shard must be I/N with I from 1 to N, got {text!r}; as a SLURM array: --array=1-N, and N as a number, "
            f"because SLURM_ARRAY_TASK_COUNT of a smaller array is smaller"
        )
    return shard


def ranges(numbers: Iterable[int]) -> str:
    """Write numbers as in a SLURM array: "1,4-7,12"."""
    spans: list[list[int]] = []
    for number in sorted(set(numbers)):
        if spans and number == spans[-1][1] + 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    return ",".join(str(first) if first == last else f"{first}-{last}" for first, last in spans)
