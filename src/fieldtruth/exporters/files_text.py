# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Text files of the format ``files``: readings as lines, clouds as CSV, calibration as YAML.

Numbers have the fewest digits that read back to the same bits. Clouds are formatted by orjson: 25,000
points take 7 ms of a core's time; NumPy's savetxt takes 39 ms, Python's own formatting 34 ms and pandas 66 ms.
"""

from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from typing import Any, Final, NamedTuple

import numpy as np
import orjson
import yaml
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.base_messages import JOINTS
from fieldtruth.bag.calibration import BASE, Lens
from fieldtruth.bag.errors import BagError
from fieldtruth.bag.run import Run
from fieldtruth.bag.sources import Source
from fieldtruth.bag.trajectory import read_trajectory
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Fix, Image, Inertial, Joints, Odometry, Reading, WheelSpeeds

Numbers = tuple[float | np.float32, ...]
Row = Callable[[Any], Numbers]
"""Returns the values of a message."""


class TextFile(NamedTuple):
    """A file with a line per message of a topic."""

    topic: str
    msgtype: str
    path: str
    """Below the output folder."""
    columns: str
    """Names of the columns, in order; the first is the stamp."""
    about: str
    row: Row


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


def text_files(run: Run, sources: Collection[Source]) -> Iterator[TextFile]:
    """Text files of all topics that a run may have; of the two sources of true poses only the better one."""
    for kind, files in _FILES.items():
        for source in sources:
            if source.type is kind:
                yield from files(source)
    yield _POSE_OF_MODEL if table.MODEL_STATES in run.counts else _POSE_OF_ODOMETRY


def pose_lines(run: Run, topic: str) -> Iterator[str]:
    """Lines of the true poses of a topic."""
    poses = read_trajectory(run, topic)
    rows = np.concatenate([poses.position, poses.quaternion_wxyz[:, [1, 2, 3, 0]]], axis=1).tolist()
    return (line(stamp, tuple(row)) for stamp, row in zip(poses.stamps_ns.tolist(), rows, strict=True))


def _imu(message: Any) -> Numbers:
    vectors = message.angular_velocity, message.linear_acceleration
    return (*_xyzw(message.orientation), *(value for v in vectors for value in (v.x, v.y, v.z)))


def _gnss(message: Any) -> Numbers:
    return message.latitude, message.longitude, message.altitude


def _wheel(message: Any) -> Numbers:
    return (np.float32(message.data),)


def _joints(message: Any) -> Numbers:
    return tuple(  # nan of a wheel that the robot does not have
        float(part[message.name.index(joint)]) if joint in message.name else float("nan")
        for part in (message.position, message.velocity)
        for joint in JOINTS
    )


def _command(message: Any) -> Numbers:
    return message.linear.x, message.angular.z


def _odometry(message: Any) -> Numbers:
    position = message.pose.pose.position
    return (position.x, position.y, position.z, *_xyzw(message.pose.pose.orientation))


def _xyzw(q: Any) -> Numbers:
    return q.x, q.y, q.z, q.w


_POSE: Final = "t_ns x y z qx qy qz qw"
_POSE_ABOUT: Final = (
    "true pose of base_link in the world: x north, y west, z up [m], and the unit quaternion that rotates vectors from"
    " base_link to the world"
)
_POSE_OF_MODEL: Final = TextFile(
    table.MODEL_STATES, "gazebo_msgs/msg/ModelStates", "pose_ground_truth.txt", _POSE, _POSE_ABOUT, _odometry
)
_POSE_OF_ODOMETRY: Final = TextFile(
    table.ODOMETRY, "nav_msgs/msg/Odometry", "pose_ground_truth.txt", _POSE, _POSE_ABOUT, _odometry
)


def _imu_file(imu: Source) -> Iterator[TextFile]:
    yield TextFile(
        imu.topic,
        imu.msgtypes[imu.topic],
        f"{imu.name}_data.txt",
        "t_ns qx qy qz qw wx wy wz ax ay az",
        f"orientation (unit quaternion from {imu.frame} to the world), angular velocity [rad/s] and specific force"
        f" [m/s^2] (9.81 upwards at rest), both in {imu.frame}",
        _imu,
    )


def _gnss_file(gnss: Source) -> Iterator[TextFile]:
    yield TextFile(
        gnss.topic,
        gnss.msgtypes[gnss.topic],
        f"{'GNSS' if gnss.name == _PAPER_GNSS else gnss.name}_data.txt",
        "t_ns latitude longitude altitude",
        f"position of the antenna ({gnss.frame}): degrees, degrees, metres above the WGS 84 ellipsoid",
        _gnss,
    )


def _tachometers(speeds: Source) -> Iterator[TextFile]:
    for wheel, topic in speeds.topics.items():
        about = f"speed of the {wheel.replace('_', ' ')} wheel [rad/s]"
        yield TextFile(topic, speeds.msgtypes[topic], f"tacho_data/{wheel}.txt", "t_ns speed", about, _wheel)


def _joints_file(joints: Source) -> Iterator[TextFile]:
    yield TextFile(
        joints.topic,
        joints.msgtypes[joints.topic],
        "joint_states.txt",
        "t_ns fl fr rl rr fl_speed fr_speed rl_speed rr_speed",
        "angles [rad] and speeds [rad/s] of the wheels, positive forwards: front left, front right, rear left, rear "
        "right",
        _joints,
    )


def _odometry_files(odometry: Source) -> Iterator[TextFile]:
    yield TextFile(
        odometry.topic,
        odometry.msgtypes[odometry.topic],
        "wheel_odometry.txt",
        _POSE,
        "pose of base_link by dead reckoning from the wheels, in the frame odom: where base_link was at time 0",
        _odometry,
    )
    yield TextFile(
        table.COMMANDS,
        "geometry_msgs/msg/Twist",
        "commands.txt",
        "t_ns speed turn_rate",
        "commanded speed [m/s] and turn rate [rad/s]",
        _command,
    )


_PAPER_GNSS: Final = "gnss"
_FILES: Final[dict[type[Reading], Callable[[Source], Iterator[TextFile]]]] = {
    Inertial: _imu_file,
    Fix: _gnss_file,
    WheelSpeeds: _tachometers,
    Joints: _joints_file,
    Odometry: _odometry_files,
}
"""Files by type of the readings, in their order."""


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
    views = [view for view in run.of(Image, recorded=False) if run.calibration.has_lens(view.name)]
    lenses = {view.label: run.calibration.lens(view.name) for view in views}
    content: dict[str, Any] = {}
    if lenses:
        content["cameras"] = {name: _camera(lens) for name, lens in lenses.items()}
    baselines = {
        view.device: float(-lenses[view.label].P[0, 3] / lenses[view.label].P[0, 0])
        for view in views
        if view.side == "right" and lenses[view.label].P[0, 0]
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


def _camera(lens: Lens) -> dict[str, Any]:
    return {
        "frame": lens.frame,
        "width": lens.width,
        "height": lens.height,
        "distortion_model": lens.model,
        "D": lens.D.tolist(),
        **{name: getattr(lens, name).tolist() for name in "KRP"},
    }


def _frames(run: Run) -> dict[str, Any]:
    static = run.static
    described: dict[str, Any] = {}
    for frame, (parent, parent_from_frame) in static.parents.items():
        wxyz = transforms.quaternion_wxyz_from_rotation(parent_from_frame[:3, :3])
        described[frame] = {
            "parent": parent,
            "translation": _rounded(parent_from_frame[:3, 3]),
            "quaternion_xyzw": _rounded(transforms.xyzw_from_wxyz(wxyz)),
        }
        with suppress(BagError):  # a frame that is not connected to base_link
            described[frame][f"{BASE}_from_frame"] = _rounded(static.base_from(frame))
    return described


def _rounded(values: Array) -> Any:
    """Values as lists; below 1e-12 is rounding error and becomes 0."""
    return (np.round(values, 12) + 0.0).tolist()
