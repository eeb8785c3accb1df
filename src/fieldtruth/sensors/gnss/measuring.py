# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The positions that a GNSS receiver measures along a drive, from what its antenna receives through the scene."""

import dataclasses
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core import random
from fieldtruth.core.arrays import Array, Counts, Mask
from fieldtruth.core.geodesy import geodetic_from_world, world_from_geodetic
from fieldtruth.core.random import GaussMarkov
from fieldtruth.drive.track import GnssFixes, GnssReadings
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.gnss import noise
from fieldtruth.sensors.gnss.almanac import directions, read_almanac, seconds_of_week
from fieldtruth.sensors.gnss.config import GnssConfig
from fieldtruth.sensors.gnss.navigation import PositionFilter, RangeErrors
from fieldtruth.sensors.gnss.signal import GnssSignal
from fieldtruth.sensors.gnss.solution import solve
from fieldtruth.sensors.gnss.visibility import amplitudes

NO_FIX: Final = -1
"""Status of sensor_msgs/NavSatStatus without a position."""
ALONE: Final = {"single": 0, "sbas": 1, "rtk": 0}
"""Its status with a position but without a base station: FIX or SBAS_FIX."""
AIDED: Final = 2
"""GBAS_FIX, with ambiguities as real or as whole numbers, as ROS drivers have it."""


class Sky(NamedTuple):
    """What an antenna receives at t times of n satellites."""

    directions: Array
    """Unit vectors (t, n, 3) in the world frame."""
    ratio: Array
    """Carrier-to-noise density ratios (t, n) [dB-Hz], -inf of what does not arrive."""
    used: Mask
    """(t, n)."""


def sky_at(scene: Scene | None, antennas: Array, stamps_ns: Counts, signal: GnssSignal) -> Sky:
    """Return the sky above antenna positions (t, 3) [m] at stamps (t,); without a scene there are no obstacles."""
    seconds = seconds_of_week(signal.utc) + np.asarray(stamps_ns) / 1e9
    toward = directions(read_almanac(signal.constellations), seconds)
    sine = toward[..., 2]
    above = noise.in_use(sine, np.full(sine.shape, 100.0), signal)
    amplitude = np.where(above, 1.0, 0.0)
    if scene is not None and signal.obstacles:
        leaf = 10.0 ** (-signal.leaf_db / 20.0)
        for k, antenna in enumerate(antennas):
            amplitude[k, above[k]] = amplitudes(scene, antenna, toward[k, above[k]], leaf)
    ratio = noise.carrier_to_noise(sine, amplitude, signal)
    return Sky(toward, ratio, noise.in_use(sine, ratio, signal))


class GnssErrors:
    """What a receiver measures, fix by fix, so that fixes do not depend on how their series is cut.

    Args:
        config: the receiver.
        signal: its figures.
        seed: of the experiment.
    """

    def __init__(self, config: GnssConfig, signal: GnssSignal, seed: int) -> None:
        self._signal, self._step_s = signal, 1.0 / config.rate_hz

        def rng(purpose: str) -> np.random.Generator:
            return random.rng_of(seed, config.name, purpose)

        self._rtk = noise.RtkStates(rng("rtk"), self._step_s, signal) if signal.mode == "rtk" else None
        kept = [float(np.exp(-self._step_s / tau)) for tau in (signal.range_tau_s, signal.multipath_tau_s)]
        satellites = len(read_almanac(signal.constellations).names)
        self._processes = [
            GaussMarkov(rng(name), satellites, share)
            for name, share in zip(("range", "multipath", "white"), [*kept, 0.0], strict=True)
        ]
        self._filter, self._state = PositionFilter(), -1

    def extend(self, true: GnssReadings, scene: Scene | None) -> GnssReadings:
        """Return the next readings with what the receiver measures in a scene of obstacles."""
        antennas = world_from_geodetic(true.geodetic)
        fixes = [
            self._fix(sky_at(scene, antennas[k : k + 1], true.stamps_ns[k : k + 1], self._signal), true.geodetic[k])
            for k in range(len(true.stamps_ns))
        ]
        return dataclasses.replace(true, fixes=self._joined(fixes))

    def _fix(self, sky: Sky, geodetic: Array) -> "_Fix":
        """Return the fix at a true position (3,) under a sky of one time."""
        signal = self._signal
        states = np.zeros(1, np.int64)
        if self._rtk is not None:
            states = self._rtk.extend(np.where(sky.used, sky.ratio, -np.inf))
        sigma = noise.sigmas(sky.directions[..., 2], sky.ratio, states, signal)
        solution = solve(sky.directions, sky.used, np.sqrt(sum(each**2 for each in sigma)))
        gain = solution.gain[0] if solution.dop[0, 0] <= signal.pdop_max else np.full_like(solution.gain[0], np.nan)
        errors = [RangeErrors(p.draw(1)[0], own[0], p.kept) for p, own in zip(self._processes, sigma, strict=True)]
        state = int(states[0])
        memory = float(np.exp(-self._step_s / max(signal.filter_s, 1e-9))) if state == self._state else 0.0
        self._state = state
        error, covariance = self._filter.follow(gain, errors, memory)
        found, exact = bool(np.isfinite(error[0])), signal.is_exact
        moved = geodetic if exact else geodetic_from_world(world_from_geodetic(geodetic) + error)
        return _Fix(
            geodetic=moved if found else np.full(3, np.nan),
            covariance=covariance if found and not exact else np.zeros((3, 3)),
            status=NO_FIX if not found else ALONE[signal.mode] if state == noise.SINGLE else AIDED,
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
