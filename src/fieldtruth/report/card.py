# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The data card of a run, DATASET.md: contents, conventions and limits of the data.

Its words about robot, environment, season, light and weather are those of the experiment; other cards use them, too.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import numpy as np

import fieldtruth
from fieldtruth.bag.file import TRACK
from fieldtruth.bag.messages import EARTH, fixed_transforms
from fieldtruth.bag.topics import in_namespace, latches_objects, objects_topic, topics_of_run
from fieldtruth.core import transforms
from fieldtruth.core.classes import NO_RETURN
from fieldtruth.core.geodesy import Origin
from fieldtruth.core.lenses import FLAT
from fieldtruth.core.readings import Cloud, Image, Inertial, Odometry, Reading
from fieldtruth.core.templates import templates
from fieldtruth.drive.track import Track
from fieldtruth.experiment.catalogue import ROBOTS
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.environment_file import CENTRE, files_of
from fieldtruth.experiment.imaging_config import ImagingConfig
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.experiment.sensor_config import TRUTH, SensorConfig
from fieldtruth.world.model import World

_TEMPLATES: Final = templates("fieldtruth.report")


def robot_title(robot: RobotConfig) -> str:
    """Return the robot with its article: that of its model, or one with figures of its own."""
    name = str(ROBOTS[robot.model]["description"]).partition(":")[0].removesuffix(" A200")
    if name.startswith("A robot"):
        return f"{robot.drive.replace('_', '-')} robot of {robot.mass:g} kg"
    return name if robot == RobotConfig(model=robot.model) else f"robot with figures other than a {name}'s"


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
    environments = _list(e.world_name for e in experiments)
    seasons = _list(str(e.layout.get("season", "summer")) for e in experiments)
    light = _list(_light(e.light) for e in experiments)
    weather = _list(", ".join([e.weather.text, *([e.wind.text] if e.wind else [])]) for e in experiments)
    return (
        f"Vegetation, relief and ground follow models of Central European landscapes: {environments}, in {seasons}, "
        f"with light of {light} and {weather}; all others are missing.{_maps(experiments)}"
    )


def _maps(experiments: Sequence[Experiment]) -> str:
    """Return a sentence about the maps of sites, with a blank before it; empty without a site."""
    sites = [e.layout for e in experiments if CENTRE in e.layout]
    if not sites:
        return ""
    files = _list(path.name for layout in sites for _, path in files_of(layout))
    source = " Parts are © OpenStreetMap contributors, under the ODbL." * any("map" in layout for layout in sites)
    return f" Sites follow maps of real landscapes ({files or 'none'}).{source}"


def _light(light: LightConfig) -> str:
    words = f"preset {light.preset}"
    unused = {"latitude", "longitude"} if light.date is None else set()
    own = light.model_dump(exclude={"preset", *unused}, exclude_defaults=True)
    return words + f" with own {', '.join(own)}" * bool(own)


def _list(words: Iterable[str]) -> str:
    *others, last = dict.fromkeys(words)
    return f"{', '.join(others)} and {last}" if others else last


def sensor_lines(rig: Rig) -> list[str]:
    """Figures of the sensors that see, cameras first, of others where several are alike, and what is not ideal."""
    seen = sorted(
        (each for each in rig.enabled(SensorConfig) if each.sees), key=lambda each: not issubclass(each.gives, Image)
    )
    lines = [_figures(each, rig) for each in seen] or ["- No sensor that sees was enabled."]
    lines += [_figures(each, rig) for each in rig.in_order() if not each.sees and len(_alike(each, rig)) > 1]
    return lines + [_real(sensor) for sensor in rig.in_order() if not sensor.is_ideal]


def _figures(sensor: SensorConfig, rig: Rig) -> str:
    words = sensor.summary() or sensor.figures()
    return f"- {_named(sensor, rig)}" + f": {words}" * (words != "-")


def _alike(sensor: SensorConfig, rig: Rig) -> list[SensorConfig]:
    """Sensors of a rig whose readings are of the same type."""
    return [each for each in rig.in_order() if each.gives is sensor.gives]


def _real(sensor: SensorConfig) -> str:
    """Name the errors and the clock of a sensor that is not ideal."""
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
    """Sentence about the frames of the clouds; empty for a rig without any."""
    frames = [f"`{each.outputs()[0].frame}`" for each in rig.sensors if issubclass(each.gives, Cloud)]
    if not frames:
        return ""
    return f"{', '.join(frames)}: frame{'s' * (len(frames) > 1)} of the points, x forward, y left, z up. "


def ray_depths(rig: Rig) -> str:
    """Phrase about the cameras whose depth is along the ray: those that can see beyond 180 degrees."""
    names = [f"`{each.name}`" for each in rig.enabled(ImagingConfig) if each.lens.model not in FLAT]
    return f", of {', '.join(names)} along the ray" if names else ""


def frame_content(rig: Rig) -> str:
    """Name the readings of one separate frame."""
    views, scanners = rig.imagers, rig.giving(Cloud)
    is_pair = len(rig.enabled(ImagingConfig)) == 1 and len(views) == 2
    images = "a stereo pair" if is_pair else f"{len(views)} images" if len(views) > 1 else "an image"
    clouds = f"{len(scanners)} clouds" if len(scanners) > 1 else "a cloud"
    return " and ".join([images] * bool(views) + [clouds] * bool(scanners)) or "a pose"


def _named(sensor: SensorConfig, rig: Rig) -> str:
    words = f"{sensor.noun[:1].upper()}{sensor.noun[1:]}"
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
    rig, own = experiment.rig, experiment.namespace
    topics = topics_of_run(experiment, latched=latches_objects(experiment, len(world.instances)))
    return _TEMPLATES.get_template("card.md.jinja").render(
        experiment=experiment,
        robot=rig.robot,
        title=robot_title(rig.robot),
        world=world,
        track=track,
        track_file=TRACK,
        length=np.linalg.norm(np.diff(track.motion.position, axis=0), axis=1).sum(),
        content=frame_content(rig),
        version=fieldtruth.__version__,
        counts=counts,
        topics=[topic._replace(name=in_namespace(topic.name, own)) for topic in topics],
        objects_topic=in_namespace(objects_topic([topic.name for topic in topics]), own),
        sensors=[*sensor_lines(rig), *measured],
        rays=ray_depths(rig),
        clouds=cloud_frames(rig),
        classes=world.classes,
        no_return=NO_RETURN,
        origin=_origin(world.origin),
        frames=_frames(rig, world.origin),
        moves=_moves([experiment]),
        odometry=note_lines(rig, Odometry),
        inertial=note_lines(rig, Inertial),
    )


def card_part(name: str, experiments: Sequence[Experiment]) -> str:
    """Return a part of the card of runs as Markdown: ``limits`` or ``licence``."""
    return _TEMPLATES.get_template(f"card_{name}.md.jinja").render(moves=_moves(experiments)).rstrip()


def _moves(experiments: Sequence[Experiment]) -> str:
    """Return a sentence about what moves in experiments beside the robot of each."""
    moving = dict.fromkeys(name for each in experiments for name in each.moving)
    if not moving:
        return "Only the robot moves: there is no wind, and there are no people, animals or vehicles."
    return f"Nothing moves beside the robot but what `experiment.yaml` has: {_list(moving)}."


def _origin(origin: Origin) -> str:
    latitude, longitude, height = origin
    north, east = "NS"[latitude < 0], "EW"[longitude < 0]
    return f"{abs(latitude):.9g} deg {north}, {abs(longitude):.9g} deg {east}, {height:g} m"


def _frames(rig: Rig, origin: Origin) -> list[tuple[str, ...]]:
    """Parent, child, position and quaternion of each fixed frame."""
    rows: list[tuple[str, ...]] = []
    for (parent, child), parent_from_child in fixed_transforms(rig, origin).items():
        wxyz = transforms.quaternion_wxyz_from_rotation(parent_from_child[:3, :3])
        xyzw = transforms.xyzw_from_wxyz(wxyz).round(9)
        digits = ".3f" if parent == EARTH else ".6g"
        xyz = ", ".join(f"{value:{digits}}" for value in parent_from_child[:3, 3] + 0.0)
        rows.append((parent, child, xyz, ", ".join(f"{value:.6g}" for value in xyzw + 0.0)))
    return rows
