# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What the data card says about the sensors of a rig; a sensor is named if there are several of its kind."""

from fieldtruth.core.lenses import FLAT
from fieldtruth.core.readings import Cloud, Reading
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import TRUTH, SensorConfig
from fieldtruth.experiment.sensor_families import ImagingConfig, ScanningConfig


def sensor_lines(rig: Rig) -> list[str]:
    """Figures of the sensors that see, of others where there are several of a kind, and what is not ideal."""
    seen = [_figures(each, rig) for config in (ImagingConfig, ScanningConfig) for each in rig.enabled(config)]
    lines = seen or ["- Neither cameras nor LiDAR were enabled."]
    lines += [_figures(each, rig) for each in rig.in_order() if not each.sees and len(_alike(each, rig)) > 1]
    return lines + [_real(sensor) for sensor in rig.in_order() if not sensor.is_ideal]


def _figures(sensor: SensorConfig, rig: Rig) -> str:
    return f"- {_named(sensor, rig)}: {sensor.summary()}"


def _alike(sensor: SensorConfig, rig: Rig) -> list[SensorConfig]:
    """Sensors of a rig whose readings are of the same type."""
    return [each for each in rig.in_order() if each.gives is sensor.gives]


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


def note_lines(rig: Rig, reading: type[Reading]) -> list[str]:
    """How the sensors whose readings are of a type take them."""
    lines = []
    for sensor in (each for each in rig.in_order() if issubclass(each.gives, reading)):
        named = f"`{sensor.name}`" if len(_alike(sensor, rig)) > 1 else f"The {sensor.noun}"
        lines += [f"- {note}" for note in sensor.notes(named)]
    return lines


def cloud_frames(rig: Rig) -> str:
    """Sentence about the frames of the clouds; empty for a rig without LiDAR."""
    frames = [f"`{sensor.frame}`" for sensor in rig.sensors if isinstance(sensor, ScanningConfig)]
    if not frames:
        return ""
    return f"{', '.join(frames)}: frame{'s' * (len(frames) > 1)} of the points, x forward, y left, z up. "


def ray_depths(rig: Rig) -> str:
    """Phrase about the cameras whose depth is along the ray: those that can see beyond 180 degrees."""
    names = [f"`{camera.name}`" for camera in rig.enabled(ImagingConfig) if camera.lens.model not in FLAT]
    return f", of {', '.join(names)} along the ray" if names else ""


def frame_content(rig: Rig) -> str:
    """What one separate frame consists of."""
    views, scanners = rig.imagers, rig.enabled(ScanningConfig)
    is_pair = len(rig.enabled(ImagingConfig)) == 1 and len(views) == 2
    images = "a stereo pair" if is_pair else f"{len(views)} images" if len(views) > 1 else "an image"
    clouds = f"{len(scanners)} clouds" if len(scanners) > 1 else "a cloud"
    return " and ".join([images] * bool(views) + [clouds] * bool(scanners)) or "a pose"


def _named(sensor: SensorConfig, rig: Rig) -> str:
    noun = sensor.noun or sensor.kind
    words = f"{noun[:1].upper()}{noun[1:]}"
    if sensor.gives is Cloud and sensor.model:
        words = f"{words} {sensor.model}"
    return f"{words} `{sensor.name}`" if len(_alike(sensor, rig)) > 1 else words
