# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Pages of incomplete, invalid and hostile bags."""

import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_pages import (
    ODOMETRY,
    POINTS,
    TAGS,
    TYPES,
    Page,
    changed,
    only,
    words,
)

from fieldtruth.bag.messages import STORE
from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.report.page import write_report

LACKS = {
    "images": "no camera images",
    "cloud": "has no /os1_cloud_node/points",
    "classes": "neither tag images nor clouds",
    "path": "no true poses",
    "motion": "neither true poses nor readings",
    "calibration": "no CameraInfo",
}
SCRIPTS = 5  # numbers, settings and data of the cloud, and two scripts


@pytest.mark.parametrize(
    ("topics", "shown"),
    [
        ([POINTS, ODOMETRY, "/tf_static"], {"cloud", "classes", "path", "motion"}),
        ([POINTS], {"cloud", "classes"}),
        ([TAGS[1]], {"images", "classes"}),
        (["/stereo/camera/left/real/compressed"], {"images"}),
        (["/imu/data", "/stereo/camera/right/camera_info"], {"motion", "calibration"}),
        (["/gazebo/model_states"], {"path", "motion"}),
        (["/clock"], set()),
    ],
)
def test_page_states_what_the_bag_lacks(small_run: Path, tmp_path: Path, topics: list[str], shown: set[str]) -> None:
    bag = only(small_run / "park_1.bag", tmp_path / "some.bag", *topics)
    page = Page(write_report(bag))
    for section, text in LACKS.items():
        assert (text in page.words(f".//section[@id='{section}']")) == (section not in shown), section
    assert [row[0] for row in page.rows(".//section[@id='topics']//table")] == sorted(topics, key=page.text.index)
    assert ("there is no experiment.yaml beside the bag" in page.text) == ("path" in shown)


def test_model_states_give_the_same_path_as_odometry(small_run: Path, tmp_path: Path, page: Page) -> None:
    bag = only(small_run / "park_1.bag", tmp_path / "states.bag", "/gazebo/model_states")
    other = Page(write_report(bag))
    assert other.terms(".//dl[@class='key']")["driven"] == page.terms(".//dl[@class='key']")["driven"]
    for curve in ("speed", "heading", "height"):
        (times, values), (_, known) = (
            other.data("numbers")["curves"][curve][0],
            page.data("numbers")["curves"][curve][0],
        )
        assert len(times) > 600  # of 1,200 readings, two per bucket
        assert values[-1] == pytest.approx(known[-1], rel=1e-4)


def test_hostile_names_are_escaped(small_run: Path, tmp_path: Path) -> None:
    evil = '</script><script>hacked=1</script><img src=x onerror="hacked=2">{{ 7*7 }}'
    names = {POINTS: POINTS, "/imu/data": f"/{evil}", "/tf_static": "/tf_static"}

    def change(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        if topic == "/tf_static":
            frame = b"<script>1</script>"
            data = data.replace(b"\x12\x00\x00\x00left_camera_optical"[4:12], frame[:8])  # same length
        return (names[topic], stamp, data) if topic in names else None

    folder = tmp_path / "run"
    folder.mkdir()
    bag = changed(small_run / "park_1.bag", folder / "<b onclick=alert(1)>&.bag", change)
    page = Page(write_report(bag))
    assert page.words(".//h1") == "<b onclick=alert(1)>&"
    assert f"/{evil}" in [row[0] for row in page.rows(".//section[@id='topics']//table")]
    assert len(list(page.root.iter("script"))) == SCRIPTS
    assert not [e for e in page.root.iter() if any(str(name).startswith("on") for name in e.keys())]  # noqa: SIM118
    assert not list(page.root.iter("b onclick"))


def test_hostile_description_is_escaped(small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fieldtruth.report.page.view_world", lambda *_: (None, ""))
    folder = tmp_path / "park_1"
    folder.mkdir()
    only(small_run / "park_1.bag", folder / "park_1.bag", ODOMETRY, "/gazebo/model_states")
    text = (small_run / "experiment.yaml").read_text()
    evil = "</p><script>alert(1)</script> {{ run }}"
    (folder / "experiment.yaml").write_text(re.sub(r"(?m)^description: .*$", f"description: '{evil}'", text))
    page = Page(write_report(folder))
    assert page.words(".//p[@class='lead']") == evil
    assert len(list(page.root.iter("script"))) == SCRIPTS - 2  # there is no cloud


def test_unusable_topics_are_listed_with_reasons(small_run: Path, tmp_path: Path) -> None:
    def change(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        if topic == TAGS[0]:
            return topic, stamp, data.replace(b"\x04\x00\x00\x00rgb8", b"\x04\x00\x00\x00rgb9")
        if topic == "/imu/data":
            return "/navsat/fix", stamp, data
        return (topic, stamp, data) if topic == TAGS[1] else None

    page = Page(write_report(changed(small_run / "park_1.bag", tmp_path / "odd.bag", change)))
    notes = page.words(".//section[@id='path']/div[@class='lack']")
    assert f"{TAGS[0]}: the tag image at 40000000 ns: its encoding must be one of rgb8, bgr8, 8UC3, " in notes
    assert ", got 'rgb9'" in notes
    assert "/navsat/fix: contains sensor_msgs/msg/Imu, not sensor_msgs/msg/NavSatFix" in notes
    assert f"{30 * 160 * 92:,}" in page.words(".//table[@class='shares']/tfoot")  # the right camera only


def test_invalid_messages_do_not_stop_the_report(small_run: Path, tmp_path: Path) -> None:
    """Mounts with a zero quaternion, a camera without focal length, a cloud and images of a wrong size."""

    def change(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        if topic not in {*TAGS, POINTS, ODOMETRY, "/tf_static", "/stereo/camera/left/camera_info", "/imu/data"}:
            return None
        message: Any = STORE.deserialize_ros1(data, TYPES[topic])
        if topic == "/tf_static":
            for each in message.transforms:
                q = each.transform.rotation
                q.x = q.y = q.z = q.w = 0.0
        elif topic == POINTS:
            message.width += 1
        elif topic in TAGS:
            message.height += 1
        elif topic == "/imu/data":
            message.linear_acceleration.x = float("nan")
        elif topic != ODOMETRY:
            message.K = np.zeros(9)
        return topic, stamp, bytes(STORE.serialize_ros1(message, TYPES[topic]))

    page = Page(write_report(changed(small_run / "park_1.bag", tmp_path / "odd.bag", change)))
    for section in ("images", "classes", "cloud"):
        assert page.root.findall(f".//section[@id='{section}']/p[@class='lack']"), section
    notes = page.words(".//section[@id='path']/div[@class='lack']")
    assert all(topic in notes for topic in (*TAGS, POINTS))
    channels = page.root.findall(".//figure[@data-key='acceleration']//span[@class='channels']/span")
    assert [words(channel)[0] for channel in channels] == ["y", "z"]


def test_bag_with_a_single_stamp_has_a_page(small_run: Path, tmp_path: Path) -> None:
    seen = set()

    def change(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        if topic in seen or topic not in {ODOMETRY, "/imu/data", POINTS}:
            return None
        seen.add(topic)
        return topic, 10**8, data

    page = Page(write_report(changed(small_run / "park_1.bag", tmp_path / "one.bag", change)))
    assert page.terms(".//dl[@class='key']")["recorded"] == "0.0 s"
    assert len(page.root.findall(".//figure[@class='curve']")) == 6


def test_long_and_unprintable_names_are_shortened(small_run: Path, tmp_path: Path) -> None:
    odd = "/" + 300 * "long"

    odds = {"/imu/data": odd, "/navsat/fix": "/\x01\u202e"}

    def kept(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        return (odds[topic], stamp, data) if topic in odds else None

    bag = changed(small_run / "park_1.bag", tmp_path / "odd.bag", kept)
    with pytest.warns(FieldtruthWarning, match="no experiment.yaml"):  # its text is no UTF-8
        page = Page(write_report(bag.rename(tmp_path / os.fsdecode(b"n\xff.bag"))))
    assert page.words(".//h1") == "n?"
    names = {row[0] for row in page.rows(".//section[@id='topics']//table")}
    assert names == {odd[:159] + "…", "/\N{REPLACEMENT CHARACTER}\N{REPLACEMENT CHARACTER}"}


def test_pixels_without_a_class_are_counted(small_run: Path, tmp_path: Path) -> None:
    def change(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        return (topic, stamp, data[:-3] + b"\x01\x02\x03") if topic == TAGS[0] else None

    page = Page(write_report(changed(small_run / "park_1.bag", tmp_path / "odd.bag", change)))
    assert page.rows(".//table[@class='shares']")[0][:2] == ["no class", "0.01 %30"]
