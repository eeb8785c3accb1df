# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The configuration of RViz, from that of the paper's rig."""

import re
from importlib.resources import files

from fieldtruth.experiment.rig import Rig
from fieldtruth.sensors.camera.config import CameraConfig


def rviz_configuration(rig: Rig, ros: int) -> str:
    """Return RViz's file for ROS 1 or 2: the cloud of each LiDAR, photograph and tag image of each camera or pair."""
    text = (files("fieldtruth.gazebo.ros") / "templates" / "fieldtruth.rviz").read_text(encoding="utf-8")
    text = "".join(_displays(block, rig) for block in re.split(r"(?m)^(?=    - Class: |  \w)", text))
    text = _without_axes(text, rig)
    if ros == 1:
        return text
    for panel in ("Displays", "Time", "Selection", "Views", "Tool Properties"):
        text = text.replace(f"Class: rviz/{panel}\n", f"Class: rviz_common/{panel}\n")
    # RViz of ROS 2 takes the transport from the end of the topic's name.
    text = re.sub(r"Image Topic: (\S+)\n *Transport Hint: raw", r"Topic: \1", text)
    text = re.sub(r"Image Topic: (\S+)\n *Transport Hint: (\w+)", r"Topic: \1/\2", text)
    return text.replace("Class: rviz/", "Class: rviz_default_plugins/")


def _displays(block: str, rig: Rig) -> str:
    """Repeat the display of a sensor for each sensor of that kind; with several, its name has theirs."""
    if "- Class: rviz/PointCloud2\n" in block:
        each = [(lidar.name, lidar.topic) for lidar in rig.lidars]
    elif "- Class: rviz/Image\n" in block:
        each = [(camera.name, camera.imagers()[0].topic) for camera in rig.cameras]
    else:
        return block
    suffixes = [f", {name}" if len(each) > 1 else "" for name, _ in each]
    return "".join(
        re.sub(r"(Name: .*)", rf"\1{suffix}", block)
        .replace("Topic: /os1_cloud_node/points\n", f"Topic: {topic}\n")
        .replace("Topic: /stereo/camera/left/", f"Topic: {topic}/")
        for suffix, (_, topic) in zip(suffixes, each, strict=True)
    )


def _without_axes(text: str, rig: Rig) -> str:
    """Hide the cameras' frames, which their optical frames hide, and have the time follow the first cloud."""
    hidden = "        {}:\n          Value: false\n"
    cameras = [imager.frame for s in rig.sensors if isinstance(s, CameraConfig) for imager in s.imagers()]
    paper = "".join(hidden.format(f"{side}_camera") for side in ("left", "right"))
    text = text.replace(paper, "".join(hidden.format(frame) for frame in cameras))
    name = f"cloud by class, {rig.lidars[0].name}" if len(rig.lidars) > 1 else "cloud by class"
    return text.replace("SyncSource: cloud by class\n", f"SyncSource: {name if rig.lidars else ''}".rstrip() + "\n")
