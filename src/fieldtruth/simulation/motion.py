# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Motion of the robot of an experiment: a drive in the physics that goes on step by step, or one that is given.

Along given poses, positions follow a cubic spline and orientations SciPy's rotation spline: velocity, turn rate and
their derivatives are continuous. The rate of the physics samples both; velocity and turn rate are those of the step
that ends at the stamp, as in the physics (``sensors.imu.sensing``). So their sums over all steps are the path and the
attitude, and the IMU of a track that was recorded from the physics reads what it read there. A noisy file makes a noisy
IMU.
"""

import math
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial import ConvexHull, KDTree
from scipy.spatial.transform import Rotation, RotationSpline

from fieldtruth.bag.file import TRACK
from fieldtruth.bag.track_file import TrackFile, read_track_file
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning, TrackError
from fieldtruth.core.progress import Advance
from fieldtruth.core.transforms import pose_from_quaternion_wxyz, wxyz_from_xyzw, xyzw_from_wxyz
from fieldtruth.drive.physics import Command
from fieldtruth.drive.plan import plan_and_drive
from fieldtruth.drive.simulate import Checkpoint, Drive, SimulatedRobot
from fieldtruth.drive.standing import standing_robot
from fieldtruth.drive.track import (
    STEP_NS,
    STEP_S,
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
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.moving import KNOT_NS
from fieldtruth.simulation.company import ALONE, KNOT_STEPS, Company
from fieldtruth.world.model import Collider, World

_STRIDE: Final = 10
"""Rows of the motion between two that are checked: 10 ms."""
_BLOCK: Final = 100_000
"""Rows that the rotation spline computes at once; it takes half a kilobyte for each."""


class _Found(NamedTuple):
    """Depths [m] of the checked rows in a solid, above 0 inside, and what it is."""

    rows: NDArray[np.intp]
    depth: Array
    what: str


def check_motion(world: World, motion: Motion, rig: Rig, file: str, start_ns: int, *, allow_inside: bool) -> None:
    """Check that base_link stays within the world, and that it and sensors that see stay out of everything solid.

    Args:
        world: the world.
        motion: of base_link.
        rig: the sensors that are enabled are checked.
        file: name of the track file, for messages.
        start_ns: stamp [ns] in the file of the motion's time 0, for messages.
        allow_inside: whether to check the world's edge only.

    Raises:
        TrackError: with the first time, the position and the object.
    """
    rows = np.append(np.arange(0, len(motion.stamps_ns) - 1, _STRIDE), len(motion.stamps_ns) - 1)
    stamps = (motion.stamps_ns[rows] + start_ns) / 1e9
    world_from_base = transforms.pose_from_quaternion_wxyz(motion.position[rows], motion.quaternion_wxyz[rows])
    half = np.array(world.size) / 2
    outside = (np.abs(world_from_base[:, :2, 3]) > half).any(axis=1)
    if outside.any():
        k = int(np.argmax(outside))
        raise TrackError(
            f"{file}: at {stamps[k]:.3f} s base_link is {_at(world_from_base[k, :3, 3])}, outside the world "
            f"{world.name}, which spans x -{half[0]:g} to {half[0]:g} m, y -{half[1]:g} to {half[1]:g} m"
        )
    if not allow_inside and (first := _first_inside(world, world_from_base, rig)) is not None:
        k, what = first
        raise TrackError(f"{file}: from {stamps[k]:.3f} s on {what}; drive: {{allow_inside: true}} senses there")


def _first_inside(world: World, world_from_base: Array, rig: Rig) -> tuple[int, str] | None:
    """Return the first of the poses (n, 4, 4) that is inside something, and what is where."""
    first: tuple[int, str] | None = None
    for frame, offset in _points(rig).items():
        points = (world_from_base @ np.append(offset, 1.0))[:, :3]
        for found in _solids(world, points):
            inside = found.rows[found.depth > 0]
            if len(inside) and (first is None or inside[0] < first[0]):
                deepest = int(np.argmax(found.depth))
                where = _at(points[found.rows[deepest]])
                first = int(inside[0]), f"{frame} is {found.what}, up to {found.depth[deepest]:.2f} m {where}"
    return first


def _points(rig: Rig) -> dict[str, tuple[float, float, float]]:
    """Checked points in base_link [m] by frame."""
    mounts = (item for sensor in rig.in_order() if sensor.sees for item in sensor.frames().items())
    origins = {frame: mount.xyz for frame, mount in mounts}
    return {"base_link": (0.0, 0.0, 0.0), **origins}


def _solids(world: World, points: Array) -> Iterator[_Found]:
    """Yield the depths of points (n, 3) [m] in the ground, in water, and in the colliders of objects near them."""
    every = np.arange(len(points))
    ground = world.terrain.field.height_at(points[:, 0], points[:, 1])
    yield _Found(every, ground - points[:, 2], "below the ground")
    if world.water_level is not None:
        level = world.water_at(points[:, 0], points[:, 1])
        wet = every[ground < level]
        yield _Found(wet, level[wet] - points[wet, 2], "under water")
    plan = KDTree(points[:, :2])
    for instance in world.instances:
        for collider in world.meshes[instance.mesh].colliders:
            world_from_solid = instance.world_from_object @ transforms.pose(
                collider.position, (0.0, 0.0, collider.yaw_deg)
            )
            scale = float(np.cbrt(np.linalg.det(world_from_solid[:3, :3])))
            reach = scale * float(np.linalg.norm(collider.size))  # of a sphere around the middle of the base
            near = np.array(plan.query_ball_point(world_from_solid[:2, 3], reach, return_sorted=True), np.intp)
            if len(near):
                in_solid = transforms.transform(np.linalg.inv(world_from_solid).astype(np.float64), points[near])
                depth = _depth(collider, in_solid) * scale
                yield _Found(near, depth, f"inside the object {instance.name!r}")


def _depth(collider: Collider, points: Array) -> Array:
    """Depth [in units of the object], (n,), of points (n, 3) in a collider's frame; above 0 inside."""
    if collider.points:  # the middle of the bounding box's base is the origin
        faces = ConvexHull(np.array(collider.points) - collider.position).equations
        return np.asarray(-(points @ faces[:, :3].T + faces[:, 3]).max(axis=1))
    *across, height = collider.size
    if collider.shape == "cylinder":
        sides = [across[0] - np.hypot(points[:, 0], points[:, 1])]
    else:
        sides = [length / 2 - np.abs(points[:, axis]) for axis, length in enumerate(across)]
    depth: Array = np.min([*sides, points[:, 2], height - points[:, 2]], axis=0)
    return depth


def _at(xyz: Array) -> str:
    return "at x {:.2f} m, y {:.2f} m, z {:.2f} m".format(*xyz)


def motion_along(
    stamps_ns: Counts,
    position: Array,
    quaternion_wxyz: Array,
    start_ns: int,
    seconds: float | None = None,
    sweep: int = 0,
) -> Motion:
    """Return the motion of base_link along poses in the world.

    Args:
        stamps_ns: rising, (n,), n >= 2.
        position: (n, 3) [m].
        quaternion_wxyz: unit quaternions (n, 4).
        start_ns: the stamp that becomes time 0; poses before it only shape the splines.
        seconds: end after this time [s]; None for the last pose.
        sweep: steps of the physics behind the end; behind the last pose, the motion goes on as in its last step.

    Raises:
        TrackError: there are no poses at the start.
    """
    first_ns, last_ns = int(stamps_ns[0]), int(stamps_ns[-1])
    count = (last_ns - start_ns) // STEP_NS
    if count < 1 or start_ns + STEP_NS < first_ns:
        raise TrackError(
            f"the poses of the track are from {first_ns / 1e9:.3f} s to {last_ns / 1e9:.3f} s; drive.start_s must be "
            f"between, got {start_ns / 1e9:.3f} s"
        )
    if seconds is not None:
        count = min(count, max(1, round(seconds / STEP_S)))
    count, known = count + sweep, min(count + sweep, (last_ns - start_ns) // STEP_NS)
    times = np.asarray((stamps_ns - start_ns) / 1e9, np.float64)
    steps = np.arange(known + 1, dtype=np.float64) * STEP_S
    positions = CubicSpline(times, position)(steps)
    attitudes = _attitudes(times, quaternion_wxyz, steps)
    # At the stamps of the poses exactly these: the splines round in the last bit.
    rows, rest = np.divmod(stamps_ns - start_ns, STEP_NS)
    own = (rest == 0) & (rows >= 0) & (rows <= known)
    positions[rows[own]], attitudes[rows[own]] = position[own], quaternion_wxyz[own]
    positions, attitudes = _continued(positions, attitudes, count - known)
    turned = np.einsum("ni,ni->n", attitudes[1:], attitudes[:-1]) < 0
    attitudes[1:] *= np.cumprod(np.where(turned, -1.0, 1.0))[:, None]  # q and -q are the same rotation
    turns = Rotation.from_quat(xyzw_from_wxyz(attitudes))
    return Motion(
        stamps_ns=np.arange(1, count + 1, dtype=np.int64) * STEP_NS,
        position=positions[1:],
        quaternion_wxyz=attitudes[1:],
        linear_velocity=np.diff(positions, axis=0) / STEP_S,
        angular_velocity=(turns[1:] * turns[:-1].inv()).as_rotvec() / STEP_S,
    )


def track_along(swept: Motion, rig: Rig) -> Track:
    """Return the track of a motion, which ends with the sweep of the last scan.

    What moves along given poses may have no wheels.
    """
    return Track(motion=swept.first(len(swept.stamps_ns) - sweep_steps(rig)), swept=swept, base=None)


def _attitudes(times: Array, quaternion_wxyz: Array, steps: Array) -> Array:
    """Quaternions wxyz (m, 4) at ``steps`` [s] of a spline through those at ``times`` (n,) [s]."""
    spline = RotationSpline(times, Rotation.from_quat(xyzw_from_wxyz(quaternion_wxyz)))
    blocks = np.split(steps, np.arange(_BLOCK, len(steps), _BLOCK))
    return wxyz_from_xyzw(np.concatenate([spline(block).as_quat() for block in blocks]))


def _continued(positions: Array, attitudes: Array, count: int) -> tuple[Array, Array]:
    """Positions (n, 3) and quaternions wxyz (n, 4) with ``count`` further rows, each moved like the last one."""
    before, last = Rotation.from_quat(xyzw_from_wxyz(attitudes[-2:]))
    numbers = np.arange(1, count + 1)[:, None]
    turned = Rotation.from_rotvec(numbers * (last * before.inv()).as_rotvec()) * last
    moved = positions[-1] + numbers * (positions[-1] - positions[-2])
    return np.concatenate([positions, moved]), np.concatenate([attitudes, wxyz_from_xyzw(turned.as_quat())])


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


def track_in(
    world: World,
    experiment: Experiment,
    given: TrackFile | None,
    advance: Advance | None = None,
    company: Company | None = None,
) -> Track:
    """Plan the route and drive, follow the poses of a track file, or stand the robot where frames are taken.

    The robot's ``company`` moves with it, in ``world``, which is the company's.
    """
    if given is not None:
        track = follow_track(experiment, world, given)
        if company is not None:
            company.follow(track.swept, int(track.motion.stamps_ns[-1]))
        return track
    if experiment.frames is not None:
        return standing_robot(world, experiment)
    return plan_and_drive(world, experiment, advance) if company is None else company.drive(advance)[ALONE]


class MotionState(NamedTuple):
    """State of a motion, from which it goes on."""

    reached_ns: int
    checkpoint: Checkpoint | None
    motion: Motion | None
    wheels: WheelMotion | None
    company: Any = None


class GrowingMotion(ABC):
    """Motion that is known up to ``reached_ns``, and at the end up to that of the last sweep."""

    reached_ns: int
    end_ns: float
    """Its end [ns]; infinite while that is not known."""

    stands: Stamps | None = None
    """Stamps (n,) [ns] of the poses of a robot that stands; None of a motion."""

    @property
    def ended(self) -> bool:
        """Return whether the end is reached."""
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
    """The drive of a robot in the physics; an endless one does not end at the last waypoint."""

    def __init__(
        self,
        world: World,
        experiment: Experiment,
        route: RouteConfig,
        *,
        endless: bool = False,
        company: Company | None = None,
    ) -> None:
        name = experiment.namespace or ALONE
        self._drive = Drive(world, experiment, route, others=company.others(name) if company else None)
        self._drive.endless, self._drive.whole = endless, KNOT_STEPS if company else 1
        self._drive.limit(experiment.seconds)
        self._motion, self._wheels = self._drive.drive_to(0)
        self._start = pose_from_quaternion_wxyz(*self.robot.pose)
        self.reached_ns, self.end_ns = 0, self._drive.end * STEP_NS
        self._company = company if name == ALONE else None
        """Of a robot alone, whose actors move with it; a fleet moves those of several."""
        if self._company is not None:
            before = self._company.poses[ALONE].save()
            self._company.poses[ALONE].restart(self._start)
            try:
                self._company.begin({ALONE: route})
            except ConfigurationError:  # an earlier drive may go on
                self._company.poses[ALONE].restore(before)
                raise

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
        if command is not None and self._company is not None:
            self._company.set_free(self.reached_ns)
        until = self.reached_ns // STEP_NS + steps
        while self.robot.steps < (step := min(until, self._drive.end, self._next_knot())):
            self._drive_to(int(step), command, keep_ns)
        self.end_ns = self._drive.end * STEP_NS
        self.reached_ns = int(min(until * STEP_NS, self.end_ns))
        if self.ended:  # the drive goes on until the last sweep is complete
            if self._company is not None:
                self._company.end_actors(int(self.end_ns))
            self._add(*self._drive.drive_to(2**62, command), keep_ns)

    def forget_others(self, before_ns: int) -> None:
        """Forget the motion of actors that no stamp from this one [ns] on needs."""
        if self._company is not None:
            self._company.forget(before_ns)

    def _next_knot(self) -> float:
        """Step of the next knot at which actors are met; infinite without any."""
        return math.inf if self._company is None else (self.robot.steps // KNOT_STEPS + 1) * KNOT_STEPS

    def _drive_to(self, step: int, command: Command | None, keep_ns: int) -> None:
        """Drive to a step, at most to the next knot."""
        company, stamp = self._company, step * STEP_NS
        if company is not None and self.robot.steps % KNOT_STEPS == 0:
            company.meet({ALONE: self.robot}, self.robot.steps * STEP_NS)
        motion, wheels = self._drive.drive_to(step, command)
        self._add(motion, wheels, keep_ns)
        if company is not None and step % KNOT_STEPS == 0:
            company.add(ALONE, motion)
            company.step_actors(stamp)

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
        others = None if self._company is None else self._company.save()
        return MotionState(self.reached_ns, self._drive.save(), self._motion, self._wheels, others)

    def restore(self, saved: MotionState) -> None:
        """Go on from where ``save`` was called."""
        assert saved.checkpoint is not None
        assert saved.motion is not None
        assert saved.wheels is not None
        self._drive.restore(saved.checkpoint)
        self._motion, self._wheels = saved.motion, saved.wheels
        self.reached_ns, self.end_ns = saved.reached_ns, saved.checkpoint.end * STEP_NS
        if self._company is not None:
            self._company.restore(saved.company)
            self._company.meet({ALONE: self.robot}, saved.reached_ns // KNOT_NS * KNOT_NS)


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
    world: World,
    experiment: Experiment,
    given: TrackFile | None,
    route: RouteConfig | None,
    *,
    endless: bool = False,
    company: Company | None = None,
) -> GrowingMotion:
    """Put the robot at the start of a route that was planned, or find the poses that are given.

    Raises:
        RouteError, TrackError: as ``track_in``.
    """
    if given is None and experiment.frames is None and route is not None:
        return LiveMotion(world, experiment, route, endless=endless, company=company)
    return GivenMotion(track_in(world, experiment, given, company=company))
