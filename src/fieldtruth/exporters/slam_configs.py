# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export configuration files of SLAM programs for a run: topics, mounts, lenses, LiDAR and noise of its rig."""

import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import TF_STATIC, Source
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.core.readings import Cloud, Image, Inertial
from fieldtruth.core.yaml_io import write_mapping
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.exporters import Options
from fieldtruth.exporters.sequences import first_views
from fieldtruth.exporters.tum import tum_text

_UINT8, _UINT32, _FLOAT32 = 2, 6, 7
"""Datatypes of sensor_msgs/PointField."""


class ImuNoise(NamedTuple):
    """White noise and random walk of the bias of an IMU, one figure for its three axes."""

    gyroscope: float
    """Density [rad/s/sqrt(Hz)]."""
    accelerometer: float
    """Density [m/s^2/sqrt(Hz)]."""
    gyroscope_walk: float
    """[rad/s^2/sqrt(Hz)]."""
    accelerometer_walk: float
    """[m/s^3/sqrt(Hz)]."""


ASSUMED_NOISE: Final = ImuNoise(1.6968e-4, 2.0e-3, 1.9393e-5, 3.0e-3)
"""Of an IMU without noise, because filters divide by it: an ADIS16448 as in sensor.yaml of the EuRoC data set (Burri et
al., 2016, doi 10.1177/0278364915620033)."""


class LidarFacts(NamedTuple):
    """A LiDAR."""

    name: str
    topic: str
    frame: str
    base_from_lidar: Array
    rate_hz: float
    rings: int
    columns: int
    min_range: float
    max_range: float
    """[m]."""
    pattern: str | None
    fields: Mapping[str, int]
    """Datatype of each field of its points, as in sensor_msgs/PointField."""

    @property
    def has_t(self) -> bool:
        """Whether points have their time after the stamp in ``t`` [ns], so that scans can be deskewed."""
        return self.fields.get("t") == _UINT32

    @property
    def has_time(self) -> bool:
        """Whether points have their time after the stamp in ``time`` [s], as Velodyne's driver writes it."""
        return self.fields.get("time") == _FLOAT32

    @property
    def has_short_ring(self) -> bool:
        """Whether ``ring`` has 8 bits, as in Ouster's older driver; else it has 16."""
        return self.fields.get("ring") == _UINT8


class ImuFacts(NamedTuple):
    """An inertial measurement unit."""

    name: str
    topic: str
    base_from_imu: Array
    rate_hz: float
    noise: ImuNoise
    assumed: bool
    """Whether the readings are exact, so that the noise is ``ASSUMED_NOISE``."""


class ViewFacts(NamedTuple):
    """A view of a camera."""

    name: str
    topic: str
    """Of the raw image after ``image_transport republish``: that of the photograph without /compressed."""
    base_from_optical: Array
    model: str
    """pinhole, plumb_bob, rational_polynomial, equidistant or equirectangular."""
    intrinsics: tuple[float, float, float, float]
    """fx, fy, cx, cy [pixel]; the centre of the first pixel is (0, 0)."""
    coefficients: tuple[float, ...]
    width: int
    height: int
    rate_hz: float


class Facts(NamedTuple):
    """The sensors that a program can use; without one that the bag lacks."""

    lidar: LidarFacts | None
    imu: ImuFacts | None
    views: tuple[ViewFacts, ...]
    """Left and right of a pair, or the view of a camera."""
    more: tuple[str, ...]
    """Names of LiDARs, IMUs and cameras that the rig has beside these."""


def read_facts(run: Run) -> Facts:
    """Read what a bag has of the first sensor of each kind.

    Raises:
        BagError: /tf_static is missing or does not connect a sensor with base_link, or the bag is damaged.
    """
    run.require(TF_STATIC)
    lidars, imus = run.of(Cloud), run.of(Inertial)
    views = [view for view in first_views(run) if view.has(run.counts, "photo") and run.calibration.has_lens(view.name)]
    used, cameras = {view.device for view in views}, dict.fromkeys(v.device for v in run.of(Image, recorded=False))
    others = [camera for camera in cameras if camera not in used]
    more = [sensor.name for sensor in (*lidars[1:], *imus[1:])] + others * bool(views)
    return Facts(
        _lidar(run, lidars[0]) if lidars else None,
        _imu(run, imus[0]) if imus else None,
        tuple(_view(run, view) for view in views),
        tuple(more),
    )


def _lidar(run: Run, lidar: Source) -> LidarFacts:
    config = lidar.config
    return LidarFacts(
        name=lidar.name,
        topic=lidar.topic,
        frame=run.calibration.frame(lidar.name),
        base_from_lidar=run.calibration.base_from(lidar.name),
        rate_hz=config.rate_hz,
        rings=config.rings,
        columns=config.columns,
        min_range=config.min_range,
        max_range=config.max_range,
        pattern=config.pattern,
        fields={field.name: field.datatype for field in run.readings(lidar.name, labelled=False).message(0).fields},
    )


def _imu(run: Run, imu: Source) -> ImuFacts:
    noise, mount = noise_of(imu.config), run.calibration.base_from(imu.name)
    return ImuFacts(imu.name, imu.topic, mount, imu.config.rate_hz, noise or ASSUMED_NOISE, noise is None)


def noise_of(imu: Any) -> ImuNoise | None:
    """Noise of an IMU, of the worst axis; None if it reads exactly. What it lacks, as often walks, is assumed."""
    if (signal := imu.signal) is None:
        return None
    names = ("noise_density", "random_walk")
    keys = (f"{triad}_{name}" for name in names for triad in ("gyroscope", "accelerometer"))
    figures = (float(np.max(getattr(signal, key))) for key in keys)
    return ImuNoise(*(figure or assumed for figure, assumed in zip(figures, ASSUMED_NOISE, strict=True)))


def _view(run: Run, view: Source) -> ViewFacts:
    lens = run.calibration.lens(view.name)
    return ViewFacts(
        name=view.label,
        topic=view.topic.removesuffix("/compressed"),
        base_from_optical=run.calibration.base_from(view.name),
        model="pinhole" if lens.is_pinhole else lens.model,
        intrinsics=(float(lens.K[0, 0]), float(lens.K[1, 1]), float(lens.K[0, 2]), float(lens.K[1, 2])),
        coefficients=() if lens.is_pinhole else tuple(lens.D.tolist()),
        width=lens.width,
        height=lens.height,
        rate_hz=view.config.rate_hz,
    )


Files = dict[str, str]
"""Text by name of the file."""
_LEAST_VARIANCE: Final = (0.1, 0.1, 1e-4, 1e-4)
"""acc_cov, gyr_cov, b_acc_cov, b_gyr_cov in every file of hku-mars/FAST_LIO 7cc4175: with room for vibration and for
what the filter neglects, more than most IMUs have of noise."""
_MARSIM, _VELODYNE, _OUSTER = 4, 2, 3
"""FAST-LIO2's lidar_type: points without time, with ``time``, with ``t``."""
_SECOND, _NANOSECOND = 0, 3
"""Its timestamp_unit."""


def numbers(values: Any) -> list[float]:
    """Row by row, without rounding errors of a rotation by right angles."""
    flat: list[float] = (np.round(np.asarray(values, np.float64), 12) + 0.0).ravel().tolist()
    return flat


def kiss_icp(facts: Facts) -> Files | str:
    """KISS-ICP 1.3 (PRBonn/kiss-icp 4bd9a10, config/config.py). Its poses are those of the LiDAR's frame."""
    if (lidar := facts.lidar) is None:
        return "no LiDAR"
    data = {"max_range": lidar.max_range, "min_range": lidar.min_range, "deskew": lidar.has_t}
    head = f"# KISS-ICP: kiss_icp_pipeline --topic {lidar.topic} --config kiss_icp.yaml BAG\n"
    return {"kiss_icp.yaml": head + write_mapping({"data": data})}


def rko_lio(facts: Facts) -> Files | str:
    """RKO-LIO 0.4 (PRBonn/rko_lio a335c17, config.py): mounts in the base frame, here that of the LiDAR."""
    lidar, imu = facts.lidar, facts.imu
    if lidar is None or imu is None:
        return "no LiDAR" if lidar is None else "no IMU"
    lidar_from_imu = transforms.inverse(lidar.base_from_lidar) @ imu.base_from_imu
    values = {
        "deskew": lidar.has_t,
        "min_range": lidar.min_range,
        "max_range": lidar.max_range,
        "extrinsic_lidar2base_quat_xyzw_xyz": _quaternion_and_position(np.eye(4)),
        "extrinsic_imu2base_quat_xyzw_xyz": _quaternion_and_position(lidar_from_imu),
    }
    head = f"# RKO-LIO: rko_lio --config rko_lio.yaml --lidar {lidar.topic} --imu {imu.topic} FOLDER_OF_THE_BAG\n"
    return {"rko_lio.yaml": head + write_mapping(values)}


def lio_sam(facts: Facts) -> Files | str:
    """LIO-SAM (TixiaoShan/LIO-SAM 0be1fbe, config/params.yaml, include/utility.h, src/imuPreintegration.cpp).

    ``extrinsicRot`` turns readings of the IMU into the LiDAR's axes, and so does ``extrinsicRPY`` for the orientation;
    ``extrinsicTrans`` is the IMU's position in the LiDAR's frame: the LiDAR's pose is multiplied by it from the right.
    """
    lidar, imu = facts.lidar, facts.imu
    if lidar is None or imu is None:
        return "no LiDAR" if lidar is None else "no IMU"
    if lidar.pattern is not None:
        return "it orders points by ring and azimuth, which a Livox does not have"
    if lidar.has_short_ring and lidar.has_t:
        sensor = "ouster"
    elif not lidar.has_short_ring and (lidar.has_time or not lidar.has_t):
        sensor = "velodyne"
    else:
        return "it reads a ring of 8 bits with t, or of 16 bits with time; set time_field: time or point_fields: ouster"
    lidar_from_imu = transforms.inverse(lidar.base_from_lidar) @ imu.base_from_imu
    rotation, noise = numbers(lidar_from_imu[:3, :3]), imu.noise
    values = {
        "pointCloudTopic": lidar.topic, "imuTopic": imu.topic, "odomTopic": "odometry/imu", "gpsTopic": "odometry/gpsz",
        "lidarFrame": lidar.frame, "baselinkFrame": "base_link", "odometryFrame": "odom", "mapFrame": "map",
        "useImuHeadingInitialization": False, "useGpsElevation": False,
        "sensor": sensor, "N_SCAN": lidar.rings, "Horizon_SCAN": lidar.columns, "downsampleRate": 1,
        "lidarMinRange": lidar.min_range, "lidarMaxRange": lidar.max_range,
        "imuAccNoise": noise.accelerometer, "imuGyrNoise": noise.gyroscope,
        "imuAccBiasN": noise.accelerometer_walk, "imuGyrBiasN": noise.gyroscope_walk,
        "imuGravity": GRAVITY, "imuRPYWeight": 0.01,
        "extrinsicTrans": numbers(lidar_from_imu[:3, 3]), "extrinsicRot": rotation, "extrinsicRPY": list(rotation),
        "edgeThreshold": 1.0, "surfThreshold": 0.1, "edgeFeatureMinValidNum": 10, "surfFeatureMinValidNum": 100,
        "odometrySurfLeafSize": 0.4, "mappingCornerLeafSize": 0.2, "mappingSurfLeafSize": 0.4,
        "z_tollerance": 1000.0, "rotation_tollerance": 1000.0, "numberOfCores": 4, "mappingProcessInterval": 0.15,
        "loopClosureEnableFlag": True, "loopClosureFrequency": 1.0, "surroundingKeyframeSize": 50,
    }  # fmt: skip
    head = "# LIO-SAM: config/params.yaml. Its other keys keep their defaults.\n" + _about_noise(facts)
    return {"lio_sam.yaml": head + write_mapping({"lio_sam": values})}


def fast_lio2(facts: Facts) -> Files | str:
    """FAST-LIO2 (hku-mars/FAST_LIO 7cc4175, config/*.yaml, src/preprocess.cpp): the LiDAR's pose in the IMU's frame.

    Its clouds must be PointCloud2: those of a Livox are read by their ``t``, as an Ouster's. Variances are those of a
    reading, and of the bias's change over the time between two, as its prediction multiplies both by that time.
    """
    lidar, imu = facts.lidar, facts.imu
    if lidar is None or imu is None:
        return "no LiDAR" if lidar is None else "no IMU"
    imu_from_lidar = transforms.inverse(imu.base_from_imu) @ lidar.base_from_lidar
    kind, unit = (_OUSTER, _NANOSECOND) if lidar.has_t else (_MARSIM, _SECOND)
    if lidar.has_time:
        kind, unit = _VELODYNE, _SECOND
    noise = imu.noise
    densities = (noise.accelerometer, noise.gyroscope, noise.accelerometer_walk, noise.gyroscope_walk)
    variances = [max(d * d * imu.rate_hz, least) for d, least in zip(densities, _LEAST_VARIANCE, strict=True)]
    values = {
        "common": {
            "lid_topic": lidar.topic, "imu_topic": imu.topic, "time_sync_en": False, "time_offset_lidar_to_imu": 0.0,
        },
        "preprocess": {
            "lidar_type": kind, "scan_line": lidar.rings, "scan_rate": round(lidar.rate_hz), "timestamp_unit": unit,
            "blind": lidar.min_range,
        },
        "mapping": {
            **dict(zip(("acc_cov", "gyr_cov", "b_acc_cov", "b_gyr_cov"), variances, strict=True)),
            "fov_degree": 90.0 if lidar.pattern == "avia" else 180.0,
            "det_range": lidar.max_range,
            "extrinsic_est_en": False,
            "extrinsic_T": numbers(imu_from_lidar[:3, 3]),
            "extrinsic_R": numbers(imu_from_lidar[:3, :3]),
        },
        "publish": {
            "path_en": True, "scan_publish_en": True, "dense_publish_en": True, "scan_bodyframe_pub_en": True,
        },
        "pcd_save": {"pcd_save_en": False, "interval": -1},
    }  # fmt: skip
    head = "# FAST-LIO2: a file for its folder config; *_cov are at least those of its own files.\n"
    return {"fast_lio2.yaml": head + _about_noise(facts) + write_mapping(values)}


def _about_noise(facts: Facts) -> str:
    """A comment where the IMU reads exactly."""
    if facts.imu is None or not facts.imu.assumed:
        return ""
    return "# The IMU reads exactly; its noise here is assumed, because filters divide by it.\n"


def _quaternion_and_position(a_from_b: Array) -> list[float]:
    return numbers(
        [*transforms.xyzw_from_wxyz(transforms.quaternion_wxyz_from_rotation(a_from_b[:3, :3])), *a_from_b[:3, 3]]
    )


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


PROGRAMS: Final[Mapping[str, Callable[[Facts], Files | str]]] = {
    "KISS-ICP": kiss_icp,
    "RKO-LIO": rko_lio,
    "LIO-SAM": lio_sam,
    "FAST-LIO2": fast_lio2,
    "OpenVINS": open_vins,
    "ORB-SLAM3": orb_slam3,
}
_README: Final = """\
Configuration files of SLAM programs for {run}

{sensors}
{files}"""
_REPUBLISH: Final = """\

OpenVINS and ORB-SLAM3 read raw images; the photographs in the bag are JPEG:
{lines}"""
_ORB_TOPICS: Final = """\
ORB-SLAM3 has names of its own for topics. Beside these, start it with:
  {remaps}
"""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: a file, or a folder, for each program, and a README.txt.

    Programs that cannot read the sensors of the rig are left out, with a warning of one line that says why.

    Raises:
        BagError: the bag has no sensor that any program reads, or no /tf_static, or is damaged.
    """
    (run,) = runs
    with options.progress.stage("write the configuration files"):
        facts = read_facts(run)
        made = {name: program(facts) for name, program in PROGRAMS.items()}
    missing = {name: files for name, files in made.items() if isinstance(files, str)}
    if len(missing) == len(PROGRAMS):
        raise BagError(f"{run.bag} has no sensor that a SLAM program reads: neither LiDAR nor camera")
    files = {path: text for each in made.values() if not isinstance(each, str) for path, text in each.items()}
    for path, text in files.items():
        (target / path).parent.mkdir(parents=True, exist_ok=True)
        (target / path).write_text(text, encoding="utf-8")
    left_out = "; ".join(f"{name}: {why}" for name, why in missing.items())
    if missing:
        warnings.warn(f"left out of {target.name}: {left_out}", FieldtruthWarning, stacklevel=2)
    truths = _write_truths(run, facts, target)
    (target / "README.txt").write_text(_readme(run, facts, made, left_out, truths), encoding="utf-8")


def _write_truths(run: Run, facts: Facts, target: Path) -> str:
    """Write the true poses of the sensors, as far as the bag has poses, and return their line of the README."""
    if not run.has_poses:
        return ""
    mounts = {
        "lidar": facts.lidar and facts.lidar.base_from_lidar,
        "imu": facts.imu and facts.imu.base_from_imu,
        "camera": facts.views[0].base_from_optical if facts.views else None,
    }
    names = []
    for name, base_from_sensor in mounts.items():
        if base_from_sensor is not None:
            names.append(f"truth_{name}.tum")
            (target / names[-1]).write_text(tum_text(run.trajectory, base_from_sensor), encoding="ascii")
    return f"true poses of the sensors in the world, for evo: {', '.join(names)}\n"


def _readme(run: Run, facts: Facts, made: Mapping[str, Files | str], left_out: str, truths: str) -> str:
    used = {
        "LiDAR": facts.lidar and f"{facts.lidar.name}, {facts.lidar.topic}",
        "IMU": facts.imu and f"{facts.imu.name}, {facts.imu.topic}",
        "camera": ", ".join(view.name for view in facts.views),
        "not used": ", ".join(facts.more),
    }
    sensors = "".join(f"{what}: {value}\n" for what, value in used.items() if value)
    files = "".join(f"{name}: {', '.join(each)}\n" for name, each in made.items() if not isinstance(each, str))
    files += (f"left out: {left_out}\n" if left_out else "") + truths
    text = _README.format(run=run.name, sensors=sensors, files=files)
    return text + (_images(facts) if facts.views else "")


def _images(facts: Facts) -> str:
    """How to decompress the photographs, and to give ORB-SLAM3 its topics."""
    topics = [view.topic for view in facts.views]
    lines = "".join(f"  rosrun image_transport republish compressed in:={t} raw out:={t}\n" for t in topics)
    names = ("/camera/left/image_raw", "/camera/right/image_raw") if len(topics) == 2 else ("/camera/image_raw",)
    remaps = [f"{name}:={topic}" for name, topic in zip(names, topics, strict=True)]
    remaps += [f"/imu:={facts.imu.topic}"] if facts.imu else []
    return _REPUBLISH.format(lines=lines) + _ORB_TOPICS.format(remaps=" ".join(remaps))
