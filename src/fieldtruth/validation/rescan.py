# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Every cloud made again in the rebuilt world, and compared ray by ray."""

import threading
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import RawMessage
from fieldtruth.sense.lidar import Lidar, ray_directions
from fieldtruth.validation.check import Check
from fieldtruth.validation.claims import Claim
from fieldtruth.validation.law import check_of
from fieldtruth.validation.sampler import Sampler
from fieldtruth.validation.subject import Examiner, Place, Subject, place_of
from fieldtruth.validation.witness import Outcome, Tally, Witness, close

F8 = NDArray[np.float64]


class Rescan(Examiner):
    """Clouds against the rebuilt world."""

    topics = (table.POINTS,)

    def __init__(self, subject: Subject, place: Place, witness: Witness, sampler: Sampler) -> None:
        self._subject = subject
        self._place = place
        self._witness = witness
        self._sampler = sampler
        self._tally = Tally(subject, "the LiDAR, in the world built again, returns the cloud", "clouds")
        self._lidars = threading.local()
        config = subject.rig.lidar
        self._directions = ray_directions(config).reshape(-1, 3)
        sweep = np.rint(np.arange(config.columns) * (1e9 / config.rate_hz / config.columns))
        self._sweep_ns = [int(t) for t in sweep] if config.spinning else [0]

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        self._subject.motion.when_known(raw.stamp_ns + self._sweep_ns[-1], lambda: self._ask(raw, message))

    def results(self) -> list[Check]:
        """Retraced clouds."""
        tally = self._tally
        figures = f"{tally.law.seen:,} rays of {tally.count:,} clouds come back the same{tally.pardoned}"
        laws = [tally.law, tally.equal]
        return [check_of("retraced clouds", laws, figures, f"no {table.POINTS}, or no true motion")]

    def _ask(self, raw: RawMessage, message: Any) -> None:
        state, base_from_lidar = self._subject.motion.state, self._subject.rig.lidar.mount.base_from_sensor
        poses = np.stack([state(raw.stamp_ns + t).world_from_base @ base_from_lidar for t in self._sweep_ns])
        seed = raw.stamp_ns if self._sampler.takes(raw.stamp_ns) else None
        self._subject.submit(
            lambda: self._scan(raw, message, poses, seed), lambda found: self._fold(found, place_of(raw))
        )

    def _fold(self, outcome: Outcome | None, place: str) -> None:
        if outcome is not None:
            self._tally.add(outcome, place)
            self._witness.fold(outcome)

    def _scan(self, raw: RawMessage, message: Any, poses: F8, seed: int | None) -> Outcome | None:
        """Scan again from poses by column (columns, 4, 4), or from one (1, 4, 4)."""
        config, rays = self._subject.rig.lidar, len(self._directions)
        try:
            cloud = read.points(message)
            number = cloud["column"].astype(np.int64) * config.rings + cloud["ring"]
            xyz = np.stack([cloud[axis] for axis in "xyz"], axis=-1)
            told = _dense(number, rays, xyz, cloud["label"], cloud["instance"])
        except (ValueError, KeyError):
            return None  # its layout is told by its own law
        scan = self._lidar().scan(poses if len(poses) > 1 else poses[0])
        number = scan.column.astype(np.int64) * config.rings + scan.ring
        seen = _dense(number, rays, scan.xyz, scan.label, scan.instance)
        same = (told.label == seen.label) & (told.instance == seen.instance)
        equal = bool(same.all()) and np.array_equal(told.xyz, seen.xyz)
        same &= close(told.xyz, seen.xyz).all(axis=1)

        def claim(k: int) -> Claim:
            column, ring = divmod(k, config.rings)
            pose = poses[column % len(poses)]
            return Claim(
                where=f"{place_of(raw)}, column {column}, ring {ring}",
                origin=pose[:3, 3],
                direction=pose[:3, :3] @ self._directions[k],
                range_m=float(np.linalg.norm(told.xyz[k].astype(np.float64))),
                label=int(told.label[k]),
                instance=int(told.instance[k]),
                least=config.min_range,
                most=config.max_range,
                pulse=True,
            )

        return self._witness.judge(np.flatnonzero(~same), rays, claim, seed, equal=equal)

    def _lidar(self) -> Lidar:
        """Return this thread's LiDAR."""
        if not hasattr(self._lidars, "own"):
            self._lidars.own = Lidar(self._subject.rig.lidar, self._place.scene)
        lidar: Lidar = self._lidars.own
        return lidar


class _Dense(NamedTuple):
    """A value for each ray of the LiDAR; 0 where none came back."""

    xyz: NDArray[np.float32]
    label: NDArray[np.uint16]
    instance: NDArray[np.uint16]


def _dense(number: Any, rays: int, xyz: Any, label: Any, instance: Any) -> _Dense:
    inside = (number >= 0) & (number < rays)  # others are told by the laws of beams
    dense = _Dense(np.zeros((rays, 3), np.float32), np.zeros(rays, np.uint16), np.zeros(rays, np.uint16))
    dense.xyz[number[inside]] = xyz[inside]
    dense.label[number[inside]] = label[inside]
    dense.instance[number[inside]] = instance[inside]
    return dense
