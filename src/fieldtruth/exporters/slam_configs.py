# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export configuration files of SLAM programs for a run: topics, mounts, lenses, rays and noise of its sensors.

Programs take one LiDAR, one IMU and one camera. These are the first sensor of the rig that scans in rings and columns,
the first that gives inertial readings, and the first stereo pair, without a pair the first sensor of images. Mounts,
lenses and fields of points are those of the messages in the bag.

``slam/*.yaml`` are the files with ``$names`` in place of the values that depend on the rig. Keys and conventions are
those of the sources named at each function. It returns the files by name, or why the program cannot read these sensors,
in one line.
"""

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
from fieldtruth.core.lenses import COEFFICIENTS, Lens
from fieldtruth.core.readings import Cloud, Image, Inertial
from fieldtruth.core.yaml_io import filled, package_data, write_mapping
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.experiment.scanning_config import ScanningConfig
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import first_views, format_of
from fieldtruth.exporters.tum import tum_text
from fieldtruth.report.rig import kalibr_lens

Files = dict[str, str]
"""Text by name of the file."""
_UINT8, _UINT32, _FLOAT32 = 2, 6, 7
"""Datatypes of sensor_msgs/PointField."""
_TEXTS: Final = package_data("fieldtruth.exporters", "slam_configs.yaml")


# ---------------------------------------------------------------------------------------------------------------------
# The sensors of a run


class InertialNoise(NamedTuple):
    """White noise and random walk of the bias of an IMU, one figure for its three axes."""

    gyroscope: float
    """Density [rad/s/sqrt(Hz)]."""
    accelerometer: float
    """Density [m/s^2/sqrt(Hz)]."""
    gyroscope_walk: float
    """[rad/s^2/sqrt(Hz)]."""
    accelerometer_walk: float
    """[m/s^3/sqrt(Hz)]."""


ASSUMED_NOISE: Final = InertialNoise(1.6968e-4, 2.0e-3, 1.9393e-5, 3.0e-3)
"""Noise of an IMU that reads exactly, because filters divide by it: an ADIS16448 as in sensor.yaml of EuRoC's data set
(Burri et al., 2016, doi 10.1177/0278364915620033)."""


class CloudFacts(NamedTuple):
    """A sensor that scans in rings and columns."""

    name: str
    topic: str
    frame: str
    base_from_sensor: Array
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


class InertialFacts(NamedTuple):
    """An inertial measurement unit."""

    name: str
    topic: str
    base_from_sensor: Array
    rate_hz: float
    noise: InertialNoise
    assumed: bool
    """True: the readings are exact, and the noise is ``ASSUMED_NOISE``."""


class ViewFacts(NamedTuple):
    """A view of a camera."""

    name: str
    topic: str
    """Topic of the raw image after ``image_transport republish``: that of the photograph without /compressed."""
    base_from_optical: Array
    lens: Lens
    width: int
    height: int
    rate_hz: float
    stored: str = "JPEG"
    """Format of its photographs."""


class Facts(NamedTuple):
    """The sensors that a program can use; without one that the bag lacks."""

    cloud: CloudFacts | None
    inertial: InertialFacts | None
    views: tuple[ViewFacts, ...]
    """Left and right of a pair, or a single view."""
    more: tuple[str, ...]
    """Names of sensors of clouds, inertial readings and images that the rig has beside these."""


def read_facts(run: Run) -> Facts:
    """Read the sensors that programs can use: the first of scans, of inertial readings and of images in the bag.

    Raises:
        BagError: /tf_static is missing or does not connect a sensor with base_link, or the bag is damaged.
    """
    run.require(TF_STATIC)
    scanning = [each for each in run.of(Cloud) if isinstance(each.config, ScanningConfig)]
    inertial = run.of(Inertial)
    views = [view for view in first_views(run) if view.has(run.counts, "photo") and run.calibration.has_lens(view.name)]
    used, devices = {view.device for view in views}, dict.fromkeys(v.device for v in run.of(Image, recorded=False))
    more = [each.name for each in run.of(Cloud) if each not in scanning[:1]] + [each.name for each in inertial[1:]]
    return Facts(
        _cloud(run, scanning[0]) if scanning else None,
        _inertial(run, inertial[0]) if inertial else None,
        tuple(_view(run, view) for view in views),
        (*more, *(device for device in devices if views and device not in used)),
    )


def _cloud(run: Run, sensor: Source) -> CloudFacts:
    frame, mount = run.calibration.frame(sensor.name), run.calibration.base_from(sensor.name)
    fields = {field.name: field.datatype for field in run.readings(sensor.name, labelled=False).message(0).fields}
    return CloudFacts(sensor.name, sensor.topic, frame, mount, sensor.config, fields)


def _inertial(run: Run, sensor: Source) -> InertialFacts:
    noise, mount = noise_of(sensor.config), run.calibration.base_from(sensor.name)
    return InertialFacts(sensor.name, sensor.topic, mount, sensor.config.rate_hz, noise or ASSUMED_NOISE, noise is None)


def noise_of(config: Any) -> InertialNoise | None:
    """Noise of an IMU, of the worst axis; None if it reads exactly. What it lacks, as often walks, is assumed."""
    if (signal := config.signal) is None:
        return None
    names = ("noise_density", "random_walk")
    keys = (f"{triad}_{name}" for name in names for triad in ("gyroscope", "accelerometer"))
    figures = (float(np.max(getattr(signal, key, 0.0))) for key in keys)
    return InertialNoise(*(figure or assumed for figure, assumed in zip(figures, ASSUMED_NOISE, strict=True)))


def _view(run: Run, view: Source) -> ViewFacts:
    lens, model = run.calibration.lens(view.name), "pinhole"
    fx, fy, cx, cy = (float(lens.K[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
    coefficients: tuple[float, ...] = ()
    if not lens.is_pinhole:  # some drivers leave out the last coefficients
        model, names = lens.model, COEFFICIENTS.get(lens.model, "").split()
        coefficients = (*lens.D.tolist(), *[0.0] * (len(names) - len(lens.D)))
    return ViewFacts(
        name=view.label,
        topic=view.topic.removesuffix("/compressed"),
        base_from_optical=run.calibration.base_from(view.name),
        lens=Lens(model, fx, fy, cx, cy, coefficients),
        width=lens.width,
        height=lens.height,
        rate_hz=view.config.rate_hz,
        stored=format_of(run, view),
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
    if facts.cloud is None:
        return "no LiDAR"
    head = f"# KISS-ICP: kiss_icp_pipeline --topic {facts.cloud.topic} --config kiss_icp.yaml BAG\n"
    return {"kiss_icp.yaml": head + write_mapping(_filled("kiss_icp", facts))}


def rko_lio(facts: Facts) -> Files | str:
    """RKO-LIO 0.4 (PRBonn/rko_lio a335c17, config.py): mounts in the base frame, here that of the LiDAR."""
    cloud, inertial = facts.cloud, facts.inertial
    if cloud is None or inertial is None:
        return "no LiDAR" if cloud is None else "no IMU"
    pose = transforms.inverse(cloud.base_from_sensor) @ inertial.base_from_sensor
    xyzw = transforms.xyzw_from_wxyz(transforms.quaternion_wxyz_from_rotation(pose[:3, :3]))
    head = f"# RKO-LIO: rko_lio --config rko_lio.yaml --lidar {cloud.topic} --imu {inertial.topic} FOLDER_OF_THE_BAG\n"
    values = _filled("rko_lio", facts, cloud_from_inertial=_numbers([*xyzw, *pose[:3, 3]]))
    return {"rko_lio.yaml": head + write_mapping(values)}


def lio_sam(facts: Facts) -> Files | str:
    """LIO-SAM (TixiaoShan/LIO-SAM 0be1fbe, config/params.yaml, include/utility.h, src/imuPreintegration.cpp).

    ``extrinsicRot`` turns readings of the IMU into the LiDAR's axes, and so does ``extrinsicRPY`` for the orientation;
    ``extrinsicTrans`` is the IMU's position in the LiDAR's frame: the LiDAR's pose is multiplied by it from the right.
    """
    cloud, inertial = facts.cloud, facts.inertial
    if cloud is None or inertial is None:
        return "no LiDAR" if cloud is None else "no IMU"
    if getattr(cloud.config, "pattern", None) is not None:
        return "it orders points by ring and azimuth, which a Livox does not have"
    if cloud.has_short_ring and cloud.has_t:
        sensor = "ouster"
    elif not cloud.has_short_ring and (cloud.has_time or not cloud.has_t):
        sensor = "velodyne"
    else:
        return "it reads a ring of 8 bits with t, or of 16 bits with time; set time_field: time or point_fields: ouster"
    values = _filled(
        "lio_sam",
        facts,
        sensor=sensor,
        gravity=GRAVITY,
        **_rotation_and_position(transforms.inverse(cloud.base_from_sensor) @ inertial.base_from_sensor),
    )
    head = "# LIO-SAM: config/params.yaml. Its other keys keep their defaults.\n" + _NO_NOISE * inertial.assumed
    return {"lio_sam.yaml": head + write_mapping(values)}


def fast_lio2(facts: Facts) -> Files | str:
    """FAST-LIO2 (hku-mars/FAST_LIO 7cc4175, config/*.yaml, src/preprocess.cpp): the LiDAR's pose in the IMU's frame.

    Its clouds must be PointCloud2: those of a Livox are read by their ``t``, as an Ouster's. Variances are those of a
    reading, and of the bias's change over the time between two, as its prediction multiplies both by that time.
    """
    cloud, inertial = facts.cloud, facts.inertial
    if cloud is None or inertial is None:
        return "no LiDAR" if cloud is None else "no IMU"
    kind, unit = (_OUSTER, _NANOSECOND) if cloud.has_t else (_MARSIM, _SECOND)
    if cloud.has_time:
        kind, unit = _VELODYNE, _SECOND
    noise = inertial.noise
    densities = (noise.accelerometer, noise.gyroscope, noise.accelerometer_walk, noise.gyroscope_walk)
    pairs = zip(_LEAST_VARIANCE.items(), densities, strict=True)
    values = _filled(
        "fast_lio2",
        facts,
        kind=kind,
        unit=unit,
        rate=round(cloud.config.rate_hz),
        fov=90.0 if getattr(cloud.config, "pattern", None) == "avia" else 180.0,
        **{key: max(density * density * inertial.rate_hz, least) for (key, least), density in pairs},
        **_rotation_and_position(transforms.inverse(inertial.base_from_sensor) @ cloud.base_from_sensor),
    )
    head = "# FAST-LIO2: a file for its folder config; *_cov are at least those of its own files.\n"
    return {"fast_lio2.yaml": head + _NO_NOISE * inertial.assumed + write_mapping(values)}


def _filled(template: str, facts: Facts, **values: Any) -> dict[str, Any]:
    """Return the values of a template, whose ``$names`` stand for ``values``, or attributes of facts."""
    text = package_data("fieldtruth.exporters", f"slam/{template}.yaml")
    found: dict[str, Any] = filled(text, facts._asdict() | values)
    return found


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
    if not facts.views or facts.inertial is None:
        return "no IMU" if facts.views else "no camera"
    count = len(facts.views)
    views: dict[str, Any] = {}
    for k, view in enumerate(facts.views):
        lens = kalibr_lens(view.lens)
        if isinstance(lens, str):
            return f"it does not have {lens}"
        views[f"cam{k}"] = _filled(
            "open_vins_view",
            facts,
            pose=_inertial_from_view(facts.inertial, view).tolist(),
            overlaps=[1 - k] if count == 2 else [],
            resolution=[view.width, view.height],
            topic=view.topic,
            **lens,
        )
    rate = min(21.0, facts.views[0].rate_hz + 1.0)
    contents = {
        "estimator": _filled("open_vins_estimator", facts, is_pair=count == 2, count=count, gravity=GRAVITY, rate=rate),
        "inertial": _filled("open_vins_inertial", facts),
        "views": views,
    }
    texts = {_TEXTS["open_vins"][name]: write_mapping(values) for name, values in contents.items()}
    return {f"open_vins/{name}": _YAML + _ITEM.sub(r"\1  - ", text) for name, text in texts.items()}


def orb_slam3(facts: Facts) -> Files | str:
    """ORB-SLAM3 1.0 (UZ-SLAMLab/ORB_SLAM3 1464d8f, src/Settings.cc).

    ``IMU.T_b_c1`` takes points of the left camera to the IMU, ``Stereo.T_c1_c2`` those of the right camera to the left.
    Numbers that it reads as real have a decimal point.
    """
    if not facts.views:
        return "no camera"
    left, right = facts.views[0], facts.views[-1]
    if left.lens.model not in _ORB_LENSES:
        return f"it does not have the lens {left.lens.model}"
    values: dict[str, Any] = {"File.version": '"1.0"', "Camera.type": f'"{_ORB_LENSES[left.lens.model]}"'}
    for number, view in enumerate(facts.views, start=1):
        values |= _orb_view(f"Camera{number}", view)
    values |= {"Camera.width": left.width, "Camera.height": left.height, "Camera.fps": max(round(left.rate_hz), 1)}
    values["Camera.RGB"] = 1
    if len(facts.views) == 2:
        left_from_right = transforms.inverse(left.base_from_optical) @ right.base_from_optical
        values |= {"Stereo.ThDepth": 60.0, "Stereo.T_c1_c2": _opencv_matrix(left_from_right)}
    if facts.inertial is not None:
        pose, rate = _opencv_matrix(_inertial_from_view(facts.inertial, left)), float(facts.inertial.rate_hz)
        values |= _filled("orb_slam3_inertial", facts, pose=pose, rate=rate)
    lines = "".join(f"{key}: {value}\n" for key, value in (values | _filled("orb_slam3", facts)).items())
    kind = _TEXTS["orb_kinds"][len(facts.views) - 1] + "-Inertial" * (facts.inertial is not None)
    return {"orb_slam3.yaml": f"{_YAML}# ORB-SLAM3, {kind}: it uses its names for topics, see README.txt\n{lines}"}


def _orb_view(name: str, view: ViewFacts) -> dict[str, Any]:
    lens, values = view.lens, dict[str, Any]()
    keys, figures = ["fx", "fy", "cx", "cy"], (lens.fx, lens.fy, lens.cx, lens.cy, *lens.coefficients)
    if lens.model == "equidistant":
        keys += ["k1", "k2", "k3", "k4"]
        values = {f"{name}.overlappingBegin": 0, f"{name}.overlappingEnd": view.width}
    else:
        keys += ["k1", "k2", "p1", "p2", "k3"]
        figures += (0.0,) * (9 - len(figures))
    return dict(zip((f"{name}.{key}" for key in keys), figures, strict=True)) | values


def _opencv_matrix(matrix: Array) -> str:
    return f"!!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: f\n   data: {_numbers(matrix)}"


def _inertial_from_view(inertial: InertialFacts, view: ViewFacts) -> Array:
    matrix = transforms.inverse(inertial.base_from_sensor) @ view.base_from_optical
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
        "cloud": facts.cloud and facts.cloud.base_from_sensor,
        "inertial": facts.inertial and facts.inertial.base_from_sensor,
        "views": facts.views[0].base_from_optical if facts.views else None,
    }
    names = [_TEXTS["truths"][what] for what, mount in mounts.items() if mount is not None]
    for name, mount in zip(names, (each for each in mounts.values() if each is not None), strict=True):
        (target / name).write_text(tum_text(run.trajectory, mount), encoding="ascii")
    return f"true poses of the sensors in the world, for evo: {', '.join(names)}\n"


def _readme(run: Run, facts: Facts, made: Mapping[str, Files | str], left_out: str, truths: str) -> str:
    used = {
        "cloud": facts.cloud and f"{facts.cloud.name}, {facts.cloud.topic}",
        "inertial": facts.inertial and f"{facts.inertial.name}, {facts.inertial.topic}",
        "views": ", ".join(view.name for view in facts.views),
        "more": ", ".join(facts.more),
    }
    sensors = "".join(f"{_TEXTS['used'][what]}: {value}\n" for what, value in used.items() if value)
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
    remaps += [f"/imu:={facts.inertial.topic}"] if facts.inertial else []
    words = {"formats": " and ".join(sorted({view.stored for view in facts.views})), "lines": lines}
    return f"{_TEXTS['republish']}{_TEXTS['orb_topics']}".format(**words, remaps=" ".join(remaps))
