# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What the data card says about the sensors of a rig; a sensor is named if there are several of its kind."""

from collections.abc import Sequence
from typing import Final

from fieldtruth.core.lenses import FLAT, fields_of_view
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import TRUTH, SensorConfig
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.lens_config import LensConfig
from fieldtruth.sensors.camera.stereo_config import StereoConfig
from fieldtruth.sensors.lidar.config import LidarConfig

_SAMPLING: Final = {
    "mean": "reads means over the interval that ends at the stamp, from the motion at 1 kHz: turns about all\n"
    "  axes are added up as rotations, and the specific force is expressed in `{frame}` at the stamp.",
    "instant": "reads the last millisecond before each stamp: what shakes faster than half its rate appears\n"
    "  as slower motion.",
}
_SHORT: Final = {"mean": "means between stamps", "instant": "the last millisecond before each stamp"}


def sensor_lines(rig: Rig) -> list[str]:
    """Figures of the cameras and LiDARs, and of IMUs and receivers if there are several."""
    lines = [_camera(each, rig) for each in rig.cameras] + [_lidar(each, rig) for each in rig.lidars]
    lines = lines or ["- Neither cameras nor LiDAR were enabled."]
    if len(rig.imus) > 1:
        lines += [f"- IMU `{i.name}`: {i.rate_hz:g} Hz in `{i.frame}`, {_SHORT[i.sampling]}." for i in rig.imus]
    if len(rig.antennas) > 1:
        lines += [f"- GNSS receiver `{a.name}`: {a.rate_hz:g} Hz, antenna at `{a.frame}`." for a in rig.antennas]
    return lines + [_real(sensor) for sensor in rig.in_order() if not sensor.is_ideal]


def _real(sensor: SensorConfig) -> str:
    """What makes a sensor other than ideal."""
    what = ["errors of a real sensor (`signal` in experiment.yaml)"] * (sensor.signal is not None)
    if (clock := sensor.clock) is not None:
        what.append(
            f"a clock of its own (offset {clock.offset_s:g} s, drift {clock.drift_ppm:g} ppm, "
            f"jitter {clock.jitter_s:g} s; {clock.drop_share:.1%} of its readings are lost); "
            "stamps in the bag are the true time"
        )
    truth = [topic.name for topic in sensor.topics() if topic.name.endswith(TRUTH)]
    ideal = f". Ideal readings: {', '.join(f'`{name}`' for name in truth)}" if truth else ""
    return f"- `{sensor.name}` has {' and '.join(what)}{ideal}."


def imu_lines(rig: Rig) -> list[str]:
    """How each IMU takes its readings."""
    return [
        f"- {f'`{imu.name}`' if len(rig.imus) > 1 else 'The IMU'} {_SAMPLING[imu.sampling].format(frame=imu.frame)}"
        for imu in rig.imus
    ]


def odometry_lines(rig: Rig) -> list[str]:
    """What the error of wheel odometry is, if there is one."""
    if rig.wheel_odometry is None:
        return []
    return [
        f"- Wheel odometry (`{rig.wheel_odometry.topic}`) is exact in what it measures, the angles of the wheels: all "
        "of its error is slip and\n  skidding. Its covariances are the constants of a real Husky's driver. The frame "
        "`odom` is not in `/tf`."
    ]


def cloud_frames(rig: Rig) -> str:
    """Sentence about the frames of the clouds; empty for a rig without LiDAR."""
    frames = [f"`{sensor.frame}`" for sensor in rig.sensors if isinstance(sensor, LidarConfig)]
    if not frames:
        return ""
    return f"{', '.join(frames)}: frame{'s' * (len(frames) > 1)} of the points, x forward, y left, z up. "


def ray_depths(rig: Rig) -> str:
    """Phrase about the cameras whose depth is along the ray: those that can see beyond 180 degrees."""
    names = [f"`{camera.name}`" for camera in rig.cameras if camera.lens.model not in FLAT]
    return f", of {', '.join(names)} along the ray" if names else ""


def frame_content(rig: Rig) -> str:
    """What one separate frame consists of."""
    images = "a stereo pair" if _is_pair(rig) else f"{len(rig.imagers)} images" if len(rig.imagers) > 1 else "an image"
    clouds = f"{len(rig.lidars)} clouds" if len(rig.lidars) > 1 else "a cloud"
    return " and ".join([images] * bool(rig.cameras) + [clouds] * bool(rig.lidars)) or "a pose"


def _is_pair(rig: Rig) -> bool:
    return len(rig.cameras) == 1 and isinstance(rig.cameras[0], StereoConfig)


def _named(kind: str, sensor: SensorConfig, others: Sequence[SensorConfig]) -> str:
    return f"{kind} `{sensor.name}`" if len(others) > 1 else kind


def _camera(camera: CameraConfig, rig: Rig) -> str:
    angles = camera.horizontal_fov_deg, camera.vertical_fov_deg
    if camera.lens.fx is not None:
        angles = fields_of_view(camera.projection, camera.width, camera.height)
    kind, whose, baseline = "Camera", "Its", ""
    if isinstance(camera, StereoConfig):
        kind, whose, baseline = "Stereo camera", "Their", f", baseline {camera.baseline:g} m"
    lens = "" if camera.lens == LensConfig() else f" {whose} lens is `{camera.lens.model}`; CameraInfo describes it."
    return (
        f"- {_named(kind, camera, rig.cameras)}: {camera.width} x {camera.height}, "
        f"{angles[0]:g} x {angles[1]:g} deg{baseline}. "
        f"Photographs are JPEG (quality {camera.jpeg_quality}); tag, depth and instance images are lossless.{lens}"
    )


def _lidar(lidar: LidarConfig, rig: Rig) -> str:
    timing = "columns are measured in turn over one period" if lidar.spinning else "all rays leave at the stamp"
    elevations = lidar.elevations_deg
    beams = f" (elevations {min(elevations):g} to {max(elevations):g} deg)" if elevations else ""
    name = _named(f"LiDAR {lidar.model}" if lidar.model else "LiDAR", lidar, rig.lidars)
    field = f"360 x {lidar.vertical_fov_deg:g} deg{beams}" if lidar.pattern is None else f"pattern {lidar.pattern}"
    return (
        f"- {name}: {lidar.columns} x {lidar.rings} rays, {field}, "
        f"{lidar.min_range:g} to {lidar.max_range:g} m; {timing}; only returns are stored."
    )
