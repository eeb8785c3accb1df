# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs with the signal of real cameras: same truth as without, same bytes from any number of workers, valid."""

from pathlib import Path
from typing import Any

import pytest
from small_park import in_small_park

from fieldtruth.bag.reader import open_bag
from fieldtruth.experiment.catalogue import preset_of
from fieldtruth.experiment.config import Experiment
from fieldtruth.pipeline import generate
from fieldtruth.simulation.motion import without_wheels
from fieldtruth.validation.runner import validate

pytestmark = pytest.mark.usefixtures("small_sky", "in_park")


def _experiment(signal: Any, **changes: Any) -> Experiment:
    cameras = {"width": 96, "height": 54, "depth": True, "instances": True, "signal": signal}
    return in_small_park(**{"seconds": 0.12, "rig": {"cameras": cameras, "lidar": {"enabled": False}}} | changes)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Bags of a robot's cameras in rain, by one worker and by two."""
    robot = _experiment(preset_of("camera", "robot") | {"lens_drops": 20}, weather={"rain_mm_h": 10.0})
    return {str(k): generate(robot, tmp_path_factory.mktemp(str(k)), workers=k) for k in (1, 2)}


def _messages(bag: Path) -> dict[str, list[tuple[int, bytes]]]:
    found: dict[str, list[tuple[int, bytes]]] = {}
    with open_bag(bag) as reader:
        for message in reader.messages():
            found.setdefault(message.topic, []).append((message.stamp_ns, message.data))
    return found


def test_bytes_do_not_depend_on_workers(runs: dict[str, Path]) -> None:
    assert runs["1"].read_bytes() == runs["2"].read_bytes()


def test_only_photographs_differ(runs: dict[str, Path], tmp_path: Path) -> None:
    """All other messages are those of a run of ideal cameras in clear weather."""
    real, ideal = _messages(runs["1"]), _messages(generate(_experiment(None), tmp_path, workers=1))
    assert ideal.keys() == real.keys()
    assert {topic for topic in ideal if ideal[topic] != real[topic]} == {
        f"/stereo/camera/{side}/real/compressed" for side in ("left", "right")
    }


def test_run_is_valid_and_says_what_is_not_compared(runs: dict[str, Path]) -> None:
    checks = {check.name: check for check in validate(runs["1"].parent, full=True)}
    assert all(check.passed is not False for check in checks.values()), [c for c in checks.values() if not c.passed]
    assert checks["photographs"].passed is None
    assert checks["photographs"].text == "every camera has the signal of a real one; their other images are compared"
    assert checks["retraced images"].passed


def test_frames_have_a_signal_too(tmp_path: Path) -> None:
    """The robot stands: a frame does not see the poses of others through its shutter or its metering."""
    values = without_wheels(_experiment("datasheet")).model_dump() | {"route": None, "frames": {"count": 3}}
    bag = generate(Experiment.model_validate(values | {"seconds": None, "drive": None}), tmp_path, workers=1)
    assert len(_messages(bag)["/stereo/camera/left/real/compressed"]) == 3
