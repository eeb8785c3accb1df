# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The environments by name. This table imports nothing heavy, so that listing them is fast.

An environment is one file of layers in ``data/environments``, of which the package ``layered`` makes worlds, or a
package of two modules with fixed names: ``config`` (its layout, a pydantic model ``Config``, and ``CORRIDORS``, the
lines that stay free of obstacles; those of the package are in their data files) and ``build`` (the function ``build``).
Entry points of the group ``fieldtruth.environments`` name such packages, folders ``environments`` of FIELDTRUTH_PATH
contain them.
"""

import ast
import re
import sys
from functools import cache
from importlib.util import find_spec
from inspect import cleandoc
from pathlib import Path
from typing import Any, Final, NamedTuple

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.registry import Registry, Source, user_folders
from fieldtruth.core.yaml_io import parse_mapping, read_text
from fieldtruth.experiment.environment_file import SITE


class Environment(NamedTuple):
    """One line of description, and the name of the package that builds it."""

    description: str
    package: str


def _read(name: str, given: Any) -> Environment:
    """Describe a package, or a folder that is one, by the first line of its docstring."""
    if isinstance(given, Environment):
        return given
    if isinstance(given, Path) and given.suffix == ".yaml":
        description = str(parse_mapping(read_text(given), str(given)).get("description", ""))
        return Environment(description, f"{__name__}.layered")
    if not isinstance(given, Path):
        return Environment(_first_line(given.__doc__), given.__name__)
    if str(given.parent) not in sys.path:
        sys.path.append(str(given.parent))
    spec = find_spec(name)
    if spec is None or [Path(place).resolve() for place in spec.submodule_search_locations or ()] != [given.resolve()]:
        raise ConfigurationError(f"{given}: another module has the name {name!r}; rename the folder")
    front = given / "__init__.py"
    text = front.read_text(encoding="utf-8") if front.is_file() else ""
    return Environment(_first_line(ast.get_docstring(ast.parse(text))), name)


def _first_line(text: str | None) -> str:
    return cleandoc(text or "").partition("\n")[0].rstrip(".")


@cache
def _has_layers(path: Path) -> bool:
    return re.search(r"^ground:", read_text(path), re.MULTILINE) is not None


class Environments(Registry[Environment]):
    """Environments by name; in a user's folders also files of layers, which have the section ``ground``."""

    def _added(self) -> dict[str, Source]:
        found = super()._added()
        for path in (path for base in user_folders() for path in sorted((base / "environments").glob("*.yaml"))):
            if path.stem not in found and _has_layers(path):
                if path.stem in self._own:
                    raise ConfigurationError(f"{path}: another environment has the name {path.stem!r} already")
                found[path.stem] = path
        return found


ENVIRONMENTS: Final[Registry[Environment]] = Environments(
    "environment",
    "environments",
    "",
    _read,
    {
        name: Environment(description, f"{__name__}.layered")
        for name, description in (
            ("forest", "dense forest: 350 trees and more, two trails, fallen trunks, stones, bushes, high grass"),
            ("hillside", "rugged hillside: granite flank with heath, rocks, dry high grass, bushes, few trees"),
            ("lake", "lake's shore: water, beaches and scarps, reeds, high grass, bushes, trees, a power line"),
            ("park", "urban park: lawn, two trails, trees, bushes, lamp posts, benches, tables, trash bins"),
            ("boreal", "boreal forest: slender spruces, moss, bilberries, boulders, dead wood; a bog with pools"),
            ("field_track", "field track: a grassy farm track between ripe wheat and rows of maize, hedges"),
            ("forest_road", "forest road: gravel with wheel tracks between walls of bushes and trees, a branch"),
            ("orchard", "orchard and vineyard: rows of apple trees, vines on a trellis, a farm track, a hedge"),
            ("quarry", "quarry: a wide yard of gravel with tracks, heaps and banks of stones, puddles, a tree line"),
            ("scrub", "Mediterranean scrub: maquis, olive terraces with walls of dry stone, rocks, dry grass, a track"),
            ("thicket", "winter thicket: leafless bush, dry tall grass, a muddy track with puddles, oaks, junipers"),
            ("wet_meadow", "wet meadow: ditches with reeds, drains, pools, soft ground, rushes, willows, a track"),
        )
    },
)

FROM_FILES: Final = {SITE: Environment("a site: ground, trees, paths and surfaces from maps", f"{__name__}.{SITE}")}
"""Environments without an entry, because each world of theirs is named by its file."""


def find_environment(name: str, source: str = "") -> Environment:
    """Return an environment of a name, or one of ``FROM_FILES``; raises as ``Registry.find``."""
    return FROM_FILES[name] if name in FROM_FILES else ENVIRONMENTS.find(name, source)


PAPER: Final = ("forest", "hillside", "lake", "park")
"""Environments of the paper."""


def list_environments() -> dict[str, str]:
    """Name and one descriptive line of each environment."""
    return {name: environment.description for name, environment in ENVIRONMENTS.items()}
