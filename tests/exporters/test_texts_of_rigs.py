# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Exports of another robot: their texts have no word about sensors and wheels that it lacks."""

import shutil
import warnings
from pathlib import Path
from zipfile import ZipFile

import pytest
from many_recording import record_many
from many_sensors import many_sensors

from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.experiment.rig import Rig
from fieldtruth.exporters import FORMATS, export

FOREIGN = ("Husky", "left camera", "right camera", "left and right", "image_3", "both cameras", "four wheels")
"""Words of the paper's rig: a pair of cameras on a robot with four wheels."""
LEFT_OUT = (
    *("kitti-object", "kitti-tracking", "mot", "occupancy", "stereo-depth", "coco", "zip", "mcap", "tum"),
    *("local-maps", "local-maps-bag", "image-cost", "experience", "scene-completion", "video", "webp"),
)
"""Formats that build the world again, need a pair, depth or instances, or have no text."""


@pytest.fixture(scope="module")
def two_wheels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run of a robot with two driven wheels and a caster, with one LiDAR and one camera."""
    chosen = [each for each in many_sensors() if each.get("name", "") in ("top", "front", "imu_front", "")]
    rig = Rig.model_validate({"sensors": chosen, "robot": {"model": "generic_differential"}})
    return record_many(tmp_path_factory.mktemp("two_wheels"), rig)


def texts_of(path: Path) -> str:
    """All text in an export, of workbooks too."""
    found = [file for file in ([path] if path.is_file() else sorted(path.rglob("*"))) if file.is_file()]
    text = [file.read_text("utf-8") for file in found if file.suffix in (".md", ".txt", ".yaml", ".json", ".py")]
    for book in (file for file in found if file.suffix == ".xlsx"):
        with ZipFile(book) as archive:
            text.append(archive.read("xl/sharedStrings.xml").decode())
    return "\n".join(text)


@pytest.mark.parametrize("to", [name for name in FORMATS if name not in LEFT_OUT])
def test_texts_are_of_the_rig(to: str, two_wheels: Path, tmp_path: Path) -> None:
    run = Path(shutil.copytree(two_wheels, tmp_path / "many"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FieldtruthWarning)
        text = texts_of(export(run, to, out=tmp_path / "out"))
    assert text
    assert [word for word in FOREIGN if word in text] == []
    if to == "files":
        assert "rear" not in text.replace("rear left, rear right; nan: the robot does not have this wheel", "")
        assert "of the camera and all points of the LiDAR of many" in text
    if to == "huggingface":
        assert "differential robot of 25 kg drives" in text
        assert "\nPhotographs and LiDAR clouds of a ground robot" in text
