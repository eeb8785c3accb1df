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

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.kernels.compile import kernel
from fieldtruth.sense import embree
from fieldtruth.sense.hits import HitTable, classify, hit_top
from fieldtruth.sense.packets import Packet, new_packet, set_ray
from fieldtruth.sense.scene import Scene

WAVELENGTH: Final = 299_792_458.0 / 1_575.42e6
"""Of the carrier L1 and E1 [m]."""
RAYS: Final = 16
"""Rays to a satellite."""
KNOTS: Final = np.array([0.0, 0.5, 2.0, 8.0, 32.0, 128.0])
"""Distances from the antenna [m] between which a ray is straight; beyond the last it is parallel to the line."""
LEAVES: Final = (Label.TREETOP, Label.BUSH, Label.HIGH_GRASS)

_NEXT: Final = 1e-3  # [m] beyond a leaf, where its ray goes on
_FAR: Final = 1e5  # [m], beyond every hill
_WEAK: Final = 1e-3  # share of the amplitude, 60 dB, below which nothing is left
_OPEN, _LEAF, _OPAQUE = 0, 1, 2
_SURFACE: Final = np.full(256, _OPAQUE, np.uint8)
_SURFACE[[int(label) for label in LEAVES]] = _LEAF
_SURFACE[16:] = _OPEN  # the robot, whose antenna stands above it, and drops of rain
_LANES = embree.LANES
Kinds = NDArray[np.uint8]
_X, _Y, _DX, _DY = embree.ORG_X, embree.ORG_Y, embree.DIR_X, embree.DIR_Y
_T, _PRIM = embree.TFAR, embree.PRIM_ID
_intersect: Any = embree.intersect


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
    _trace(scene.rays.handle, scene.hits, new_packet(coherent=False), paths, (leaf, _SURFACE), share)
    mean: Array = share.mean(axis=1)
    return mean


@kernel(allocates=True)
def _trace(
    scene: np.uint64, hits: HitTable, packet: Packet, paths: Array, surfaces: tuple[float, Kinds], out: Array
) -> None:
    """Follow rays along their ``paths``; ``out`` (n, rays) is the share of the amplitude that arrives."""
    leaf, kinds = surfaces
    ray, words, valid, arguments = packet
    count, rays, corners, _ = paths.shape
    total = count * rays
    part, near = np.zeros(_LANES, np.int64), np.zeros(_LANES)
    for first in range(0, total, _LANES):
        for lane in range(_LANES):
            part[lane], near[lane] = (0 if first + lane < total else corners), 0.0
            if first + lane < total:
                out[(first + lane) // rays, (first + lane) % rays] = 1.0
        running = True
        while running:
            running = False
            for lane in range(_LANES):
                k = min(first + lane, total - 1)
                i, j, s = k // rays, k % rays, min(part[lane], corners - 2)
                x, y, z = paths[i, j, s, 0], paths[i, j, s, 1], paths[i, j, s, 2]
                dx, dy, dz = paths[i, j, s + 1, 0] - x, paths[i, j, s + 1, 1] - y, paths[i, j, s + 1, 2] - z
                length = np.sqrt(dx * dx + dy * dy + dz * dz)
                set_ray(packet, lane, (x, y, z), (dx / length, dy / length, dz / length), near[lane], length)
                valid[lane] = -1 if part[lane] < corners - 1 else 0
                running |= valid[lane] != 0
            if not running:
                break
            _intersect(valid.ctypes, scene, ray.ctypes, arguments.ctypes)
            for lane in range(_LANES):
                if valid[lane] == 0:
                    continue
                top = hit_top(hits.geometry_top, words, lane)
                if top < 0:
                    part[lane], near[lane] = part[lane] + 1, 0.0
                    continue
                i, j, far = (first + lane) // rays, (first + lane) % rays, ray[_T + lane]
                x, y = ray[_X + lane] + far * ray[_DX + lane], ray[_Y + lane] + far * ray[_DY + lane]
                class_id, _ = classify(hits, top, words[_PRIM + lane], x, y)
                near[lane] = far * (1.0 + 1e-6) + _NEXT
                if kinds[class_id] == _LEAF:
                    out[i, j] *= leaf
                if kinds[class_id] == _OPAQUE or out[i, j] < _WEAK:
                    out[i, j], part[lane] = 0.0, corners
