# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The measurements made again in the rebuilt world.

The LiDAR's and the cameras' own engine traces whole clouds and images from the true poses. Where it and the bag differ,
as on another processor some rays at borders do, a second tracer in double precision judges what the bag says. The same
tracer also judges some rays of each sample for itself, so that the engine is not the only witness.
"""

import threading
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.classes import Label
from fieldtruth.errors import FieldtruthError
from fieldtruth.experiment.rig import CAMERA_FROM_OPTICAL
from fieldtruth.record import read
from fieldtruth.record import topics as table
from fieldtruth.record.stored import RawMessage
from fieldtruth.sense import Camera, Lidar
from fieldtruth.sense.lidar import ray_directions
from fieldtruth.sense.pinhole import pinhole
from fieldtruth.validate.bundle import Bundler, Moment
from fieldtruth.validate.check import Check
from fieldtruth.validate.claims import NOTHING, UNKNOWN, Claim, refuted
from fieldtruth.validate.exact import ExactTracer
from fieldtruth.validate.law import check_of
from fieldtruth.validate.sampler import Sampler
from fieldtruth.validate.subject import Examiner, Place, Subject, place_of

F8 = NDArray[np.float64]

RAYS: Final = 16
"""Rays of a sampled cloud or image that the second tracer judges for itself."""
JUDGED: Final = 200
"""Rays of a cloud or image that it judges at most where the engine and the bag differ."""
ELSEWHERE: Final = 0.05
"""Share of rays from which on cloud or image were made in another place, and ``RAYS`` of them are enough to tell."""


def close(mine: NDArray[np.floating[Any]], theirs: NDArray[np.floating[Any]]) -> NDArray[np.bool_]:
    """Whether ranges [m] are the same in single precision, on whatever processor."""
    return np.asarray(np.abs(mine - theirs) <= 2e-5 + 1e-6 * np.abs(theirs))


class Outcome(NamedTuple):
    """What came of a cloud or an image."""

    rays: int
    differ: int
    """Rays of which the engine says otherwise."""
    wrong: list[str]
    """What is wrong with the bag's rays, by the second tracer."""
    judged: int
    """Rays that differ and were judged."""
    sampled: int
    """Rays that the second tracer judged for itself."""
    sampled_wrong: list[str]


class Retrace(Examiner):
    """Clouds and images against the rebuilt world."""

    def __init__(self, subject: Subject, sampler: Sampler, cloud_sampler: Sampler, *, full: bool) -> None:
        self._subject = subject
        self._sampler = sampler
        self._cloud_sampler = cloud_sampler
        self._full = full
        self._bundler = Bundler(("tag", "depth", "instances"), subject.run.counts, self._ask_moment)
        self._place = subject.place
        self.topics = [*self._bundler.topics, table.POINTS] if self._place is not None else []
        self._sensors = threading.local()
        self._tracer = None if self._place is None else ExactTracer(self._place.world)
        self._cloud = subject.law("the LiDAR, in the world built again, returns the cloud")
        self._image = subject.law("the camera, in the world built again, sees the tags, depths and object ids")
        self._ray = subject.law("rays traced in double precision meet what the bag says")
        self._differ = self._clouds = self._images = 0
        rig = subject.rig
        self._directions = ray_directions(rig.lidar).reshape(-1, 3)
        columns = np.arange(rig.lidar.columns)
        self._sweep = [int(t) for t in np.rint(columns * (1e9 / rig.lidar.rate_hz / rig.lidar.columns))]

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        if raw.topic != table.POINTS:
            self._bundler.add(raw.topic, raw.stamp_ns, message)
            return
        until = raw.stamp_ns + (self._sweep[-1] if self._subject.rig.lidar.spinning else 0)
        self._subject.motion.when_known(until, lambda: self._ask_cloud(raw, message))

    def finish(self) -> None:
        """See the end of the bag."""
        self._bundler.finish()

    def results(self) -> list[Check]:
        """Retraced clouds, retraced images, independent rays."""
        why = self._subject.no_place
        pardoned = f"; {self._differ:,} rays differ in a last digit or graze a border" if self._differ else ""
        part = "all" if self._full else "a sample"
        return [
            check_of("retraced clouds", [self._cloud],
                     f"{self._cloud.seen:,} rays of {self._clouds:,} clouds come back the same{pardoned}",
                     why or f"no {table.POINTS}, or no true motion"),
            check_of("retraced images", [self._image],
                     f"{self._image.seen:,} pixels of {self._images:,} images ({part}) are seen again{pardoned}",
                     why or "no tag images, or no true motion"),
            check_of("independent rays", [self._ray],
                     f"{self._ray.seen:,} rays, traced a second time in double precision, meet what the bag says",
                     why or "no clouds and no tag images, or no true motion"),
        ]  # fmt: skip

    def _ask_cloud(self, raw: RawMessage, message: Any) -> None:
        lidar, state = self._subject.rig.lidar, self._subject.motion.state
        base_from_lidar = lidar.mount.base_from_sensor
        if lidar.spinning:
            poses = np.stack([state(raw.stamp_ns + t).world_from_base for t in self._sweep]) @ base_from_lidar
        else:
            poses = state(raw.stamp_ns).world_from_base @ base_from_lidar
        sampled = self._cloud_sampler.takes(raw.stamp_ns)
        self._subject.submit(lambda: self._scan(raw, message, poses, sampled), self._fold_cloud)

    def _ask_moment(self, moment: Moment) -> None:
        if "tag" in moment.parts:
            self._subject.motion.when_known(moment.stamp_ns, lambda: self._ask_image(moment))

    def _ask_image(self, moment: Moment) -> None:
        sampled = self._sampler.takes(moment.stamp_ns)
        if not (sampled or self._full):
            return
        cameras = self._subject.rig.cameras
        mount = cameras.left if moment.side == "left" else cameras.right
        pose = (
            self._subject.motion.state(moment.stamp_ns).world_from_base @ mount.base_from_sensor @ CAMERA_FROM_OPTICAL
        )
        self._subject.submit(lambda: self._shoot(moment, pose, sampled), self._fold_image)

    def _fold_cloud(self, outcome: Outcome | None) -> None:
        if outcome is not None:
            self._clouds += 1
            self._cloud.count(outcome.rays, len(outcome.wrong), outcome.wrong[0] if outcome.wrong else "")
            self._fold(outcome)

    def _fold_image(self, outcome: Outcome | None) -> None:
        if outcome is not None:
            self._images += 1
            self._image.count(outcome.rays, len(outcome.wrong), outcome.wrong[0] if outcome.wrong else "")
            self._fold(outcome)

    def _fold(self, outcome: Outcome) -> None:
        self._differ += outcome.differ
        self._ray.count(outcome.sampled, len(outcome.sampled_wrong), "".join(outcome.sampled_wrong[:1]))

    def _scan(self, raw: RawMessage, message: Any, poses: F8, sampled: bool) -> Outcome | None:
        """Scan again, and compare ray by ray."""
        config = self._subject.rig.lidar
        try:
            cloud = read.points(message)
            number = cloud["column"].astype(np.int64) * config.rings + cloud["ring"]
            xyz = np.stack([cloud[axis] for axis in "xyz"], axis=-1)
            told = _dense(number, len(self._directions), xyz, cloud["label"], cloud["instance"])
        except (ValueError, KeyError):
            return None  # its layout is told by its own law
        scan = self._lidar().scan(poses)
        number = scan.column.astype(np.int64) * config.rings + scan.ring
        seen = _dense(number, len(self._directions), scan.xyz, scan.label, scan.instance)
        same = (told.label == seen.label) & (told.instance == seen.instance)
        same &= close(told.xyz, seen.xyz).all(axis=1)

        def claim(k: int) -> Claim:
            column, ring = divmod(k, config.rings)
            pose = poses[column] if poses.ndim == 3 else poses
            label, instance = int(told.label[k]), int(told.instance[k])
            return Claim(
                f"{place_of(raw)}, column {column}, ring {ring}", pose[:3, 3], pose[:3, :3] @ self._directions[k],
                float(np.linalg.norm(told.xyz[k].astype(np.float64))), label, instance,
                config.min_range, config.max_range, pulse=True,
            )  # fmt: skip

        return self._judge(np.flatnonzero(~same), len(self._directions), claim, raw.stamp_ns if sampled else None)

    def _shoot(self, moment: Moment, pose: F8, sampled: bool) -> Outcome | None:
        """Look again, and compare pixel by pixel."""
        config, lens = self._subject.rig.cameras, pinhole(self._subject.rig.cameras)
        try:
            label = read.labels(read.image(moment.parts["tag"]))
            instance = read.instances(moment.parts["instances"]) if "instances" in moment.parts else None
            depth = read.depth(moment.parts["depth"]).astype(np.float64) if "depth" in moment.parts else None
        except FieldtruthError:
            return None  # what is wrong with a picture is told by its own laws
        if any(p is not None and p.shape != (config.height, config.width) for p in (label, instance, depth)):
            return None
        seen = self._camera().label(pose)
        same = label == seen.label
        if instance is not None:
            same &= instance == seen.instance
        if depth is not None:
            with np.errstate(invalid="ignore"):
                same &= np.where(seen.depth > 0, close(depth, seen.depth.astype(np.float64)), depth == np.inf)

        def claim(k: int) -> Claim:
            v, u = divmod(k, config.width)
            ray = np.array([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, 1.0])
            length = float(np.linalg.norm(ray))
            sky = label[v, u] == Label.SKY
            reach = NOTHING if sky else float("nan") if depth is None else float(depth[v, u]) * length
            return Claim(
                f"{moment.place('tag')}, row {v}, column {u}", pose[:3, 3], pose[:3, :3] @ ray / length, reach,
                int(label[v, u]), UNKNOWN if instance is None else int(instance[v, u]), 0.0, config.far, pulse=False,
            )  # fmt: skip

        return self._judge(np.flatnonzero(~same), label.size, claim, moment.stamp_ns if sampled else None)

    def _judge(self, differ: NDArray[np.intp], rays: int, claim: Any, seed: int | None) -> Outcome:
        """Let the second tracer judge rays that differ, and a sample of all."""
        place, tracer = self._subject.place, self._tracer
        assert place is not None
        assert tracer is not None
        count = min(len(differ), RAYS if len(differ) > ELSEWHERE * rays else JUDGED)
        judged = differ[np.unique(np.linspace(0, len(differ) - 1, count).astype(int))]
        drawn = (
            [] if seed is None else np.random.default_rng(seed).choice(rays, min(RAYS, rays), replace=False).tolist()
        )
        wrong, drawn_wrong = (_wrong(place, tracer, [claim(int(k)) for k in rows]) for rows in (judged, drawn))
        return Outcome(rays, len(differ) - len(wrong), wrong, len(judged), len(drawn), drawn_wrong)

    def _lidar(self) -> Lidar:
        if not hasattr(self._sensors, "lidar"):
            assert self._place is not None
            self._sensors.lidar = Lidar(self._subject.rig.lidar, self._place.scene)
        lidar: Lidar = self._sensors.lidar
        return lidar

    def _camera(self) -> Camera:
        if not hasattr(self._sensors, "camera"):
            assert self._place is not None
            self._sensors.camera = Camera(self._subject.rig.cameras, self._place.scene, reuse=True)
        camera: Camera = self._sensors.camera
        return camera


class _Dense(NamedTuple):
    """A value for each ray of the LiDAR; 0 where none came back."""

    xyz: NDArray[np.float32]
    label: NDArray[np.uint16]
    instance: NDArray[np.uint16]


def _dense(number: Any, rays: int, xyz: Any, label: Any, instance: Any) -> _Dense:
    inside = number < rays  # others are told by the laws of beams
    dense = _Dense(np.zeros((rays, 3), np.float32), np.zeros(rays, np.uint16), np.zeros(rays, np.uint16))
    dense.xyz[number[inside]] = xyz[inside]
    dense.label[number[inside]] = label[inside]
    dense.instance[number[inside]] = instance[inside]
    return dense


def _wrong(place: Place, tracer: ExactTracer, claims: list[Claim]) -> list[str]:
    """What is wrong with each claim that is."""
    answers = refuted(place.world, tracer, claims)
    return [f"{claim.where}: {_told(claim)}, but {answer}"
            for claim, answer in zip(claims, answers, strict=True) if answer is not None]  # fmt: skip


def _told(claim: Claim) -> str:
    if claim.range_m == NOTHING:
        return "nothing came back" if claim.pulse else "sky"
    thing = "" if claim.instance == UNKNOWN else f" of object {claim.instance}"
    return f"class {claim.label}{thing} at {claim.range_m:.4f} m"
