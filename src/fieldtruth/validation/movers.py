# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What moves beside the robot: velocities against poses, and points against boxes, without a rebuilt world.

Boxes are those of ``Run.movers``. A point is compared with the box where its object was when the ray of the point left.
"""

from collections import deque
from collections.abc import Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import ModelStatesReader
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.transforms import wxyz_from_xyzw
from fieldtruth.drive.track import Motion, poses_at
from fieldtruth.validation.check import Rule, Spec, Tally
from fieldtruth.validation.context import KEPT, STEP_NS, Checker, Context, at
from fieldtruth.validation.kind_checks import LabelledPoints

# Of robots both are exact. Others may have velocities of the middle of a step, at accelerations of up to 50 m/s^2.
VELOCITY: Final = Rule("what moves beside the robot has the velocity of its poses", 0.05, "m/s")
TURN: Final = Rule("what moves beside the robot has the turn rate of its poses", 0.05, "rad/s")
# Poses are 1 ms apart, in which a car at 20 m/s moves by 2 cm.
INSIDE: Final = Rule("points on what moves are in its box at the time of their rays", 0.03, "m outside")
MOVING_OBJECTS: Final[Spec] = Spec(
    "moving objects", (VELOCITY, TURN, INSIDE), "points and poses", f"no {table.MODEL_STATES}"
)
_BLOCK: Final = 500


class MovingObjects(Checker):
    """Poses, velocities and points of what moves beside the robot of a run."""

    def __init__(self, context: Context, points: Sequence[LabelledPoints]) -> None:
        self._context, self._movers = context, list(context.movers)
        self._tally = context.tally(MOVING_OBJECTS)
        self.tallies = [self._tally]
        self._points = {each.topic: each for each in points if each.sweep_ns is not None}
        self.topics = (table.MODEL_STATES, *self._points) if self._movers else ()
        self._reader = ModelStatesReader()
        self._rows: list[tuple[int, Array, Array]] = []
        """Stamp, poses (m, 7) and twists (m, 6) that were not checked."""
        self._known: deque[tuple[int, Array]] = deque(maxlen=KEPT)
        """Stamp [ns] and poses (m, 7) of the latest messages."""

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message; model states before the motion window does, which then knows when clouds are complete."""
        if raw.topic != table.MODEL_STATES:
            source = self._points[raw.topic]
            end_ns = raw.stamp_ns + (source.sweep_ns or 0)
            self._context.motion.when_known(end_ns, partial(self._submit, raw, message, source))
            return
        every, names = self._reader.poses(raw.data), self._reader.names
        if not all(mover.name in names for mover in self._movers):
            return  # the check of static objects reports other names
        rows = [names.index(mover.name) for mover in self._movers]
        poses = every[rows]
        self._known.append((raw.stamp_ns, poses))
        self._rows.append((raw.stamp_ns, poses, self._reader.twists(raw.data)[rows]))
        if len(self._rows) > _BLOCK:
            self._check_motion()

    def finish(self) -> None:
        """Finish the checks after the last message."""
        self._check_motion()

    def _check_motion(self) -> None:
        """Check the collected rows; the last one begins the next block."""
        if len(self._rows) < 2:
            return
        stamps, poses, twists = (np.array(each) for each in zip(*self._rows, strict=True))
        steps = np.flatnonzero(np.diff(stamps) == STEP_NS)  # gaps are reported by the stamps
        before, after, found = poses[steps], poses[steps + 1], twists[steps + 1]
        with np.errstate(invalid="ignore"):
            linear = (after[..., :3] - before[..., :3]) / (STEP_NS / 1e9) - found[..., :3]
        self._tally[VELOCITY].measure_all(np.linalg.norm(linear, axis=-1).ravel(), partial(self._where, stamps[steps]))
        turn = np.full(linear.shape, np.nan)
        if np.isfinite(poses).all() and np.linalg.norm(poses[..., 3:], axis=-1).all():
            first, second = (Rotation.from_quat(each[..., 3:].reshape(-1, 4)) for each in (before, after))
            turn = (second * first.inv()).as_rotvec().reshape(linear.shape) / (STEP_NS / 1e9) - found[..., 3:]
        self._tally[TURN].measure_all(np.linalg.norm(turn, axis=-1).ravel(), partial(self._where, stamps[steps]))
        del self._rows[:-1]

    def _where(self, stamps: Counts, k: int) -> str:
        """Describe a value of rows by step and mover."""
        step, number = divmod(k, len(self._movers))
        return f"{self._movers[number].name!r} in {table.MODEL_STATES} at {stamps[step] + STEP_NS} ns"

    def _submit(self, raw: RawMessage, message: Any, source: LabelledPoints) -> None:
        end_ns = raw.stamp_ns + (source.sweep_ns or 0)
        known = [row for row in self._known if raw.stamp_ns - STEP_NS <= row[0] <= end_ns + STEP_NS]
        motion = self._context.motion.motion
        rows = slice(int(np.searchsorted(motion.stamps_ns, raw.stamp_ns - STEP_NS)), None)
        own = Motion(**{name: values[rows].copy() for name, values in vars(motion).items()})
        if known and len(own.stamps_ns):
            self._context.jobs.append(lambda: self._compare(raw, message, source, known, own))

    def _compare(
        self, raw: RawMessage, message: Any, source: LabelledPoints, known: list[tuple[int, Array]], own: Motion
    ) -> list[Tally]:
        """Compare the points of a cloud with boxes at their own times."""
        try:
            points = source.decode(message, raw.stamp_ns)
            instance = points["instance"]
        except (BagError, ValueError, KeyError, TypeError, IndexError):
            return []  # the check of labels reports the layout
        names = points.dtype.names or ()
        times = raw.stamp_ns + (points["t"].astype(np.int64) if "t" in names else np.zeros(len(points), np.int64))
        stamps, poses = np.array([stamp for stamp, _ in known]), np.array([rows for _, rows in known])
        mount, part = self._context.run.sensors[source.sensor].config.mount.base_from_sensor, self._tally.part()
        for number, mover in enumerate(self._movers):
            # Scans that go on after the end of the bag have rays when no pose is known.
            chosen = np.flatnonzero((instance == mover.object_id) & (times <= min(stamps[-1], own.stamps_ns[-1])))
            if not len(chosen):
                continue
            leaves, of = np.unique(times[chosen], return_inverse=True)
            xyz = np.stack([points[axis][chosen] for axis in "xyz"], axis=-1).astype(np.float64)
            world_from_sensor = poses_at(own, leaves)[of] @ mount
            world = np.einsum("nij,nj->ni", world_from_sensor[:, :3, :3], xyz) + world_from_sensor[:, :3, 3]
            row = np.clip(np.searchsorted(stamps, times[chosen] - STEP_NS // 2), 0, len(stamps) - 1)
            pose = poses[row, number]
            turned = transforms.rotation_from_quaternion_wxyz(wxyz_from_xyzw(pose[:, 3:]))
            in_box = np.einsum("nji,nj->ni", turned, world - pose[:, :3]) - mover.centre
            outside = np.linalg.norm(np.maximum(np.abs(in_box) - mover.size / 2, 0.0), axis=1)
            where = partial(_point_at, raw, mover.name, chosen)
            part[INSIDE].measure_all(np.maximum(outside - mover.reach, 0.0), where)
        return [part]


def _point_at(raw: RawMessage, name: str, rows: Counts, k: int) -> str:
    return f"{at(raw)}, row {rows[k]}, on {name!r}"
