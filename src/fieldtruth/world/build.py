# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds by name and seed, built by rules or taken from the cache."""

import contextlib
import hashlib
import json
import os
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from pydantic import ValidationError

from fieldtruth.core.errors import UnknownNameError
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.problems import configuration_error
from fieldtruth.world.environments import ENVIRONMENTS
from fieldtruth.world.library import data_files
from fieldtruth.world.model import World
from fieldtruth.world.store import read_world, save_world
from fieldtruth.world.trails import Line


def build_world(environment: str, seed: int = 0, layout: Mapping[str, Any] | None = None) -> World:
    """Build an environment by its rules. Same name, seed and layout, same world.

    ``layout`` changes its configuration, ``{"old_trees": 60}`` say: docs/environments.md lists the keys.

    The lines of the built-in experiments of this environment stay free of obstacles, whichever of them is driven, so
    that all its experiments share one world. Raises UnknownNameError, and ConfigurationError for a layout that is not
    allowed.
    """
    check_layout(environment, layout)
    return ENVIRONMENTS[environment].build(seed, _corridors(environment), layout)


def check_experiment(experiment: Experiment, source: str = "") -> None:
    """Check that an experiment's environment exists and that its layout is allowed there.

    Raises:
        UnknownNameError: unknown environment.
        ConfigurationError: a key or value that the environment's layout does not allow; the text starts with
            ``source``, a file's name for example.
    """
    check_layout(experiment.environment, experiment.layout, source)


def check_layout(environment: str, layout: Mapping[str, Any] | None, source: str = "") -> None:
    """Raise UnknownNameError for an unknown environment, ConfigurationError for a layout that it does not allow.

    ``source``, a file's name say, stands in front of what is wrong.
    """
    if environment not in ENVIRONMENTS:
        raise UnknownNameError("environment", environment, ENVIRONMENTS)
    if not layout:
        return
    config = ENVIRONMENTS[environment].config
    try:
        config.model_validate(dict(layout))
    except ValidationError as report:
        raise configuration_error(config, report, f"{source}: layout" if source else "layout") from report


def load_world(
    environment: str, seed: int = 0, layout: Mapping[str, Any] | None = None, *, cache_folder: Path | None = None
) -> World:
    """Return the world from the cache, or build it (see ``build_world``) and put it there.

    The cache is ``$XDG_CACHE_HOME/fieldtruth`` (or ``~/.cache/fieldtruth``) unless a folder is given; its key covers
    the code that builds worlds, so that a changed rule never meets an old world. Where it cannot be written, it is not.
    """
    folder = cache_folder if cache_folder is not None else default_cache()
    stem = f"{environment}-{seed}{_layout_key(layout)}"
    path = folder / f"{stem}-{_code_key()}.npz"
    if environment in ENVIRONMENTS and path.is_file():
        try:
            return read_world(path)
        except (OSError, ValueError, KeyError, EOFError, TypeError, NotImplementedError, BadZipFile):
            path.unlink(missing_ok=True)  # cut short or foreign: build it anew
    world = build_world(environment, seed, layout)
    with contextlib.suppress(OSError):
        save_world(path, world)
        for stale in set(folder.glob(f"{stem}-*.npz")) - {path}:
            stale.unlink()
    return world


def default_cache() -> Path:
    """Folder of built worlds."""
    root = os.environ.get("XDG_CACHE_HOME")
    return (Path(root) if root else Path.home() / ".cache") / "fieldtruth"


def world_of(experiment: Experiment) -> World:
    """Return the world in which an experiment takes place."""
    return load_world(experiment.environment, experiment.seed, experiment.layout)


def _layout_key(layout: Mapping[str, Any] | None) -> str:
    if not layout:
        return ""
    return "_" + hashlib.blake2b(json.dumps(layout, sort_keys=True).encode(), digest_size=6).hexdigest()


def _corridors(environment: str) -> list[Line]:
    from fieldtruth.experiment.catalogue import list_experiments
    from fieldtruth.experiment.files import load_experiment
    from fieldtruth.experiment.route import metres_from_route

    routes = [
        load_experiment(name).route for name in list_experiments() if load_experiment(name).environment == environment
    ]
    return [Line.through([tuple(p) for p in metres_from_route(route)], smooth=False) for route in routes]


@cache
def _code_key() -> str:
    """Digest of all that shapes a world: this package's rules and built-in routes, NumPy's and SciPy's version."""
    digest = hashlib.blake2b(f"{version('numpy')} {version('scipy')}".encode(), digest_size=8)
    root = Path(__file__).parent
    for path in sorted([*root.rglob("*.py"), *data_files(), *(root.parent / "experiment" / "builtin").glob("*.yaml")]):
        digest.update(path.read_bytes())
    return digest.hexdigest()
