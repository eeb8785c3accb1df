# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration files of SLAM programs, read as the programs read them, against the rig's geometry worked out by hand.

The paper's rig: the LiDAR is at (0.09, 0, 0.826) with the axes of base_link; the IMU is at (0.19, 0, 0.149) with x up,
y right, z forward; the cameras are at (0.15, 0.06, 0.72) and (0.15, -0.06, 0.72), optical axes forward.
"""

import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from export_bags import without
from numpy.typing import ArrayLike, NDArray

from fieldtruth.bag.decode import read_bag
from fieldtruth.bag.file import BagError
from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.exporters import export
from fieldtruth.exporters.slam_configs import ASSUMED_NOISE


@pytest.fixture(scope="module")
def folder(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export(small_run, "slam-configs", out=tmp_path_factory.mktemp("slam") / "park_1_slam")


def values_of(path: Path) -> dict[str, Any]:
    values: dict[str, Any] = yaml.safe_load(path.read_text("utf-8"))
    return values


def stored(path: Path) -> cv2.FileStorage:
    """Open a file as OpenVINS and ORB-SLAM3 do."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.isOpened()
    return storage


def list_of(node: cv2.FileNode) -> list[Any]:
    return [list_of(node.at(k)) if node.at(k).isSeq() else node.at(k).real() for k in range(node.size())]


def moved(matrix: ArrayLike, point: ArrayLike) -> NDArray[np.float64]:
    moved: NDArray[np.float64] = (np.asarray(matrix, np.float64) @ np.append(point, 1.0))[:3]
    return moved


# ---------------------------------------------------------------------------------------------------------------------
# The paper's rig


def test_files_are_of_all_programs_and_named_in_the_readme(folder: Path) -> None:
    files = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    chain = {f"open_vins/{name}.yaml" for name in ("estimator_config", "kalibr_imu_chain", "kalibr_imucam_chain")}
    lidar = {f"{name}.yaml" for name in ("kiss_icp", "rko_lio", "lio_sam", "fast_lio2", "orb_slam3")}
    truth = {f"truth_{name}.tum" for name in ("lidar", "imu", "camera")}
    assert files == chain | lidar | truth | {"README.txt"}
    text = (folder / "README.txt").read_text("utf-8")
    assert all(name in text for name in files - {"README.txt"})
    assert "republish compressed in:=/stereo/camera/right/real raw out:=/stereo/camera/right/real" in text


def test_fast_lio2_has_the_lidar_in_the_frame_of_the_imu(folder: Path) -> None:
    mapping = values_of(folder / "fast_lio2.yaml")["mapping"]
    rotation = np.reshape(mapping["extrinsic_R"], (3, 3))
    point = rotation @ (0.0, 1.0, 0.0) + mapping["extrinsic_T"]  # 1 m left of the LiDAR
    assert point == pytest.approx([0.677, -1.0, -0.1], abs=1e-12)  # up, right, forward
    point = rotation @ (5.0, 0.0, 2.0) + mapping["extrinsic_T"]
    assert point == pytest.approx([2.677, 0.0, 4.9], abs=1e-12)


def test_lio_sam_has_the_imu_in_the_frame_of_the_lidar(folder: Path, small_run: Path) -> None:
    values = values_of(folder / "lio_sam.yaml")["lio_sam"]
    assert values["extrinsicTrans"] == pytest.approx([0.1, 0.0, -0.677], abs=1e-12)
    readings = [reading.message for reading in read_bag(small_run / "park_1.bag", ["/imu/data"])]
    forces = [[m.linear_acceleration.x, m.linear_acceleration.y, m.linear_acceleration.z] for m in readings]
    up = np.reshape(values["extrinsicRot"], (3, 3)) @ np.mean(forces, axis=0)
    assert up == pytest.approx([0.0, 0.0, values["imuGravity"]], abs=0.7)  # it starts to drive
    assert up[2] == pytest.approx(values["imuGravity"], abs=0.1)
    assert values["extrinsicRPY"] == values["extrinsicRot"]  # the orientation is of the same frame


def test_rko_lio_has_the_imu_in_the_frame_of_the_lidar(folder: Path) -> None:
    values = values_of(folder / "rko_lio.yaml")
    x, y, z, w, *position = values["extrinsic_imu2base_quat_xyzw_xyz"]
    axis = np.array([x, y, z])
    turned = [v + 2.0 * np.cross(axis, np.cross(axis, v) + w * v) for v in np.eye(3)]  # of a vector by a quaternion
    assert turned[0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)  # the IMU's x is up
    assert turned[1] == pytest.approx([0.0, -1.0, 0.0], abs=1e-9)
    assert position == pytest.approx([0.1, 0.0, -0.677], abs=1e-12)
    assert values["extrinsic_lidar2base_quat_xyzw_xyz"] == [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]


def test_rko_lio_reads_its_file(folder: Path) -> None:
    config = pytest.importorskip("rko_lio.config", reason="pip install rko_lio")
    read = config.PipelineConfig.from_dict(values_of(folder / "rko_lio.yaml"))
    assert (read.lio.deskew, read.lio.min_range, read.lio.max_range) == (False, 0.3, 120.0)
    assert read.extrinsic_imu2base_quat_xyzw_xyz[4:] == pytest.approx([0.1, 0.0, -0.677])


def test_kiss_icp_reads_its_file(folder: Path) -> None:
    config = pytest.importorskip("kiss_icp.config", reason="pip install kiss-icp")
    data = config.load_config(folder / "kiss_icp.yaml").data  # an unknown key would be an error
    assert (data.max_range, data.min_range, data.deskew) == (120.0, 0.3, False)


def test_open_vins_has_the_cameras_in_the_frame_of_the_imu(folder: Path, small_run: Path) -> None:
    chain = stored(folder / "open_vins" / "kalibr_imucam_chain.yaml")
    infos = {r.topic: r.message for r in read_bag(small_run / "park_1.bag") if r.topic.endswith("camera_info")}
    for name, side, right in (("cam0", "left", -0.06), ("cam1", "right", 0.06)):
        camera, info = chain.getNode(name), infos[f"/stereo/camera/{side}/camera_info"]
        ahead = moved(list_of(camera.getNode("T_imu_cam")), (0.0, 0.0, 10.0))
        assert ahead == pytest.approx([0.571, right, 9.96], abs=1e-12)
        aside = moved(list_of(camera.getNode("T_imu_cam")), (2.0, 0.0, 10.0))
        assert aside == pytest.approx([0.571, right + 2.0, 9.96], abs=1e-12)
        assert list_of(camera.getNode("intrinsics")) == [info.K[0], info.K[4], info.K[2], info.K[5]]
        assert list_of(camera.getNode("resolution")) == [160, 92]
        assert list_of(camera.getNode("distortion_coeffs")) == [0.0] * 4
        assert camera.getNode("rostopic").string() == f"/stereo/camera/{side}/real"
    assert list_of(chain.getNode("cam0").getNode("cam_overlaps")) == [1]


def test_open_vins_has_rates_noise_and_gravity(folder: Path) -> None:
    chain = stored(folder / "open_vins" / "kalibr_imu_chain.yaml")
    imu = chain.getNode("imu0")
    assert imu.getNode("gyroscope_noise_density").real() == ASSUMED_NOISE.gyroscope
    assert imu.getNode("accelerometer_noise_density").real() == ASSUMED_NOISE.accelerometer
    assert imu.getNode("gyroscope_random_walk").real() == ASSUMED_NOISE.gyroscope_walk
    assert imu.getNode("accelerometer_random_walk").real() == ASSUMED_NOISE.accelerometer_walk
    assert imu.getNode("update_rate").real() == 50.0
    assert imu.getNode("rostopic").string() == "/imu/data"
    estimator = stored(folder / "open_vins" / "estimator_config.yaml")
    assert estimator.getNode("gravity_mag").real() == 9.81
    assert estimator.getNode("max_cameras").real() == 2
    pair = estimator.getNode("use_stereo")
    assert pair.string() == "true" if pair.isString() else pair.real() == 1.0  # OpenCV 4, OpenCV 5
    for key in ("relative_config_imu", "relative_config_imucam"):
        assert (folder / "open_vins" / estimator.getNode(key).string()).is_file()


def test_orb_slam3_has_the_left_camera_in_the_imu_and_the_right_in_the_left(folder: Path) -> None:
    settings = stored(folder / "orb_slam3.yaml")
    body = settings.getNode("IMU.T_b_c1").mat()
    assert moved(body, (0.0, 1.0, 10.0)) == pytest.approx([-0.429, -0.06, 9.96], abs=1e-5)  # y is down
    left_from_right = settings.getNode("Stereo.T_c1_c2").mat()
    assert moved(left_from_right, (0.0, 0.0, 0.0)) == pytest.approx([0.12, 0.0, 0.0], abs=1e-6)


def test_orb_slam3_rectifies_to_the_baseline(folder: Path) -> None:
    """As it does: OpenCV's stereoRectify takes the pose of the left camera in the right."""
    settings = stored(folder / "orb_slam3.yaml")
    k = [[settings.getNode(f"Camera{n}.{key}").real() for key in ("fx", "fy", "cx", "cy")] for n in (1, 2)]
    matrices = [np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]) for fx, fy, cx, cy in k]
    right_from_left = np.linalg.inv(settings.getNode("Stereo.T_c1_c2").mat().astype(np.float64))
    none = np.zeros(5)
    *_, projection, _, _, _ = cv2.stereoRectify(
        matrices[0], none, matrices[1], none, (160, 92), right_from_left[:3, :3], right_from_left[:3, 3:]
    )
    assert projection[0, 3] / projection[0, 0] == pytest.approx(-0.12, abs=1e-6)


def test_orb_slam3_has_numbers_of_the_types_that_it_reads(folder: Path) -> None:
    settings = stored(folder / "orb_slam3.yaml")
    whole = {"Camera.width", "Camera.height", "Camera.fps", "Camera.RGB", "ORBextractor.nFeatures"}
    whole |= {"ORBextractor.nLevels", "ORBextractor.iniThFAST", "ORBextractor.minThFAST"}
    texts, matrices = {"File.version", "Camera.type"}, {"Stereo.T_c1_c2", "IMU.T_b_c1"}
    for key in settings.root().keys():  # noqa: SIM118 (it is no dict)
        node = settings.getNode(key)
        kind = next((k for k, keys in (("int", whole), ("text", texts), ("map", matrices)) if key in keys), "real")
        assert {"int": node.isInt(), "text": node.isString(), "map": node.isMap(), "real": node.isReal()}[kind], key
    assert settings.getNode("Camera.type").string() == "PinHole"
    assert settings.getNode("IMU.Frequency").real() == 50.0
    assert settings.getNode("Camera.fps").real() == 25


@pytest.mark.parametrize(
    ("name", "mount"),
    [("lidar", (0.09, 0.0, 0.826)), ("imu", (0.19, 0.0, 0.149)), ("camera", (0.15, 0.06, 0.72))],
)
def test_true_poses_are_those_of_the_sensor(
    name: str, mount: tuple[float, float, float], folder: Path, small_run: Path, tmp_path: Path
) -> None:
    base = np.loadtxt(export(small_run, "tum", out=tmp_path / "base.tum"))
    sensor = np.loadtxt(folder / f"truth_{name}.tum")
    assert sensor[:, 0].tolist() == base[:, 0].tolist()
    axis, w = base[:, 4:7], base[:, 7:]
    arm = np.broadcast_to(mount, axis.shape)
    turned = arm + 2.0 * np.cross(axis, np.cross(axis, arm) + w * arm)
    assert sensor[:, 1:4] == pytest.approx(base[:, 1:4] + turned, abs=1e-9)


def test_what_a_rig_lacks_is_left_out_in_one_line(brief_run: Path, tmp_path: Path) -> None:
    def left(*topics: str) -> tuple[set[str], str]:
        name = f"{len(list(tmp_path.iterdir()))}"
        bag = without(brief_run / "park_1.bag", tmp_path / name / "park_1.bag", *topics)
        shutil.copy(brief_run / "experiment.yaml", bag.parent)
        with pytest.warns(FieldtruthWarning, match="left out of ") as caught:
            made = export(bag, "slam-configs")
        misfit, line = (str(each.message) for each in caught)
        assert "experiment.yaml" in misfit
        assert f"does not fit the bag: no {topics[0]}" in misfit
        return {path.stem for path in made.rglob("*.yaml")}, line

    files, line = left("/imu/data")
    assert files == {"kiss_icp", "orb_slam3"}
    assert line.endswith("RKO-LIO: no IMU; LIO-SAM: no IMU; FAST-LIO2: no IMU; OpenVINS: no IMU")
    files, line = left("/os1_cloud_node/points")
    assert files == {"estimator_config", "kalibr_imu_chain", "kalibr_imucam_chain", "orb_slam3"}
    files, line = left("/stereo/camera/left/camera_info", "/stereo/camera/right/camera_info")
    assert files == {"kiss_icp", "rko_lio", "lio_sam", "fast_lio2"}
    assert "OpenVINS: no camera; ORB-SLAM3: no camera" in line


def test_bag_without_sensors_is_refused(brief_run: Path, tmp_path: Path) -> None:
    topics = ["/os1_cloud_node/points", *(f"/stereo/camera/{side}/camera_info" for side in ("left", "right"))]
    bag = without(brief_run / "park_1.bag", tmp_path / "park_1.bag", *topics)
    with pytest.raises(BagError, match="neither LiDAR nor camera"):
        export(bag, "slam-configs")
    assert [path.name for path in tmp_path.iterdir()] == ["park_1.bag"]
