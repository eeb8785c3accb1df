# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""An experiment with a track file: its motion in a world, and the form in which it is stored beside the bag."""

import warnings

from fieldtruth.bag.run import TRACK
from fieldtruth.bag.track_file import TrackFile
from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.drive.given_motion import check_motion, motion_along, track_along
from fieldtruth.drive.track import Track, sweep_steps
from fieldtruth.experiment.config import Experiment
from fieldtruth.world.model import World


def with_stored_track(experiment: Experiment, file: TrackFile) -> Experiment:
    """Return the experiment as it is written beside the bag, where track.csv holds the poses of the track file.

    What moves along a track file may have no wheels, so there is no wheel odometry.
    """
    assert experiment.drive is not None
    drive = experiment.drive.model_copy(update={"track": TRACK, "topic": None, "pose_of": file.frame})
    return without_wheels(experiment).model_copy(update={"drive": drive})


def without_wheels(experiment: Experiment) -> Experiment:
    """Return the experiment without wheel odometry."""
    rig = experiment.rig.with_each(lambda sensor: {"enabled": False} if sensor.needs_wheels else {})
    return experiment.model_copy(update={"rig": rig})


def follow_track(experiment: Experiment, world: World, file: TrackFile) -> Track:
    """Return the motion of the rig along the poses of a track file.

    Warns of a long time without a pose.

    Raises:
        TrackError: the track leads out of the world or into something solid, or has no poses after ``start_s``.
        UnknownNameError: ``pose_of`` is not a frame of the rig.
    """
    config, rig = experiment.drive, experiment.rig
    assert config is not None
    poses, start_ns = file.in_world(config, rig), file.start_ns(config)
    swept = motion_along(
        poses.stamps_ns,
        poses.position,
        poses.quaternion_wxyz,
        start_ns,
        experiment.seconds,
        sweep_steps(rig),
    )
    track = track_along(swept, rig)
    check_motion(world, track.motion, rig, file.name, start_ns, allow_inside=config.allow_inside)
    if file.gap:
        warnings.warn(file.gap, FieldtruthWarning, stacklevel=2)
    return track
