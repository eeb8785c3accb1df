# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tree, URDF and camchain of a rig, each against an independent reader or formula."""

import io

import cv2
import numpy as np
import pytest
import yaml
from many_sensors import many_rig

from fieldtruth.bag.messages import rig_transforms
from fieldtruth.core import lenses, transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning
from fieldtruth.experiment.catalogue import list_robots
from fieldtruth.experiment.rig import Rig
from fieldtruth.report.rig import FORMATS, sensor_table
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.imu.config import ImuConfig

RIGS = pytest.mark.parametrize("rig", [Rig(), many_rig()], ids=["paper", "many"])


@RIGS
def test_the_tree_has_every_frame_once_below_its_parent(rig: Rig) -> None:
    lines = FORMATS["tree"].text(rig).splitlines()[1:]
    parents: list[str] = []
    found: dict[tuple[str, str], list[float]] = {}
    for line in lines:
        depth, words = (len(line) - len(line.lstrip())) // 2, line.split()
        parents[depth:] = [words[0]]
        if depth > 1:
            found[parents[depth - 1], words[0]] = [float(word) for word in words[1:7]]
    assert parents[:2] == ["world", "base_link"]
    expected = rig_transforms(rig)
    assert found.keys() == expected.keys()
    for pair, values in found.items():
        np.testing.assert_allclose(transforms.pose(values[:3], values[3:]), expected[pair], atol=1e-6)


def test_the_table_has_a_line_for_each_sensor() -> None:
    rig = many_rig().with_sensors(ImuConfig, enabled=False)
    header, *rows = (line.split() for line in sensor_table(rig).splitlines())
    assert header[:3] == ["sensor", "kind", "model"]
    assert [row[:2] for row in rows] == [[sensor.name, sensor.kind] for sensor in rig.sensors]
    lines = {row[0]: " ".join(row[5:]) for row in rows}
    assert lines["low"] == "16 rings x 904 columns, -15 to 15 deg, 1 to 100 m, spinning"
    assert lines["pair"] == "160 x 96 pixels, 69 x 42 deg, pinhole, baseline 0.1 m"
    assert lines["imu_rear"] == "off"


@pytest.mark.parametrize(
    "rig",
    [Rig(), many_rig(), *(Rig.model_validate({"robot": name, "sensors": []}) for name in list_robots())],
    ids=["paper", "many", *list_robots()],
)
def test_the_urdf_has_the_transforms_of_the_rig(rig: Rig) -> None:
    yourdfpy = pytest.importorskip("yourdfpy")
    read = yourdfpy.URDF.load(io.BytesIO(FORMATS["urdf"].text(rig).encode()), load_meshes=False)
    assert read.validate(), read.errors
    transforms = rig_transforms(rig)
    assert set(read.link_map) == {"base_link", *(child for _, child in transforms)}
    for (parent, child), parent_from_child in transforms.items():
        np.testing.assert_allclose(read.get_transform(child, parent), parent_from_child, rtol=0, atol=1e-9)
    wheels = {name for name in read.link_map if name.endswith("_wheel")}
    assert {joint.child for joint in read.robot.joints if joint.type == "continuous"} == wheels
    assert wheels == {f"{name}_wheel" for name in rig.wheels.names}
    masses = [link.inertial.mass for link in read.robot.links if link.inertial is not None]
    assert sum(masses) == pytest.approx(rig.robot.mass)
    for wheel in wheels:  # the tread touches the ground, and its cylinder turns about y
        [visual] = read.link_map[wheel].visuals
        np.testing.assert_allclose(np.abs(visual.origin[:3, 2]), [0.0, 1.0, 0.0], atol=1e-9)
        height = read.get_transform(wheel, "base_footprint")[2, 3]
        assert height == pytest.approx(visual.geometry.cylinder.radius, abs=1e-9)


def camchain(rig: Rig) -> dict[str, dict[str, object]]:
    with pytest.warns(FieldtruthWarning, match="camera panorama has the lens equirectangular"):
        text = FORMATS["camchain"].text(rig)
    assert "# Left out: camera panorama has the lens equirectangular" in text
    return dict(yaml.safe_load(text))


def kalibr_pixels(camera: dict[str, object], points: Array) -> Array:
    """Project with OpenCV as Kalibr does: its models are a pinhole with OpenCV's distortions."""
    fx, fy, cx, cy = np.array(camera["intrinsics"])
    matrix, coefficients = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), np.array(camera["distortion_coeffs"])
    assert camera["camera_model"] == "pinhole"
    assert len(coefficients) == 4
    zero = np.zeros(3)
    if camera["distortion_model"] == "radtan":
        return np.asarray(cv2.projectPoints(points, zero, zero, matrix, coefficients)[0], np.float64).reshape(-1, 2)
    assert camera["distortion_model"] == "equidistant"
    pixels = cv2.fisheye.projectPoints(points[:, None], zero, zero, matrix, coefficients)[0]
    return np.asarray(pixels, np.float64).reshape(-1, 2)


def test_pixels_of_the_camchain_are_those_of_the_cameras() -> None:
    lens = {"model": "plumb_bob", "coefficients": [-0.1, 0.02, 0.001, -0.002, 0.0], "cx": 75.25, "fx": 120.0}
    sensors = many_rig().model_dump()["sensors"]
    rig = Rig.model_validate({"sensors": [s | ({"lens": lens} if s["name"] == "front" else {}) for s in sensors]})
    chain = camchain(rig)
    imagers = [imager for imager in rig.imagers if imager.name != "panorama"]
    assert list(chain) == [f"cam{k}" for k in range(len(imagers))]
    points = np.random.default_rng(3).uniform((-2.0, -1.0, 3.0), (2.0, 1.0, 9.0), (50, 3))
    for imager, camera in zip(imagers, chain.values(), strict=True):
        found = kalibr_pixels(camera, points)
        np.testing.assert_allclose(found, lenses.project(imager.config.projection, points), atol=1e-6)
        assert camera["resolution"] == [imager.config.width, imager.config.height]
        assert camera["rostopic"] == imager.topics["photograph"]
    assert chain["cam2"]["intrinsics"] == [120.0, 120.0, 75.25, 47.5]  # (96 - 1) / 2: as OpenCV counts


def test_transforms_of_the_camchain_take_points_along_the_chain() -> None:
    rig = many_rig()
    chain = camchain(rig)
    imagers = [imager for imager in rig.imagers if imager.name != "panorama"]
    point_imu = np.array([[0.3, -0.2, 0.7]])
    in_base = transforms.transform(rig.enabled(ImuConfig)[0].mount.base_from_sensor, point_imu)
    last = np.zeros((0, 3))
    for imager, camera in zip(imagers, chain.values(), strict=True):
        in_camera = transforms.transform(np.array(camera["T_cam_imu"]), point_imu)
        np.testing.assert_allclose(transforms.transform(imager.base_from_optical, in_camera), in_base, atol=1e-12)
        if len(last):
            np.testing.assert_allclose(transforms.transform(np.array(camera["T_cn_cnm1"]), last), in_camera, atol=1e-12)
        last = in_camera
    assert "T_cn_cnm1" not in chain["cam0"]


def test_a_camchain_without_imu_has_only_the_cameras() -> None:
    chain = yaml.safe_load(FORMATS["camchain"].text(Rig().with_sensors(ImuConfig, enabled=False)))
    assert list(chain) == ["cam0", "cam1"]
    assert not {"T_cam_imu", "timeshift_cam_imu"} & (chain["cam0"].keys() | chain["cam1"].keys())
    np.testing.assert_allclose(np.array(chain["cam1"]["T_cn_cnm1"])[:3, 3], [-0.12, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("lens", "line"),
    [
        ({"model": "plumb_bob", "coefficients": [-0.1, 0, 0, 0, 0.01]}, "has the lens plumb_bob with k3 = 0.01"),
        ({"model": "rational_polynomial", "coefficients": [0.1] + [0.0] * 7}, "has the lens rational_polynomial"),
        (None, "the rig has none that is enabled"),
    ],
)
def test_without_a_camera_for_kalibr_it_is_one_line(lens: dict[str, object] | None, line: str) -> None:
    rig = Rig.model_validate({"cameras": {"lens": lens}}) if lens else Rig().with_sensors(CameraConfig, enabled=False)
    with pytest.raises(ConfigurationError, match="no camera for Kalibr") as error:
        FORMATS["camchain"].text(rig)
    assert line in str(error.value)


def imu_files(*imus: dict[str, object]) -> list[dict[str, float]]:
    mount = {"mount": {"xyz": [0, 0, 0.5]}}
    rig = Rig.model_validate({"sensors": [{"kind": "imu", "name": f"i{k}", **mount, **i} for k, i in enumerate(imus)]})
    return list(yaml.safe_load_all(FORMATS["imu"].text(rig)))


def test_kalibrs_imu_file_has_the_noise_of_the_imu() -> None:
    noise = {
        "accelerometer_noise_density": 0.01,
        "accelerometer_random_walk": 2e-4,
        "gyroscope_noise_density": [1e-3, 3e-3, 2e-3],
        "gyroscope_random_walk": 4e-5,
    }
    [found] = imu_files({"rate_hz": 200.0, "signal": noise})
    assert found == noise | {"gyroscope_noise_density": 3e-3, "rostopic": "/i0/data", "update_rate": 200.0}


def test_a_random_walk_stands_for_bias_instability_where_white_noise_meets_it() -> None:
    signal = {"gyroscope_noise_density": 1e-3, "gyroscope_bias_instability": 1e-4, "accelerometer_noise_density": 0.1}
    with pytest.warns(FieldtruthWarning, match="accelerometer_random_walk below 1e-06"):
        [found] = imu_files({"signal": signal})
    tau = (1e-3 / 1e-4) ** 2  # where the Allan deviation of white noise is that of the bottom
    assert found["gyroscope_random_walk"] * (tau / 3.0) ** 0.5 == pytest.approx(1e-4)
    assert found["accelerometer_random_walk"] == 1e-6


def test_an_ideal_imu_gets_values_above_the_zero_that_kalibr_refuses() -> None:
    with pytest.warns(FieldtruthWarning, match="i1: accelerometer_noise_density, .*, which Kalibr needs"):
        noisy, ideal = imu_files(
            {
                "signal": {
                    **dict.fromkeys(
                        [f"{t}_{n}" for t in ("gyroscope", "accelerometer") for n in ("noise_density", "random_walk")],
                        0.1,
                    )
                }
            },
            {},
        )
    assert {key: value for key, value in noisy.items() if "_" in key and key != "update_rate"} == dict.fromkeys(
        noisy.keys() - {"rostopic", "update_rate"}, 0.1
    )
    assert all(value > 0.0 for key, value in ideal.items() if key != "rostopic")
    with pytest.raises(ConfigurationError, match="no IMU for Kalibr"):
        FORMATS["imu"].text(Rig().with_sensors(ImuConfig, enabled=False))
