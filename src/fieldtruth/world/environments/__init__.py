# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The environments by name. This table imports nothing heavy, so that listing them is fast.

An environment is a package of modules with fixed names: ``config`` (its layout, a pydantic model ``Config``),
``corridors`` (``CORRIDORS``, the lines that stay free of obstacles) and ``build`` (the function ``build``).
"""

from typing import Final, NamedTuple


class Environment(NamedTuple):
    """One line of description, and the name of the package that builds it."""

    description: str
    package: str


def _builtin(name: str, description: str) -> tuple[str, Environment]:
    return name, Environment(description, f"{__name__}.{name}")


ENVIRONMENTS: Final[dict[str, Environment]] = dict(
    [
        _builtin("forest", "dense forest: 350 trees and more, two trails, fallen trunks, stones, bushes, high grass"),
        _builtin("hillside", "rugged hillside: granite flank with heath, rocks, dry high grass, bushes, few trees"),
        _builtin("lake", "lake's shore: water, beaches and scarps, reeds, high grass, bushes, trees, a power line"),
        _builtin("park", "urban park: lawn, two trails, trees, bushes, lamp posts, benches, tables, trash bins"),
    ]
)


def list_environments() -> dict[str, str]:
    """Name and one descriptive line of each environment."""
    return {name: environment.description for name, environment in ENVIRONMENTS.items()}
