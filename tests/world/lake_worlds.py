# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Lakes for tests: laid out in full, but with one individual of each plant and without textures."""

from functools import cache

import numpy as np
import pytest

from fieldtruth.experiment.catalogue import experiment_names
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.route import metres_from_route
from fieldtruth.world import assembly
from fieldtruth.world.environments.lake.build import build as build_lake
from fieldtruth.world.environments.lake.config import Config as LakeConfig
from fieldtruth.world.model import World
from fieldtruth.world.trails import Line


@cache
def lake_routes() -> dict[str, np.ndarray[tuple[int, int], np.dtype[np.float64]]]:
    """Corners (n, 2) [m] of each built-in experiment at the lake, its start first."""
    experiments = [load_experiment(name) for name in experiment_names()]
    return {e.name: metres_from_route(e.route) for e in experiments if e.environment == "lake"}


@cache
def lake_variant(seed: int, **changes: float) -> World:
    """A quick lake; textures do not bear on its layout."""
    corners = lake_routes().values()
    lines = [Line.through([(float(x), float(y)) for x, y in points], smooth=False) for points in corners]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(assembly, "make_textures", lambda *_: {})
        return build_lake(seed, lines, LakeConfig.model_validate({"individuals": 1, "grass": 0.5, **changes}))
