# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Topics of images: what a view publishes, under which names after its own topic, and in which types of messages."""

from typing import Final

STREAMS: Final = {
    "camera_info": ("camera_info", "sensor_msgs/msg/CameraInfo"),
    "photograph": ("real/compressed", "sensor_msgs/msg/CompressedImage"),
    "tag": ("tag/img_raw", "sensor_msgs/msg/Image"),
    "depth": ("depth", "sensor_msgs/msg/Image"),
    "instances": ("instances", "sensor_msgs/msg/Image"),
    "normals": ("normals", "sensor_msgs/msg/Image"),
    "flow": ("flow", "sensor_msgs/msg/Image"),
    "parts": ("parts", "sensor_msgs/msg/Image"),
    "passability": ("passability", "sensor_msgs/msg/Image"),
}
"""Streams of a view: end of the topic, and type, in the order of its messages."""
EXTRAS: Final = ("depth", "instances", "normals", "flow", "parts", "passability")
"""Streams that a camera publishes only if the key of that name is true."""
IMAGES: Final = {
    "photo": "photograph",
    "label": "tag",
    "depth": "depth",
    "instance": "instances",
    "normal": "normals",
    "flow": "flow",
    "part": "parts",
    "passability": "passability",
}
"""Stream by field of ``core.readings.Image``."""


def image_topic(view: str, stream: str) -> str:
    """Return the topic of a stream, one of ``STREAMS``, of a view by the topic of that."""
    return f"{view}/{STREAMS[stream][0]}"
