# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How much of a satellite's signal reaches the antenna through the scene that LiDARs and cameras see.

A wave needs the space around the straight line, its first Fresnel zone: at a distance d from the antenna a disc of
radius sqrt(wavelength d), 0.44 m at 1 m and 1.4 m at 10 m. Sixteen rays bend apart so as to fill that disc evenly. Each
arrives with the amplitude that leaves let through, or with none if ground, wood, rock or furniture stops it, and the
mean of the amplitudes is that of the signal. A straight edge through the line of sight thus takes 6 dB, as the
diffraction at a knife edge does (ITU-R P.526, section 4.1), and a thin trunk weakens a satellite which a wall takes.

Leaves attenuate by their number, not by the length of the path: the surfaces that a ray crosses are an unbiased measure
of leaf area along it in a thin crown as in a dense one, in which the first and the last of a few hits say little.
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.kernels.gnss import LEAF, OPAQUE, OPEN, trace_paths
from fieldtruth.kernels.packets import new_packet
from fieldtruth.sense.scene import Scene

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

    Args:
        scene: shared by all sensors.
        antenna: position (3,) [m] in the world.
        directions: unit vectors (n, 3) in the world to the satellites.
        leaf: share of the amplitude that passes a leaf.
    """
    share, paths = np.zeros((len(directions), RAYS)), ray_paths(antenna, directions)
    trace_paths(scene.rays.handle, scene.hits, new_packet(coherent=False), paths, (leaf, _SURFACE), share)
    mean: Array = share.mean(axis=1)
    return mean
