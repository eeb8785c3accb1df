# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Motion of the robot of an experiment: a drive in the physics that goes on step by step, or one that is given."""

import warnings
from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from fieldtruth.bag.file import TRACK
from fieldtruth.bag.track_file import TrackFile, read_track_file
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning
from fieldtruth.core.progress import Advance
from fieldtruth.core.transforms import pose_from_quaternion_wxyz
from fieldtruth.drive.given_motion import check_motion, motion_along, track_along
from fieldtruth.drive.physics import Command
from fieldtruth.drive.plan import plan_and_drive, standing_robot
from fieldtruth.drive.simulate import Checkpoint, Drive, SimulatedRobot
from fieldtruth.drive.track import (
    STEP_NS,
    Base,
    Commands,
    Motion,
    Stamps,
    Track,
    WheelMotion,
    joined,
    rows_of,
    state_at,
    sweep_steps,
)
from fieldtruth.experiment.config import Experiment, RouteConfig
from fieldtruth.world.model import World


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


class Given(NamedTuple):
    """An experiment in its stored form, and the track file that it follows, if it does."""

    experiment: Experiment
    track: TrackFile | None


def with_given_track(experiment: Experiment) -> Given:
    """Read the track file of an experiment that has one; what follows poses or stands has no wheel odometry.

    Beside the bag, track.csv holds the poses of the track file.

    Raises:
        TrackError, BagError: a track file that cannot be read.
    """
    track = None
    if (drive := experiment.drive) is not None:
        track = read_track_file(drive)
        drive = drive.model_copy(update={"track": TRACK, "topic": None, "pose_of": track.frame})
        experiment = without_wheels(experiment).model_copy(update={"drive": drive})
    return Given(without_wheels(experiment) if experiment.frames is not None else experiment, track)


def track_in(world: World, experiment: Experiment, given: TrackFile | None, advance: Advance | None = None) -> Track:
    """Plan the route and drive, follow the poses of a track file, or stand the robot where frames are taken."""
    if experiment.frames is not None and given is None:
        return standing_robot(world, experiment)
    return plan_and_drive(world, experiment, advance) if given is None else follow_track(experiment, world, given)


class MotionState(NamedTuple):
    """State of a motion, from which it goes on."""

    reached_ns: int
    checkpoint: Checkpoint | None
    motion: Motion | None
    wheels: WheelMotion | None


class GrowingMotion(ABC):
    """Motion that is known up to ``reached_ns``, and at the end up to that of the last sweep."""

    reached_ns: int
    end_ns: float
    """Its end [ns]; infinite while that is not known."""

    stands: Stamps | None = None
    """Stamps (n,) [ns] of the poses of a robot that stands; None of a motion."""

    @property
    def ended(self) -> bool:
        """Whether the end is reached."""
        return self.reached_ns >= self.end_ns

    @property
    def world_from_base(self) -> Array:
        """Pose (4, 4) of base_link at ``reached_ns``."""
        return state_at(self.known().swept, self.reached_ns).world_from_base

    @abstractmethod
    def advance(self, steps: int, command: Command | None, keep_ns: int) -> None:
        """Go on by steps of the physics, at most to the end; rows before ``keep_ns`` are needed no more."""

    @abstractmethod
    def known(self) -> Track:
        """Return the rows that are known and kept."""

    @abstractmethod
    def save(self) -> MotionState:
        """Return what ``restore`` needs to go on from here."""

    @abstractmethod
    def restore(self, saved: MotionState) -> None:
        """Go on from where ``save`` was called."""


class LiveMotion(GrowingMotion):
    """The drive of a robot in the physics."""

    def __init__(self, world: World, experiment: Experiment, route: RouteConfig) -> None:
        self._drive = Drive(world, experiment, route)
        self._drive.limit(experiment.seconds)
        self._motion, self._wheels = self._drive.drive_to(0)
        self._start = pose_from_quaternion_wxyz(*self.robot.pose)
        self.reached_ns, self.end_ns = 0, self._drive.end * STEP_NS

    @property
    def robot(self) -> SimulatedRobot:
        """The robot in the physics."""
        return self._drive.robot

    @property
    def world_from_base(self) -> Array:
        """Pose (4, 4) of base_link at ``reached_ns``."""
        return super().world_from_base if self.reached_ns else self._start

    def advance(self, steps: int, command: Command | None, keep_ns: int) -> None:
        """Drive on towards a command, or those of the follower."""
        until = self.reached_ns // STEP_NS + steps
        self._add(*self._drive.drive_to(int(min(until, self._drive.end)), command), keep_ns)
        self.end_ns = self._drive.end * STEP_NS
        self.reached_ns = int(min(until * STEP_NS, self.end_ns))
        if self.ended:  # the drive goes on until the last sweep is complete
            self._add(*self._drive.drive_to(2**62, command), keep_ns)

    def _add(self, motion: Motion, wheels: WheelMotion, keep_ns: int) -> None:
        first = int(np.searchsorted(self._motion.stamps_ns, keep_ns))
        self._motion = joined(rows_of(self._motion, first, 2**62), motion)
        self._wheels = joined(rows_of(self._wheels, first, 2**62), wheels)

    def known(self) -> Track:
        """Return the rows that are known and kept."""
        count = int(np.searchsorted(self._motion.stamps_ns, self.reached_ns, side="right"))
        none = Commands(stamps_ns=np.zeros(0, np.int64), command=np.zeros((0, 2)))
        base = Base(wheels=rows_of(self._wheels, 0, count), commands=none)
        return Track(motion=self._motion.first(count), swept=self._motion, base=base)

    def save(self) -> MotionState:
        """Return what ``restore`` needs to go on from here."""
        return MotionState(self.reached_ns, self._drive.save(), self._motion, self._wheels)

    def restore(self, saved: MotionState) -> None:
        """Go on from where ``save`` was called."""
        assert saved.checkpoint is not None
        assert saved.motion is not None
        assert saved.wheels is not None
        self._drive.restore(saved.checkpoint)
        self._motion, self._wheels = saved.motion, saved.wheels
        self.reached_ns, self.end_ns = saved.reached_ns, saved.checkpoint.end * STEP_NS


class GivenMotion(GrowingMotion):
    """A motion that is known from the start: along a track file, or frames of a robot that stands."""

    def __init__(self, track: Track) -> None:
        self._track, self.reached_ns, self._keep_ns = track, 0, 0
        self.end_ns = int(track.motion.stamps_ns[-1])
        self.stands = track.motion.stamps_ns if track.is_frames else None

    def advance(self, steps: int, command: Command | None, keep_ns: int) -> None:
        """Go on along the poses."""
        if command is not None:
            raise ConfigurationError("command must be None: this experiment has poses that are given, and no drive")
        self.reached_ns, self._keep_ns = min(self.reached_ns + steps * STEP_NS, int(self.end_ns)), keep_ns

    def known(self) -> Track:
        """Return the rows that are known."""
        motion = self._track.motion
        first = int(np.searchsorted(motion.stamps_ns, self._keep_ns))
        count = int(np.searchsorted(motion.stamps_ns, self.reached_ns, side="right"))
        return Track(
            motion=rows_of(motion, first, count), swept=self._track.swept, base=None, is_frames=self._track.is_frames
        )

    def save(self) -> MotionState:
        """Return what ``restore`` needs to go on from here."""
        return MotionState(self.reached_ns, None, None, None)

    def restore(self, saved: MotionState) -> None:
        """Go on from where ``save`` was called."""
        self.reached_ns, self._keep_ns = saved.reached_ns, 0


def motion_of(
    world: World, experiment: Experiment, given: TrackFile | None, route: RouteConfig | None
) -> GrowingMotion:
    """Put the robot at the start of a route that was planned, or find the poses that are given.

    Raises:
        RouteError, TrackError: as ``track_in``.
    """
    if given is None and experiment.frames is None and route is not None:
        return LiveMotion(world, experiment, route)
    return GivenMotion(track_in(world, experiment, given))
