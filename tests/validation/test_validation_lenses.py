# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs of cameras with other lenses pass every check; a lens that differs from the images does not."""

import shutil
from pathlib import Path
from typing import Any

import pytest
from small_park import in_small_park

from fieldtruth.bag.file import BagError
from fieldtruth.exporters import export
from fieldtruth.pipeline import generate
from fieldtruth.validation.runner import validate

pytestmark = pytest.mark.usefixtures("small_sky", "in_park")

K1 = 0.08
LENSES: dict[str, dict[str, Any]] = {
    "plumb_bob": {"lens": {"model": "plumb_bob", "coefficients": (K1, -0.05, -0.003, 0.002, 0.0)}},
    "fisheye": {"model": "fisheye_190", "width": 112, "height": 112},
    "panorama": {"model": "panorama", "width": 160, "height": 80},
}


def recorded(folder: Path, cameras: dict[str, Any]) -> Path:
    small = {"width": 160, "height": 92, "depth": True, "instances": True}
    return generate(in_small_park(seconds=0.25, rig={"cameras": small | cameras}), folder).parent


@pytest.fixture(scope="module")
def distorted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run with the lens plumb_bob."""
    return recorded(tmp_path_factory.mktemp("distorted"), LENSES["plumb_bob"])


@pytest.mark.parametrize(
    "name", [name if name == "plumb_bob" else pytest.param(name, marks=pytest.mark.slow) for name in LENSES]
)
def test_a_run_of_another_lens_passes(name: str, distorted: Path, tmp_path: Path) -> None:
    run = distorted if name == "plumb_bob" else recorded(tmp_path, LENSES[name])
    checks = {check.name: check for check in validate(run, full=True, samples=4)}
    assert [check.text for check in checks.values() if check.passed is False] == []
    for row in ("calibration", "images", "depth", "retraced images", "photographs", "independent rays"):
        assert checks[row].passed, checks[row].text
    assert "retracing" in checks["lidar and cameras"].text


def test_a_lens_of_the_wrong_sign_fails(distorted: Path, tmp_path: Path) -> None:
    run = Path(shutil.copytree(distorted, tmp_path / distorted.name))
    path = run / "experiment.yaml"
    path.write_text(path.read_text(encoding="utf-8").replace(f"[{K1}, ", f"[-{K1}, "), encoding="utf-8")
    failed = {check.name for check in validate(run, samples=4) if check.passed is False}
    assert {"calibration", "retraced images", "independent rays"} <= failed


def test_kitti_refuses_images_that_are_not_rectified(distorted: Path, tmp_path: Path) -> None:
    with pytest.raises(BagError, match=r"KITTI has rectified photographs, .* the lens 'plumb_bob'; rectify them"):
        export(distorted, "kitti", out=tmp_path / "out")
