# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration files of SLAM programs for other rigs: types of points, noise, lenses."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

from fieldtruth.core.lenses import Lens
from fieldtruth.exporters.slam_configs import (
    ASSUMED_NOISE,
    CloudFacts,
    Facts,
    InertialFacts,
    InertialNoise,
    ViewFacts,
    fast_lio2,
    kiss_icp,
    lio_sam,
    noise_of,
    open_vins,
    orb_slam3,
    rko_lio,
)
from fieldtruth.sensors.imu.config import ImuConfig, ImuSignal

FLOAT32, FLOAT64, UINT8, UINT16, UINT32 = 7, 8, 2, 4, 6
NOISE = InertialNoise(1e-3, 0.1, 1e-4, 0.01)


def facts(
    *,
    fields: dict[str, int] | None = None,
    pattern: str | None = None,
    noise: InertialNoise = NOISE,
    model: str = "pinhole",
    coefficients: tuple[float, ...] = (),
) -> Facts:
    """A LiDAR 2 m ahead of the IMU, and one camera in the IMU."""
    ahead = np.eye(4)
    ahead[0, 3] = 2.0
    config = SimpleNamespace(rate_hz=10.0, rings=16, columns=1800, min_range=0.5, max_range=100.0, pattern=pattern)
    lidar = CloudFacts("top", "/top/points", "top", ahead, config, fields or {})
    imu = InertialFacts("imu", "/imu/data", np.eye(4), 200.0, noise, assumed=False)
    view = ViewFacts(
        "front", "/front/real", np.eye(4), Lens(model, 400.0, 410.0, 319.5, 239.5, coefficients), 640, 480, 30.0
    )
    return Facts(lidar, imu, (view,), ())


def read(files: dict[str, str] | str, name: str) -> dict[str, Any]:
    assert isinstance(files, dict), files
    values: dict[str, Any] = yaml.safe_load(files[name].removeprefix("%YAML:1.0\n"))
    return values


@pytest.mark.parametrize(
    ("fields", "kind", "unit", "sensor"),
    [
        ({"ring": UINT16}, 4, 0, "velodyne"),  # an instant, no time
        ({"ring": UINT16, "t": UINT32}, 3, 3, None),
        ({"ring": UINT8, "t": UINT32}, 3, 3, "ouster"),
        ({"ring": UINT16, "t": UINT32, "time": FLOAT32}, 2, 0, "velodyne"),
        ({"ring": UINT16, "t": UINT32, "timestamp": FLOAT64}, 3, 3, None),
    ],
)
def test_type_of_points_is_one_that_the_program_reads(
    fields: dict[str, int], kind: int, unit: int, sensor: str | None
) -> None:
    preprocess = read(fast_lio2(facts(fields=fields)), "fast_lio2.yaml")["preprocess"]
    assert (preprocess["lidar_type"], preprocess["timestamp_unit"]) == (kind, unit)
    assert (preprocess["scan_line"], preprocess["scan_rate"], preprocess["blind"]) == (16, 10, 0.5)
    found = lio_sam(facts(fields=fields))
    if sensor is None:
        assert isinstance(found, str)
        assert "time_field: time or point_fields: ouster" in found
    else:
        values = read(found, "lio_sam.yaml")["lio_sam"]
        assert (values["sensor"], values["N_SCAN"], values["Horizon_SCAN"]) == (sensor, 16, 1800)
        assert (values["lidarMinRange"], values["lidarMaxRange"]) == (0.5, 100.0)
    deskew = "t" in fields
    assert read(kiss_icp(facts(fields=fields)), "kiss_icp.yaml")["data"]["deskew"] is deskew
    assert read(rko_lio(facts(fields=fields)), "rko_lio.yaml")["deskew"] is deskew


def test_livox_has_no_rings_for_lio_sam() -> None:
    fields = {"ring": UINT16, "t": UINT32, "time": FLOAT32}
    assert "Livox" in str(lio_sam(facts(fields=fields, pattern="avia")))
    assert read(fast_lio2(facts(fields=fields, pattern="avia")), "fast_lio2.yaml")["mapping"]["fov_degree"] == 90.0


def test_noise_of_the_imu_is_in_the_units_of_the_program() -> None:
    values = read(lio_sam(facts(fields={"ring": UINT16})), "lio_sam.yaml")["lio_sam"]
    names = ("imuGyrNoise", "imuAccNoise", "imuGyrBiasN", "imuAccBiasN")
    assert [values[name] for name in names] == [1e-3, 0.1, 1e-4, 0.01]
    mapping = read(fast_lio2(facts()), "fast_lio2.yaml")["mapping"]
    assert mapping["acc_cov"] == pytest.approx(0.1**2 * 200.0)  # white noise of a reading at 200 Hz: density^2 * rate
    assert mapping["b_acc_cov"] == pytest.approx(0.01**2 * 200.0)
    assert (mapping["gyr_cov"], mapping["b_gyr_cov"]) == (0.1, 1e-4)  # less than in the program's own files


def test_noise_of_the_worst_axis_is_taken_and_what_is_missing_assumed() -> None:
    rough = ImuSignal(gyroscope_noise_density=(1e-3, 3e-3, 2e-3), accelerometer_random_walk=0.5)
    assert noise_of(ImuConfig(signal=rough)) == (
        3e-3,
        ASSUMED_NOISE.accelerometer,
        ASSUMED_NOISE.gyroscope_walk,
        0.5,
    )
    assert noise_of(ImuConfig()) is None


def test_lens_is_one_that_the_program_has() -> None:
    fisheye = facts(model="equidistant", coefficients=(0.1, 0.02, 0.003, 0.0004))
    camera = read(open_vins(fisheye), "open_vins/kalibr_imucam_chain.yaml")["cam0"]
    assert (camera["distortion_model"], camera["distortion_coeffs"]) == ("equidistant", [0.1, 0.02, 0.003, 0.0004])
    text = str(orb_slam3(fisheye))
    assert "KannalaBrandt8" in text
    assert "Camera1.k4: 0.0004" in text
    radial = facts(model="plumb_bob", coefficients=(0.1, 0.02, 0.003, 0.004, 0.05))
    assert "plumb_bob with k3" in str(open_vins(radial))
    settings = orb_slam3(radial)
    assert isinstance(settings, dict)
    lines = settings["orb_slam3.yaml"].splitlines()
    expected = {"k1": 0.1, "k2": 0.02, "p1": 0.003, "p2": 0.004, "k3": 0.05}  # ROS's order is k1, k2, p1, p2, k3
    assert all(f"Camera1.{key}: {value}" in lines for key, value in expected.items())
    for program in (open_vins, orb_slam3):
        assert "lens equirectangular" in str(program(facts(model="equirectangular")))
