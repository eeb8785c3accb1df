# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shapes of the ground: slopes that a robot can drive, erosion, what trees leave in the soil, relief and its cover.

Slope limits. The gradient is cut to the limit and integrated by Poisson's equation (as Fattal, Lischinski and Werman
did with light, SIGGRAPH 2002). "Is a gradient" and "is nowhere too steep" are both convex, so alternating projections
(von Neumann) converge to a surface that is both. A route across a steep flank becomes a ledge without edges, and the
hill keeps its shape on either side.

Erosion. Streams follow the stream power law dh/dt = -K A^0.5 S (A the area drained, S the slope), solved implicitly
from the outlets upwards (Braun and Willett, Geomorphology 180, 2013), after hollows are filled to their lowest rim
(Barnes, Lehman and Mulla, Computers and Geosciences 62, 2014). Creep is linear diffusion (Culling, Journal of Geology
68, 1960). Collapse is the thermal weathering of Musgrave, Kolb and Mace (SIGGRAPH 1989): material above the angle of
repose moves to the lower neighbours. Material cut by streams is removed. Nothing here is random.

Pits and mounds. Sizes of old pairs whose trunk has rotted: mounds about 0.2 to 0.5 m high and 2 to 3 m long, pits about
as deep, the longer axis across the fall; the trees of one storm fell in one direction (Schaetzl, Burns, Small and
Johnson 1990, Physical Geography 11, quoted from memory).

Roots. Sizes follow the trunk's radius r: the swell is 0.25 r high and falls off over 2.5 r; four to seven roots leave
the trunk 0.4 r above the soil, thin out over 6 to 16 r and show above it in parts (drawn from photographs of spruce and
beech on shallow soils; no published statistics were found).

Microrelief has profiles with the displacement spectrum that ISO 8608 gives to a class of ground. A profile along any
straight line has the one-sided spectrum Gd(n) = Gd(n0) (n / n0)^-w [m^3] at spatial frequencies n [cycles/m], n0 = 0.1
(ISO 8608:2016, equation 7). An isotropic field of two-sided spectrum S(q) [m^4], q the magnitude of the spatial
frequency, has profiles of Gd(n) = 2 int S(hypot(n, m)) dm over all m: the frequencies across the line are summed (the
Abel transform of S). For S = C q^-(w + 1) the integral is C n^-w B(1/2, w/2) with Euler's beta function, so that C =
Gd(n0) n0^w / (2 B(1/2, w/2)) gives the profiles asked for. ``BAND`` limits q; up to its lower end n is unchanged, and
near its upper end the profiles lack what lies beyond: for w = 2, Gd(n) is multiplied by sqrt(1 - (n / q_max)^2).

The same white noise is used for every waviness, so that ground types merge without a seam.

The layer is short grass, litter or crumbs: what rays meet above the soil where no blade stands, and wheels press flat.
Its heights are normal numbers of the ground types' means and deviations, correlated over a few centimetres. It fades
out towards the edge of a trail from both sides, and where the cover changes to bare ground it changes with it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import gaussian_filter
from scipy.special import beta

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.erosion import diffuse, incise, route, slide
from fieldtruth.world.grids import coarseness
from fieldtruth.world.materials import GROUND_TYPES, MATERIALS, REFERENCE_FREQUENCY, Layer, Roughness
from fieldtruth.world.model import Terrain, node_axes

_TIGHTER: Final = 0.96


def slope_limit(distance: Array, *, within: float, beyond: float, near: float, far: float) -> Array:
    """Maximum slope [rise over run] at ``distance`` [m] from a route.

    ``within`` [deg] up to ``near`` [m], ``beyond`` [deg] from ``far`` [m] on, smooth in between.
    """
    t = np.clip((distance - near) / (far - near), 0.0, 1.0)
    return np.asarray(np.tan(np.radians(within + (beyond - within) * t * t * (3.0 - 2.0 * t))))


def limit_slope(heights: Array, spacing: float, limit: ArrayLike, *, rounds: int = 40) -> Array:
    """Heights (nx, ny) [m] whose slope nowhere exceeds ``limit`` [rise over run], a number or one per node.

    The mean height is kept. Each round cuts to ``_TIGHTER`` times the limit, so that a few rounds get below it.
    """
    h = np.array(heights, np.float64)
    aim = np.broadcast_to(np.asarray(limit, np.float64) * _TIGHTER, h.shape)
    nx, ny = h.shape
    waves = 2 * np.cos(np.pi * np.arange(nx) / nx)[:, None] + 2 * np.cos(np.pi * np.arange(ny) / ny) - 4
    waves[0, 0] = 1.0
    mean = h.mean()
    for _ in range(rounds):
        along, across = np.diff(h, axis=0) / spacing, np.diff(h, axis=1) / spacing
        share = np.minimum(1.0, aim / np.maximum(_steepness(along, across), 1e-9))
        if share.min() > _TIGHTER - 0.005:
            break
        along = along * np.minimum(share[1:], share[:-1]) * spacing
        across = across * np.minimum(share[:, 1:], share[:, :-1]) * spacing
        divergence = np.zeros_like(h)
        divergence[:-1] += along
        divergence[1:] -= along
        divergence[:, :-1] += across
        divergence[:, 1:] -= across
        spectrum = fft.dctn(divergence, type=2) / waves
        spectrum[0, 0] = 0.0
        h = fft.idctn(spectrum, type=2) + mean
    return h


def _steepness(along: Array, across: Array) -> Array:
    """Slope [rise over run] at each node (nx, ny), from the steepest cell sides along x and along y at the node."""
    a, b = np.abs(along), np.abs(across)
    a = np.maximum(np.pad(a, ((1, 0), (0, 0))), np.pad(a, ((0, 1), (0, 0))))
    b = np.maximum(np.pad(b, ((0, 0), (1, 0))), np.pad(b, ((0, 0), (0, 1))))
    return np.asarray(np.hypot(a, b))


class Eroded(NamedTuple):
    """Heights (nx, ny) [m] after erosion, and the area [m^2] that drains through each node."""

    heights: Array
    drained: Array


def eroded(
    heights: Array,
    spacing: float,
    *,
    strength: Array | float = 0.02,
    creep: float = 0.02,
    repose_deg: float = 36.0,
    steps: int = 30,
) -> Eroded:
    """Erode heights (nx, ny) [m] on a grid of ``spacing`` [m]; the border is unchanged.

    ``strength`` is K dt, a number or one per node: the depth [m] that a stream which drains 1 m^2 cuts into a slope of
    1 in a step. ``creep`` is D dt [m^2] per step. ``repose_deg`` [deg] limits the slope of the result.
    """
    h = np.array(heights, np.float64)
    power = np.ascontiguousarray(np.broadcast_to(np.asarray(strength, np.float64), h.shape))
    share = creep / spacing**2
    parts = max(1, int(np.ceil(share / 0.2)))
    order, receiver, drained = np.zeros(h.size, np.int64), np.zeros(h.size, np.int64), np.zeros(h.size)
    for _ in range(steps):
        route(h, order, receiver, drained, spacing)
        incise(h.reshape(-1), power.reshape(-1), order, receiver, drained, spacing, h.shape[1])
        for _ in range(parts):
            diffuse(h, share / parts)
    h = collapsed(h, spacing, repose_deg=repose_deg, steps=steps)
    route(h, order, receiver, drained, spacing)
    return Eroded(h, drained.reshape(h.shape).copy())


def collapsed(heights: Array, spacing: float, *, repose_deg: float, steps: int = 30) -> Array:
    """Collapse slopes above ``repose_deg`` [deg] into the lower neighbours; the volume inside the border is kept."""
    h = np.array(heights, np.float64)
    moved = np.empty_like(h)
    for _ in range(steps):
        slide(h, moved, float(np.tan(np.radians(repose_deg))), spacing)
        h += moved
    return h


def pits_and_mounds(x: Array, y: Array, positions: ArrayLike, rng: np.random.Generator) -> Array:
    """Heights [m] at the nodes of axes x, y [m] of pairs about ``positions`` (n, 2); as much soil is up as down.

    Draws the storm's direction, then for each pair its deviation from it, length and depth.
    """
    total, storm = np.zeros((len(x), len(y))), rng.uniform(0.0, 2.0 * np.pi)
    for px, py in np.asarray(positions, np.float64).reshape(-1, 2):
        fall, half, depth = storm + rng.normal(0.0, 0.5), rng.uniform(0.7, 1.3), rng.uniform(0.15, 0.45)
        i, j = (np.flatnonzero(np.abs(axis - at) < 5.0 * half) for axis, at in ((x, px), (y, py)))
        dx, dy = np.meshgrid(x[i] - px, y[j] - py, indexing="ij")
        along, across = np.cos(fall) * dx + np.sin(fall) * dy, np.cos(fall) * dy - np.sin(fall) * dx
        # The pair is a Gaussian's slope along the fall: its two halves have the same volume.
        width = 0.6 * half
        total[np.ix_(i, j)] += (
            depth * np.exp(0.5) * along / width * np.exp(-0.5 * ((along / width) ** 2 + (across / half) ** 2))
        )
    return total


STEP: Final = 0.04
"""Distance [m] between the points of a root."""


def root_swells(
    x: Array, y: Array, trunks: Iterable[tuple[float, float, float]], rng: np.random.Generator | None
) -> Array:
    """Heights [m] at the nodes of axes x, y [m] of the roots of ``trunks`` (x, y, radius) [m]; None: only swells."""
    total = np.zeros((len(x), len(y)))
    for tx, ty, radius in trunks:
        roots = [_root(radius, turn, rng) for turn in _directions(rng)] if rng is not None else []
        points = np.concatenate([np.zeros((0, 4)), *roots])
        reach = max(float(np.abs(points[:, :2]).max(initial=0.0)) + 0.2, 6.0 * radius)
        i, j = (np.flatnonzero(np.abs(axis - at) < reach) for axis, at in ((x, tx), (y, ty)))
        if len(i) and len(j):
            dx, dy = x[i] - tx, y[j] - ty
            swell = np.exp(-0.5 * (dx[:, None] ** 2 + dy**2) / (2.5 * radius) ** 2)
            total[np.ix_(i, j)] += 0.25 * radius * swell + _ridges(dx, dy, points)
    return total


def _directions(rng: np.random.Generator) -> Array:
    """Directions [rad] of four to seven roots, roughly even."""
    count = int(rng.integers(4, 8))
    return np.asarray(
        (np.arange(count) + rng.uniform(-0.35, 0.35, count)) * 2.0 * np.pi / count + rng.uniform(0.0, 6.3)
    )


def _root(radius: float, turn: float, rng: np.random.Generator) -> Array:
    """Points (n, 4) of a root: x, y from the trunk's centre, height and half width [m]."""
    length = radius * rng.uniform(6.0, 16.0)
    s = np.arange(0.0, length, STEP)
    heading = turn + np.cumsum(rng.normal(0.0, 0.12, len(s)))
    xy = radius * np.array([np.cos(turn), np.sin(turn)]) + np.cumsum(
        STEP * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0
    )
    left = 1.0 - s / length
    dips = np.sin(2.0 * np.pi * s / rng.uniform(0.5, 1.1) + rng.uniform(0.0, 6.3))
    height = 0.4 * radius * np.exp(-1.2 * s / radius) + 0.14 * radius * left * np.clip(0.4 + dips, 0.0, 1.0)
    return np.column_stack([xy, height, np.maximum(0.03, 0.3 * radius * left**2)])


def _ridges(dx: Array, dy: Array, points: Array) -> Array:
    """Highest of Gaussian bumps (len(dx), len(dy)) at points (n, 4) of x, y, height and half width [m]."""
    heights = np.zeros((len(dx), len(dy)))
    for x, y, height, width in points:
        i = slice(*np.searchsorted(dx, (x - 3.0 * width, x + 3.0 * width)))
        j = slice(*np.searchsorted(dy, (y - 3.0 * width, y + 3.0 * width)))
        away = (dx[i, None] - x) ** 2 + (dy[j] - y) ** 2
        heights[i, j] = np.maximum(heights[i, j], height * np.exp(-0.5 * away / width**2))
    return heights


BAND: Final = (0.125, 10.0)
"""Lowest and highest spatial frequency [cycles/m]: 8 m, above which are the environment's own hills, to 0.1 m."""
SPACING: Final = 0.05
"""Distance [m] between the nodes of the microrelief: two to the shortest wave."""
Axes = tuple[Array, Array]
"""Coordinates [m] along x and along y of a grid's nodes."""


def relief_axes(x: Array, y: Array) -> Axes:
    """Coordinates [m] of the microrelief's nodes between the ends of two axes."""
    spacing = relief_spacing(x, y)
    x, y = (np.linspace(axis[0], axis[-1], round((axis[-1] - axis[0]) / spacing) + 1) for axis in (x, y))
    return x, y


def relief_spacing(x: Array, y: Array) -> float:
    """Distance [m] between the nodes of the microrelief over two axes: ``SPACING``, more in a large world."""
    return SPACING * coarseness((float(x[-1] - x[0]), float(y[-1] - y[0])))


def with_microrelief(
    hills: Array,
    coarse: Axes,
    fine: Axes,
    cover: Sequence[tuple[Roughness, ArrayLike]],
    rng: np.random.Generator,
    *,
    lowest: float = 0.0,
) -> Array:
    """Heights [m] at the nodes of axes ``fine``: a cubic spline through ``hills`` at those of ``coarse``, and relief.

    ``cover`` has the share of each kind of ground at the nodes of ``coarse``; amplitudes are mixed, not powers. The
    relief is made with nodes ``SPACING`` apart, whatever ``fine`` is: a coarser terrain is a sample of a finer one.
    ``lowest`` [cycles/m] is the least spatial frequency of the relief, where ``hills`` have all that is below.
    """
    own = relief_axes(*coarse)
    relief = np.zeros([len(axis) for axis in own])
    white = white_noise(relief.shape, rng)
    for waviness in sorted({roughness.waviness for roughness, _ in cover}):
        amplitude = np.zeros(hills.shape)
        for roughness, share in cover:
            if roughness.waviness == waviness:
                amplitude += np.sqrt(roughness.unevenness) * np.asarray(share, np.float64)
        noise = shaped(white, relief_spacing(*coarse), waviness, lowest)[: relief.shape[0], : relief.shape[1]]
        relief += RectBivariateSpline(*coarse, amplitude, kx=1, ky=1)(*own) * noise
    heights = RectBivariateSpline(*coarse, hills)(*fine)
    return np.asarray(heights + RectBivariateSpline(*own, relief, kx=1, ky=1)(*fine))


def white_noise(shape: tuple[int, ...], rng: np.random.Generator) -> Float32Array:
    """Independent normal numbers on a grid of at least ``shape`` nodes whose sides suit a Fourier transform."""
    return rng.standard_normal([fft.next_fast_len(n, real=True) for n in shape], dtype=np.float32)


def shaped(white: Float32Array, spacing: float, waviness: float, lowest: float = 0.0) -> Float32Array:
    """White noise filtered to heights [m] of unit unevenness, Gd(n0) = 1 m^3; periodic over the array."""
    nx, ny = white.shape
    q = np.hypot(fft.fftfreq(nx, spacing)[:, None], fft.rfftfreq(ny, spacing)).astype(np.float32)
    inside = (q >= max(BAND[0], lowest)) & (q <= min(BAND[1], 0.5 / spacing))
    q[~inside] = 1.0
    level = REFERENCE_FREQUENCY**waviness / (2.0 * beta(0.5, waviness / 2.0))
    gain = np.where(inside, np.float32(np.sqrt(level) / spacing) * q ** np.float32(-(waviness + 1.0) / 2.0), 0.0)
    return np.asarray(fft.irfft2(fft.rfft2(white) * gain.astype(np.float32), s=white.shape), np.float32)


EDGE: Final = 0.12
"""Distance [m] from a trail's edge, or from its border, at which the layer has its full height."""


def with_layer(terrain: Terrain, rng: np.random.Generator) -> Terrain:
    """Add the layers that belong to a terrain's cover and to its trails."""
    names = (*terrain.ground_materials, terrain.trail_material or terrain.ground_materials[0])
    layers = [GROUND_TYPES[MATERIALS[name].ground_type].layer for name in names]
    distance = terrain.other_ground.at(*np.meshgrid(*node_axes(terrain.field), indexing="ij", sparse=True))
    outside = np.clip(distance / EDGE, 0.0, 1.0)
    inside = np.clip(-(distance + terrain.border_width) / EDGE, 0.0, 1.0)
    height = np.zeros(terrain.field.heights.shape)
    for correlation in sorted({layer.correlation for layer in layers if layer is not None}):
        own = [layer if layer is not None and layer.correlation == correlation else Layer(0.0, 0.0) for layer in layers]
        mean, deviation = (
            outside * _on_nodes(terrain, terrain.cover.values @ np.array(values[:-1], np.float32)) + inside * values[-1]
            for values in ([layer.mean for layer in own], [layer.deviation for layer in own])
        )
        height += mean + deviation * _noise(terrain, correlation, rng)
    # Rounded to half precision, 15 um at 3 cm: all that is written with fewer digits keeps it.
    return replace(terrain, layer=np.maximum(height, 0.0).astype(np.float16).astype(np.float32))


def _noise(terrain: Terrain, correlation: float, rng: np.random.Generator) -> Array:
    """Normal numbers of unit deviation whose correlation falls to 1/e over ``correlation`` [m] (Gaussian)."""
    x, y = node_axes(terrain.field)
    own = relief_axes(x, y)
    width = correlation / relief_spacing(x, y) / 2.0
    kernel = np.zeros(2 * int(4 * width + 1) + 1)
    kernel[len(kernel) // 2] = 1.0
    gain = (gaussian_filter(kernel, width, mode="constant") ** 2).sum()  # along one axis; the square of the amplitude
    white = rng.standard_normal([len(axis) for axis in own], dtype=np.float32)
    return np.asarray(RectBivariateSpline(*own, gaussian_filter(white, width) / gain, kx=1, ky=1)(x, y))


def _on_nodes(terrain: Terrain, values: Float32Array) -> Array:
    """Values at the cover's nodes, at the nodes of the field."""
    spline = RectBivariateSpline(*node_axes(terrain.cover), values, kx=1, ky=1)
    return np.asarray(spline(*node_axes(terrain.field)))
