# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parks for tests: the real one once per session, and variants without painting textures anew."""

import hashlib
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fieldtruth.experiment.catalogue import experiment_names
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.route import metres_from_route
from fieldtruth.world import assembly
from fieldtruth.world.build import load_world
from fieldtruth.world.environments.park.build import build as build_park
from fieldtruth.world.environments.park.config import Config as ParkConfig
from fieldtruth.world.model import World
from fieldtruth.world.trails import Line


@cache
def real_park(folder: Path) -> World:
    """The park of seed 0; ``folder`` is the session's own."""
    return load_world("park", 0, cache_folder=folder / "worlds")


def routes() -> dict[str, np.ndarray[tuple[int, int], np.dtype[np.float64]]]:
    """Corners (n, 2) [m] of each built-in experiment in the park, its start first."""
    experiments = [load_experiment(name) for name in experiment_names()]
    return {e.name: metres_from_route(e.route) for e in experiments if e.environment == "park"}


@cache
def park_variant(seed: int, **changes: int) -> World:
    """A park with one individual of each kind of tree and without textures, which do not bear on its layout."""
    lines = [Line.through([(float(x), float(y)) for x, y in corners], smooth=False) for corners in routes().values()]
    config = ParkConfig.model_validate({"individuals": 1, **changes})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(assembly, "make_textures", lambda *_: {})
        return build_park(seed, lines, config)


def digest(thing: object) -> str:
    """Hash of everything in a world: names, numbers, every byte of every array."""
    sum_ = hashlib.blake2b()

    def add(value: object) -> None:
        if isinstance(value, np.ndarray):
            sum_.update(f"{value.dtype}{value.shape}".encode())
            sum_.update(np.ascontiguousarray(value).tobytes())
        elif is_dataclass(value):
            for field in fields(value):
                sum_.update(field.name.encode())
                add(getattr(value, field.name))
        elif hasattr(value, "items"):
            for key, item in value.items():
                sum_.update(str(key).encode())
                add(item)
        elif isinstance(value, tuple | list):
            sum_.update(f"({len(value)}".encode())
            for item in value:
                add(item)
        else:
            sum_.update(repr(value).encode())

    add(thing)
    return sum_.hexdigest()
