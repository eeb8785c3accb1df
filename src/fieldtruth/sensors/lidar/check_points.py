# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Points of LiDARs as checks compare them: those of an ideal cloud, a value for each ray, and the law of their noise.

The noise is not made again: what the rebuilt world's surfaces send back gives the signal that is expected of each ray,
and the signal's figures give the deviation of its range and the probability that it returns.
"""

import threading
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.kernels.lidar import EchoBuffers
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.noise import limit_of
from fieldtruth.sensors.lidar.sensing import ray_directions
from fieldtruth.sensors.lidar.signal import LidarSignal
from fieldtruth.validation.check import Check, Rule, Spec, Tally

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

    @classmethod
    def of(cls, config: LidarConfig, column: Any, ring: Any, *values: Any) -> "DenseCloud":
        """Spread returns over all rays; those of rays that do not exist are reported by the check of rays."""
        number, count = column.astype(np.int64) * config.rings + ring, config.columns * config.rings
        inside = (number >= 0) & (number < count)
        parts: list[NDArray[Any]] = [
            np.zeros((count, 3), np.float32),
            np.zeros(count, np.uint16),
            np.zeros(count, np.uint32),
        ]
        for part, value in zip(parts, values, strict=True):
            part[number[inside]] = value[inside]
        return cls(*parts)

    def first(self, count: int) -> "DenseCloud":
        """The values of the first ``count`` rays."""
        return DenseCloud(self.xyz[:count], self.label[:count], self.instance[:count])

    def labelled_as(self, other: "DenseCloud", where: Mask) -> "DenseCloud":
        """The same with class and instance of another one where ``where`` is true."""
        label, instance = np.where(where, other.label, self.label), np.where(where, other.instance, self.instance)
        return DenseCloud(self.xyz, label, instance)


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
