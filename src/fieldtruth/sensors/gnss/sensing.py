# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Positions of a GNSS receiver: the true ones, and those of a receiver that hears satellites through the scene.

docs/gnss.md explains orbits, rays to the satellites, errors of ranges and RTK. Positions of satellites follow
IS-GPS-200, section 20.3.3.5.2.1 and table 20-IV, reduced to the terms of an almanac, which are good to a few kilometres
within a fortnight: 0.01 deg seen from the ground.
"""

import dataclasses
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from functools import cache
from importlib.resources import files
from typing import Final, NamedTuple

import numpy as np
import pymap3d

from fieldtruth.core import random
from fieldtruth.core.arrays import Array, Counts, Mask
from fieldtruth.core.classes import Label
from fieldtruth.core.geodesy import PAPER_ORIGIN, Origin, geodetic_from_world, world_from_geodetic
from fieldtruth.core.random import GaussMarkov
from fieldtruth.drive.controller import antenna_geodetic
from fieldtruth.drive.track import STEP_NS, Motion, Stamps, steps_at_rate
from fieldtruth.kernels.gnss import LEAF, OPAQUE, OPEN, trace_paths
from fieldtruth.kernels.packets import new_packet
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.gnss.config import GnssConfig, GnssSignal

GRAVITATION: Final = 3.986005e14
"""Gravitational constant of the Earth [m^3/s^2] in IS-GPS-200."""
EARTH_RATE: Final = 7.2921151467e-5
"""Rotation of the Earth [rad/s] in IS-GPS-200."""
TIME_OF_WEEK: Final = 61440.0
"""Time of applicability of the almanac [s] of GPS week 2429."""
_LEAP: Final = timedelta(seconds=18)  # GPS time less UTC since 2017
WEEK_START: Final = datetime(1980, 1, 6, tzinfo=UTC) + timedelta(weeks=2429) - _LEAP
"""UTC at which the week of the almanac begins."""
_SYSTEMS: Final = {"gps": "G", "galileo": "E"}


class Almanac(NamedTuple):
    """Orbits of n satellites; arrays (n,), angles in radians as in the data file."""

    names: tuple[str, ...]
    sqrt_a: Array  # [m^0.5]
    eccentricity: Array
    inclination: Array
    node: Array  # longitude of the ascending node at the beginning of the week
    node_rate: Array  # [rad/s]
    perigee: Array
    anomaly: Array  # mean anomaly at the time of applicability


@cache
def read_almanac(systems: tuple[str, ...]) -> Almanac:
    """Return the satellites of the systems, ``gps`` and ``galileo``, from ``almanac.csv``, which states its sources."""
    text = (files("fieldtruth.sensors.gnss") / "almanac.csv").read_text(encoding="utf-8")
    rows = [line.split(",") for line in text.splitlines() if not line.startswith("#")][1:]
    rows = [row for system in systems for row in rows if row[0].startswith(_SYSTEMS[system])]
    return Almanac(tuple(row[0] for row in rows), *np.array([row[1:] for row in rows], np.float64).T)


def seconds_of_week(utc: datetime) -> float:
    """Seconds [s] from the beginning of the almanac's week to a time."""
    return (utc - WEEK_START).total_seconds()


def eccentric_anomaly(mean: Array, eccentricity: Array) -> Array:
    """Solve Kepler's equation E - e sin E = M [rad] by Newton's method, for e below 0.5."""
    result = mean + eccentricity * np.sin(mean)
    for _ in range(5):  # the error is squared each time: e = 0.02 needs two
        result = result - (result - eccentricity * np.sin(result) - mean) / (1.0 - eccentricity * np.cos(result))
    return result


def positions(almanac: Almanac, seconds: Array) -> Array:
    """Earth-fixed positions (t, n, 3) [m] at times (t,) [s] from the beginning of the almanac's week."""
    elapsed = np.asarray(seconds)[:, None] - TIME_OF_WEEK
    axis = almanac.sqrt_a**2
    mean = almanac.anomaly + np.sqrt(GRAVITATION / axis**3) * elapsed
    anomaly = eccentric_anomaly(mean, almanac.eccentricity)
    sine = np.sqrt(1.0 - almanac.eccentricity**2) * np.sin(anomaly)
    latitude = np.arctan2(sine, np.cos(anomaly) - almanac.eccentricity) + almanac.perigee  # argument of latitude
    radius = axis * (1.0 - almanac.eccentricity * np.cos(anomaly))
    node = almanac.node + (almanac.node_rate - EARTH_RATE) * elapsed - EARTH_RATE * TIME_OF_WEEK
    along, across = radius * np.cos(latitude), radius * np.sin(latitude)
    level = across * np.cos(almanac.inclination)
    return np.stack(
        [
            along * np.cos(node) - level * np.sin(node),
            along * np.sin(node) + level * np.cos(node),
            across * np.sin(almanac.inclination),
        ],
        axis=-1,
    )


def directions(almanac: Almanac, seconds: Array, origin: Origin = PAPER_ORIGIN) -> Array:
    """Unit vectors (t, n, 3) in the world frame (north, west, up) from its ``origin`` to the satellites.

    Seen from elsewhere in a world of 1 km they differ by 3e-5 rad; the signal's travel turns the Earth by 5e-6 rad.
    """
    x, y, z = np.moveaxis(positions(almanac, seconds), -1, 0)
    east, north, up = pymap3d.ecef2enu(x, y, z, *origin)
    vectors = np.stack([north, -east, up], axis=-1)
    unit: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit


ENU: Final = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""East, north, up from north, west, up."""


class RangeErrors(NamedTuple):
    """Errors of ranges at a time: independent Gauss-Markov series (n,) of unit variance, and their sigma (n,) [m]."""

    series: Array
    sigma: Array
    kept: float
    """Correlation from one time to the next; 0 for white noise."""


class PositionFilter:
    """The filter with which a receiver follows its solutions, and the exact covariance of its output.

    It averages their errors: f_k = b f_(k-1) + (1 - b) G_k e_k. The errors e of the ranges are sums of Gauss-Markov
    processes, and the covariance of f with each of them obeys a recursion of its own.
    """

    def __init__(self) -> None:
        self._error, self._covariance = np.zeros(3), np.zeros((3, 3))
        self._shared: list[Array] | None = None  # covariance with each process; None without a position before

    def follow(self, gain: Array, errors: Sequence[RangeErrors], memory: float) -> tuple[Array, Array]:
        """Return the error (3,) of the position in the world frame [m], and its covariance (3, 3) in ENU [m^2].

        Args:
            gain: (3, n) of the solution, NaN without one: then so is the result.
            errors: whose sum is the error of each range.
            memory: share of the output before that the filter keeps; 0 where it begins.
        """
        if not np.isfinite(gain).all():
            self._shared = None
            return np.full(3, np.nan), np.full((3, 3), np.nan)
        old = 0.0 if self._shared is None else memory
        new, before = 1.0 - old, self._shared or [np.zeros_like(gain) for _ in errors]
        moved = [gain * each.sigma for each in errors]
        cross = old * sum(p.kept * (c @ m.T) for p, c, m in zip(errors, before, moved, strict=True))
        ours = new**2 * sum(m @ m.T for m in moved)
        self._covariance = old**2 * self._covariance + new * (cross + np.transpose(cross)) + ours
        self._shared = [old * p.kept * c + new * m for p, c, m in zip(errors, before, moved, strict=True)]
        self._error = old * self._error + new * sum(m @ p.series for p, m in zip(errors, moved, strict=True))
        return self._error, ENU @ self._covariance @ ENU.T


UNKNOWNS: Final = 4


class Solution(NamedTuple):
    """Solutions at t times with n satellites; rows without one are NaN."""

    gain: Array
    """(t, 3, n): by how much the position moves in the world frame (north, west, up) with the error of a range."""
    dop: Array
    """(t, 3): position, horizontal and vertical dilution of precision."""
    satellites: Counts
    """(t,) satellites in use."""


def solve(directions: Array, used: Mask, sigma: Array) -> Solution:
    """Solve for position and clock by weighted least squares.

    With H the rows (-u, 1) of the unit vectors u to the satellites, and W the inverse variances of their ranges, the
    errors e of the ranges move the solution by (H' W H)^-1 H' W e, whose covariance is (H' W H)^-1 (Misra and Enge,
    Global Positioning System, 2nd ed., chapter 6).

    Args:
        directions: unit vectors (t, n, 3) to the satellites in the world frame.
        used: (t, n) satellites in use; with fewer than four there is no solution.
        sigma: (t, n) standard deviations of the ranges [m]; 0 counts as one that is small and the same for all.
    """
    count = used.sum(axis=1)
    solved = count >= UNKNOWNS
    rows = np.concatenate([-directions, np.ones((*used.shape, 1))], axis=-1)[solved]
    inverse = np.where(used, 1.0 / np.maximum(sigma, 1e-9) ** 2, 0.0)[solved]
    cofactor = _inverse(np.einsum("tn,tni,tnj->tij", np.where(used, 1.0, 0.0)[solved], rows, rows))
    covariance = _inverse(np.einsum("tn,tni,tnj->tij", inverse, rows, rows))
    gain = np.einsum("tij,tnj,tn->tin", covariance, rows, inverse)
    axes = np.diagonal(cofactor, axis1=1, axis2=2)
    dop = np.sqrt(np.stack([axes[:, :3].sum(axis=1), axes[:, :2].sum(axis=1), axes[:, 2]], axis=-1))
    return Solution(_spread(gain[:, :3], solved), _spread(dop, solved), count)


def _inverse(matrices: Array) -> Array:
    """Inverse of symmetric matrices (t, 4, 4); NaN where satellites lie in one plane with the clock."""
    regular = np.linalg.cond(matrices) < 1e12
    result = np.full_like(matrices, np.nan)
    result[regular] = np.linalg.inv(matrices[regular])
    return result


def _spread(values: Array, rows: Mask) -> Array:
    result = np.full((len(rows), *values.shape[1:]), np.nan)
    result[rows] = values
    return result


WAVELENGTH: Final = 299_792_458.0 / 1_575.42e6
"""Of the carrier L1 and E1 [m]."""
RAYS: Final = 16
"""Rays to a satellite."""
KNOTS: Final = np.array([0.0, 0.5, 2.0, 8.0, 32.0, 128.0])
"""Distances from the antenna [m] between which a ray is straight; beyond the last it is parallel to the line."""
LEAVES: Final = (Label.TREETOP, Label.BUSH, Label.HIGH_GRASS)
_FAR: Final = 1e5  # [m], beyond every hill
_SURFACE: Final = np.full(256, OPAQUE, np.uint8)
_SURFACE[[int(label) for label in LEAVES]] = LEAF
_SURFACE[16:] = OPEN  # the robot, whose antenna stands above it, and drops of rain


def sunflower() -> Array:
    """Positions (rays, 2) in the unit disc, as the seeds of a sunflower, so that each stands for the same area."""
    k = np.arange(RAYS) + 0.5
    angle = np.pi * (3.0 - np.sqrt(5.0)) * k
    disc: Array = np.sqrt(k / RAYS)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return disc


def ray_paths(antenna: Array, directions: Array) -> Array:
    """Corners (n, rays, corners, 3) [m] of the rays from an antenna (3,) in ``directions`` (n, 3), unit vectors."""
    helper = np.where(np.abs(directions[:, 2:]) < 0.9, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    side = np.cross(helper, directions)
    side /= np.linalg.norm(side, axis=-1, keepdims=True)
    disc = sunflower()
    across = disc[:, :1] * side[:, None] + disc[:, 1:] * np.cross(directions, side)[:, None]  # (n, rays, 3)
    knots, radii = np.append(KNOTS, _FAR), np.sqrt(WAVELENGTH * np.append(KNOTS, KNOTS[-1]))
    along = knots[:, None] * directions[:, None, None]
    paths: Array = antenna + along + radii[:, None] * across[:, :, None]
    return paths


def amplitudes(scene: Scene, antenna: Array, directions: Array, leaf: float) -> Array:
    """Share (n,) of the amplitude in the open with which signals arrive.

    The rays fill the first Fresnel zone evenly, at a distance d from the antenna a disc of radius sqrt(wavelength d). A
    straight edge through the line of sight thus takes 6 dB, as the diffraction at a knife edge does (ITU-R P.526,
    section 4.1).

    Args:
        scene: shared by all sensors.
        antenna: position (3,) [m] in the world.
        directions: unit vectors (n, 3) in the world to the satellites.
        leaf: share of the amplitude that passes a leaf.
    """
    share, paths = np.zeros((len(directions), RAYS)), ray_paths(antenna, directions)
    trace_paths(scene.still.rays.handle, scene.still.hits, new_packet(coherent=False), paths, (leaf, _SURFACE), share)
    mean: Array = share.mean(axis=1)
    return mean


REFERENCE_DBHZ: Final = 45.0
"""Carrier-to-noise density ratio at which the sigmas of multipath and thermal noise hold."""
_EARTH: Final = 6_378_137.0  # [m]
_LAYER: Final = 350_000.0  # [m], height of the ionosphere
SINGLE, FLOAT, FIXED = 0, 1, 2
"""States of an RTK receiver: alone, ambiguities as real numbers, and as whole ones."""


def obliquity(sine: Array) -> Array:
    """Path through the ionosphere's layer relative to the zenith, by the sine of the elevation: 1 to 3.14.

    Source: RTCA DO-229, appendix A.4.4.10.4, a thin shell 350 km high.
    """
    factor: Array = 1.0 / np.sqrt(1.0 - (1.0 - sine * sine) * (_EARTH / (_EARTH + _LAYER)) ** 2)
    return factor


def carrier_to_noise(sine: Array, amplitude: Array, signal: GnssSignal) -> Array:
    """Carrier-to-noise density ratio [dB-Hz] by the sine of the elevation and the share of amplitude that arrives."""
    horizon, zenith = signal.cn0_horizon_dbhz, signal.cn0_zenith_dbhz
    with np.errstate(divide="ignore"):
        ratio: Array = horizon + (zenith - horizon) * np.maximum(sine, 0.0) + 20.0 * np.log10(amplitude)
    return ratio


def sigmas(sine: Array, ratio: Array, state: Counts, signal: GnssSignal) -> tuple[Array, Array, Array]:
    """Standard deviations (t, n) [m] of the slow error, of that of reflections and of the white one.

    Args:
        sine: (t, n) of the elevations.
        ratio: (t, n) carrier-to-noise density ratios [dB-Hz].
        state: (t,) of the receiver.
        signal: figures.

    The variance of noise is inverse to the signal's power (Hartinger and Brunner, Variances of GPS phase observations:
    the SIGMA-epsilon model, GPS Solutions 2, 1999); reflections are as strong under trees while the direct signal, by
    whose amplitude their error is divided, is weaker.
    """
    alone, floating = (state == SINGLE)[:, None], (state == FLOAT)[:, None]
    growth = 10.0 ** ((REFERENCE_DBHZ - np.maximum(ratio, 0.0)) / 20.0)
    phase = np.where(floating, signal.rtk_float_sigma_m, signal.rtk_fixed_sigma_m)
    return (
        np.where(alone, signal.range_sigma_m * obliquity(sine), 0.0),
        np.where(alone, signal.multipath_sigma_m, phase) * growth,
        np.where(alone, signal.white_sigma_m, signal.rtk_white_sigma_m) * growth,
    )


class RtkStates:
    """States of an RTK receiver, which go on from call to call: they do not depend on how a drive is cut.

    It had its ambiguities before the drive. The phase of a satellite that was too weak counts from its beginning again,
    and takes ``rtk_fix_s`` to be of use.

    Args:
        rng: used by these states only.
        step_s: time [s] from one to the next.
        signal: figures.
    """

    def __init__(self, rng: np.random.Generator, step_s: float, signal: GnssSignal) -> None:
        self._rng, self._step_s, self._signal = rng, step_s, signal
        self._number = 0
        self._weak_at: Array | float = -np.inf  # number at which each satellite was last too weak
        self._linked_at = self._since = -np.inf

    def extend(self, ratio: Array) -> Counts:
        """Return the next states (t,) by the carrier-to-noise density ratios (t, n) of satellites in use, else -inf."""
        return np.array([self._next(row) for row in ratio], np.int64)

    def _next(self, ratio: Array) -> int:
        signal, step_s = self._signal, self._step_s
        now = self._number * step_s
        strong = ratio >= signal.rtk_cn0_min_dbhz
        self._weak_at = np.where(strong, self._weak_at, self._number)
        count = np.count_nonzero(strong & ((self._number - self._weak_at) * step_s >= signal.rtk_fix_s))
        chance = self._rng.random(3)
        lost = chance[0] < _probability(signal.rtk_losses_per_hour, step_s)
        if chance[1] < _probability(signal.link_losses_per_hour, step_s):
            pause = -signal.link_loss_s * np.log1p(-chance[2])  # exponential distribution
            self._linked_at = max(self._linked_at, now + pause)
        alone = now < self._linked_at
        if alone or lost:
            self._since = now
        self._number += 1
        fixed = not lost and now - self._since >= signal.rtk_fix_s and count >= signal.rtk_min_satellites
        return SINGLE if alone else FIXED if fixed else FLOAT


def in_use(sine: Array, ratio: Array, signal: GnssSignal) -> Mask:
    """Return the mask (t, n) of satellites that stand high enough and are strong enough."""
    above = sine > np.sin(np.radians(signal.elevation_mask_deg))
    used: Mask = above & np.isfinite(ratio) & (ratio >= signal.cn0_min_dbhz)
    return used


def _probability(per_hour: float, step_s: float) -> float:
    return float(-np.expm1(-per_hour * step_s / 3600.0))


@dataclasses.dataclass(frozen=True, kw_only=True)
class GnssFixes:
    """Measurements of a receiver; rows without a position have NaN there, and zeros in the covariance."""

    geodetic: Array
    """(n, 3) latitude, longitude [deg], ellipsoidal height [m]."""
    covariance: Array
    """(n, 3, 3) of the position in east, north, up [m^2]; zeros without errors."""
    status: Counts
    """(n,) of sensor_msgs/NavSatStatus."""
    service: int
    """Satellite systems, of sensor_msgs/NavSatStatus."""
    state: Counts
    """(n,) of RTK: 0 alone, 1 float, 2 fixed."""
    satellites: Counts
    """(n,) satellites in use."""
    dop: Array
    """(n, 3): position, horizontal and vertical dilution of precision; NaN below four satellites."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class GnssReadings:
    """Position of the antenna: ``geodetic`` (n, 3) latitude, longitude [deg], ellipsoidal height [m]."""

    stamps_ns: Stamps
    geodetic: Array
    fixes: GnssFixes | None = None
    """Measurements of the receiver; None if it is ideal."""


class GnssTruth:
    """True positions of an antenna, which go on as a motion grows."""

    def __init__(self, config: GnssConfig, origin: Origin = PAPER_ORIGIN) -> None:
        self._config, self._origin, self._until_ns = config, origin, 0

    def extend(self, motion: Motion) -> GnssReadings:
        """Return the geodetic positions that are due since the call before."""
        config, end_ns = self._config, int(motion.stamps_ns[-1])
        rows = steps_at_rate(config.rate_hz, end_ns, self._until_ns) - int(motion.stamps_ns[0]) // STEP_NS
        self._until_ns = end_ns
        geodetic = antenna_geodetic(motion.position[rows], motion.quaternion_wxyz[rows], config.mount, self._origin)
        return GnssReadings(stamps_ns=motion.stamps_ns[rows], geodetic=geodetic)


def read_gnss(motion: Motion, config: GnssConfig, origin: Origin = PAPER_ORIGIN) -> GnssReadings:
    """Return the geodetic positions of the antenna along a motion in a world of an ``origin``."""
    return GnssTruth(config, origin).extend(motion)


NO_FIX: Final = -1
"""Status of sensor_msgs/NavSatStatus without a position."""
ALONE: Final = {"single": 0, "sbas": 1, "rtk": 0}
"""Its status with a position but without a base station: FIX or SBAS_FIX."""
AIDED: Final = 2
"""GBAS_FIX, with ambiguities as real or as whole numbers, as ROS drivers have it."""


class Sky(NamedTuple):
    """Signals of n satellites at an antenna, at t times."""

    directions: Array
    """Unit vectors (t, n, 3) in the world frame."""
    ratio: Array
    """Carrier-to-noise density ratios (t, n) [dB-Hz], -inf of what does not arrive."""
    used: Mask
    """(t, n)."""


def sky_at(
    scene: Scene | None, antennas: Array, stamps_ns: Counts, signal: GnssSignal, origin: Origin = PAPER_ORIGIN
) -> Sky:
    """Return the sky above antenna positions (t, 3) [m] at stamps (t,); without a scene there are no obstacles."""
    seconds = seconds_of_week(signal.utc) + np.asarray(stamps_ns) / 1e9
    toward = directions(read_almanac(signal.constellations), seconds, origin)
    sine = toward[..., 2]
    above = in_use(sine, np.full(sine.shape, 100.0), signal)
    amplitude = np.where(above, 1.0, 0.0)
    if scene is not None and signal.obstacles:
        leaf = 10.0 ** (-signal.leaf_db / 20.0)
        for k, antenna in enumerate(antennas):
            amplitude[k, above[k]] = amplitudes(scene, antenna, toward[k, above[k]], leaf)
    ratio = carrier_to_noise(sine, amplitude, signal)
    return Sky(toward, ratio, in_use(sine, ratio, signal))


class GnssErrors:
    """Fixes of a receiver with errors, one by one, so that they do not depend on how their series is cut.

    Args:
        config: the receiver.
        signal: its figures.
        seed: of the experiment.
        origin: of the world.
    """

    def __init__(self, config: GnssConfig, signal: GnssSignal, seed: int, origin: Origin = PAPER_ORIGIN) -> None:
        self._signal, self._step_s, self._origin = signal, 1.0 / config.rate_hz, origin

        def rng(purpose: str) -> np.random.Generator:
            return random.rng_of(seed, config.name, purpose)

        self._rtk = RtkStates(rng("rtk"), self._step_s, signal) if signal.mode == "rtk" else None
        kept = [float(np.exp(-self._step_s / tau)) for tau in (signal.range_tau_s, signal.multipath_tau_s)]
        satellites = len(read_almanac(signal.constellations).names)
        self._processes = [
            GaussMarkov(rng(name), satellites, share)
            for name, share in zip(("range", "multipath", "white"), [*kept, 0.0], strict=True)
        ]
        self._filter, self._state = PositionFilter(), -1

    def extend(self, true: GnssReadings, scene: Scene | None) -> GnssReadings:
        """Return the next readings with what the receiver measures in a scene of obstacles."""
        antennas = world_from_geodetic(true.geodetic, self._origin)
        fixes = []
        for k in range(len(true.stamps_ns)):
            sky = sky_at(scene, antennas[k : k + 1], true.stamps_ns[k : k + 1], self._signal, self._origin)
            fixes.append(self._fix(sky, true.geodetic[k]))
        return dataclasses.replace(true, fixes=self._joined(fixes))

    def _fix(self, sky: Sky, geodetic: Array) -> "_Fix":
        """Return the fix at a true position (3,) under a sky of one time."""
        signal = self._signal
        states = np.zeros(1, np.int64)
        if self._rtk is not None:
            states = self._rtk.extend(np.where(sky.used, sky.ratio, -np.inf))
        sigma = sigmas(sky.directions[..., 2], sky.ratio, states, signal)
        solution = solve(sky.directions, sky.used, np.sqrt(sum(each**2 for each in sigma)))
        gain = solution.gain[0] if solution.dop[0, 0] <= signal.pdop_max else np.full_like(solution.gain[0], np.nan)
        errors = [RangeErrors(p.draw(1)[0], own[0], p.kept) for p, own in zip(self._processes, sigma, strict=True)]
        state = int(states[0])
        memory = float(np.exp(-self._step_s / max(signal.filter_s, 1e-9))) if state == self._state else 0.0
        self._state = state
        error, covariance = self._filter.follow(gain, errors, memory)
        found, exact = bool(np.isfinite(error[0])), signal.is_exact
        moved = (
            geodetic
            if exact
            else geodetic_from_world(world_from_geodetic(geodetic, self._origin) + error, self._origin)
        )
        return _Fix(
            geodetic=moved if found else np.full(3, np.nan),
            covariance=covariance if found and not exact else np.zeros((3, 3)),
            status=NO_FIX if not found else ALONE[signal.mode] if state == SINGLE else AIDED,
            state=state,
            satellites=int(solution.satellites[0]),
            dop=solution.dop[0],
        )

    def _joined(self, fixes: Sequence["_Fix"]) -> GnssFixes:
        return GnssFixes(
            geodetic=np.array([fix.geodetic for fix in fixes]).reshape(-1, 3),
            covariance=np.array([fix.covariance for fix in fixes]).reshape(-1, 3, 3),
            status=np.array([fix.status for fix in fixes], np.int64),
            service=self._signal.service,
            state=np.array([fix.state for fix in fixes], np.int64),
            satellites=np.array([fix.satellites for fix in fixes], np.int64),
            dop=np.array([fix.dop for fix in fixes]).reshape(-1, 3),
        )


class _Fix(NamedTuple):
    """A row of ``GnssFixes``."""

    geodetic: Array
    covariance: Array
    status: int
    state: int
    satellites: int
    dop: Array
