# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The data card of a run, DATASET.md: contents, conventions and limits of the data."""

from collections.abc import Mapping, Sequence
from importlib import resources
from string import Template
from typing import Final

import numpy as np

import fieldtruth
from fieldtruth.bag.robot_messages import fixed_transforms
from fieldtruth.bag.run import TRACK
from fieldtruth.bag.topics import latches_objects, objects_topic, topics_of_run
from fieldtruth.core import frames
from fieldtruth.core.classes import CLASSES, NO_RETURN, Label
from fieldtruth.core.readings import Inertial, Odometry
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.report.card_sensors import (
    cloud_frames,
    frame_content,
    note_lines,
    ray_depths,
    sensor_lines,
)
from fieldtruth.report.setting import body_words, robot_title
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
        wxyz = frames.quaternion_wxyz_from_rotation(parent_from_child[:3, :3])
        xyzw = ", ".join(f"{value:.6g}" for value in frames.xyzw_from_wxyz(wxyz).round(9) + 0.0)
        rows.append(f"| `{parent}` | `{child}` | {xyz} | {xyzw} |")
    return rows
