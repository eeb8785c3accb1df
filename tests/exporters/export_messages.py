# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Compare messages of ROS 1 and ROS 2, with the types of rosbags."""

import dataclasses
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from fieldtruth.bag.messages import MODEL_STATES, TF_MESSAGE

STATES = "gazebo_msgs/msg/ModelStates"
NOETIC = get_typestore(Stores.ROS1_NOETIC)
NOETIC.register(get_types_from_msg(MODEL_STATES, STATES))
NOETIC.register(get_types_from_msg(TF_MESSAGE, "tf2_msgs/msg/TFMessage"))
HUMBLE = get_typestore(Stores.ROS2_HUMBLE)
HUMBLE.register(get_types_from_msg(MODEL_STATES, STATES))


def assert_same(old: Any, new: Any, where: str) -> None:
    """Assert that all fields are equal; ROS 2 has names in lower case and no ``seq`` in headers."""
    if dataclasses.is_dataclass(old):
        names = [f.name for f in dataclasses.fields(old) if f.default is dataclasses.MISSING]  # others are constants
        if type(old).__name__.endswith("Header"):
            names.remove("seq")
        for name in names:
            assert hasattr(new, name.lower()), f"{where} lacks {name}"
            assert_same(getattr(old, name), getattr(new, name.lower()), f"{where}.{name}")
    elif isinstance(old, np.ndarray):
        there = np.frombuffer(new, np.uint8) if isinstance(new, bytes) else np.asarray(new)
        assert len(old) == len(there), where
        np.testing.assert_array_equal(old, there.astype(old.dtype), where)
    elif isinstance(old, list):
        assert len(old) == len(new), where
        for i, (a, b) in enumerate(zip(old, new, strict=True)):
            assert_same(a, b, f"{where}[{i}]")
    else:
        assert old == new, where
