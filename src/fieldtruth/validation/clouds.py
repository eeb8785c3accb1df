# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Laws of each cloud: its layout, its classes, and its beams, on whose rays every point must lie.

A point is its beam's direction times a range in single precision, each coordinate rounded to 24 bits: it lies within
1.2e-7 of its range off the beam. Twice that is allowed; a millimetre sideways is found up to 4 km.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import points
from fieldtruth.bag.reader import RawMessage
from fieldtruth.bag.sensor_messages import POINT, SWEPT_POINT
from fieldtruth.core.classes import CLASSES, NO_RETURN, Label
from fieldtruth.experiment.rig import LidarConfig
from fieldtruth.sense.lidar import ray_directions
from fieldtruth.validation.check import Check
from fieldtruth.validation.law import Law, check_of
from fieldtruth.validation.objects import N_CLASSES, ObjectLaw
from fieldtruth.validation.subject import Examiner, Subject, place_of

DIRECTION_BOUND: Final = 2.4e-7
"""[rad] between a point and its beam."""
RANGE_ROUNDING: Final = 1e-6
"""Of a range, by which coordinates in single precision may place a point before or behind the limits."""

_RETURNS: Final = [int(c.label) for c in CLASSES if c.label is not Label.VOID and c.label not in NO_RETURN]


class Laws(NamedTuple):
    """The laws of clouds."""

    layout: Law
    finite: Law
    same: Law
    known: Law
    rays: Law
    order: Law
    time: Law
    reach: Law
    direction: Law

    def another(self) -> "Laws":
        """Return the same laws with nothing seen."""
        return Laws(*(law.another() for law in self))


class Seen(NamedTuple):
    """What a thread found in a cloud."""

    laws: Laws
    points: int
    pairs: NDArray[np.int64]
    first: dict[tuple[int, int], str]


class Clouds(Examiner):
    """Labels and beams of /os1_cloud_node/points."""

    topics = (table.POINTS,)

    def __init__(self, subject: Subject, objects: ObjectLaw) -> None:
        self._subject = subject
        self._objects = objects
        self._points = self._clouds = 0
        self._laws = Laws(
            layout=subject.law("clouds have the fields of this package's point"),
            finite=subject.law("points are finite"),
            same=subject.law("intensity is the label"),
            known=subject.law("classes are known and return a pulse"),
            rays=subject.law("ring and column are the LiDAR's"),
            order=subject.law("points are ordered by column and ring, none twice"),
            time=subject.law("t is the time at which the column's rays leave"),
            reach=subject.law("ranges are the LiDAR's"),
            direction=subject.law("points lie on the rays of their ring and column", DIRECTION_BOUND, "rad"),
        )

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        config, laws, place = self._subject.rig.lidar, self._laws, place_of(raw)
        self._subject.submit(lambda: _examine(message, config, laws.another(), place), self._fold)

    def results(self) -> list[Check]:
        """Labels, beams."""
        laws = self._laws
        nothing = f"no {table.POINTS}" if table.POINTS not in self._subject.run.counts else "no such fields"
        return [
            check_of("labels", [laws.layout, laws.finite, laws.same, laws.known],
                     f"{self._points:,} points of {self._clouds:,} clouds: intensity is the label, "
                     "and a class that returns a pulse", nothing),
            check_of("beams", [laws.rays, laws.order, laws.time, laws.reach, laws.direction],
                     f"{laws.direction.seen:,} points lie on their rays: {laws.direction.margin}; order, times and "
                     "ranges are the LiDAR's", nothing),
        ]  # fmt: skip

    def _fold(self, seen: Seen) -> None:
        for mine, theirs in zip(self._laws, seen.laws, strict=True):
            mine.merge(theirs)
        self._points += seen.points
        self._clouds += 1
        self._objects.add(seen.pairs, seen.first)


def _examine(message: Any, config: LidarConfig, laws: Laws, place: str) -> Seen:
    """Examine a cloud; whatever its fields lead to that is no cloud is told as such."""
    try:
        return _examine_cloud(message, points(message), config, laws, place)
    except (ValueError, KeyError, TypeError, IndexError) as error:
        laws.layout.see(False, f"{place}: {error}")
        return Seen(laws, 0, np.zeros((0, N_CLASSES), np.int64), {})


def _examine_cloud(message: Any, cloud: NDArray[np.void], config: LidarConfig, laws: Laws, place: str) -> Seen:
    names = cloud.dtype.names or ()
    expected = SWEPT_POINT if config.spinning else POINT
    laws.layout.see(cloud.dtype == expected and message.is_dense and not message.is_bigendian,
                    f"{place}: fields {', '.join(names)}")  # fmt: skip

    def row(k: int) -> str:
        return f"{place}, row {k}"

    if "label" in names and "intensity" in names:
        label, intensity = cloud["label"], cloud["intensity"]
        laws.same.see_all(label == intensity, lambda k: f"{row(k)}: label {label[k]}, intensity {intensity[k]:g}")
    classes = next((cloud[name] for name in ("label", "intensity") if name in names), None)
    if classes is not None:
        laws.known.see_all(np.isin(classes, _RETURNS), lambda k: f"{row(k)}: class {classes[k]:g}")
    if {"x", "y", "z"} <= set(names):
        xyz = np.stack([cloud[axis] for axis in "xyz"], axis=-1).astype(np.float64)
        laws.finite.see_all(np.asarray(np.isfinite(xyz).all(axis=-1)), lambda k: f"{row(k)}: {xyz[k]} m")
        if {"ring", "column"} <= set(names):
            _examine_rays(cloud, xyz, config, laws, row)
    if cloud.dtype not in (POINT, SWEPT_POINT):
        return Seen(laws, len(cloud), np.zeros((0, N_CLASSES), np.int64), {})
    pairs, first = _pairs(cloud["instance"], cloud["label"], row)
    return Seen(laws, len(cloud), pairs, first)


def _examine_rays(
    cloud: NDArray[np.void], xyz: NDArray[np.float64], config: LidarConfig, laws: Laws, row: Callable[[int], str]
) -> None:
    ring, column = cloud["ring"].astype(np.int64), cloud["column"].astype(np.int64)
    inside = (ring >= 0) & (ring < config.rings) & (column >= 0) & (column < config.columns)
    laws.rays.see_all(inside, lambda k: f"{row(k)}: ring {ring[k]}, column {column[k]}")
    number = column * config.rings + ring
    laws.order.see_all(np.diff(number) > 0, lambda k: f"{row(k + 1)}: column {column[k + 1]}, ring {ring[k + 1]}")
    if "t" in (cloud.dtype.names or ()):
        step = 1e9 / config.rate_hz / config.columns
        due = np.rint(column * step).astype(np.uint32) if config.spinning else np.zeros(len(column), np.uint32)
        laws.time.see_all(cloud["t"] == due, lambda k: f"{row(k)}: {cloud['t'][k]} ns, due {due[k]} ns")
    reach: NDArray[np.float64] = np.linalg.norm(xyz, axis=-1)
    least, most = config.min_range * (1 - RANGE_ROUNDING), config.max_range * (1 + RANGE_ROUNDING)
    laws.reach.see_all(
        np.asarray((reach >= least) & (reach <= most)),
        lambda k: f"{row(k)}: {reach[k]:.3f} m, allowed {config.min_range:g} to {config.max_range:g} m",
    )
    beams = _directions(config)[np.where(inside, column, 0), np.where(inside, ring, 0)]
    with np.errstate(invalid="ignore"):  # what is not finite is told by another law, and broken by this one
        aside = np.linalg.norm(xyz - beams * reach[:, None], axis=-1) / np.maximum(reach, 1e-9)
    laws.direction.measure_all(aside[inside], lambda k: row(int(np.flatnonzero(inside)[k])))


@cache
def _directions(config: LidarConfig) -> NDArray[np.float64]:
    return ray_directions(config)


def _pairs(
    instance: NDArray[np.uint16], label: NDArray[np.uint16], row: Callable[[int], str]
) -> tuple[NDArray[np.int64], dict[tuple[int, int], str]]:
    """Counts of objects by class, and the first row of each pair; classes that do not exist are another law's."""
    known = np.flatnonzero(label < N_CLASSES)
    code = instance[known].astype(np.int64) * N_CLASSES + label[known]
    found, firsts, counts = np.unique(code, return_index=True, return_counts=True)
    pairs = np.zeros((int(found.max(initial=-1)) // N_CLASSES + 1, N_CLASSES), np.int64)
    pairs.reshape(-1)[found] = counts
    where = {divmod(int(c), N_CLASSES): row(int(known[k])) for c, k in zip(found, firsts, strict=True)}
    return pairs, where
