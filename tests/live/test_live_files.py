# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Files for Foxglove, Nav2 and slam_toolbox name topics, frames, services and limits that there are."""

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from fieldtruth.bag.messages import WORLD, rig_transforms
from fieldtruth.bag.topics import topics_of
from fieldtruth.experiment.rig import Cylinder, Rig, body_parts, chassis_box
from fieldtruth.live.commands import ALLOWED

FILES = Path(__file__).parents[2] / "examples/live"
PAPER = Rig()
TOPICS = {topic.name for topic in topics_of(PAPER)} | {*ALLOWED, "/scan", "/fieldtruth/scene"}
FRAMES = {WORLD, "map", *(name for pair in rig_transforms(PAPER) for name in pair)}


def leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for name, each in value.items():
            yield from leaves(each, name)
    else:
        yield key, value


@pytest.mark.parametrize("name", ["nav2_husky_park.yaml", "slam_toolbox.yaml"])
def test_parameters_name_what_there_is_and_use_simulated_time(name: str) -> None:
    nodes = yaml.safe_load((FILES / name).read_text("utf-8"))
    found = [*leaves(nodes)]
    frames = {value for key, value in found if key.endswith("_frame")}
    topics = {f"/{value.lstrip('/')}" for key, value in found if key in ("odom_topic", "scan_topic", "topic")}
    assert frames
    assert frames <= FRAMES
    assert topics <= TOPICS
    for node in nodes.values():
        parameters = node.get("ros__parameters") or next(iter(node.values()))["ros__parameters"]
        assert parameters["use_sim_time"] is True


def test_nav2_stays_within_the_robot() -> None:
    nodes = yaml.safe_load((FILES / "nav2_husky_park.yaml").read_text("utf-8"))
    smoother = nodes["velocity_smoother"]["ros__parameters"]
    (speed, sideways, turn), acceleration = smoother["max_velocity"], smoother["max_accel"]
    robot = PAPER.robot
    assert (speed <= robot.max_speed, sideways, turn <= robot.max_turn_rate) == (True, 0.0, True)
    assert acceleration[0] <= robot.max_acceleration
    assert acceleration[2] <= robot.max_turn_acceleration
    follow = nodes["controller_server"]["ros__parameters"]["FollowPath"]
    assert follow["desired_linear_vel"] <= speed
    assert follow["rotate_to_heading_angular_vel"] <= turn
    for costmap in ("local_costmap", "global_costmap"):
        corners = ast.literal_eval(nodes[costmap][costmap]["ros__parameters"]["footprint"])
        box = chassis_box(PAPER)
        wheels = [part for part in body_parts(PAPER) if isinstance(part, Cylinder)]
        width = max(2 * abs(wheel.centre[1]) + wheel.width for wheel in wheels)
        assert max(x for x, _ in corners) * 2 >= box.size[0]
        assert max(y for _, y in corners) * 2 == pytest.approx(width, abs=0.02)


def test_the_layout_has_every_panel_once_and_shows_topics_that_there_are() -> None:
    layout = json.loads((FILES / "foxglove_layout.json").read_text("utf-8"))

    def panels(part: Any) -> Iterator[str]:
        if isinstance(part, str):
            yield part
        else:
            yield from panels(part["first"])
            yield from panels(part["second"])

    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])
    text = json.dumps(layout)
    named = {*re.findall(r'"(/[a-z0-9_/]+)[".]', text)}
    assert len(named) > 8
    assert named <= TOPICS


def test_the_document_names_every_topic_of_commands() -> None:
    text = (FILES.parents[1] / "docs/live.md").read_text("utf-8")
    for topic, msgtypes in ALLOWED.items():
        assert f"`{topic}`" in text
        for msgtype in msgtypes:
            assert msgtype.rpartition("/")[2] in text
