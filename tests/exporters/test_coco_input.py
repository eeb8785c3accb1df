# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""COCO export of bags that are incomplete, damaged or long."""

import contextlib
import io
import struct
from pathlib import Path
from typing import Any

import pytest
from export_bags import copied, longer, peak_memory, without
from pycocotools.coco import COCO

from fieldtruth.bag import reader
from fieldtruth.bag.file import BagError
from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.exporters import export

SIDES = ("left", "right")
INSTANCES = "/stereo/camera/left/instances"
TAGS = "/stereo/camera/left/tag/img_raw"
PHOTOS = "/stereo/camera/left/real/compressed"


def coco(path: Path) -> COCO:
    with contextlib.redirect_stdout(io.StringIO()):
        return COCO(str(path))


@pytest.mark.slow
def test_memory_does_not_grow_with_duration(short: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader._RECENT, "budget", 0)  # the last chunk only, instead of 16 MB
    pictures = [f"/stereo/camera/left/{kind}" for kind in ("real/compressed", "tag/img_raw", "instances")]
    once = ["/gazebo/model_states", "/tf_static", "/stereo/camera/left/camera_info"]
    long = longer(short, tmp_path / "long.bag", 15, [*pictures, "/ground_truth/odom"], once)
    export(short, "coco", workers=1)  # makes the table of colours, 16 MB, once
    assert peak_memory(lambda: export(long, "coco", workers=1)) < 16e6  # it is 4 to 10; 90 images take 32
    assert len(coco(tmp_path / "long_coco" / "instances.json").imgs) == 90


def failure(bag: Path) -> str:
    with pytest.raises(BagError) as caught:
        export(bag, "coco", workers=2)
    assert sorted(path.name for path in bag.parent.iterdir()) == [bag.name]
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_missing_instances_are_reported_with_a_command(short: Path, tmp_path: Path) -> None:
    text = failure(without(short, tmp_path / "a.bag", INSTANCES))
    assert "has no /stereo/camera/left/instances" in text
    assert "`fieldtruth generate NAME --extras instances`" in text


def test_one_camera_is_exported(short: Path, tmp_path: Path) -> None:
    right = [f"/stereo/camera/right/{kind}" for kind in ("real/compressed", "tag/img_raw", "instances", "camera_info")]
    alone = without(short, tmp_path / "left.bag", *right)
    made = coco(export(alone, "coco", workers=1) / "instances.json")
    assert {image["camera"] for image in made.imgs.values()} == {"left"}
    assert len(made.imgs) == 6
    assert made.dataset["licenses"] == []  # the licence of a foreign bag is unknown


@pytest.mark.parametrize(
    ("topics", "words"),
    [
        ([f"/stereo/camera/{side}/real/compressed" for side in SIDES], "has no /stereo/camera/left/real/compressed"),
        ([TAGS], f"has no {TAGS}"),
        (["/gazebo/model_states"], "has no /gazebo/model_states"),
        (["/tf_static"], "has no /tf_static"),
        (["/stereo/camera/right/camera_info"], "has no /stereo/camera/right/camera_info"),
    ],
)
def test_missing_topics_are_named(topics: list[str], words: str, short: Path, tmp_path: Path) -> None:
    assert words in failure(without(short, tmp_path / "a.bag", *topics))


def stamped(data: bytes, stamp_ns: int) -> bytes:
    return data[:4] + struct.pack("<LL", *divmod(stamp_ns, 10**9)) + data[12:]


def test_incomplete_frames_are_skipped(short: Path, tmp_path: Path) -> None:
    def change(topic: str, stamp: int, data: bytes) -> bytes | None:
        gone = {PHOTOS: 40_000_000, TAGS: 160_000_000, INSTANCES: 240_000_000}
        return None if gone.get(topic) == stamp else data

    made = coco(export(copied(short, tmp_path / "a.bag", change), "coco", workers=2) / "instances.json")
    stamps = [image["stamp_ns"] for image in made.imgs.values() if image["camera"] == "left"]
    assert stamps == [k * 40_000_000 for k in (2, 3, 5)]


def test_images_without_a_stamp_have_those_of_the_bag(short: Path, tmp_path: Path) -> None:
    def change(topic: str, stamp: int, data: bytes) -> bytes | None:
        return stamped(data, 0) if topic in (PHOTOS, TAGS, INSTANCES) else data

    with pytest.warns(FieldtruthWarning, match="have no stamp"):
        made = coco(export(copied(short, tmp_path / "a.bag", change), "coco", workers=2) / "instances.json")
    stamps = [image["stamp_ns"] for image in made.imgs.values() if image["camera"] == "left"]
    assert stamps == [k * 40_000_000 for k in range(1, 7)]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t, s, d: stamped(d, s + 7) if t.endswith("compressed") else d, f"no stamp is common to {PHOTOS}, "),
        (lambda t, s, d: d.replace(b"\xff\xd8\xff", b"\xff\xd8\xfe", 1) if t == PHOTOS else d, "neither JPEG nor PNG"),
        (lambda t, s, d: d[:-1] if t == "/gazebo/model_states" else d, "damaged"),
        (lambda t, s, d: d[:9] if t == TAGS else d, f"the message of {TAGS} at 40000000 ns is damaged"),
        (lambda t, s, d: d[:-1] + b"\xff" if t == INSTANCES else d, "left camera at 40000000 ns: instance id 65"),
        (lambda t, s, d: d[:-1] + b"\x01" if t == TAGS else d, "which no class has"),
    ],
)  # fmt: skip
def test_damage_is_reported_in_one_line(change: Any, words: str, short: Path, tmp_path: Path) -> None:
    assert words in failure(copied(short, tmp_path / "a.bag", change))
