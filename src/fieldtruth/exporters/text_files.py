# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings as lines of text, every number as short as it can be and still be read back to its last bit.

Clouds go through orjson. For 25,000 points it takes 7 ms of a core's time; NumPy's savetxt and Python's own formatting
take 39 and 34 ms, pandas 66, and their nine digits make longer files.
"""

from collections.abc import Callable, Iterator
from typing import Any, Final, NamedTuple

import numpy as np
import orjson
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import stamp_ns
from fieldtruth.bag.model_states import ModelStatesReader
from fieldtruth.bag.reader import Decoder, RawMessage
from fieldtruth.bag.run import Run
from fieldtruth.experiment.rig import WHEELS

Numbers = tuple[float | np.float32, ...]
Row = Callable[[RawMessage], tuple[int, Numbers]]
"""Turns a message into its stamp [ns] and the numbers behind it."""


class TextFile(NamedTuple):
    """A file with a line per message of a topic."""

    topic: str
    path: str
    """Below the export's folder."""
    columns: str
    """Names of the columns, in order; the first is the stamp."""
    about: str
    make_row: Callable[[Decoder], Row]


def points_csv(points: NDArray[Any]) -> bytes:
    """CSV of points (n, 4), x, y, z [m] and reflectivity; whole reflectivities stand without a point.

    What is no finite number becomes ``nan``.
    """
    if not len(points):
        return b""
    nested: bytes = orjson.dumps(np.ascontiguousarray(points), option=orjson.OPT_SERIALIZE_NUMPY)
    lines = nested[2:-2].replace(b"],[", b"\n") + b"\n"
    return lines.replace(b".0\n", b"\n").replace(b"null", b"nan")


def line(stamp: int, numbers: Numbers) -> str:
    """One line: the stamp and the numbers, a blank between each two."""
    return " ".join(map(str, (stamp, *numbers))) + "\n"


def header_or_bag_stamp(raw: RawMessage, header: Any) -> int:
    """Stamp [ns] of a message: its header's, or the bag's where the header holds 0, which is ROS's word for "none"."""
    return stamp_ns(header) or raw.stamp_ns


def text_files(run: Run) -> Iterator[TextFile]:
    """Files of the topics that a run could have: all, but only the better one of two sources of true poses."""
    yield _IMU
    yield _GNSS
    yield from _TACHOMETERS
    yield _POSE_OF_MODEL if table.MODEL_STATES in run.counts else _POSE_OF_ODOMETRY


def _imu(decode: Decoder) -> Row:
    def row(raw: RawMessage) -> tuple[int, Numbers]:
        message = decode(raw)
        vectors = message.angular_velocity, message.linear_acceleration
        numbers = tuple(value for v in vectors for value in (v.x, v.y, v.z))
        return header_or_bag_stamp(raw, message.header), (*_xyzw(message.orientation), *numbers)

    return row


def _gnss(decode: Decoder) -> Row:
    def row(raw: RawMessage) -> tuple[int, Numbers]:
        message = decode(raw)
        return header_or_bag_stamp(raw, message.header), (message.latitude, message.longitude, message.altitude)

    return row


def _wheel(decode: Decoder) -> Row:
    return lambda raw: (raw.stamp_ns, (np.float32(decode(raw).data),))


def _model(decode: Decoder) -> Row:
    states = ModelStatesReader()
    return lambda raw: (raw.stamp_ns, tuple(states.poses(raw.data)[states.row(raw.data)].tolist()))


def _odometry(decode: Decoder) -> Row:
    def row(raw: RawMessage) -> tuple[int, Numbers]:
        message = decode(raw)
        position = message.pose.pose.position
        numbers = (position.x, position.y, position.z, *_xyzw(message.pose.pose.orientation))
        return header_or_bag_stamp(raw, message.header), numbers

    return row


def _xyzw(q: Any) -> Numbers:
    return q.x, q.y, q.z, q.w


_POSE: Final = "t_ns x y z qx qy qz qw"
_POSE_ABOUT: Final = (
    "true pose of base_link in the world: x north, y west, z up [m], and the unit quaternion that turns vectors of"
    " base_link into the world's"
)
_POSE_OF_MODEL: Final = TextFile(table.MODEL_STATES, "pose_ground_truth.txt", _POSE, _POSE_ABOUT, _model)
_POSE_OF_ODOMETRY: Final = TextFile(table.ODOMETRY, "pose_ground_truth.txt", _POSE, _POSE_ABOUT, _odometry)
_IMU: Final = TextFile(
    table.IMU,
    "imu_data.txt",
    "t_ns qx qy qz qw wx wy wz ax ay az",
    "attitude (unit quaternion from imu_link to the world), angular velocity [rad/s] and specific force [m/s^2] (9.81"
    " upwards at rest), both in imu_link",
    _imu,
)
_GNSS: Final = TextFile(
    table.NAVSAT,
    "GNSS_data.txt",
    "t_ns latitude longitude altitude",
    "place of the antenna (GNSS_link): degrees, degrees, metres above the ellipsoid WGS 84",
    _gnss,
)
_TACHOMETERS: Final = tuple(
    TextFile(
        topic, f"tacho_data/{wheel}.txt", "t_ns speed", f"speed of the {wheel.replace('_', ' ')} wheel [rad/s]", _wheel
    )
    for wheel, topic in zip(WHEELS, table.WHEEL_SPEEDS, strict=True)
)
