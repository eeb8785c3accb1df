# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Echoes of a beam that has a width: several rays stand for it, and what they meet within a pulse merges.

A beam's irradiance is a Gaussian of the angle, exp(-r^2 / 2 s^2) with s = FWHM / sqrt(8 ln 2). One ray in its middle
with half of the power, and the others in a ring of radius 2 s with the rest, have its moments up to the fifth degree
with six rays in the ring (Stroud 1971, Approximate calculation of multiple integrals, E2-r2 5-1), and its second and
fourth radial ones with any number. The ring is turned from beam to beam, so that two rays in it see no direction more
than others.

An echo begins with the nearest ray that is left, and takes all within ``pulse_length``. Its power is their sum and its
range their mean by power, where the peak of a waveform is that has not separated (Wagner and others 2006, ISPRS Journal
60, 100-112). Class and id are those of the object with most of its power.
"""

import numpy as np

from fieldtruth.kernels.lidar import TURNS, SubRays
from fieldtruth.kernels.packets import LANES
from fieldtruth.sensors.lidar.signal import LidarSignal


def sub_rays_of(signal: LidarSignal) -> SubRays:
    """Rays of a beam of a signal with at least three of them."""
    count = signal.sub_rays
    radius = 2.0 * np.radians(signal.divergence_deg) / np.sqrt(8.0 * np.log(2.0))
    ring = np.arange(count - 1) + np.arange(TURNS)[:, None] / TURNS  # (TURNS, count - 1) of its spacing
    angle = 2.0 * np.pi * ring / (count - 1)
    offset = np.zeros((TURNS, count, 2))
    offset[:, 1:] = radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    memory = LANES * count
    return SubRays(
        offset=offset,
        scale=float(1.0 / np.sqrt(1.0 + radius**2)),
        weight=np.array([0.5, *(count - 1) * (0.5 / (count - 1),)]),
        choice=("strongest", "last", "two").index(signal.returns),
        pulse_length=signal.pulse_length,
        number=np.array([0] * LANES + [*range(1, count)] * LANES),
        origin=np.zeros((memory, 3)),
        direction=np.zeros((memory, 3)),
        range_m=np.zeros(memory),
        clear=np.zeros(memory),
        power=np.zeros(memory),
        label=np.zeros(memory, np.int64),
        instance=np.zeros(memory, np.int64),
        order=np.zeros(count, np.int64),
    )
