# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shards share the runs out, and their numbers are written as SLURM reads them."""

from hypothesis import given, settings
from hypothesis import strategies as st

from fieldtruth.campaign.draw import Shard, parse_shard, ranges


@given(st.integers(0, 200), st.integers(1, 60))
@settings(max_examples=20, deadline=None)
def test_each_run_is_in_one_part_and_parts_differ_by_at_most_one_run(runs: int, parts: int) -> None:
    made = [Shard(part, parts).of(range(runs)) for part in range(1, parts + 1)]
    assert sorted(k for part in made for k in part) == list(range(runs))
    assert max(map(len, made)) - min(map(len, made)) <= 1


def test_with_as_many_parts_as_runs_part_i_is_run_i() -> None:
    assert [Shard(part, 20).of(range(20)) for part in range(1, 21)] == [[k] for k in range(20)]


def test_environments_that_alternate_are_in_every_part() -> None:
    runs = ["forest", "hillside", "lake", "park"] * 12
    assert all(len(set(Shard(part, 4).of(runs))) == 4 for part in range(1, 5))


def test_a_shard_is_read_as_it_is_written() -> None:
    assert parse_shard("3/10") == Shard(3, 10)


def expanded(expression: str) -> list[int]:
    """The numbers of a SLURM array expression, from sbatch's manual page."""
    spans = [part.split("-") for part in expression.split(",")] if expression else []
    return [k for span in spans for k in range(int(span[0]), int(span[-1]) + 1)]


def test_ranges_are_joined() -> None:
    assert ranges([1, 4, 5, 6, 7, 12]) == "1,4-7,12"
    assert ranges([2, 1]) == "1-2"
    assert ranges([]) == ""


@given(st.sets(st.integers(1, 300)))
@settings(max_examples=20, deadline=None)
def test_an_expression_has_every_number_once(numbers: set[int]) -> None:
    assert expanded(ranges(numbers)) == sorted(numbers)
