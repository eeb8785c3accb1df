# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The data card of a run, DATASET.md: contents, conventions and limits of the data.

Its words about robot, environment, season, light and weather are those of the experiment; other cards use them, too.
"""

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
from fieldtruth.core.lenses import FLAT
from fieldtruth.core.readings import Cloud, Inertial, Odometry, Reading
from fieldtruth.drive.track import Track
from fieldtruth.experiment.catalogue import ROBOTS
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.experiment.sensor_config import TRUTH, SensorConfig
from fieldtruth.experiment.sensor_families import ImagingConfig, ScanningConfig
from fieldtruth.world.model import World

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
    name = str(ROBOTS[robot.model]["description"]).partition(":")[0].removesuffix(" A200")
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
        tf=_TURNING if rig.reports_wheels else _FIXED,
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
    imus = "\n".join(note_lines(experiment.rig, Inertial))
    if experiment.drive is not None:
        noise = ", and the IMU reads their noise" if imus else ""
        return f"- The poses are those of the track file: no physics limits them{noise}.\n{imus}".rstrip()
    odometry = "\n".join(note_lines(experiment.rig, Odometry))
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
