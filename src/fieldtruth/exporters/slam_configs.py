# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export configuration files of SLAM programs for a run: topics, mounts, lenses, LiDAR and noise of its rig.

Programs take one LiDAR, one IMU and one camera. Of a rig with several sensors these are the first LiDAR, the first IMU
and the first stereo pair, without a pair the first camera. Mounts, lenses and fields of points are those of the
messages in the bag.

``slam/*.yaml`` are the files with ``$names`` in place of the values that depend on the rig. Keys and conventions are
those of the sources named at each function. It returns the files by name, or why the program cannot read these sensors,
in one line.
"""

import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
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
from fieldtruth.core.yaml_io import package_data, write_mapping
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import first_views
from fieldtruth.exporters.tum import tum_text

Files = dict[str, str]
"""Text by name of the file."""
_UINT8, _UINT32, _FLOAT32 = 2, 6, 7
"""Datatypes of sensor_msgs/PointField."""


# ---------------------------------------------------------------------------------------------------------------------
# The sensors of a run


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
    config: Any
    fields: Mapping[str, int]
    """Datatype of each field of its points, as in sensor_msgs/PointField."""

    @property
    def has_t(self) -> bool:
        """True if points have their time after the stamp in ``t`` [ns], so that scans can be deskewed."""
        return self.fields.get("t") == _UINT32

    @property
    def has_time(self) -> bool:
        """True if points have their time after the stamp in ``time`` [s], as Velodyne's driver writes it."""
        return self.fields.get("time") == _FLOAT32

    @property
    def has_short_ring(self) -> bool:
        """True if ``ring`` has 8 bits, as in Ouster's older driver; else it has 16."""
        return self.fields.get("ring") == _UINT8


class ImuFacts(NamedTuple):
    """An inertial measurement unit."""

    name: str
    topic: str
    base_from_imu: Array
    rate_hz: float
    noise: ImuNoise
    assumed: bool
    """True: the readings are exact, and the noise is ``ASSUMED_NOISE``."""


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
    frame, mount = run.calibration.frame(lidar.name), run.calibration.base_from(lidar.name)
    fields = {field.name: field.datatype for field in run.readings(lidar.name, labelled=False).message(0).fields}
    return LidarFacts(lidar.name, lidar.topic, frame, mount, lidar.config, fields)


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


# ---------------------------------------------------------------------------------------------------------------------
# LiDAR odometry


_LEAST_VARIANCE: Final = {"acc_cov": 0.1, "gyr_cov": 0.1, "b_acc_cov": 1e-4, "b_gyr_cov": 1e-4}
"""In every file of hku-mars/FAST_LIO 7cc4175: with room for vibration and for what the filter neglects, more than most
IMUs have of noise."""
_MARSIM, _VELODYNE, _OUSTER = 4, 2, 3
"""FAST-LIO2's lidar_type: points without time, with ``time``, with ``t``."""
_SECOND, _NANOSECOND = 0, 3
"""Its timestamp_unit."""
_NO_NOISE: Final = "# The IMU reads exactly; its noise here is assumed, because filters divide by it.\n"


def kiss_icp(facts: Facts) -> Files | str:
    """KISS-ICP 1.3 (PRBonn/kiss-icp 4bd9a10, config/config.py). Its poses are those of the LiDAR's frame."""
    if facts.lidar is None:
        return "no LiDAR"
    head = f"# KISS-ICP: kiss_icp_pipeline --topic {facts.lidar.topic} --config kiss_icp.yaml BAG\n"
    return {"kiss_icp.yaml": head + write_mapping(_filled("kiss_icp", facts))}


def rko_lio(facts: Facts) -> Files | str:
    """RKO-LIO 0.4 (PRBonn/rko_lio a335c17, config.py): mounts in the base frame, here that of the LiDAR."""
    lidar, imu = facts.lidar, facts.imu
    if lidar is None or imu is None:
        return "no LiDAR" if lidar is None else "no IMU"
    pose = transforms.inverse(lidar.base_from_lidar) @ imu.base_from_imu
    xyzw = transforms.xyzw_from_wxyz(transforms.quaternion_wxyz_from_rotation(pose[:3, :3]))
    head = f"# RKO-LIO: rko_lio --config rko_lio.yaml --lidar {lidar.topic} --imu {imu.topic} FOLDER_OF_THE_BAG\n"
    values = _filled("rko_lio", facts, lidar_from_imu=_numbers([*xyzw, *pose[:3, 3]]))
    return {"rko_lio.yaml": head + write_mapping(values)}


def lio_sam(facts: Facts) -> Files | str:
    """LIO-SAM (TixiaoShan/LIO-SAM 0be1fbe, config/params.yaml, include/utility.h, src/imuPreintegration.cpp).

    ``extrinsicRot`` turns readings of the IMU into the LiDAR's axes, and so does ``extrinsicRPY`` for the orientation;
    ``extrinsicTrans`` is the IMU's position in the LiDAR's frame: the LiDAR's pose is multiplied by it from the right.
    """
    lidar, imu = facts.lidar, facts.imu
    if lidar is None or imu is None:
        return "no LiDAR" if lidar is None else "no IMU"
    if lidar.config.pattern is not None:
        return "it orders points by ring and azimuth, which a Livox does not have"
    if lidar.has_short_ring and lidar.has_t:
        sensor = "ouster"
    elif not lidar.has_short_ring and (lidar.has_time or not lidar.has_t):
        sensor = "velodyne"
    else:
        return "it reads a ring of 8 bits with t, or of 16 bits with time; set time_field: time or point_fields: ouster"
    values = _filled(
        "lio_sam",
        facts,
        sensor=sensor,
        gravity=GRAVITY,
        **_rotation_and_position(transforms.inverse(lidar.base_from_lidar) @ imu.base_from_imu),
    )
    head = "# LIO-SAM: config/params.yaml. Its other keys keep their defaults.\n" + _NO_NOISE * imu.assumed
    return {"lio_sam.yaml": head + write_mapping(values)}


def fast_lio2(facts: Facts) -> Files | str:
    """FAST-LIO2 (hku-mars/FAST_LIO 7cc4175, config/*.yaml, src/preprocess.cpp): the LiDAR's pose in the IMU's frame.

    Its clouds must be PointCloud2: those of a Livox are read by their ``t``, as an Ouster's. Variances are those of a
    reading, and of the bias's change over the time between two, as its prediction multiplies both by that time.
    """
    lidar, imu = facts.lidar, facts.imu
    if lidar is None or imu is None:
        return "no LiDAR" if lidar is None else "no IMU"
    kind, unit = (_OUSTER, _NANOSECOND) if lidar.has_t else (_MARSIM, _SECOND)
    if lidar.has_time:
        kind, unit = _VELODYNE, _SECOND
    noise = imu.noise
    densities = (noise.accelerometer, noise.gyroscope, noise.accelerometer_walk, noise.gyroscope_walk)
    pairs = zip(_LEAST_VARIANCE.items(), densities, strict=True)
    values = _filled(
        "fast_lio2",
        facts,
        kind=kind,
        unit=unit,
        rate=round(lidar.config.rate_hz),
        fov=90.0 if lidar.config.pattern == "avia" else 180.0,
        **{key: max(density * density * imu.rate_hz, least) for (key, least), density in pairs},
        **_rotation_and_position(transforms.inverse(imu.base_from_imu) @ lidar.base_from_lidar),
    )
    head = "# FAST-LIO2: a file for its folder config; *_cov are at least those of its own files.\n"
    return {"fast_lio2.yaml": head + _NO_NOISE * imu.assumed + write_mapping(values)}


def _filled(template: str, facts: Facts, **values: Any) -> dict[str, Any]:
    """Return the values of a template, with those that its ``$names`` stand for: ``values``, or attributes of facts."""

    def fill(node: Any) -> Any:
        if isinstance(node, dict):
            return {key: fill(each) for key, each in node.items()}
        if not (isinstance(node, str) and node.startswith("$")):
            return node
        found = values[node[1:]] if node[1:] in values else attrgetter(node[1:])(facts)
        return list(found) if isinstance(found, list) else found  # a copy: YAML would refer to the first of two

    filled: dict[str, Any] = fill(package_data("fieldtruth.exporters", f"slam/{template}.yaml"))
    return filled


def _numbers(values: Any) -> list[float]:
    """Return numbers row by row, without rounding errors of a rotation by right angles."""
    flat: list[float] = (np.round(np.asarray(values, np.float64), 12) + 0.0).ravel().tolist()
    return flat


def _rotation_and_position(a_from_b: Array) -> dict[str, list[float]]:
    return {"rotation": _numbers(a_from_b[:3, :3]), "position": _numbers(a_from_b[:3, 3])}


# ---------------------------------------------------------------------------------------------------------------------
# Visual SLAM


_YAML: Final = "%YAML:1.0\n"
"""The first line of a file that OpenCV's FileStorage reads."""
_ITEM: Final = re.compile(r"^( *)- ", re.MULTILINE)
"""Beginning of an item of a list, which FileStorage wants further to the right than the list's key."""
_ORB_LENSES: Final = {"pinhole": "PinHole", "plumb_bob": "PinHole", "equidistant": "KannalaBrandt8"}


def open_vins(facts: Facts) -> Files | str:
    """OpenVINS (rpng/open_vins 6948812, config/euroc_mav): ``T_imu_cam`` takes points of the camera to the IMU."""
    if not facts.views or facts.imu is None:
        return "no IMU" if facts.views else "no camera"
    count = len(facts.views)
    cameras: dict[str, Any] = {}
    for k, view in enumerate(facts.views):
        lens = _kalibr_lens(view)
        if isinstance(lens, str):
            return lens
        cameras[f"cam{k}"] = {
            "T_imu_cam": _imu_from_camera(facts.imu, view).tolist(),
            "cam_overlaps": [1 - k] if count == 2 else [],
            **lens,
            "resolution": [view.width, view.height],
            "rostopic": view.topic,
            "timeshift_cam_imu": 0.0,
        }
    rate = min(21.0, facts.views[0].rate_hz + 1.0)
    contents = {
        "estimator_config": _filled(
            "open_vins_estimator", facts, is_pair=count == 2, count=count, gravity=GRAVITY, rate=rate
        ),
        "kalibr_imu_chain": _filled("open_vins_imu", facts),
        "kalibr_imucam_chain": cameras,
    }
    texts = {name: _ITEM.sub(r"\1  - ", write_mapping(values)) for name, values in contents.items()}
    return {f"open_vins/{name}.yaml": _YAML + text for name, text in texts.items()}


def _kalibr_lens(view: ViewFacts) -> dict[str, Any] | str:
    """Return the lens with Kalibr's keys, or that OpenVINS does not have it."""
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
    if left.model not in _ORB_LENSES:
        return f"it does not have the lens {left.model}"
    values: dict[str, Any] = {"File.version": '"1.0"', "Camera.type": f'"{_ORB_LENSES[left.model]}"'}
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
    lines = "".join(f"{key}: {value}\n" for key, value in (values | _filled("orb_slam3", facts)).items())
    kind = ("Stereo" if len(facts.views) == 2 else "Monocular") + ("-Inertial" if facts.imu else "")
    return {"orb_slam3.yaml": f"{_YAML}# ORB-SLAM3, {kind}: it uses its names for topics, see README.txt\n{lines}"}


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
    return f"!!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: f\n   data: {_numbers(matrix)}"


def _imu_from_camera(imu: ImuFacts, view: ViewFacts) -> Array:
    matrix = transforms.inverse(imu.base_from_imu) @ view.base_from_optical
    return np.asarray(np.round(matrix, 12) + 0.0)


# ---------------------------------------------------------------------------------------------------------------------
# The export

PROGRAMS: Final[Mapping[str, Callable[[Facts], Files | str]]] = {
    "KISS-ICP": kiss_icp,
    "RKO-LIO": rko_lio,
    "LIO-SAM": lio_sam,
    "FAST-LIO2": fast_lio2,
    "OpenVINS": open_vins,
    "ORB-SLAM3": orb_slam3,
}
_TEXTS: Final = package_data("fieldtruth.exporters", "slam_configs.yaml")


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
    text: str = _TEXTS["readme"].format(run=run.name, sensors=sensors, files=files)
    return text + (_images(facts) if facts.views else "")


def _images(facts: Facts) -> str:
    """Commands that decompress the photographs, and that give ORB-SLAM3 its topics."""
    topics = [view.topic for view in facts.views]
    lines = "".join(f"  rosrun image_transport republish compressed in:={t} raw out:={t}\n" for t in topics)
    names = ("/camera/left/image_raw", "/camera/right/image_raw") if len(topics) == 2 else ("/camera/image_raw",)
    remaps = [f"{name}:={topic}" for name, topic in zip(names, topics, strict=True)]
    remaps += [f"/imu:={facts.imu.topic}"] if facts.imu else []
    return f"{_TEXTS['republish']}{_TEXTS['orb_topics']}".format(lines=lines, remaps=" ".join(remaps))
