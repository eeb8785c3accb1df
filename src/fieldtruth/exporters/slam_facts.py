# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What SLAM programs must know of a rig: topics, fields, figures and mounts of one LiDAR, one IMU and one camera.

Of a rig with several sensors these are the first LiDAR, the first IMU and the first stereo pair, without a pair the
first camera. Mounts, lenses and fields of points are those of the messages in the bag.
"""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import TF_STATIC, Source
from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Cloud, Image, Inertial
from fieldtruth.exporters.sequences import first_views

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
