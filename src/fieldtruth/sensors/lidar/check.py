# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clouds: layout, labels and rays of every point; and the cloud that the LiDAR measures in the rebuilt world.

Points of LiDARs as checks compare them: those of an ideal cloud, a value for each ray, and the law of their noise. The
noise is not made again: what the rebuilt world's surfaces send back gives the signal that is expected of each ray, and
the signal's figures give the deviation of its range and the probability that it returns.
"""

import threading
from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from fieldtruth.bag import decode as read
from fieldtruth.bag.file import BagError
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import NO_RETURN, Label
from fieldtruth.drive.track import poses_at
from fieldtruth.experiment.rig import Rig, visible_parts
from fieldtruth.kernels.lidar import EchoBuffers
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.sensors.lidar.config import PASSING, LidarConfig, LidarSignal
from fieldtruth.sensors.lidar.sensing import (
    IdealLidar,
    Lidar,
    limit_of,
    ray_directions,
    ray_times_ns,
    ring_lag,
    sweep_times_ns,
)
from fieldtruth.validation.check import Check, Rule, Spec, Tally
from fieldtruth.validation.context import Checker, Context, Sampler, at
from fieldtruth.validation.kind_checks import KindChecks, LabelledPoints, Pass
from fieldtruth.validation.rays import UNKNOWN, RayReading, RayReference, close, same_passing
from fieldtruth.validation.world import ClassComparison, ObjectClasses

BIAS: Final = Rule("ranges have no bias, within 5 standard errors and 2 %")
WIDTH: Final = Rule("ranges vary as the signal's range_noise says, within 5 standard errors and 2 %")
RETURNED: Final = Rule("as many pulses return as the signal's reach says, within 5 standard errors and 0.2 %")
NOISE: Final[Spec] = Spec("noise of LiDARs", (BIAS, WIDTH, RETURNED), skipped="no clouds, or no true motion")
_ERRORS: Final = 5.0
_SLACK: Final = 0.02
"""Share of a deviation by which echoes of wide beams may differ: elsewhere a ray may meet another surface."""
_LOST: Final = 0.002


def rays_at(config: LidarConfig, stamp_ns: int) -> Array:
    """Directions (columns * rings, 3) of a scan at a stamp by number of the ray."""
    return _directions(config, 0 if config.pattern is None else stamp_ns)


@lru_cache(maxsize=16)
def _directions(config: LidarConfig, stamp_ns: int) -> Array:
    return ray_directions(config, stamp_ns).reshape(-1, 3)


def ideal_points(cloud: NDArray[np.void], config: LidarConfig, directions: Array) -> NDArray[np.void]:
    """Points of a cloud by column and ring; of a LiDAR with a signal at their true ranges, one of a ray.

    Args:
        cloud: points with the cloud's own fields.
        config: its LiDAR.
        directions: (columns * rings, 3) of its rays by number.
    """
    names = cloud.dtype.names or ()
    if not {"x", "y", "z", "ring", "column"} <= set(names) or not (config.organised or config.signal):
        return cloud
    ray = cloud["column"].astype(np.int64) * config.rings + cloud["ring"]
    if config.organised:
        order = np.argsort(ray, kind="stable")
        cloud, ray = cloud[order], ray[order]
        returned = np.isfinite(cloud["x"])
        cloud, ray = cloud[returned], ray[returned]
    if config.signal is None or "true_range" not in names:
        return cloud
    first = np.ones(len(ray), np.bool_)
    first[1:] = ray[1:] != ray[:-1]
    known = first & (cloud["true_range"] > 0.0) & (ray >= 0) & (ray < len(directions))
    found: NDArray[np.void] = cloud[known]
    xyz = directions[ray[known]] * found["true_range"].astype(np.float64)[:, None]
    for axis, values in zip("xyz", xyz.T, strict=True):
        found[axis] = values
    return found


class DenseCloud(NamedTuple):
    """A value for each ray of the LiDAR; 0 without a return."""

    xyz: NDArray[np.float32]
    label: NDArray[np.uint16]
    instance: NDArray[np.uint32]
    part: NDArray[np.uint8]
    passing: NDArray[np.float32]

    @classmethod
    def of(cls, config: LidarConfig, column: Any, ring: Any, values: Sequence[Any]) -> "DenseCloud":
        """Spread returns over all rays; those of rays that do not exist are reported by the check of rays."""
        number, count = column.astype(np.int64) * config.rings + ring, config.columns * config.rings
        inside = (number >= 0) & (number < count)
        parts: list[NDArray[Any]] = [
            np.zeros((count, 3), np.float32),
            np.zeros(count, np.uint16),
            np.zeros(count, np.uint32),
            np.zeros(count, np.uint8),
            np.zeros((count, 2), np.float32),
        ]
        for part, value in zip(parts, values, strict=True):
            part[number[inside]] = value[inside]
        return cls(*parts)

    @classmethod
    def of_points(cls, config: LidarConfig, cloud: NDArray[np.void]) -> "DenseCloud":
        """Return the values of points with the fields of a message."""
        xyz = np.stack([cloud[axis] for axis in "xyz"], axis=-1)
        part = cloud["part"] if config.parts else np.zeros(len(cloud), np.uint8)
        zeros = np.zeros(len(cloud), np.float32)
        passing = np.stack([cloud[name] if config.passability else zeros for name in PASSING], axis=-1)
        return cls.of(config, cloud["column"], cloud["ring"], (xyz, cloud["label"], cloud["instance"], part, passing))

    def first(self, count: int) -> "DenseCloud":
        """The values of the first ``count`` rays."""
        return DenseCloud._make(values[:count] for values in self)

    def labelled_as(self, other: "DenseCloud", where: Mask) -> "DenseCloud":
        """The same with all but the points of another one where ``where`` is true."""
        label, instance = np.where(where, other.label, self.label), np.where(where, other.instance, self.instance)
        passing = np.where(where[:, None], other.passing, self.passing)
        return DenseCloud(self.xyz, label, instance, np.where(where, other.part, self.part), passing)


def expected_signal(signal: LidarSignal, echoes: EchoBuffers) -> Array:
    """Photons of each echo (echoes, columns, rings), 0 without one; infinite if every pulse returns."""
    limit = limit_of(signal)
    with np.errstate(divide="ignore", invalid="ignore"):
        power = echoes.apparent.astype(np.float64) / echoes.depth.astype(np.float64) ** 2
        photons = np.where(echoes.depth > 0.0, signal.signal_at_reach * power / limit if limit else np.inf, 0.0)
    return np.asarray(photons)


def deviation_of(signal: LidarSignal, photons: Array) -> Array:
    """Standard deviation [m] of ranges, with that of the rounding to the resolution."""
    if not signal.range_noise:
        return np.full(photons.shape, signal.resolution / np.sqrt(12.0))
    at, deviations = np.log(np.array(signal.range_noise)).T
    own = np.exp(np.interp(np.log(np.minimum(photons, 1e30)), at, deviations))
    return np.asarray(np.hypot(own, signal.resolution / np.sqrt(12.0)))


class NoiseTally(Tally):
    """Sums over all points of the LiDARs with a signal; the check is made of them at the end."""

    def __init__(self, spec: Spec = NOISE, strict: bool = True) -> None:
        super().__init__(spec, strict)
        self._lock = threading.Lock()
        self._sums: dict[str, Array] = {}

    def add(self, config: LidarConfig, cloud: NDArray[np.void], echoes: EchoBuffers, columns: int) -> None:
        """Add the points of the first ``columns`` of a cloud, with the echoes that are expected of its rays."""
        assert config.signal is not None
        photons = expected_signal(config.signal, echoes)[:, :columns]
        deviations = deviation_of(config.signal, np.maximum(photons, 1e-9))
        threshold = config.signal.signal_at_reach
        with np.errstate(invalid="ignore", divide="ignore"):
            likely = np.where(np.isinf(photons), 1.0, ndtr((photons - threshold) / np.sqrt(photons)))
        likely = np.where(photons > 0.0, likely, 0.0)
        inside = np.isfinite(cloud["x"]) & (cloud["column"] < columns)
        column, ring = cloud["column"][inside].astype(int), cloud["ring"][inside].astype(int)
        measured = np.linalg.norm(np.stack([cloud[axis][inside].astype(np.float64) for axis in "xyz"]), axis=0)
        depths = np.where(echoes.depth > 0.0, echoes.depth, np.inf)[:, column, ring].astype(np.float64)
        echo = np.abs(depths - measured).argmin(axis=0)
        error = (measured - depths[echo, np.arange(len(echo))]) / np.maximum(deviations[echo, column, ring], 1e-6)
        error = error[np.isfinite(error)]
        sums = [len(error), error.sum(), (error**2).sum(), len(measured), likely.sum(), (likely * (1 - likely)).sum()]
        with self._lock:
            self._sums[config.name] = self._sums.get(config.name, np.zeros(6)) + sums

    def result(self) -> Check:
        """Return the check."""
        for name, (count, total, squares, returned, expected, variance) in sorted(self._sums.items()):
            mean, width = total / max(count, 1.0), np.sqrt(squares / max(count, 1.0))
            slack = _ERRORS / np.sqrt(max(count, 1.0))
            text = f"{name}: {count:,.0f} points, mean {mean:.4f}, deviation {width:.4f} of that expected"
            self[BIAS].see(bool(abs(mean) <= slack + _SLACK), text)
            self[WIDTH].see(bool(abs(width - 1.0) <= slack + _SLACK), text)
            limit = _ERRORS * np.sqrt(variance) + _LOST * expected
            found = f"{name}: {returned:,.0f} returns, expected {expected:,.0f}"
            self[RETURNED].see(bool(abs(returned - expected) <= limit), found)
            self.note = "; ".join([*filter(None, [self.note]), text, found])
        return super().result()


LAYOUT: Final = Rule("clouds have the fields of this package's points")
FINITE: Final = Rule("points are finite")
INTENSITY: Final = Rule("intensity is the label")
RETURNING: Final = Rule("classes exist and return a pulse")
_NO_FIELDS: Final = "no clouds with these fields"
LABELS: Final[Spec] = Spec("labels", (LAYOUT, FINITE, INTENSITY, RETURNING), "points", _NO_FIELDS)
INDICES: Final = Rule("ring and column exist")
ORDER: Final = Rule("points are ordered by column and ring, without repetition")
TIME: Final = Rule("t, where present, is the time at which the ray leaves")
RANGE: Final = Rule("ranges are within the LiDAR's limits")
# A point is a direction times a range, each coordinate rounded to 24 bits: it is within 1.2e-7 of its ray.
DIRECTION: Final = Rule("points lie on the rays of their ring and column", 2.4e-7, "rad")
RAYS: Final[Spec] = Spec("rays", (INDICES, ORDER, TIME, RANGE, DIRECTION), "points", _NO_FIELDS)
SAME_RETURNS: Final = Rule("LiDARs measure the same returns in the rebuilt world")
# On a processor like the one that made a run all clouds are equal, and one that is not was changed. A point of a LiDAR
# with a signal is compared by its true range, which is rounded another time.
EQUAL_CLOUDS: Final = Rule("clouds made as here are equal to the last digit", minor=True)
_NO_CLOUDS: Final = "no clouds, or no true motion"
RETRACED_CLOUDS: Final[Spec] = Spec("retraced clouds", (SAME_RETURNS, EQUAL_CLOUDS), "rays", _NO_CLOUDS)
_ROUNDING: Final = 1e-6
"""Share of a range by which single precision may exceed the limits."""
_CLOCK_ROUNDING: Final = 1e-6
"""[s], which a double resolves for stamps of today, and single precision within a scan."""


class Clouds(Checker):
    """Labels and rays of every cloud."""

    def __init__(self, context: Context, objects: ObjectClasses) -> None:
        self._context, self._objects = context, objects
        self._configs = {config.topic: config for config in context.rig.enabled(LidarConfig)}
        self.topics = tuple(self._configs)
        self._labels, self._rays = context.tally(LABELS), context.tally(RAYS)
        self.tallies = [self._labels, self._rays]

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        config, where, classes = self._configs[raw.topic], at(raw), self._objects.comparison()
        labels, rays = self._labels.part(), self._rays.part()

        def work() -> list[Tally]:
            try:
                _check_cloud(raw, message, config, labels, rays, classes)
            except (
                BagError,
                ValueError,
                KeyError,
                TypeError,
                IndexError,
            ) as error:  # bytes that do not hold these fields
                labels[LAYOUT].see(False, f"{where}: {error}")
            return [labels, rays, classes.tally]

        self._context.jobs.append(work)


def _check_cloud(
    raw: RawMessage, message: Any, config: LidarConfig, tally: Tally, rays: Tally, classes: ClassComparison
) -> None:
    cloud, where = read.points(message), at(raw)
    found, due = _fields(cloud.dtype), _fields(config.point_type(wide_ids=classes.has_wide_ids))
    untimed = {"t": "<u4"} if "t" in found and not config.spinning else {}  # all rays leave at once
    whole = found == due | untimed and message.is_dense != config.organised and not message.is_bigendian
    tally[LAYOUT].see(bool(whole), f"{where}: fields {', '.join(found)}")

    directions = rays_at(config, raw.stamp_ns)
    cloud = ideal_points(cloud, config, directions)

    def row(k: int) -> str:
        return f"{where}, row {k}"

    if {"label", "intensity"} <= found.keys() and config.intensity == "class":
        label, intensity = cloud["label"], cloud["intensity"]
        same = label == intensity
        tally[INTENSITY].see_all(same, lambda k: f"{row(k)}: label {label[k]}, intensity {intensity[k]:g}")
    of_class = ("label", *["intensity"] * (config.signal is None))
    if name := next((name for name in of_class if name in found), None):
        values = cloud[name]
        returning = np.isin(values, [row.label for row in classes.classes.coloured if row.label not in NO_RETURN])
        tally[RETURNING].see_all(returning, lambda k: f"{row(k)}: class {values[k]:g}")
    if {"x", "y", "z"} <= found.keys():
        xyz = np.stack([cloud[axis] for axis in "xyz"], axis=-1).astype(np.float64)
        tally[FINITE].see_all(np.asarray(np.isfinite(xyz).all(axis=-1)), lambda k: f"{row(k)}: {xyz[k]} m")
        if {"ring", "column"} <= found.keys():
            _check_rays(cloud, xyz, directions, config, rays, row)
    stamp = read.stamp_ns(message.header)
    if whole and config.point_fields == "ouster" and config.signal is None:
        _check_ouster(cloud, xyz, tally, rays, row)
    if whole and config.point_fields == "livox":
        _check_livox(cloud, stamp, tally, rays, row)
    clock = config.time_field if config.spinning else None
    if whole and clock:
        start = stamp if clock == "timestamp" else 0
        leaves = (start + cloud["t"].astype(np.int64)) / 1e9
        late = np.abs(cloud[clock] - leaves) > _CLOCK_ROUNDING
        rays[TIME].see_all(~late, lambda k: f"{row(k)}: {clock} {cloud[clock][k]} s, due at {leaves[k]} s")
    if whole:
        real = np.flatnonzero(cloud["label"] < len(classes.classes))
        classes.see(cloud["instance"][real], cloud["label"][real], lambda k: row(int(real[k])))


def _fields(points: np.dtype[np.void]) -> dict[str, str]:
    """Return the fields of points with their NumPy types."""
    return {name: kind.str for name, (kind, *_) in (points.fields or {}).items()}


def _check_ouster(cloud: NDArray[np.void], xyz: Array, tally: Tally, rays: Tally, row: Callable[[int], str]) -> None:
    dark = (cloud["reflectivity"] == cloud["label"]) & (cloud["ambient"] == 0)
    tally[INTENSITY].see_all(
        dark, lambda k: f"{row(k)}: reflectivity {cloud['reflectivity'][k]}, ambient {cloud['ambient'][k]}"
    )
    range_mm = 1000.0 * np.linalg.norm(xyz, axis=-1)
    near = np.abs(cloud["range"] - range_mm) < 0.5 + 1e-6  # an integer
    rays[RANGE].see_all(near, lambda k: f"{row(k)}: range {cloud['range'][k]} mm, point at {range_mm[k]:.3f} mm")


def _check_livox(cloud: NDArray[np.void], stamp_ns: int, tally: Tally, rays: Tally, row: Callable[[int], str]) -> None:
    sure = (cloud["line"] == cloud["ring"]) & (cloud["tag"] == 0)
    tally[LAYOUT].see_all(sure, lambda k: f"{row(k)}: line {cloud['line'][k]}, tag {cloud['tag'][k]}")
    due = (stamp_ns + (cloud["t"].astype(np.int64) if "t" in (cloud.dtype.names or ()) else 0)) * 1.0
    rays[TIME].see_all(cloud["timestamp"] == due, lambda k: f"{row(k)}: timestamp {cloud['timestamp'][k]} ns")


def _check_rays(
    cloud: NDArray[np.void], xyz: Array, directions: Array, config: LidarConfig, tally: Tally, row: Callable[[int], str]
) -> None:
    ring, column = cloud["ring"].astype(np.int64), cloud["column"].astype(np.int64)
    inside = (ring >= 0) & (ring < config.rings) & (column >= 0) & (column < config.columns)
    tally[INDICES].see_all(inside, lambda k: f"{row(k)}: ring {ring[k]}, column {column[k]}")
    rising = np.diff(column * config.rings + ring) > 0
    tally[ORDER].see_all(rising, lambda k: f"{row(k + 1)}: column {column[k + 1]}, ring {ring[k + 1]}")
    if "t" in (cloud.dtype.names or ()):
        due = _times(config)[np.where(inside, column * config.rings + ring, 0)]
        tally[TIME].see_all(cloud["t"] == due, lambda k: f"{row(k)}: {cloud['t'][k]} ns, due at {due[k]} ns")
    range_m: Array = np.linalg.norm(xyz, axis=-1)
    least, most = config.min_range * (1 - _ROUNDING), config.max_range * (1 + _ROUNDING)
    limits = f"limits are {config.min_range:g} and {config.max_range:g} m"
    tally[RANGE].see_all(
        np.asarray((range_m >= least) & (range_m <= most)), lambda k: f"{row(k)}: {range_m[k]:.3f} m, {limits}"
    )
    rays = directions[np.where(inside, column * config.rings + ring, 0)]
    with np.errstate(invalid="ignore"):  # points that are not finite break this rule as well
        aside = np.linalg.norm(xyz - rays * range_m[:, None], axis=-1) / np.maximum(range_m, 1e-9)
    tally[DIRECTION].measure_all(aside[inside], lambda k: row(int(np.flatnonzero(inside)[k])))


@cache
def _times(config: LidarConfig) -> NDArray[np.int64]:
    """Time [ns] after the scan's stamp at which each ray leaves, by number of the ray."""
    count = config.columns * config.rings
    return ray_times_ns(config).reshape(-1) if config.spinning else np.zeros(count, np.int64)


@cache
def _sweep_times(config: LidarConfig) -> NDArray[np.int64]:
    """Times [ns] after a scan's stamp at which its columns begin and the last one ends; 0 if all rays leave at once."""
    return sweep_times_ns(config) if config.spinning else np.zeros(1, np.int64)


class RetracedClouds(Checker):
    """Every cloud, measured again in the rebuilt world and compared ray by ray."""

    def __init__(self, context: Context, rebuilt: SensorWorld, reference: RayReference, sampler: Sampler) -> None:
        self._context, self._rebuilt, self._reference, self._sampler = context, rebuilt, reference, sampler
        self._tally = context.tally(RETRACED_CLOUDS)
        self.noise = NoiseTally(strict=context.experiment is not None)
        self._tally.note = context.made_elsewhere
        self.tallies = [self._tally, self.noise]
        self._own = threading.local()
        self._configs = {config.topic: config for config in context.rig.enabled(LidarConfig)}
        self.topics = tuple(self._configs)

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        end = raw.stamp_ns + int(_sweep_times(self._configs[raw.topic])[-1])
        self._context.motion.when_known(end, lambda: self._submit(raw, message))

    def _submit(self, raw: RawMessage, message: Any) -> None:
        config, motion = self._configs[raw.topic], self._context.motion
        stamps = raw.stamp_ns + _sweep_times(config)
        if config.spinning:
            world_from_base = poses_at(motion.motion, stamps)
        else:
            world_from_base = motion.state(raw.stamp_ns).world_from_base[None]
        poses = world_from_base @ config.mount.base_from_sensor
        # The last scan of a spinning LiDAR is completed after the end of the bag, where no pose is known.
        known = int(np.searchsorted(stamps, motion.motion.stamps_ns[-1], "right"))
        seed = raw.stamp_ns if self._sampler.takes(raw.stamp_ns, config.name) else None
        columns = min(known - 1, config.columns) if len(poses) > 1 else config.columns
        self._context.jobs.append(lambda: self._compare(raw, message, poses, columns, seed))

    def _compare(self, raw: RawMessage, message: Any, poses: Array, columns: int, seed: int | None) -> list[Tally]:
        """Scan again from poses as ``Lidar.scan`` takes them, or from one (1, 4, 4); compare the first ``columns``."""
        config = self._configs[raw.topic]
        try:
            measured, directions = read.points(message), rays_at(config, raw.stamp_ns)
            bag = DenseCloud.of_points(config, ideal_points(measured, config, directions))
        except (BagError, ValueError, KeyError):
            return []  # the check of labels reports the layout
        aimed = poses if len(poses) > 1 else poses[0], raw.stamp_ns
        own = self._scanned(config, aimed)
        bag, own = bag.first(columns * config.rings), own.first(columns * config.rings)
        checked = np.arange(len(bag.label))
        if config.signal is not None:
            if not self._context.has_weather:
                self._add_noise(config, measured, aimed, columns)
            checked = np.flatnonzero(bag.xyz.any(axis=1))  # others did not return
            # A particle or an edge may have made the echo; the true range is that of the middle of the beam.
            bag = bag.labelled_as(own, (bag.label == Label.PARTICLE) | (config.signal.sub_rays > 1))
        same = np.equal(bag.label, own.label)[checked] & np.equal(bag.instance, own.instance)[checked]
        same &= (np.equal(bag.part, own.part) & same_passing(bag.passing, own.passing))[checked]
        equal = bool(same.all()) and np.array_equal(bag.xyz[checked], own.xyz[checked])
        same &= close(bag.xyz[checked], own.xyz[checked]).all(axis=1)

        def reading(j: int) -> RayReading:
            k = int(checked[j])
            column, ring = divmod(k, config.rings)
            pose = poses[0]
            if len(poses) > 1:
                pose = poses[column] + ring_lag(config)[ring] * (poses[column + 1] - poses[column])
            range_m, mount = float(np.linalg.norm(bag.xyz[k].astype(np.float64))), config.mount.base_from_sensor
            return RayReading(
                f"{at(raw)}, column {column}, ring {ring}", pose[:3, 3], pose[:3, :3] @ directions[k],
                range_m, int(bag.label[k]), int(bag.instance[k]), config.min_range, config.max_range, pulsed=True,
                in_base=(mount[:3, 3], mount[:3, :3] @ directions[k]),
                stamp_ns=raw.stamp_ns + int(ray_times_ns(config)[column, ring]) * config.spinning,
                part=int(bag.part[k]) if config.parts else UNKNOWN,
                passing=bag.passing[k] if config.passability else None,
            )  # fmt: skip

        tally = self._tally.part()
        if config.signal is None and not self._context.made_elsewhere:
            tally[EQUAL_CLOUDS].see(equal, at(raw))
        return [tally, self._reference.compare(tally[SAME_RETURNS], np.flatnonzero(~same), len(same), reading, seed)]

    def _scanned(self, config: LidarConfig, aimed: tuple[Array, int]) -> DenseCloud:
        """Scan the rebuilt world."""
        lidars = vars(self._own)
        if config.name not in lidars:
            lidars[config.name] = IdealLidar(config, self._rebuilt.scene, visible_parts(self._context.rig))
        scan = lidars[config.name].scan(*aimed)
        passes = np.zeros((len(scan.top), 2), np.float32)
        if config.passability:
            passes = self._rebuilt.passability.of(scan.top, scan.label)
        values = scan.xyz, scan.label, scan.instance, scan.part, passes
        return DenseCloud.of(config, scan.column, scan.ring, values)

    def _add_noise(self, config: LidarConfig, cloud: NDArray[np.void], aimed: tuple[Array, int], columns: int) -> None:
        """Count the noise of a cloud against the echoes that its LiDAR expects from the rebuilt world."""
        lidars, name = vars(self._own), f"signal of {config.name}"
        if name not in lidars:
            lidars[name] = Lidar(config, self._rebuilt.scene, robot=visible_parts(self._context.rig))
        self.noise.add(config, cloud, lidars[name].echoes(*aimed), columns)


def _labelled(rig: Rig) -> list[LabelledPoints]:
    """Return the LiDARs of a rig; of one with a signal the points are those at the true ranges."""

    def points_of(config: LidarConfig) -> LabelledPoints:
        def decode(message: Any, stamp_ns: int) -> NDArray[np.void]:
            return ideal_points(read.points(message), config, rays_at(config, stamp_ns))

        spins = "the LiDAR spins while the robot moves; its points are checked by retracing"
        # Of a wide beam, any part may have made the echo, and the true range is that of the middle.
        narrow = config.signal is None or config.signal.sub_rays == 1
        sweep = int(_sweep_times(config)[-1]) if narrow else None
        return LabelledPoints(config.name, config.topic, decode, spins if config.spinning else "", sweep)

    return [points_of(config) for config in rig.enabled(LidarConfig)]


def _checkers(shared: Pass) -> list[Checker]:
    context, rays = shared.context, shared.rays
    checkers: list[Checker] = [Clouds(context, shared.objects)]
    if context.rebuilt is not None and rays is not None:
        checkers.append(RetracedClouds(context, context.rebuilt, rays, shared.sampler()))
    return checkers


CHECKS: Final = KindChecks(
    make=_checkers,
    form=(LABELS, RAYS),
    retraced=(RETRACED_CLOUDS,),
    extras=(NOISE,),
    extras_of=lambda context: (NOISE,) * any(config.signal is not None for config in context.rig.enabled(LidarConfig)),
    points=_labelled,
)
