# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration files of visual SLAM: OpenVINS and ORB-SLAM3, which read them with OpenCV's FileStorage.

Keys and conventions are those of the sources named at each function. A function returns the files by name, or in one
line why the program cannot read these sensors.
"""

import re
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.yaml_io import write_mapping
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.exporters.slam_facts import Facts, ImuFacts, ViewFacts
from fieldtruth.exporters.slam_programs import Files, numbers

_YAML: Final = "%YAML:1.0\n"
"""The first line of a file that FileStorage reads."""
_ITEM: Final = re.compile(r"^( *)- ", re.MULTILINE)
"""Beginning of an item of a list, which FileStorage wants further to the right than the list's key."""

_ESTIMATOR: Final[Mapping[str, Any]] = {
    "verbosity": "INFO", "use_fej": True, "integration": "rk4",
    "calib_cam_extrinsics": False, "calib_cam_intrinsics": False, "calib_cam_timeoffset": False,
    "calib_imu_intrinsics": False, "calib_imu_g_sensitivity": False,
    "max_clones": 11, "max_slam": 50, "max_slam_in_update": 25, "max_msckf_in_update": 40, "dt_slam_delay": 1.0,
    "feat_rep_msckf": "GLOBAL_3D", "feat_rep_slam": "ANCHORED_MSCKF_INVERSE_DEPTH",
    "feat_rep_aruco": "ANCHORED_MSCKF_INVERSE_DEPTH",
    "try_zupt": False, "zupt_chi2_multipler": 0.0, "zupt_max_velocity": 0.1, "zupt_noise_multiplier": 10.0,
    "zupt_max_disparity": 0.5, "zupt_only_at_beginning": False,
    "init_window_time": 2.0, "init_imu_thresh": 0.5, "init_max_disparity": 10.0, "init_max_features": 50,
    "init_dyn_use": True, "init_dyn_mle_opt_calib": False, "init_dyn_mle_max_iter": 50, "init_dyn_mle_max_time": 0.05,
    "init_dyn_mle_max_threads": 6, "init_dyn_num_pose": 6, "init_dyn_min_deg": 5.0, "init_dyn_inflation_ori": 10.0,
    "init_dyn_inflation_vel": 100.0, "init_dyn_inflation_bg": 10.0, "init_dyn_inflation_ba": 100.0,
    "init_dyn_min_rec_cond": 1e-12, "init_dyn_bias_g": [0.0, 0.0, 0.0], "init_dyn_bias_a": [0.0, 0.0, 0.0],
    "record_timing_information": False, "record_timing_filepath": "timing.txt", "save_total_state": False,
    "filepath_est": "estimate.txt", "filepath_std": "estimate_std.txt", "filepath_gt": "truth.txt",
    "use_klt": True, "num_pts": 200, "fast_threshold": 20, "grid_x": 5, "grid_y": 5, "min_px_dist": 10,
    "knn_ratio": 0.7, "downsample_cameras": False, "num_opencv_threads": 4, "histogram_method": "HISTOGRAM",
    "use_aruco": False, "num_aruco": 1024, "downsize_aruco": True, "use_mask": False,
    "up_msckf_sigma_px": 1.0, "up_msckf_chi2_multipler": 1.0, "up_slam_sigma_px": 1.0, "up_slam_chi2_multipler": 1.0,
    "up_aruco_sigma_px": 1.0, "up_aruco_chi2_multipler": 1.0,
    "relative_config_imu": "kalibr_imu_chain.yaml", "relative_config_imucam": "kalibr_imucam_chain.yaml",
}  # fmt: skip
"""Every key that OpenVINS requires, with the values of its config/euroc_mav; calibration is exact, so it is not
estimated, and it starts in motion (init_dyn_use)."""


def open_vins(facts: Facts) -> Files | str:
    """OpenVINS (rpng/open_vins 6948812, config/euroc_mav): ``T_imu_cam`` takes points of the camera to the IMU."""
    if not facts.views or facts.imu is None:
        return "no IMU" if facts.views else "no camera"
    cameras: dict[str, Any] = {}
    for k, view in enumerate(facts.views):
        lens = _kalibr_lens(view)
        if isinstance(lens, str):
            return lens
        cameras[f"cam{k}"] = {
            "T_imu_cam": _imu_from_camera(facts.imu, view).tolist(),
            "cam_overlaps": [1 - k] if len(facts.views) == 2 else [],
            **lens,
            "resolution": [view.width, view.height],
            "rostopic": view.topic,
            "timeshift_cam_imu": 0.0,
        }
    count = len(facts.views)
    rig = {"use_stereo": count == 2, "max_cameras": count, "gravity_mag": GRAVITY}
    rate = {"track_frequency": min(21.0, facts.views[0].rate_hz + 1.0)}
    folder = "open_vins"
    return {
        f"{folder}/estimator_config.yaml": _text({**_ESTIMATOR, **rig, **rate}),
        f"{folder}/kalibr_imu_chain.yaml": _text({"imu0": _kalibr_imu(facts.imu)}),
        f"{folder}/kalibr_imucam_chain.yaml": _text(cameras),
    }


def _text(values: Mapping[str, Any]) -> str:
    return _YAML + _ITEM.sub(r"\1  - ", write_mapping(values))


def _kalibr_imu(imu: ImuFacts) -> dict[str, Any]:
    """Readings are in the IMU's frame, without scale errors: the matrices are 1, and the influence of gravity 0."""
    one: list[list[float]] = np.eye(3).tolist()
    return {
        "T_i_b": np.eye(4).tolist(),
        "accelerometer_noise_density": imu.noise.accelerometer,
        "accelerometer_random_walk": imu.noise.accelerometer_walk,
        "gyroscope_noise_density": imu.noise.gyroscope,
        "gyroscope_random_walk": imu.noise.gyroscope_walk,
        "rostopic": imu.topic,
        "time_offset": 0.0,
        "update_rate": imu.rate_hz,
        "model": "kalibr",
        **{key: [list(row) for row in one] for key in ("Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC")},
        "Tg": np.zeros((3, 3)).tolist(),
    }


def _kalibr_lens(view: ViewFacts) -> dict[str, Any] | str:
    """The lens with Kalibr's keys, or that OpenVINS does not have it."""
    k = view.coefficients
    if view.model == "pinhole":
        model, values = "radtan", [0.0] * 4
    elif view.model == "plumb_bob" and k[4] == 0.0:
        model, values = "radtan", [*k[:4]]
    elif view.model == "equidistant":
        model, values = "equidistant", [*k]
    else:
        return f"it does not have the lens {view.model}{' with k3' * (view.model == 'plumb_bob')}"
    return {
        "camera_model": "pinhole",
        "distortion_model": model,
        "distortion_coeffs": values,
        "intrinsics": [*view.intrinsics],
    }


def orb_slam3(facts: Facts) -> Files | str:
    """ORB-SLAM3 1.0 (UZ-SLAMLab/ORB_SLAM3 1464d8f, src/Settings.cc).

    ``IMU.T_b_c1`` takes points of the left camera to the IMU, ``Stereo.T_c1_c2`` those of the right camera to the left.
    Numbers that it reads as real have a decimal point.
    """
    if not facts.views:
        return "no camera"
    left, right = facts.views[0], facts.views[-1]
    kinds = {"pinhole": "PinHole", "plumb_bob": "PinHole", "equidistant": "KannalaBrandt8"}
    if left.model not in kinds:
        return f"it does not have the lens {left.model}"
    values: dict[str, Any] = {"File.version": '"1.0"', "Camera.type": f'"{kinds[left.model]}"'}
    for number, view in enumerate(facts.views, start=1):
        values |= _orb_camera(f"Camera{number}", view)
    values |= {"Camera.width": left.width, "Camera.height": left.height, "Camera.fps": max(round(left.rate_hz), 1)}
    values["Camera.RGB"] = 1
    if len(facts.views) == 2:
        left_from_right = transforms.inverse(left.base_from_optical) @ right.base_from_optical
        values |= {"Stereo.ThDepth": 60.0, "Stereo.T_c1_c2": _opencv_matrix(left_from_right)}
    if facts.imu is not None:
        noise = facts.imu.noise
        values |= {
            "IMU.T_b_c1": _opencv_matrix(_imu_from_camera(facts.imu, left)),
            "IMU.NoiseGyro": noise.gyroscope,
            "IMU.NoiseAcc": noise.accelerometer,
            "IMU.GyroWalk": noise.gyroscope_walk,
            "IMU.AccWalk": noise.accelerometer_walk,
            "IMU.Frequency": float(facts.imu.rate_hz),
        }
    lines = "".join(f"{key}: {value}\n" for key, value in (values | _ORB).items())
    kind = ("Stereo" if len(facts.views) == 2 else "Monocular") + ("-Inertial" if facts.imu else "")
    return {"orb_slam3.yaml": f"{_YAML}# ORB-SLAM3, {kind}: it uses its names for topics, see README.txt\n{lines}"}


_ORB: Final = {
    "ORBextractor.nFeatures": 1200, "ORBextractor.scaleFactor": 1.2, "ORBextractor.nLevels": 8,
    "ORBextractor.iniThFAST": 20, "ORBextractor.minThFAST": 7,
    "Viewer.KeyFrameSize": 0.05, "Viewer.KeyFrameLineWidth": 1.0, "Viewer.GraphLineWidth": 0.9,
    "Viewer.PointSize": 2.0, "Viewer.CameraSize": 0.08, "Viewer.CameraLineWidth": 3.0, "Viewer.ViewpointX": 0.0,
    "Viewer.ViewpointY": -0.7, "Viewer.ViewpointZ": -1.8, "Viewer.ViewpointF": 500.0, "Viewer.imageViewScale": 1.0,
}  # fmt: skip


def _orb_camera(name: str, view: ViewFacts) -> dict[str, Any]:
    keys, figures = ["fx", "fy", "cx", "cy"], view.intrinsics + view.coefficients
    values: dict[str, Any] = {}
    if view.model == "equidistant":
        keys += ["k1", "k2", "k3", "k4"]
        values = {f"{name}.overlappingBegin": 0, f"{name}.overlappingEnd": view.width}
    else:
        keys += ["k1", "k2", "p1", "p2", "k3"]
        figures += (0.0,) * (9 - len(figures))
    return dict(zip((f"{name}.{key}" for key in keys), figures, strict=True)) | values


def _opencv_matrix(matrix: Array) -> str:
    return f"!!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: f\n   data: {numbers(matrix)}"


def _imu_from_camera(imu: ImuFacts, view: ViewFacts) -> Array:
    matrix = transforms.inverse(imu.base_from_imu) @ view.base_from_optical
    return np.asarray(np.round(matrix, 12) + 0.0)
