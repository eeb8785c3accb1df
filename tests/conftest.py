# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A real run that many tests read and none may change: small images, every topic, made once."""

from pathlib import Path

import pytest

from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment


@pytest.fixture(scope="session")
def small_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of 1.2 s of park_1 with depth and instances, images of 320 x 184. Copy what you want to change."""
    from fieldtruth.pipeline import generate

    values = load_experiment("park_1").model_dump()
    values["seconds"] = 1.2
    values["rig"]["cameras"] |= {"width": 320, "height": 184, "depth": True, "instances": True}
    return generate(Experiment.model_validate(values), tmp_path_factory.mktemp("small_run")).parent
