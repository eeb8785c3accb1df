# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A rig with several sensors of each kind passes every check, and a wrong value of the second or later one is found."""

import struct
from pathlib import Path

import numpy as np
import pytest
from changed_bags import (
    GNSS,
    Edit,
    Edits,
    add,
    edited,
    failures,
    failures_of,
    first_message,
    pixels_in,
    points_in,
    rewritten,
)
from many_sensors import many_sensors

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.classes import PALETTE, Label
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment
from fieldtruth.pipeline import generate
from fieldtruth.sensors.gnss.config import GnssConfig
from fieldtruth.validation.runner import validate

HEADER = 4 + 8 + 4  # number, stamp, length of the frame's name
IMU, CLOUD, FIX = "/imu_rear/data", "/low/points", "/antenna_right/fix"
SIZE = (96, 160)
LARGE = {"front": {"width": 320, "height": 192, "depth": True}, "top": {"columns": 512, "rings": 64}}
"""Sensors with enough points and pixels for a comparison."""
RAYS = 4 * 512 * 64 + 7 * 904 * 16
"""The last scan of the spinning LiDAR begins at the end of the bag, so that it is not compared."""


@pytest.fixture(scope="module")
def many_run(in_park: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of 0.4 s in park_1's world, with all sensors of ``many_sensors``."""
    values = load_experiment("park_1").model_dump(exclude={"rig"})
    sensors = [each | LARGE.get(each["name"], {}) if "name" in each else each for each in many_sensors()]
    values |= {"seconds": 0.4, "rig": {"sensors": sensors}}
    return generate(Experiment.model_validate(values), tmp_path_factory.mktemp("many")).parent


@pytest.mark.slow
@pytest.mark.usefixtures("in_park")
def test_many_sensors_pass_every_check(many_run: Path) -> None:
    checks = {check.name: check for check in validate(many_run, full=True, samples=2)}
    assert [check for check in checks.values() if not check.passed] == []
    counted = {name: check.text.split(";")[0] for name, check in checks.items()}
    assert counted["imu"] == f"{80 + 40} readings"
    assert counted["gnss"] == f"{2 + 2} fixes"
    assert counted["retraced clouds"] == f"{RAYS:,} rays"
    views = {"front": 2, "pair": 4, "rear": 4, "fisheye": 2, "panorama": 2}
    assert counted["photographs"] == f"{sum(views.values())} photographs"


def negated(offset: int) -> Edit:
    """Change the sign of three doubles."""

    def edit(data: bytearray) -> None:
        struct.pack_into("<3d", data, offset, *(-value for value in struct.unpack_from("<3d", data, offset)))

    return edit


def labelled(data: bytearray) -> None:
    """Make a bench of a point."""
    points_in(data)["label"][9] = points_in(data)["intensity"][9] = Label.BENCH


def renamed(data: bytearray) -> None:
    data[HEADER : HEADER + 8] = b"top_link"


def nearer(data: bytearray) -> None:
    """Move a cloud towards its LiDAR by a twentieth, along the rays."""
    for axis in "xyz":
        points_in(data)[axis][:] *= 0.95


def painted(data: bytearray) -> None:
    pixels_in(data, "u1", 3, SIZE)[95, 7] = (0, 0, 1)


def shallow(data: bytearray) -> None:
    pixels_in(data, "<f4", size=SIZE)[95, 7] = -1.0


def owned(data: bytearray) -> None:
    pixels_in(data, "<u2", size=(192, 320))[191, 7] = 9999  # beyond the last object


@pytest.fixture(scope="module")
def wrong(many_run: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Failed checks of a bag with a wrong value in many streams."""

    def mount(data: bytearray) -> None:
        add(bytes(data).index(b"antenna_right_link") + len("antenna_right_link"), 1e-3)(data)

    left = first_message(many_run, "/antenna_left/fix").data
    focal, baseline = add(-17 - 8 - 96 - 72 - 72, 1.0), add(-17 - 8 - 96 + 24, 1.0)
    edits: Edits = {
        (IMU, 10): negated(HEADER + len("imu_rear_link") + 32 + 72),
        (CLOUD, 3): labelled,
        (CLOUD, 5): renamed,
        ("/top/points", 1): nearer,
        ("/rear/tag/img_raw", 2): painted,
        ("/rear/depth", 1): shallow,
        ("/front/instances", 1): owned,
        (table.TF_STATIC, 0): mount,
        ("/odometry/wheel", 3): add(HEADER + len("odom") + 4 + len("base_link"), 1e-3),
    }

    def change(raw: RawMessage, k: int) -> RawMessage | None:
        data = bytearray(raw.data)
        if (raw.topic, k) == (FIX, 1):  # the fix of the other antenna
            return raw._replace(data=raw.data[:-97] + left[-97:-73] + raw.data[-73:])
        if (raw.topic, k) == ("/pair/right/tag/img_raw", 0):
            return None
        if raw.topic in ("/rear/camera_info", "/pair/right/camera_info"):
            (focal if raw.topic == "/rear/camera_info" else baseline)(data)
        return edited(edits)(raw._replace(data=bytes(data)), k)

    return failures_of(many_run, tmp_path_factory.mktemp("wrong"), change)


@pytest.mark.parametrize(
    ("check", "text"),
    [
        ("imu", f"the gyroscope measures the turn of its interval: 1 of 120 mismatch, first {IMU} at 110000000 ns"),
        ("gnss", f"the fix is the true position of the antenna: 1 of 4 mismatch, first {FIX} at 400000000 ns: 0.50"),
        ("object classes", f"first {CLOUD} at 200000000 ns, row 9"),
        ("object classes", ": 2 of"),
        ("headers", f"1 of 373 mismatch, first {CLOUD} at 300000000 ns: 'top_link' instead of 'low_link'"),
        ("calibration", "'antenna_right_link' in 'base_link': 0.001"),
        ("calibration", "image size and field of view: 2 of 12 mismatch, first camera rear: 1 pixel"),
        ("calibration", "P[:, :3] is K, no binning, no ROI: 1 of 6 mismatch, first camera rear"),
        ("calibration", "m between the cameras pair_left and pair_right: 1 pixel"),
        ("tag colours", "first /rear/tag/img_raw at 300000000 ns, row 95, column 7: 0 0 1"),
        ("depth", "first /rear/depth at 200000000 ns, row 95, column 7: -1 m on an object"),
        ("lidar and cameras", "points are not in front of what their pixel shows"),
        ("lidar and cameras", "at 200000000 ns, /top/points"),
        ("synchronisation", "200000000 ns: no /pair/right/tag/img_raw"),
        ("stamps", "first /pair/right/tag/img_raw at 400000000 ns: reading 2 after reading 0"),
        ("wheel odometry", "first /odometry/wheel at 200000000 ns"),
    ],
)
def test_wrong_value_of_a_sensor_is_found_and_named(wrong: dict[str, str], check: str, text: str) -> None:
    assert text in wrong[check]


def test_only_the_changed_streams_fail(wrong: dict[str, str]) -> None:
    changed = {"imu", "gnss", "object classes", "headers", "calibration", "tag colours", "depth", "lidar and cameras"}
    assert wrong.keys() == changed | {"synchronisation", "stamps", "wheel odometry"}


@pytest.mark.usefixtures("in_park")
def test_what_only_the_world_contradicts_is_found_in_every_sensor(many_run: Path, tmp_path: Path) -> None:
    """A point of the second LiDAR, and a pixel of a rear camera, a fisheye and a panorama."""

    def swapped(data: bytearray) -> None:
        points = points_in(data)
        row = np.flatnonzero(points["label"] == Label.GROUND)[0]
        points["label"][row] = points["intensity"][row] = Label.TRAIL

    def repainted(data: bytearray) -> None:
        pixels = pixels_in(data, "u1", 3, SIZE)
        row, column = np.argwhere((pixels == PALETTE[Label.GROUND]).all(axis=-1))[-1]
        pixels[row, column] = PALETTE[Label.TRAIL]

    cameras = ("rear", "fisheye", "panorama")
    edits: Edits = {(CLOUD, 2): swapped, **{(f"/{name}/tag/img_raw", 1): repainted for name in cameras}}
    folder = rewritten(many_run, tmp_path, edited(edits))
    assert failures(validate(folder, quick=True)) == {}
    texts = failures(validate(folder, full=True, samples=1))
    assert texts.keys() == {"retraced clouds", "retraced images"}
    assert f"1 of {RAYS:,} mismatch, first {CLOUD} at 150000000 ns" in texts["retraced clouds"]
    assert "3 of" in texts["retraced images"]
    assert "first /rear/tag/img_raw at 200000000 ns" in texts["retraced images"]


def test_steering_sensors_are_the_first_ones(many_run: Path, tmp_path: Path) -> None:
    """Commands follow from the first IMU and the first receiver, whatever the others read."""

    def change(raw: RawMessage, k: int) -> RawMessage | None:
        return None if raw.topic in (IMU, FIX) else raw

    found = failures_of(many_run, tmp_path, change)
    assert "commands" not in found
    assert f"{IMU} is missing" in found["topics"]


def test_commands_need_the_sensors_that_steer(lean_run: Path, tmp_path: Path) -> None:
    """Without fixes in the bag the controller's commands cannot be computed again; they are not wrong."""
    experiment = load_experiment(lean_run / "experiment.yaml")
    without = experiment.model_copy(update={"rig": experiment.rig.with_sensors(GnssConfig, enabled=False)})
    folder = rewritten(lean_run, tmp_path, lambda raw, k: None if raw.topic == GNSS else raw, without)
    checks = {check.name: check for check in validate(folder, quick=True)}
    assert failures(list(checks.values())) == {}
    assert checks["gnss"].passed is checks["commands"].passed is None
    assert checks["commands"].text == "the IMU or the GNSS receiver that steers the robot is not enabled"
