# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The environments by name. Each file reads like its paragraph in the paper and builds a world from a seed."""

from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

from fieldtruth.world.model import World
from fieldtruth.world.trails import Line


class Environment(NamedTuple):
    """What an environment is, in a line, and the function that builds it from a seed and the lines that stay free."""

    description: str
    build: Callable[[int, Sequence[Line]], World]


def _park(seed: int, corridors: Sequence[Line]) -> World:
    from fieldtruth.world.environments.park import build_park

    return build_park(seed, corridors)


def _forest(seed: int, corridors: Sequence[Line]) -> World:
    from fieldtruth.world.environments.forest import build_forest

    return build_forest(seed, corridors)


def _lake(seed: int, corridors: Sequence[Line]) -> World:
    from fieldtruth.world.environments.lake import build_lake

    return build_lake(seed, corridors)


def _hillside(seed: int, corridors: Sequence[Line]) -> World:
    from fieldtruth.world.environments.hillside import build_hillside

    return build_hillside(seed, corridors)


ENVIRONMENTS: Final[Mapping[str, Environment]] = {
    "forest": Environment(
        "dense forest: 350 trees and more, two trails, fallen trunks, stones, bushes, high grass", _forest
    ),
    "lake": Environment(
        "lake's shore: water, beaches and scarps, reeds, high grass, bushes, trees, a power line", _lake
    ),
    "hillside": Environment("rugged hillside: a mountain's flank, rocks, dry high grass, bushes, few trees", _hillside),
    "park": Environment("urban park: lawn, two trails, trees, bushes, lamp posts, benches, tables, trash bins", _park),
}
