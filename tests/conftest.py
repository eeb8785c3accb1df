# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A bag of the real park, made once for all tests that look into it."""

from pathlib import Path

import pytest

from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.pipeline import generate


@pytest.fixture(scope="session")
def park_bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the first simulated second of park_1, with every sensor at full resolution."""
    experiment = with_overrides(load_experiment("park_1"), seconds=1.0)
    return generate(experiment, tmp_path_factory.mktemp("park_bag"))
