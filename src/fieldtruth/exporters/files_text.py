# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Text files of the format ``files``: readings as lines, clouds as CSV, calibration as YAML.

Numbers have the fewest digits that read back to the same bits. Clouds are formatted by orjson: 25,000
points take 7 ms of a core's time; NumPy's savetxt takes 39 ms, Python's own formatting 34 ms and pandas 66 ms.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, Final, NamedTuple

import numpy as np
import orjson
import yaml
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.base_messages import JOINTS
from fieldtruth.bag.calibration import BASE, first_message, read_static_frames
from fieldtruth.bag.decode import reading_stamp
from fieldtruth.bag.model_states import ModelStatesReader
from fieldtruth.bag.reader import BagError, Decoder, RawMessage
from fieldtruth.bag.run import Run
from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.topic import WHEELS
from fieldtruth.sensors.gnss.config import GnssConfig
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.wheel_odometry.config import JOINT_STATES, WHEEL_SPEEDS, WheelOdometryConfig

Numbers = tuple[float | np.float32, ...]
Row = Callable[[RawMessage], tuple[int, Numbers]]
"""Returns a message's stamp [ns] and values."""


class TextFile(NamedTuple):
    """A file with a line per message of a topic."""

    topic: str
    msgtype: str
    path: str
    """Below the output folder."""
    columns: str
    """Names of the columns, in order; the first is the stamp."""
    about: str
    make_row: Callable[[Decoder], Row]


def points_csv(points: NDArray[Any]) -> bytes:
    """CSV of points (n, 4): x, y, z [m] and reflectivity, without a decimal point if it is whole; not finite is nan."""
    if not len(points):
        return b""
    nested: bytes = orjson.dumps(np.ascontiguousarray(points), option=orjson.OPT_SERIALIZE_NUMPY)
    lines = nested[2:-2].replace(b"],[", b"\n") + b"\n"
    return lines.replace(b".0\n", b"\n").replace(b"null", b"nan")


def line(stamp: int, numbers: Numbers) -> str:
    """One line: the stamp and the numbers, separated by spaces."""
    return " ".join(map(str, (stamp, *numbers))) + "\n"


def text_files(run: Run) -> Iterator[TextFile]:
    """Text files of all topics that a run may have; of the two sources of true poses only the better one."""
    sensors = run.rig.sensors
    yield from (_imu_file(sensor) for sensor in sensors if isinstance(sensor, ImuConfig))
    yield from (_gnss_file(sensor) for sensor in sensors if isinstance(sensor, GnssConfig))
    for sensor in sensors:
        if isinstance(sensor, WheelOdometryConfig):
            yield from (*_TACHOMETERS, _JOINTS, _wheel_odometry_file(sensor), _COMMANDS)
    yield _POSE_OF_MODEL if table.MODEL_STATES in run.counts else _POSE_OF_ODOMETRY


def _imu(decode: Decoder) -> Row:
    def row(raw: RawMessage) -> tuple[int, Numbers]:
        message = decode(raw)
        vectors = message.angular_velocity, message.linear_acceleration
        numbers = tuple(value for v in vectors for value in (v.x, v.y, v.z))
        return reading_stamp(raw.stamp_ns, message.header), (*_xyzw(message.orientation), *numbers)

    return row


def _gnss(decode: Decoder) -> Row:
    def row(raw: RawMessage) -> tuple[int, Numbers]:
        message = decode(raw)
        return reading_stamp(raw.stamp_ns, message.header), (message.latitude, message.longitude, message.altitude)

    return row


def _wheel(decode: Decoder) -> Row:
    return lambda raw: (raw.stamp_ns, (np.float32(decode(raw).data),))


def _joints(decode: Decoder) -> Row:
    def row(raw: RawMessage) -> tuple[int, Numbers]:
        message = decode(raw)
        numbers = tuple(  # nan of a wheel that the robot does not have
            float(part[message.name.index(joint)]) if joint in message.name else float("nan")
            for part in (message.position, message.velocity)
            for joint in JOINTS
        )
        return reading_stamp(raw.stamp_ns, message.header), numbers

    return row


def _command(decode: Decoder) -> Row:
    def row(raw: RawMessage) -> tuple[int, Numbers]:
        message = decode(raw)
        return raw.stamp_ns, (message.linear.x, message.angular.z)

    return row


def _model(decode: Decoder) -> Row:
    states = ModelStatesReader()
    return lambda raw: (raw.stamp_ns, tuple(states.poses(raw.data)[states.row(raw.data)].tolist()))


def _odometry(decode: Decoder) -> Row:
    def row(raw: RawMessage) -> tuple[int, Numbers]:
        message = decode(raw)
        position = message.pose.pose.position
        numbers = (position.x, position.y, position.z, *_xyzw(message.pose.pose.orientation))
        return reading_stamp(raw.stamp_ns, message.header), numbers

    return row


def _xyzw(q: Any) -> Numbers:
    return q.x, q.y, q.z, q.w


_POSE: Final = "t_ns x y z qx qy qz qw"
_POSE_ABOUT: Final = (
    "true pose of base_link in the world: x north, y west, z up [m], and the unit quaternion that rotates vectors from"
    " base_link to the world"
)
_POSE_OF_MODEL: Final = TextFile(
    table.MODEL_STATES, "gazebo_msgs/msg/ModelStates", "pose_ground_truth.txt", _POSE, _POSE_ABOUT, _model
)
_POSE_OF_ODOMETRY: Final = TextFile(
    table.ODOMETRY, "nav_msgs/msg/Odometry", "pose_ground_truth.txt", _POSE, _POSE_ABOUT, _odometry
)


def _imu_file(imu: ImuConfig) -> TextFile:
    return TextFile(
        imu.topic,
        "sensor_msgs/msg/Imu",
        f"{imu.name}_data.txt",
        "t_ns qx qy qz qw wx wy wz ax ay az",
        f"orientation (unit quaternion from {imu.frame} to the world), angular velocity [rad/s] and specific force"
        f" [m/s^2] (9.81 upwards at rest), both in {imu.frame}",
        _imu,
    )


def _gnss_file(gnss: GnssConfig) -> TextFile:
    paper = GnssConfig.model_fields["name"].default
    return TextFile(
        gnss.topic,
        "sensor_msgs/msg/NavSatFix",
        f"{'GNSS' if gnss.name == paper else gnss.name}_data.txt",
        "t_ns latitude longitude altitude",
        f"position of the antenna ({gnss.frame}): degrees, degrees, metres above the WGS 84 ellipsoid",
        _gnss,
    )


_TACHOMETERS: Final = tuple(
    TextFile(
        topic,
        "std_msgs/msg/Float32",
        f"tacho_data/{wheel}.txt",
        "t_ns speed",
        f"speed of the {wheel.replace('_', ' ')} wheel [rad/s]",
        _wheel,
    )
    for wheel, topic in zip(WHEELS, WHEEL_SPEEDS, strict=True)
)

_JOINTS: Final = TextFile(
    JOINT_STATES,
    "sensor_msgs/msg/JointState",
    "joint_states.txt",
    "t_ns fl fr rl rr fl_speed fr_speed rl_speed rr_speed",
    "angles [rad] and speeds [rad/s] of the wheels, positive forwards: front left, front right, rear left, rear right",
    _joints,
)


def _wheel_odometry_file(config: WheelOdometryConfig) -> TextFile:
    return TextFile(
        config.topic,
        "nav_msgs/msg/Odometry",
        "wheel_odometry.txt",
        _POSE,
        "pose of base_link by dead reckoning from the wheels, in the frame odom: where base_link was at time 0",
        _odometry,
    )


_COMMANDS: Final = TextFile(
    table.COMMANDS,
    "geometry_msgs/msg/Twist",
    "commands.txt",
    "t_ns speed turn_rate",
    "commanded speed [m/s] and turn rate [rad/s]",
    _command,
)


# ---------------------------------------------------------------------------------------------------------------------
# Calibration

_CALIBRATION: Final = """\
# K, R, P, D: as in ROS's CameraInfo [pixel]; (0, 0) is the centre of the first pixel.
# frames: translation [m] and quaternion of the frame in its parent; base_link_from_frame takes points to base_link.
# base_link: x forward, y left, z up. Optical frames: x right, y down, z forward.
"""


def calibration_yaml(run: Run) -> str:
    """YAML of CameraInfo and /tf_static, as far as the run has them; empty if it has neither.

    Raises:
        BagError: the bag is damaged.
    """
    topics = {imager.name: imager.topic_of("camera_info") for imager in run.rig.imagers}
    infos = {name: first_message(run, topic) for name, topic in topics.items() if topic in run.counts}
    content: dict[str, Any] = {}
    if infos:
        content["cameras"] = {name: _camera(info) for name, info in infos.items()}
    baselines = {
        imager.config.name: float(-infos[imager.name].P[3] / infos[imager.name].P[0])
        for imager in run.rig.imagers
        if imager.side == "right" and imager.name in infos and infos[imager.name].P[0]
    }
    if len(baselines) == 1:
        content["baseline_m"] = baselines.popitem()[1]
    elif baselines:
        content["baseline_m"] = baselines
    if table.TF_STATIC in run.counts:
        content["frames"] = _frames(run)
    if not content:
        return ""
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)
    return _CALIBRATION + text


def _camera(info: Any) -> dict[str, Any]:
    return {
        "frame": str(info.header.frame_id),
        "width": int(info.width),
        "height": int(info.height),
        "distortion_model": str(info.distortion_model),
        "D": np.asarray(info.D, np.float64).tolist(),
        **{name: np.reshape(np.asarray(getattr(info, name), np.float64), (3, -1)).tolist() for name in ("K", "R", "P")},
    }


def _frames(run: Run) -> dict[str, Any]:
    static = read_static_frames(run)
    described: dict[str, Any] = {}
    for frame, (parent, parent_from_frame) in static.parents.items():
        wxyz = frames.quaternion_wxyz_from_rotation(parent_from_frame[:3, :3])
        described[frame] = {
            "parent": parent,
            "translation": _rounded(parent_from_frame[:3, 3]),
            "quaternion_xyzw": _rounded(frames.xyzw_from_wxyz(wxyz)),
        }
        with suppress(BagError):  # a frame that is not connected to base_link
            described[frame][f"{BASE}_from_frame"] = _rounded(static.base_from(frame))
    return described


def _rounded(values: Array) -> Any:
    """Values as lists; below 1e-12 is rounding error and becomes 0."""
    return (np.round(values, 12) + 0.0).tolist()
