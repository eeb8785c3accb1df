# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The positions that a GNSS receiver measures along a drive, from what its antenna receives through the scene."""

import dataclasses
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core import random
from fieldtruth.core.arrays import Array, Counts, Mask
from fieldtruth.core.geodesy import geodetic_from_world, world_from_geodetic
from fieldtruth.drive.track import GnssFixes, GnssReadings
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.gnss import noise
from fieldtruth.sensors.gnss.almanac import directions, read_almanac, seconds_of_week
from fieldtruth.sensors.gnss.config import GnssConfig
from fieldtruth.sensors.gnss.navigation import Process, follow
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


def measure(scene: Scene | None, readings: GnssReadings, config: GnssConfig, seed: int) -> GnssReadings:
    """Return the readings of a receiver with what it measures added; as they are if its signal is ideal.

    Args:
        scene: with the obstacles.
        readings: true positions of the antenna.
        config: the receiver.
        seed: of the experiment.
    """
    signal = config.signal
    if signal is None or not len(readings.stamps_ns):
        return readings
    antennas = world_from_geodetic(readings.geodetic)
    sky = sky_at(scene, antennas, readings.stamps_ns, signal)
    return dataclasses.replace(readings, fixes=fixes_of(sky, readings.geodetic, config, seed))


def fixes_of(sky: Sky, geodetic: Array, config: GnssConfig, seed: int) -> GnssFixes:
    """Return the positions that a receiver at ``geodetic`` (t, 3) measures under a sky."""
    signal, step_s = config.signal, 1.0 / config.rate_hz
    assert signal is not None

    def rng(purpose: str) -> np.random.Generator:
        return random.rng_of(seed, config.name, purpose)

    states = np.zeros(len(geodetic), np.int64)
    if signal.mode == "rtk":
        states = noise.rtk_states(rng("rtk"), np.where(sky.used, sky.ratio, -np.inf), step_s, signal)
    sigma = noise.sigmas(sky.directions[..., 2], sky.ratio, states, signal)
    solution = solve(sky.directions, sky.used, np.sqrt(sum(each**2 for each in sigma)))
    solution.gain[~(solution.dop[:, 0] <= signal.pdop_max)] = np.nan
    kept = [float(np.exp(-step_s / tau)) for tau in (signal.range_tau_s, signal.multipath_tau_s)]
    processes = [
        Process(noise.gauss_markov(rng(name), sky.used.shape, share), each, share)
        for name, each, share in zip(("range", "multipath", "white"), sigma, [*kept, 0.0], strict=True)
    ]
    memory = np.where(np.diff(states, prepend=-1), 0.0, np.exp(-step_s / max(signal.filter_s, 1e-9)))
    error, covariance = follow(solution.gain, processes, memory)
    found, exact = np.isfinite(error[:, 0]), signal.is_exact
    moved = geodetic if exact else geodetic_from_world(world_from_geodetic(geodetic) + error)
    return GnssFixes(
        geodetic=np.where(found[:, None], moved, np.nan),
        covariance=np.where(found[:, None, None] & (not exact), covariance, 0.0),
        status=np.where(found, np.where(states == noise.SINGLE, ALONE[signal.mode], AIDED), NO_FIX),
        service=signal.service,
        state=states,
        satellites=solution.satellites,
        dop=solution.dop,
    )
