# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What there is, by name: the experiments that ship with the package, and the environments. Light: a list is quick."""

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from importlib.resources import files

from fieldtruth.errors import UnknownNameError
from fieldtruth.experiment.text import parse_mapping


@cache
def _texts() -> dict[str, str]:
    folder = files("fieldtruth.experiment") / "builtin"
    entries = sorted((e for e in folder.iterdir() if e.name.endswith(".yaml")), key=lambda e: e.name)
    return {e.name.removesuffix(".yaml"): e.read_text(encoding="utf-8") for e in entries}


def experiment_names() -> tuple[str, ...]:
    """Names of the experiments that ship with the package, sorted."""
    return tuple(_texts())


def experiment_text(name: str) -> str:
    """YAML of an experiment that ships with the package.

    Raises:
        UnknownNameError: there is none of that name; lists those that there are.
    """
    try:
        return _texts()[name]
    except KeyError:
        raise UnknownNameError("experiment", name, experiment_names()) from None


def list_experiments() -> dict[str, str]:
    """Name and one descriptive line of each experiment that ships with the package."""
    return {name: str(parse_mapping(text, name).get("description", "")) for name, text in _texts().items()}


def _environments() -> Mapping[str, object]:
    # Late: the builders bring geometry along.
    environments: Mapping[str, object] = getattr(
        import_module("fieldtruth.world.environments"), "ENVIRONMENTS", {"park": None}
    )
    return environments


def environment_names() -> tuple[str, ...]:
    """Names of the environments, in the paper's order."""
    return tuple(_environments())


def list_environments() -> dict[str, str]:
    """Name and one descriptive line of each environment: the first line of its builder's docstring."""
    return {name: (builder.__doc__ or "").strip().partition("\n")[0] for name, builder in _environments().items()}
