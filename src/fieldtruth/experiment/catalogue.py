# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The built-in experiments by name, without heavy imports."""

from functools import cache
from importlib.resources import files

from fieldtruth.core.errors import UnknownNameError
from fieldtruth.experiment.yaml_io import parse_mapping


@cache
def _texts() -> dict[str, str]:
    folder = files("fieldtruth.experiment") / "builtin"
    entries = sorted((e for e in folder.iterdir() if e.name.endswith(".yaml")), key=lambda e: e.name)
    return {e.name.removesuffix(".yaml"): e.read_text(encoding="utf-8") for e in entries}


def experiment_names() -> tuple[str, ...]:
    """Names of the built-in experiments, sorted."""
    return tuple(_texts())


def experiment_text(name: str) -> str:
    """YAML text of a built-in experiment.

    Raises:
        UnknownNameError: unknown name.
    """
    try:
        return _texts()[name]
    except KeyError:
        raise UnknownNameError("experiment", name, experiment_names()) from None


def list_experiments() -> dict[str, str]:
    """Name and one-line description of each built-in experiment."""
    return {name: str(parse_mapping(text, name).get("description", "")) for name, text in _texts().items()}
