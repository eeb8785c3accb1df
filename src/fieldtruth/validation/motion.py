# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Frames and motion: true poses, mounts, the drive, and the commands that steer it.

The true poses are those of /gazebo/model_states; odometry and /tf repeat them. The physics steps velocity first and
then the pose with the new velocity (semi-implicit Euler), so from one message to the next the robot moves by ``v dt``
and turns by ``w dt`` exactly. The residual is rounding, 1e-14 m; the tolerance of 1e-9 leaves room for other
mathematics libraries.
"""

from collections import Counter
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import matrix
from fieldtruth.bag.geometry import ModelStatesReader, Trajectory
from fieldtruth.bag.messages import WHEEL_FRAMES, fixed_transforms
from fieldtruth.bag.reader import RawMessage
from fieldtruth.bag.topics import ROBOT
from fieldtruth.bag.track_file import read_track_file
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import FieldtruthError, RouteError
from fieldtruth.core.geodesy import PAPER_ORIGIN
from fieldtruth.core.readings import Fix, Inertial
from fieldtruth.drive.controller import WaypointFollower, antenna_geodetic
from fieldtruth.experiment.config import FRAME_RATE, Experiment, geodetic_route, metres_from_route
from fieldtruth.validation.check import Rule, Spec, Tally
from fieldtruth.validation.context import STEP_NS, Checker, Context, at, is_attitude

STILL: Final = Rule("only what can move does, and names do not change")
UNIQUE: Final = Rule("names are unique")
SAME_ROBOT: Final = Rule("of several robots, that of the run is where the first row has it")
_NO_STATES: Final = f"no {table.MODEL_STATES} with a model {ROBOT!r}"
STATIC_OBJECTS: Final[Spec] = Spec("static objects", (STILL, UNIQUE, SAME_ROBOT), "messages", _NO_STATES)

UNIT: Final = Rule("attitudes are unit quaternions", 1e-9, "from length 1", minor=True)
# 10 ms of jitter in the stamps at several metres a second.
JUMPS: Final = Rule("the robot does not jump", 0.05, "m")
MOVES: Final = Rule("the robot moves by velocity times time step", 1e-9, "m")
TURNS: Final = Rule("the robot turns by turn rate times time step", 1e-9, "rad")
MOTION: Final[Spec] = Spec("motion", (UNIT, JUMPS, MOVES, TURNS), "messages", _NO_STATES)

ODOMETRY_POSE: Final = Rule("the pose of odometry is that of model states", 0.0, "m or of a quaternion")
TF_POSE: Final = Rule("the pose of /tf is that of model states", 0.0, "m or of a quaternion")
TWIST: Final = Rule("the twist of odometry is that of model states in base_link", 1e-9, "m/s or rad/s")
EXACT: Final = Rule("covariances of odometry are zero", minor=True)
_NO_PAIR: Final = "only one of /gazebo/model_states, /ground_truth/odom and /tf"
POSES: Final[Spec] = Spec("poses", (ODOMETRY_POSE, TF_POSE, TWIST, EXACT), "poses", _NO_PAIR)

_JUMP_NS: Final = 100_000_000
"""Longest time [ns] between messages over which jumps are checked."""
_BLOCK: Final = 500


class ModelStates(Checker):
    """Static objects and the motion of the robot in /gazebo/model_states."""

    topics = (table.STATIC_MODEL_STATES, table.MODEL_STATES)

    def __init__(self, context: Context) -> None:
        self._context = context
        self._reader = ModelStatesReader()
        self._static, self._motion = context.tally(STATIC_OBJECTS), context.tally(MOTION)
        if context.run.is_frames:
            self._motion.skipped = "separate frames: the robot does not move from one to the next"
        self.tallies = [self._static, self._motion]
        self._namespace = (context.experiment and context.experiment.namespace) or ""
        self._first: tuple[tuple[str, ...], Array] | None = None
        self._stamps: list[int] = []
        self._rows: list[Array] = []
        self._fresh = 0  # first row that no earlier block has checked
        self._length = 0.0

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        poses, twists, names = self._reader.poses(raw.data), self._reader.twists(raw.data), self._reader.names
        if not self._context.names:
            self._context.names = names
            twice = sorted(name for name, count in Counter(names).items() if count > 1)
            self._static[UNIQUE].see(not twice, f"{at(raw)}: {', '.join(twice)}")
        if raw.topic == table.STATIC_MODEL_STATES or ROBOT not in names:
            return
        row = names.index(ROBOT)
        others = np.concatenate([poses, twists], axis=1)
        state = others[row, [0, 1, 2, 6, 3, 4, 5, 7, 8, 9, 10, 11, 12]]
        own = [names.index(name) for name in self._context.moving if name in names]
        if (namespace := self._namespace) in names:
            twin = others[names.index(namespace)]
            self._static[SAME_ROBOT].see(np.array_equal(twin, others[row]), f"{at(raw)}: {namespace!r}")
        others[[row, *own]] = 0.0
        if self._first is None:
            self._first = names, others
        same = names == self._first[0] and np.array_equal(others, self._first[1])
        self._static[STILL].see(same, "" if same else f"{at(raw)}: {self._moved(names, others)}")
        self._context.motion.add(raw.stamp_ns, state)
        self._stamps.append(raw.stamp_ns)
        self._rows.append(state)
        if len(self._rows) > _BLOCK:
            self._check_motion()

    def finish(self) -> None:
        """Finish the checks after the last message."""
        self._check_motion()
        self._motion.note = f"{self._length:.2f} m driven"

    def _check_motion(self) -> None:
        """Check the collected rows; the last one begins the next block."""
        if len(self._rows) < 2:
            return
        stamps, rows, tally, fresh = np.array(self._stamps), np.array(self._rows), self._motion, self._fresh
        spans = np.diff(stamps)
        steps = np.flatnonzero(spans == STEP_NS)  # gaps are reported by the stamps
        near = np.flatnonzero(spans < _JUMP_NS)
        moved = np.linalg.norm(np.diff(rows[:, :3], axis=0) - spans[:, None] / 1e9 * rows[1:, 7:10], axis=1)
        length = np.linalg.norm(rows[fresh:, 3:7], axis=1)
        tally[UNIT].measure_all(length - 1.0, lambda k: _states_at(stamps[fresh + k]))
        tally[JUMPS].measure_all(moved[near], lambda k: f"after {_states_at(stamps[near[k]])}")
        tally[MOVES].measure_all(moved[steps], lambda k: _states_at(stamps[steps[k] + 1]))
        tally[TURNS].measure_all(_turn_residuals(rows, steps), lambda k: _states_at(stamps[steps[k] + 1]))
        self._length += float(np.linalg.norm(rows[-1, :3] - rows[0, :3]))
        del self._stamps[:-1], self._rows[:-1]
        self._fresh = 1

    def _moved(self, names: tuple[str, ...], others: Array) -> str:
        """Name what differs from the first message."""
        assert self._first is not None
        if names != self._first[0]:
            return "other names than in the first message"
        row, column = np.argwhere(~(others == self._first[1]))[0]
        return f"the {'pose' if column < 7 else 'twist'} of {names[row]!r} has changed"


def _turn_residuals(rows: Array, steps: NDArray[np.intp]) -> Array:
    """Angle [rad] between attitudes after some steps and those that follow from the turn rate; NaN without attitude."""
    before, after = rows[steps], rows[steps + 1]
    if not (len(steps) and np.isfinite(rows).all() and np.linalg.norm(rows[:, 3:7], axis=1).min() > 0.0):
        return np.full(len(steps), np.nan)
    turn = Rotation.from_quat(after[:, [4, 5, 6, 3]]) * Rotation.from_quat(before[:, [4, 5, 6, 3]]).inv()
    residuals: Array = np.linalg.norm(turn.as_rotvec() - STEP_NS / 1e9 * after[:, 10:], axis=1)
    return residuals


def _states_at(stamp_ns: int) -> str:
    return f"{table.MODEL_STATES} at {stamp_ns} ns"


class Poses(Checker):
    """/ground_truth/odom and /tf against /gazebo/model_states; without those, odometry is taken for the true motion."""

    def __init__(self, context: Context) -> None:
        self._motion, self._tally = context.motion, context.tally(POSES)
        self.tallies = [self._tally]
        self._has_states = table.MODEL_STATES in context.run.counts
        self.topics = [name for name in (table.ODOMETRY, table.TF) if name in context.run.counts]

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        if raw.topic == table.TF:
            for each in message.transforms:
                if each.child_frame_id in WHEEL_FRAMES:
                    continue
                pose = _row(each.transform.translation, each.transform.rotation)
                self._motion.when_known(raw.stamp_ns, partial(self._compare, raw, pose, TF_POSE))
            return
        pose, twist = _row(message.pose.pose.position, message.pose.pose.orientation), message.twist.twist
        self._tally[EXACT].see(not (message.pose.covariance.any() or message.twist.covariance.any()), at(raw))
        velocities = np.array([[v.x, v.y, v.z] for v in (twist.linear, twist.angular)])
        if self._has_states:
            self._motion.when_known(raw.stamp_ns, lambda: self._compare(raw, pose, ODOMETRY_POSE, velocities))
        elif is_attitude(pose[3:]):
            rotated = velocities @ transforms.rotation_from_quaternion_wxyz(pose[3:]).T
            self._motion.add(raw.stamp_ns, np.concatenate([pose, rotated.ravel()]))

    def _compare(self, raw: RawMessage, pose: Array, rule: Rule, velocities: Array | None = None) -> None:
        state = self._motion.state(raw.stamp_ns)
        true = np.concatenate([state.position, state.quaternion_wxyz])
        self._tally[rule].measure(float(np.abs(pose - true).max()), at(raw))
        if velocities is not None:
            world_from_base = transforms.rotation_from_quaternion_wxyz(state.quaternion_wxyz)
            in_base = np.stack([state.linear_velocity, state.angular_velocity]) @ world_from_base
            self._tally[TWIST].measure(float(np.abs(velocities - in_base).max()), at(raw))


def _row(position: Any, q: Any) -> Array:
    return np.array([position.x, position.y, position.z, q.w, q.x, q.y, q.z])


MOUNTS: Final = Rule("frames of /tf_static are mounted as in the rig", 1e-9, "m or of a rotation")
UNIT_ROTATIONS: Final = Rule("rotations of /tf_static are unit quaternions", 1e-6, "from length 1", minor=True)
ONCE: Final = Rule("/tf_static is published once", minor=True)
MOUNT_RULES: Final = (MOUNTS, UNIT_ROTATIONS, ONCE)


class Mounts(Checker):
    """Fixed frames in /tf_static against the rig; ``tally`` has ``MOUNT_RULES``."""

    topics = (table.TF_STATIC,)

    def __init__(self, context: Context, tally: Tally) -> None:
        self._context, self._tally, self.tallies = context, tally, [tally]
        self._published = 0

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        self._published += 1
        for each in message.transforms:
            q, child = each.transform.rotation, each.child_frame_id
            length = float(np.linalg.norm([q.w, q.x, q.y, q.z]))
            if self._tally[UNIT_ROTATIONS].measure(length - 1.0, f"{at(raw)}: {child!r}"):
                self._context.parents[child] = (each.header.frame_id, matrix(each.transform))

    def finish(self) -> None:
        """Finish the checks after the last message."""
        if self._context.experiment is not None and table.TF_STATIC in self._context.run.counts:
            self._tally[ONCE].see(self._published == 1, f"{self._published} messages of {table.TF_STATIC}")
        if parents := self._context.parents:
            rebuilt = self._context.rebuilt
            origin = PAPER_ORIGIN if rebuilt is None else rebuilt.world.origin  # a bag's own need not be compared
            for (parent, child), true in fixed_transforms(self._context.rig, origin).items():
                found_parent, found = parents.get(child, ("", true))
                residual = float(np.abs(found - true).max()) if found_parent == parent else np.nan
                self._tally[MOUNTS].measure(residual, f"{child!r} in {parent!r}")


# The robot settles for two seconds before the recording, in which it may creep.
START: Final = Rule("the drive begins at the start of the route", 0.3, "m")
END: Final = Rule(
    "the drive lasts as long as the experiment says, or until the robot stops at the last waypoint, or the track ends"
)
# Poses between two steps of the physics are compared with the linear interpolation, 1e-6 m from the spline at 10 m/s^2.
FOLLOWS: Final = Rule("the robot passes through the poses of the track file", 1e-4, "m or of a rotation")
DRIVE: Final[Spec] = Spec("drive", (START, END, FOLLOWS), skipped="no experiment, or no true motion")

_SPARSE_NS: Final = 10_000_000
"""Of the poses of a track file, one in this time [ns] is compared."""
_STOPPING: Final = 0.5  # [m] from the fix that reaches the last waypoint to standstill, at most
_STANDING: Final = 0.05  # [m/s]


class Drive(Checker):
    """Beginning and end of the drive, or its poses, against the experiment."""

    topics = (table.MODEL_STATES,)

    def __init__(self, context: Context) -> None:
        self._context = context
        self._tally = context.tally(DRIVE)
        self.tallies = [self._tally]
        self._first: Array | None = None
        self._last_ns = 0
        self._given, self._next = self._read_given(), 0

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message, after the motion window has."""
        motion = self._context.motion
        if self._first is None and motion.started:
            self._first = motion.state(raw.stamp_ns).position.copy()
        self._last_ns = raw.stamp_ns
        given = self._given
        while given is not None and self._next < len(given) and given.stamps_ns[self._next] <= raw.stamp_ns:
            stamp = int(given.stamps_ns[self._next])
            if stamp >= STEP_NS and motion.started:
                apart = motion.state(stamp).world_from_base - given.world_from_base(stamp)
                self._tally[FOLLOWS].measure(float(np.abs(apart).max()), f"at {stamp} ns")
            self._next += 1

    def finish(self) -> None:
        """Finish the checks after the last message."""
        experiment, goal = self._context.experiment, None
        if experiment is None or self._first is None:
            return
        try:
            if experiment.frames is not None:
                raise RouteError("frames do not begin at the start of a route")
            corners = metres_from_route(experiment.route, self._context.origin)
        except FieldtruthError:
            pass  # a random route has no waypoints before it is planned, a track file and frames have none
        else:
            away, goal = float(np.linalg.norm(self._first[:2] - corners[0])), corners[-1]
            self._tally[START].measure(away, f"the first pose is {away:.2f} m from the start")
        self._check_end(experiment, goal)

    def _read_given(self) -> Trajectory | None:
        """Return the poses of the track file, with simulated time as stamps; None without a readable file."""
        experiment = self._context.experiment
        if experiment is None or experiment.drive is None:
            return None
        try:
            file = read_track_file(experiment.drive)
            poses = file.in_world(experiment.drive, experiment.rig)
        except FieldtruthError as error:
            self._tally.skipped = str(error)
            return None
        stamps = poses.stamps_ns - file.start_ns(experiment.drive)
        _, rows = np.unique(stamps // _SPARSE_NS, return_index=True)
        rows = np.append(rows[:-1], len(stamps) - 1)  # the last says when the track ends
        return Trajectory(stamps[rows], poses.position[rows], poses.quaternion_wxyz[rows])

    def _check_end(self, experiment: Experiment, goal: Any) -> None:
        seconds, asked, end = self._last_ns / 1e9, experiment.seconds, self._tally[END]
        due = None if asked is None else max(1, round(asked * 1e9 / STEP_NS)) * STEP_NS
        if experiment.frames is not None:
            due = round(experiment.frames.count * 1e9 / FRAME_RATE)
        if self._given is not None:
            over = int(self._given.stamps_ns[-1]) // STEP_NS * STEP_NS
            due = over if due is None else min(due, over)
        if due is not None and (self._last_ns >= due or self._given is not None or experiment.frames is not None):
            end.see(self._last_ns == due, f"{seconds:g} s instead of {due / 1e9:g} s")
            self._tally.note = f"{seconds:g} s as in the experiment"
        elif goal is not None:
            state = self._context.motion.state(self._last_ns)
            antenna = transforms.transform(state.world_from_base, np.array([experiment.rig.first(Fix).mount.xyz]))[0]
            away, speed = float(np.linalg.norm(antenna[:2] - goal)), float(np.linalg.norm(state.linear_velocity))
            self._tally.note = f"{seconds:g} s, then {away:.2f} m from the last waypoint at {speed:.2f} m/s"
            arrived = away < experiment.control.arrival_distance + _STOPPING and speed < _STANDING
            end.see(arrived, f"it ends after {self._tally.note}")


# The controller's first fix is that of time 0, the first known one a millisecond later.
COMMAND: Final = Rule("commands are those of the controller for fix and heading", 1e-5, "m/s or rad/s")
COMMANDS: Final[Spec] = Spec("commands", (COMMAND,), "commands", f"no {table.COMMANDS}, or no waypoints")


class Commands(Checker):
    """Commands against the controller, which gets the ideal fixes and headings of the bag."""

    def __init__(self, context: Context) -> None:
        self._context, self._tally = context, context.tally(COMMANDS)
        self._attitude, self._position = context.rig.first(Inertial), context.rig.first(Fix)
        self._fixes, readings = (each.true_topic(each.topic) for each in (self._position, self._attitude))
        self.topics = (readings, self._fixes, table.COMMANDS)
        self.tallies = [self._tally]
        self._heading: tuple[int, float] = (0, 0.0)
        self._follower: WaypointFollower | None = None
        experiment = context.experiment
        if experiment is None:
            return
        self._yields = experiment.control.yield_to is not None
        if not (self._attitude.enabled and self._position.enabled):
            self._tally.skipped = "the IMU or the GNSS receiver that steers the robot is not enabled"
            return
        try:
            route = geodetic_route(experiment.route, context.origin)
            self._follower = WaypointFollower(route.waypoints, experiment.control, context.origin)
        except FieldtruthError:
            return  # a random route has no waypoints before it is planned, a track file has none
        context.motion.when_known(0, self._see_start)

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message; at equal stamps, IMU and fix come before the command."""
        follower = self._follower
        if follower is None:
            return
        if raw.topic == self._fixes:
            follower.update_fix(message.latitude, message.longitude)
        elif raw.topic != table.COMMANDS:
            q = message.orientation
            world_from_sensor = transforms.rotation_from_quaternion_wxyz(np.array([q.w, q.x, q.y, q.z]))
            base_from_sensor = self._attitude.mount.base_from_sensor[:3, :3]
            self._heading = raw.stamp_ns, float(transforms.yaw_from_rotation(world_from_sensor @ base_from_sensor.T))
        elif self._heading[0] == raw.stamp_ns:
            found = message.linear.x, message.angular.z
            due = np.array(follower.command(self._heading[1]))
            if self._yields and due[0] > 0:  # by a share of the command, which depends on what is ahead
                due *= min(max(found[0] / due[0], 0.0), 1.0)
            self._tally[COMMAND].measure(float(np.abs(np.subtract(due, found)).max()), at(raw))

    def _see_start(self) -> None:
        assert self._follower is not None
        state = self._context.motion.state(0)
        mount, origin = self._position.mount, self._context.origin
        antenna = antenna_geodetic(state.position, state.quaternion_wxyz, mount, origin)
        self._follower.update_fix(float(antenna[0]), float(antenna[1]))
