# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A drive that is cut into steps is the whole drive: the motion, and what sensors of motion read of it."""

import pickle
from typing import Any, Literal

import numpy as np
import pytest
from drive_worlds import hills, make_experiment, make_world

from fieldtruth.drive.physics import Command
from fieldtruth.drive.simulate import Drive, drive
from fieldtruth.drive.track import Motion, Track, WheelMotion
from fieldtruth.experiment.config import geodetic_route
from fieldtruth.sensors.gnss.config import GnssConfig
from fieldtruth.sensors.gnss.sensing import GnssTruth, read_gnss
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.imu.sensing import ImuTruth, read_imu
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig
from fieldtruth.sensors.wheel_odometry.sensing import WheelTruth

WORLD = make_world(hills)
EXPERIMENT = make_experiment([(1.0, 0.3)])
MOUNT: Any = {"xyz": (0.1, 0.2, 0.3), "rpy_deg": (10.0, 20.0, 33.0)}


@pytest.fixture(scope="module")
def track() -> Track:
    return drive(WORLD, EXPERIMENT)


def new_drive() -> Drive:
    return Drive(WORLD, EXPERIMENT, geodetic_route(EXPERIMENT.route))


def rows(values: Any, begin: int, end: int) -> Any:
    return type(values)(**{name: column[begin:end] for name, column in vars(values).items()})


def equal(parts: list[Any], whole: Any) -> None:
    for name, column in vars(whole).items():
        if isinstance(column, np.ndarray):
            np.testing.assert_array_equal(np.concatenate([getattr(part, name) for part in parts]), column, name)


@pytest.mark.parametrize("size", [500, 37, 1])
def test_the_motion_does_not_depend_on_the_steps(track: Track, size: int) -> None:
    """Each step begins in another drive, with what was saved before it."""
    first, second = new_drive(), new_drive()
    parts = list[tuple[Motion, WheelMotion]]()
    while first.robot.steps < min(first.end, 10**5):
        parts.append(first.drive_to(int(min(first.robot.steps + size, first.end))))
        if size > 1:
            second.restore(pickle.loads(pickle.dumps(first.save())))
            first, second = second, first
    equal([motion for motion, _ in parts], track.motion)
    assert track.base is not None
    equal([wheels for _, wheels in parts], track.base.wheels)


def test_given_commands_do_not_depend_on_the_steps_either() -> None:
    ends = []
    for size in (13, 100):
        drive, command = new_drive(), Command(0.4, 0.1)
        while drive.robot.steps < 300:
            drive.drive_to(min(300, drive.robot.steps + size), command)
        drive.drive_to(400)  # the follower again
        ends.append(np.concatenate(drive.robot.pose))
    np.testing.assert_array_equal(ends[0], ends[1])


@pytest.mark.parametrize("sampling", ["mean", "instant"])
@pytest.mark.parametrize("rate", [7.0, 1000.0])
def test_readings_of_a_growing_motion(track: Track, rate: float, sampling: Literal["mean", "instant"]) -> None:
    """Whatever is cut, readings are those of the whole motion, of which only the last rows are known."""
    imu = ImuConfig(name="own", rate_hz=rate, sampling=sampling, mount=MOUNT)
    gnss = GnssConfig(rate_hz=min(rate, 50.0))
    wheels = WheelOdometryConfig(rate_hz=rate)
    assert track.base is not None
    motion, turned, count = track.motion, track.base.wheels, len(track.motion.stamps_ns)
    for size in (2, 37, 500):
        truths = ImuTruth(imu), GnssTruth(gnss), WheelTruth(wheels, EXPERIMENT.rig.wheels)
        found: list[list[Any]] = [[], [], [], []]
        for end in [*range(size, count, size), count]:
            window = max(0, end - size - 200), end
            known = rows(motion, *window)
            true = truths[2].extend(known.stamps_ns, rows(turned, *window))
            parts = truths[0].extend(known), truths[1].extend(known), true.tachometers, true.odometry
            for each, part in zip(found, parts, strict=True):
                each.append(part)
        equal(found[0], read_imu(motion, imu))
        equal(found[1], read_gnss(motion, gnss))
        whole = WheelTruth(wheels, EXPERIMENT.rig.wheels).extend(motion.stamps_ns, turned)
        equal(found[2], whole.tachometers)
        equal(found[3], whole.odometry)
