# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The environments by name. Each file reads like its paragraph in the paper and builds a world from a seed."""

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final, NamedTuple

if TYPE_CHECKING:  # a list of names needs none of these
    from fieldtruth.experiment.rig import Frozen
    from fieldtruth.world.model import World
    from fieldtruth.world.trails import Line


class Environment(NamedTuple):
    """What an environment is, in a line, and where its rules are: module, function and configuration by name.

    The module is imported when it is needed, because a list of names must be quick.
    """

    description: str
    module: str
    build_name: str
    config_name: str

    @property
    def config(self) -> "type[Frozen]":
        """The configuration of its layout: counts, densities, relief, trails."""
        config: type[Frozen] = getattr(self._module(), self.config_name)
        return config

    def build(self, seed: int, corridors: "Sequence[Line]", layout: Mapping[str, Any] | None = None) -> "World":
        """Build it; ``corridors`` stay free, ``layout`` changes its configuration.

        Raises pydantic.ValidationError for a layout that is not allowed.
        """
        build: Callable[[int, Sequence[Line], Frozen], World] = getattr(self._module(), self.build_name)
        return build(seed, corridors, self.config.model_validate(dict(layout or {})))

    def _module(self) -> ModuleType:
        return import_module(f"fieldtruth.world.environments.{self.module}")


def list_environments() -> dict[str, str]:
    """Name and one descriptive line of each environment."""
    return {name: environment.description for name, environment in ENVIRONMENTS.items()}


def _environment(module: str, description: str) -> Environment:
    return Environment(description, module, f"build_{module}", f"{module.capitalize()}Config")


ENVIRONMENTS: Final[Mapping[str, Environment]] = {
    name: _environment(name, description)
    for name, description in (
        ("forest", "dense forest: 350 trees and more, two trails, fallen trunks, stones, bushes, high grass"),
        ("hillside", "rugged hillside: a mountain's flank, rocks, dry high grass, bushes, few trees"),
        ("lake", "lake's shore: water, beaches and scarps, reeds, high grass, bushes, trees, a power line"),
        ("park", "urban park: lawn, two trails, trees, bushes, lamp posts, benches, tables, trash bins"),
    )
}
