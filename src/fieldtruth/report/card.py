# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The data card of a run, DATASET.md: contents, conventions and limits of the data."""

from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from string import Template
from typing import Final

import numpy as np

import fieldtruth
from fieldtruth.bag.messages import fixed_transforms
from fieldtruth.bag.run import TRACK
from fieldtruth.bag.topics import latches_objects, objects_topic, topics_of_run
from fieldtruth.core import transforms
from fieldtruth.core.classes import CLASSES, NO_RETURN, Label
from fieldtruth.core.lenses import FLAT, fields_of_view
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.experiment.robot_models import robot_data
from fieldtruth.experiment.sensor_config import TRUTH, SensorConfig
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.lens_config import LensConfig
from fieldtruth.sensors.camera.stereo_config import StereoConfig
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.world.model import World

_SAMPLING: Final = {
    "mean": "reads means over the interval that ends at the stamp, from the motion at 1 kHz: turns about all\n"
    "  axes are added up as rotations, and the specific force is expressed in `{frame}` at the stamp.",
    "instant": "reads the last millisecond before each stamp: what shakes faster than half its rate appears\n"
    "  as slower motion.",
}
_SHORT: Final = {"mean": "means between stamps", "instant": "the last millisecond before each stamp"}
_FOLLOWED: Final = (
    "The sensors of the rig follow the poses of a track file, without physics and wheels; `base_link` and the model "
    "`husky` are what follows it, for"
)
_STANDING: Final = (
    "Separate frames, each {content}: the robot stands on free ground at any heading, tilted and\n"
    "raised at random. There is no motion, so there are no readings of IMU, GNSS and wheels, and all velocities are 0;"
)
_FIXED: Final = "`/tf` has the pose of `base_link` in the world"
_TURNING: Final = f"{_FIXED} and those of the wheels in `base_link`"


def robot_title(robot: RobotConfig) -> str:
    """Return the robot with its article: that of its model, or one with figures of its own."""
    name = str(robot_data(robot.model)["description"]).partition(":")[0].removesuffix(" A200")
    if name.startswith("A robot"):
        return f"{robot.drive.replace('_', '-')} robot of {robot.mass:g} kg"
    return name if robot == RobotConfig(model=robot.model) else f"robot with figures other than a {name}'s"


def body_words(robot: RobotConfig) -> dict[str, str]:
    """Return the words of the card's part about physics that depend on the robot."""
    return {
        "wheels": "four wheels" if robot.caster is None else "two driven wheels and a caster",
        "as_real": ", as on the real one" if robot.model == "husky" else "",
        "mass": f"{robot.mass:g}",
        "torque": f"{robot.max_torque:g}",
    }


def collection_of(experiments: Sequence[Experiment]) -> str:
    """Return a sentence about how the sensors moved in experiments: which robots drove, stood or followed poses."""
    groups = {
        "drives": [e for e in experiments if e.frames is None and e.drive is None],
        "stands at random poses": [e for e in experiments if e.frames is not None and e.drive is None],
        "follows given poses, without physics,": [e for e in experiments if e.drive is not None],
    }
    parts = [f"a {_list(robot_title(e.rig.robot) for e in made)} {verb}" for verb, made in groups.items() if made]
    return f"{'; '.join(parts)} in generated natural environments"


def conditions_of(experiments: Sequence[Experiment]) -> str:
    """Return a sentence about the environments, seasons, light and weather that experiments have."""
    environments = _list(e.environment for e in experiments)
    seasons = _list(str(e.layout.get("season", "summer")) for e in experiments)
    light, weather = _list(_light(e.light) for e in experiments), _list(e.weather.text for e in experiments)
    return (
        f"Vegetation, relief and ground follow models of Central European landscapes: {environments}, in {seasons}, "
        f"with light of {light} and {weather}; all others are missing."
    )


def _light(light: LightConfig) -> str:
    words = f"preset {light.preset}"
    own = light.model_dump(exclude={"preset"}, exclude_defaults=True)
    return words + f" with own {', '.join(own)}" * bool(own)


def _list(words: Iterable[str]) -> str:
    *others, last = dict.fromkeys(words)
    return f"{', '.join(others)} and {last}" if others else last


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


def data_card(
    experiment: Experiment, world: World, track: Track, counts: Mapping[str, int], measured: Sequence[str] = ()
) -> str:
    """Return the card of a run as Markdown with the front matter of data set hubs.

    Args:
        experiment: the executed experiment.
        world: its world.
        track: the drive.
        counts: number of messages by topic.
        measured: lines about what sensors have measured.
    """
    rig = experiment.rig
    return _template("card.md").substitute(
        name=experiment.name,
        description=f"{experiment.description}\n" if experiment.description else "",
        motion=_motion(experiment, track),
        tf=_TURNING if rig.wheel_odometry is not None else _FIXED,
        physics=_physics(experiment),
        track="" if experiment.drive is None else f", with the poses in `{TRACK}`",
        environment=experiment.environment,
        size="{:g} x {:g}".format(*world.size),
        objects=len(world.instances),
        version=fieldtruth.__version__,
        seed=experiment.seed,
        topics="\n".join(_topics(experiment, counts, latches_objects(experiment, len(world.instances)))),
        objects_topic=objects_topic(counts),
        sensors="\n".join([*sensor_lines(rig), *measured]),
        rays=ray_depths(rig),
        clouds=cloud_frames(rig),
        classes="\n".join(_classes()),
        frames="\n".join(_frames(rig)),
        limits=card_part("limits"),
        licence=card_part("licence"),
    )


def card_part(name: str) -> str:
    """Return a part of the card that is the same for all runs, as Markdown: ``limits`` or ``licence``."""
    return _template(f"card_{name}.md").substitute().rstrip()


def _motion(experiment: Experiment, track: Track) -> str:
    if track.is_frames:
        return f"{_STANDING.format(content=frame_content(experiment.rig))} {len(track.motion.stamps_ns)} frames of"
    length = np.linalg.norm(np.diff(track.motion.position, axis=0), axis=1).sum()
    subject = f"A simulated {robot_title(experiment.rig.robot)} drives" if experiment.drive is None else _FOLLOWED
    return f"{subject} {length:.2f} m in {track.duration_s:.3f} s through"


def _template(name: str) -> Template:
    return Template(resources.files("fieldtruth.report").joinpath(name).read_text(encoding="utf-8"))


def _physics(experiment: Experiment) -> str:
    if experiment.frames is not None:
        return (
            "- Nothing moves: poses at successive stamps are far apart, and stamps only number them, 0.1 s apart. The\n"
            "  robot stands on four points of the ground before it is tilted and raised."
        )
    imus = "\n".join(imu_lines(experiment.rig))
    if experiment.drive is not None:
        noise = ", and the IMU reads their noise" if imus else ""
        return f"- The poses are those of the track file: no physics limits them{noise}.\n{imus}".rstrip()
    odometry = "\n".join(odometry_lines(experiment.rig))
    physics = _template("card_physics.md").substitute(body_words(experiment.rig.robot)).rstrip()
    return "\n".join(filter(None, (physics, odometry, imus)))


def _topics(experiment: Experiment, counts: Mapping[str, int], latched: bool) -> list[str]:
    rows = ["| topic | type | Hz | messages |", "|---|---|---|---|"]
    for topic in topics_of_run(experiment, latched=latched):
        rate = "once" if topic.rate_hz is None else f"{topic.rate_hz:g}"
        rows.append(
            f"| `{topic.name}` | {topic.msgtype.replace('/msg/', '/')} | {rate} | {counts.get(topic.name, 0)} |"
        )
    return rows


def _classes() -> list[str]:
    rows = ["| id | class | RGB | |", "|---|---|---|---|"]
    for label, name, rgb in CLASSES:
        if label is not Label.VOID and rgb is not None:
            rows.append(
                f"| {int(label)} | {name} | {rgb[0]} {rgb[1]} {rgb[2]} | {'images only' * (label in NO_RETURN)} |"
            )
    return rows


def _frames(rig: Rig) -> list[str]:
    rows = ["| parent | child | x, y, z [m] | quaternion x, y, z, w |", "|---|---|---|---|"]
    for (parent, child), parent_from_child in fixed_transforms(rig).items():
        xyz = ", ".join(f"{value:.6g}" for value in parent_from_child[:3, 3] + 0.0)
        wxyz = transforms.quaternion_wxyz_from_rotation(parent_from_child[:3, :3])
        xyzw = ", ".join(f"{value:.6g}" for value in transforms.xyzw_from_wxyz(wxyz).round(9) + 0.0)
        rows.append(f"| `{parent}` | `{child}` | {xyz} | {xyzw} |")
    return rows
