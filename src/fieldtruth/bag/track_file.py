# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Track files: stamped poses that replace route and physics, as TUM or CSV text or in a bag.

TUM: lines ``t x y z qx qy qz qw``. CSV (``.csv``): a header names the columns, in any order; others are ignored.
"""

import csv
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import UNIT
from fieldtruth.bag.file import MCAP, BagError, first_bytes, is_database
from fieldtruth.bag.geometry import StaticFrames, Trajectory, read_poses, seconds
from fieldtruth.bag.run import open_run
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.errors import TrackError, UnknownNameError
from fieldtruth.experiment.config import DriveConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import BASE

LARGEST_STEP_NS: Final = 500_000_000
"""A longer time [ns] between two poses is reported."""
MAX_SPEED: Final = 100.0
"""Highest speed [m/s] between two poses; above it are other units, a reset of the simulation, or a teleport."""
_VALUES: Final = ("x", "y", "z", "qx", "qy", "qz", "qw")
_STAMPS: Final = {"t": 9, "stamp": 9, "stamp_ns": 0}
"""Names of a CSV file's column of stamps, and the power of ten to nanoseconds."""
_ANGLES: Final = {("roll", "pitch", "yaw"): False, ("roll_deg", "pitch_deg", "yaw_deg"): True}
"""Columns about fixed axes in place of a quaternion, as in URDF; whether in degrees."""


class TrackFile(NamedTuple):
    """The content of a track file: poses of ``frame`` as they are in the file, so that quaternions may be rounded."""

    name: str
    poses: Trajectory
    frame: str

    def csv(self) -> str:
        """Return the content as CSV; reading it gives the same numbers, every bit of them."""
        wxyz = self.poses.quaternion_wxyz
        rows = np.concatenate([self.poses.position, transforms.xyzw_from_wxyz(wxyz)], axis=1).tolist()
        lines = [f"{seconds(stamp)},{','.join(map(repr, row))}" for stamp, row in zip(self.stamps, rows, strict=True)]
        return "\n".join([",".join(("t", *_VALUES)), *lines]) + "\n"

    @property
    def stamps(self) -> list[int]:
        """Stamps [ns] in the file."""
        return list(map(int, self.poses.stamps_ns))

    def start_ns(self, config: DriveConfig) -> int:
        """Return the stamp [ns] in the file that becomes time 0."""
        if config.start_s is None:
            return int(self.poses.stamps_ns[0])
        return _nanoseconds(repr(config.start_s), 9, "drive.start_s")

    def in_world(self, config: DriveConfig, rig: Rig) -> Trajectory:
        """Return the poses of base_link in the world, with the stamps of the file.

        Raises:
            UnknownNameError: ``pose_of`` is not a frame of the rig.
        """
        position, wxyz = self.poses.position, self.poses.quaternion_wxyz
        lengths = np.linalg.norm(wxyz, axis=1, keepdims=True)
        wxyz = np.where(np.abs(lengths - 1.0) > 1e-12, wxyz / lengths, wxyz)
        if self.frame != BASE or config.world_from_track is not None:
            reference = np.eye(4) if config.world_from_track is None else config.world_from_track.base_from_sensor
            frame_from_base = transforms.inverse(_base_from(self.frame, rig))
            pose = reference @ transforms.pose_from_quaternion_wxyz(position, wxyz) @ frame_from_base
            position, wxyz = pose[:, :3, 3], transforms.quaternion_wxyz_from_rotation(pose[:, :3, :3])
        return Trajectory(self.poses.stamps_ns, position, wxyz)

    @property
    def gap(self) -> str:
        """Description of the longest time without a pose; empty if it is short."""
        spans = np.diff(self.poses.stamps_ns)
        k, count = int(np.argmax(spans)), int(np.count_nonzero(spans > LARGEST_STEP_NS))
        if count == 0:
            return ""
        more = f", and {count - 1} more of over {LARGEST_STEP_NS / 1e9:g} s" if count > 1 else ""
        after = f"after {self.poses.stamps_ns[k] / 1e9:.3f} s"
        return f"{self.name}: no pose for {spans[k] / 1e9:.1f} s {after}{more}; the path between is a smooth curve"


def read_track_file(config: DriveConfig) -> TrackFile:
    """Read the track file of an experiment.

    Raises:
        TrackError: a file that cannot be read, a line that is not a pose, stamps that do not rise, a quaternion whose
            length is not 1, or less than two poses.
        BagError: a bag that cannot be read or has no poses.
        UnknownNameError: a bag has no such topic.
    """
    path = Path(config.track)
    if _is_bag(path):
        return _from_bag(path, config)
    if config.topic is not None:
        raise TrackError(f"{path}: drive.topic is allowed for a bag only, and this is not one")
    try:
        with path.open(encoding="utf-8-sig", newline="") as source:
            rows = _csv_rows(path, source) if path.suffix.lower() == ".csv" else _tum_rows(path, source)
            lines, stamps, values = array("q"), array("q"), array("d")
            for line, stamp, row in rows:
                lines.append(line)
                stamps.append(stamp)
                values.extend(row)
    except UnicodeDecodeError as error:
        raise TrackError(f"{path} is neither text nor a bag; a track file is TUM, CSV, or a bag") from error
    except csv.Error as error:
        raise TrackError(f"{path}: {error}") from error
    table_ = np.array(values, np.float64).reshape(-1, 7)
    return _checked(path.name, config.pose_of or BASE, np.array(stamps, np.int64), table_, lambda k: f"line {lines[k]}")


def _is_bag(path: Path) -> bool:
    """Return whether a path is a folder, or begins as a bag; a pipe would be empty when it is read again.

    Raises:
        TrackError: neither a folder nor a readable file.
    """
    try:
        return is_database(path) or path.is_dir() or first_bytes(path).startswith((b"#ROSBAG", MCAP))
    except BagError as error:
        raise TrackError(str(error).replace("cannot read ", "cannot read the track file ", 1)) from error


def _from_bag(path: Path, config: DriveConfig) -> TrackFile:
    run = open_run(path)
    odometry = sorted(name for name, msgtype in run.msgtypes.items() if msgtype == "nav_msgs/msg/Odometry")
    topic = table.MODEL_STATES
    if config.topic is not None or table.ODOMETRY in odometry or topic not in run.counts:
        topic = _topic(run.bag, odometry, config.topic)
    found = read_poses(run, topic, coarse=True)
    poses = found.trajectory
    values = np.concatenate([poses.position, transforms.xyzw_from_wxyz(poses.quaternion_wxyz)], axis=1)
    frame = config.pose_of or found.frame or BASE
    return _checked(run.bag.name, frame, poses.stamps_ns, values, lambda k: f"pose {k + 1} of {topic}")


def _topic(bag: Path, odometry: Sequence[str], asked: str | None) -> str:
    """Return the topic to read: the one that is asked for, or /ground_truth/odom."""
    if asked is not None and asked not in odometry:
        raise UnknownNameError(f"topic of type nav_msgs/Odometry in {bag}:", asked, odometry)
    if asked is None and table.ODOMETRY not in odometry:
        others = f"; set drive.topic to one of {', '.join(odometry)}" if odometry else ""
        raise TrackError(f"{bag} has neither {table.ODOMETRY} nor {table.MODEL_STATES}{others}")
    return asked or table.ODOMETRY


def _tum_rows(path: Path, source: Iterable[str]) -> Iterator[tuple[int, int, list[float]]]:
    """Yield line, stamp [ns] and values of each pose."""
    for number, line in enumerate(source, 1):
        cells = line.split()
        if not cells or cells[0].startswith("#"):
            continue
        if len(cells) != 8:
            raise TrackError(
                f"{path}: line {number} must be 8 numbers, t {' '.join(_VALUES)}, got {line.strip()!r:.60}"
            )
        where = f"{path}: line {number}"
        yield number, _nanoseconds(cells[0], 9, where), [_number(cell, where) for cell in cells[1:]]


def _csv_rows(path: Path, source: Iterable[str]) -> Iterator[tuple[int, int, list[float]]]:
    """Yield line, stamp [ns] and values of each pose."""
    reader = csv.reader(source, skipinitialspace=True)
    header = [name.strip().lstrip("#").strip().lower() for name in next(reader, [])]
    stamp = next((name for name in _STAMPS if name in header), None)
    angles = next((names for names in _ANGLES if set(names) <= set(header)), None)
    needed = (*_VALUES[:3], *angles) if angles and "qw" not in header else _VALUES
    missing = [name for name in needed if name not in header]
    if stamp is None or missing:
        raise TrackError(
            f"{path}: the header must name t (or stamp, stamp_ns), x, y, z and qx, qy, qz, qw (or roll, pitch, yaw, or "
            f"roll_deg, pitch_deg, yaw_deg), got {', '.join(header)!r:.80}"
        )
    columns = [header.index(name) for name in needed]
    for cells in filter(None, reader):
        where = f"{path}: line {reader.line_num}"
        if len(cells) < len(header):
            raise TrackError(f"{where} has {len(cells)} columns, the header {len(header)}")
        values = [_number(cells[column], where) for column in columns]
        if needed is not _VALUES and angles:
            values[3:] = Rotation.from_euler("xyz", values[3:], degrees=_ANGLES[angles]).as_quat().tolist()
        yield reader.line_num, _nanoseconds(cells[header.index(stamp)], _STAMPS[stamp], where), values


def _number(text: str, where: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise TrackError(f"{where}: {text!r:.40} is not a number") from None


def _nanoseconds(text: str, power: int, where: str) -> int:
    """Return a decimal stamp as whole nanoseconds; a float would round stamps of today to 200 ns."""
    try:
        stamp = int(Decimal(text.strip()).scaleb(power).to_integral_value())
    except (InvalidOperation, ValueError, OverflowError):
        raise TrackError(f"{where}: {text!r:.40} is not a stamp") from None
    if abs(stamp) >= 2**62:
        raise TrackError(f"{where}: the stamp {text!r:.40} is too large")
    return stamp


def _checked(name: str, frame: str, stamps: Counts, values: Array, where: Callable[[int], str]) -> TrackFile:
    """Check rows of x, y, z, qx, qy, qz, qw."""
    if len(stamps) < 2:
        raise TrackError(f"{name} must have at least 2 poses, got {len(stamps)}")
    finite = np.isfinite(values)
    if not finite.all():
        row, column = np.argwhere(~finite)[0]
        raise TrackError(f"{name}: {where(row)}: {_VALUES[column]} must be finite, got {values[row, column]}")
    later = np.diff(stamps) > 0
    if not later.all():
        row = int(np.argmin(later)) + 1
        now, before = stamps[row] / 1e9, stamps[row - 1] / 1e9
        raise TrackError(f"{name}: {where(row)}: stamps must rise, got {now:.9f} s after {before:.9f} s")
    lengths = np.linalg.norm(values[:, 3:], axis=1)
    unit = np.abs(lengths - 1.0) <= UNIT
    if not unit.all():
        row = int(np.argmin(unit))
        raise TrackError(f"{name}: {where(row)}: the quaternion must have the length 1, got {lengths[row]:.4g}")
    lengths, spans = np.linalg.norm(np.diff(values[:, :3], axis=0), axis=1), np.diff(stamps) / 1e9
    if (lengths > MAX_SPEED * spans).any():
        row = int(np.argmax(lengths / spans))
        raise TrackError(
            f"{name}: {where(row + 1)}: the path jumps by {lengths[row]:.1f} m in {spans[row]:.4g} s; at most "
            f"{MAX_SPEED:g} m/s are allowed"
        )
    return TrackFile(name, Trajectory(stamps, values[:, :3], transforms.wxyz_from_xyzw(values[:, 3:])), frame)


def _base_from(frame: str, rig: Rig) -> Array:
    """Pose (4, 4) in base_link of a frame of the rig.

    Raises:
        UnknownNameError: the rig has no such frame.
    """
    frames = StaticFrames.of_rig(rig)
    if frame not in {BASE, *frames.parents}:
        raise UnknownNameError("frame", frame, [BASE, *frames.parents])
    return frames.base_from(frame)
