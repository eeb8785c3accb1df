# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The RViz configuration fits a recorded bag: its topics, message types, frames and range of classes."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest
import yaml
from rosbags.highlevel import AnyReader

from fieldtruth.core.classes import Label
from fieldtruth.experiment.rig import Rig
from fieldtruth.gazebo.ros import rviz_configuration

MESSAGES: Final = {
    "rviz/PointCloud2": "sensor_msgs/msg/PointCloud2",
    "rviz/Odometry": "nav_msgs/msg/Odometry",
    "rviz/Image": "sensor_msgs/msg/Image",
}


@pytest.fixture(scope="module")
def settings() -> dict[str, Any]:
    return dict(yaml.safe_load(rviz_configuration(Rig(), ros=1))["Visualization Manager"])


@pytest.fixture(scope="module")
def displays(settings: dict[str, Any]) -> dict[str, Any]:
    return {display["Name"]: display for display in settings["Displays"]}


@pytest.fixture(scope="module")
def reader(bag: Path) -> Iterator[AnyReader]:
    with AnyReader([bag]) as opened:
        yield opened


def first_message(reader: AnyReader, topic: str) -> Any:
    connections = [c for c in reader.connections if c.topic == topic]
    connection, _, raw = next(reader.messages(connections))
    return reader.deserialize(raw, connection.msgtype)


def test_topics_are_in_the_bag_with_the_type_that_the_display_reads(
    displays: dict[str, Any], reader: AnyReader
) -> None:
    types = {c.topic: c.msgtype for c in reader.connections}
    found = set()
    for display in displays.values():
        topic = display.get("Topic") or display.get("Image Topic")
        if topic is None:
            continue
        wanted = MESSAGES[display["Class"]]
        if display.get("Transport Hint") == "compressed":
            topic, wanted = f"{topic}/compressed", "sensor_msgs/msg/CompressedImage"
        assert types.get(topic) == wanted, display["Name"]
        found.add(display["Name"])
    assert found == {"cloud by class", "path", "photograph", "tag image"}


def test_frames_are_in_the_tree_below_the_fixed_frame(
    settings: dict[str, Any], displays: dict[str, Any], reader: AnyReader
) -> None:
    parents = {
        transform.child_frame_id: transform.header.frame_id
        for topic in ("/tf", "/tf_static")
        for transform in first_message(reader, topic).transforms
    }
    fixed = settings["Global Options"]["Fixed Frame"]
    topics = ["/os1_cloud_node/points", "/stereo/camera/left/real/compressed", "/stereo/camera/left/tag/img_raw"]
    named = {
        settings["Views"]["Current"]["Target Frame"],
        displays["grid of 1 m"]["Reference Frame"],
        *(frame for frame in displays["frames"]["Frames"] if frame != "All Enabled"),
        *(first_message(reader, topic).header.frame_id for topic in topics),
        first_message(reader, "/ground_truth/odom").child_frame_id,
    }
    assert first_message(reader, "/ground_truth/odom").header.frame_id == fixed
    for frame in named:
        above = frame
        while above in parents:
            above = parents[above]
        assert above == fixed, frame
    assert fixed not in parents


def test_colours_span_all_classes_of_a_field_of_the_cloud(displays: dict[str, Any], reader: AnyReader) -> None:
    cloud = displays["cloud by class"]
    fields = [field.name for field in first_message(reader, cloud["Topic"]).fields]
    assert cloud["Channel Name"] in fields
    assert (cloud["Min Intensity"], cloud["Max Intensity"]) == (
        Label.VOID,
        Label.PARTICLE,
    )  # those of the paper's environments


def test_both_images_have_a_place_in_the_window(displays: dict[str, Any]) -> None:
    window = yaml.safe_load(rviz_configuration(Rig(), ros=1))["Window Geometry"]["QMainWindow State"]
    for name, display in displays.items():
        assert (name.encode("utf-16-be").hex() in window) == (display["Class"] == "rviz/Image"), name
