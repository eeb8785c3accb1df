# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Daylight: the sun, the dome of the sky, and the clouds between them, from the words of an experiment's ``light``.

The sky is an image of the dome: clear air, clouds, and how much of the sun's disc they let through.

Clear air. Wavelengths, the sun's irradiance above the air, ozone, and their linear sRGB are tables. Scattering is
integrated numerically along each ray through a spherical atmosphere of molecules, aerosol and ozone (Nishita et al.
1993; Bruneton and Neyret 2008): the first order exactly, with the Earth's shadow, the higher orders with the isotropic
approximation of Hillaire (2020), equations 5 to 10. Its lengths are in kilometres.

Clouds have volume, or are thin layers. Density: an outline on a map, flat bases, and billows of cellular noise that
grow with height (Schneider and Vos 2015). Light: one march along the ray, and the optical depth towards the sun from a
grid that is summed once. Higher orders of scattering are octaves of weaker extinction and rounder phase functions
(Wrenninge, Kulla and Lundqvist 2013). Their lengths are in metres.
"""

from concurrent.futures import ThreadPoolExecutor
from functools import cache, lru_cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter, uniform_filter, zoom
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.experiment.light_config import Light
from fieldtruth.kernels.atmosphere import (
    ABOVE,
    AZIMUTHS,
    BELOW,
    COSINES,
    EARTH,
    ELEVATIONS,
    HEIGHTS,
    SUN_RADIUS,
    Clear,
    fill_columns,
    fill_higher_orders,
    risen,
    scatter,
)
from fieldtruth.kernels.clouds import (
    MAP,
    MAP_TEXEL,
    NOISE,
    SHADE_TEXEL,
    CloudLight,
    Clouds,
    Layer,
    Shade,
    depth_at,
    fill_shade,
    shadows,
)
from fieldtruth.kernels.light import DISC, RADIUS_DEG, Dome
from fieldtruth.kernels.packets import Grid
from fieldtruth.kernels.sky import EDGE, add_air, clear_rows, cloud_rows, layer_rows, march_rows

WAVELENGTHS: Final = np.arange(380.0, 741.0, 20.0)
"""[nm], (19,): each stands for the 20 nm about it."""
SOLAR: Final = np.array([
    1.079, 1.583, 1.680, 1.868, 2.024, 1.962, 1.905, 1.865, 1.862, 1.838, 1.811, 1.746, 1.677, 1.594, 1.536, 1.477,
    1.409, 1.341, 1.287,
])  # fmt: skip
"""Irradiance [W/m^2/nm] outside the air at the mean distance (reference spectrum of ASTM G173-03)."""
OZONE: Final = 1e-25 * np.array([
    0.0036, 0.0162, 0.0556, 0.158, 0.364, 0.736, 1.37, 2.16, 3.11, 4.18, 4.54, 4.76, 3.75, 2.69, 1.85, 1.21, 0.773,
    0.523, 0.396,
])  # fmt: skip
"""Absorption cross-section [m^2] of an ozone molecule in the Chappuis band (Serdyuchenko et al. 2014)."""
LUX_PER_UNIT: Final = 100_000.0
"""Illuminance [lx] of an irradiance of 1: that of the sun high in a clear sky, about."""
_LUMENS_PER_WATT: Final = 683.0
_SRGB_FROM_XYZ: Final = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)
"""IEC 61966-2-1, white point D65."""
LUMINANCE: Final = np.array([0.2126, 0.7152, 0.0722])
"""Luminance of linear sRGB."""


def _matching() -> Array:
    """CIE 1931 colour matching functions (19, 3), fits of Wyman, Sloan and Shirley (2013, Journal of CGT 2)."""
    lobes = (
        ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2)),
        ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
        ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
    )
    columns = []
    for function in lobes:
        total = np.zeros(len(WAVELENGTHS))
        for height, middle, below, above in function:
            deviation = np.where(middle > WAVELENGTHS, below, above)
            total += height * np.exp(-0.5 * ((WAVELENGTHS - middle) / deviation) ** 2)
        columns.append(total)
    return np.stack(columns, axis=-1)


RGB_FROM_SPECTRUM: Final = _matching() @ _SRGB_FROM_XYZ.T * (20.0 * _LUMENS_PER_WATT / LUX_PER_UNIT)
"""(19, 3): linear sRGB in units of LUX_PER_UNIT from [W/m^2/nm]."""
ANGSTROM: Final = 1.3
"""Exponent of wavelength with which the optical depth of aerosol falls (Angstrom 1929; continental air)."""
OZONE_COLUMN: Final = 300.0
"""[Dobson units]; one is 2.687e20 molecules per square metre."""


@lru_cache(16)  # 0.3 MB each; many worlds have the same sun
def clear_sky(elevation: float, turbidity: float, ceiling: float) -> Clear:
    """Compute the clear sky.

    Args:
        elevation: of the sun's centre above the horizon [rad].
        turbidity: optical depth of all air over that of its molecules, at 550 nm.
        ceiling: height of clouds [km].
    """
    depths, higher = optical_depths(turbidity), higher_orders(turbidity)
    scattered = np.zeros((ELEVATIONS, AZIMUTHS, 2, 3, len(WAVELENGTHS)))
    passed = np.zeros((ELEVATIONS, len(WAVELENGTHS)))
    scatter(depths, higher, elevation, ceiling, scattered, passed)
    suns = [transmittance(depths, height, elevation) * SOLAR @ RGB_FROM_SPECTRUM for height in (0.0, ceiling)]
    weight = SOLAR[:, None] * RGB_FROM_SPECTRUM
    share = passed @ weight / weight.sum(axis=0)
    rgb = np.maximum(scattered * SOLAR @ RGB_FROM_SPECTRUM, 0.0)
    return Clear(rgb, np.clip(share, 0.0, 1.0), np.maximum(suns[0], 0.0), np.maximum(suns[1], 0.0))


@lru_cache(16)  # 0.2 MB each; it takes more than half of the time, for a table that suns at any height share
def higher_orders(turbidity: float) -> Array:
    """Light that was scattered more than once (HEIGHTS, COSINES, 19), per irradiance of the sun."""
    found = np.zeros((HEIGHTS, COSINES, len(WAVELENGTHS)))
    fill_higher_orders(optical_depths(turbidity), sphere(64, 0.0), found)
    return found


def optical_depths(turbidity: float) -> Array:
    """Vertical optical depth (3, 19) of molecules (Hansen and Travis 1974, equation 2.30), aerosol and ozone."""
    micron = WAVELENGTHS / 1000.0
    molecules = 0.008569 * micron**-4 * (1.0 + 0.0113 * micron**-2 + 0.00013 * micron**-4)
    at_550 = 0.008569 * 0.55**-4 * (1.0 + 0.0113 * 0.55**-2 + 0.00013 * 0.55**-4)
    aerosol = (turbidity - 1.0) * at_550 * (micron / 0.55) ** -ANGSTROM
    return np.stack([molecules, aerosol, OZONE * OZONE_COLUMN * 2.687e20])


def transmittance(depths: Array, height: float, elevation: float) -> Array:
    """Share (19,) of the sun's light that arrives at ``height`` [km], with the part of its disc that has risen."""
    column = np.zeros(3)
    dip = -np.arccos(EARTH / (EARTH + height))
    fill_columns(height, np.sin(max(elevation, dip + 0.5 * SUN_RADIUS)), column)
    return np.asarray(np.exp(-column @ depths) * risen(height, np.sin(elevation)))


def sphere(count: int, turn: float) -> Array:
    """Directions (count, 3) spread evenly over the sphere (spherical Fibonacci), turned about z by ``turn`` [rad]."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, k * np.pi * (3.0 - np.sqrt(5.0)) + turn
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)


SEEN: Final = 0.08
"""Amount from which on there is cloud to see."""
FULLEST: Final = 0.95
"""Greatest share of the sky that heaps cover."""
_AT_ONCE: Final = 60  # heaps between two measurements of the cover
_FALL: Final = 1.3  # of the number of heaps larger than a radius


def cumulus_map(rng: np.random.Generator, cover: float, thickness: float) -> Float32Array:
    """Amounts (MAP, MAP) of heaps of every size, in groups.

    The number of heaps larger than a radius falls with it to the power of -_FALL, as power laws describe fields of
    cumulus (Benner and Curry 1998; the exponent is ours), and each rises about as high as its radius.

    Args:
        rng: source of positions and sizes.
        cover: share of the area that is to be covered; above FULLEST it is FULLEST.
        thickness: height [m] at which the amount is 1.
    """
    groups = ranks(band_noise(rng, 5000.0, rough=3.0)).ravel() ** 2
    amount = np.zeros((MAP, MAP), np.float32)
    smallest, largest = 60.0, thickness
    low, high = smallest**-_FALL, largest**-_FALL
    covered = 0.0
    while covered < min(cover, FULLEST):
        # Between clouds only, once half is covered: else the last gaps would take for ever to meet.
        share = groups if covered < 0.5 else groups * (amount.ravel() <= SEEN)
        nodes = rng.choice(MAP * MAP, _AT_ONCE, p=share / share.sum())
        radii = (low + rng.random(_AT_ONCE) * (high - low)) ** (-1.0 / _FALL)
        for node, radius in zip(nodes, radii, strict=True):
            _heap(rng, amount, (node // MAP, node % MAP), float(radius), thickness)
        covered = float((amount > SEEN).mean())
    return amount


def _heap(
    rng: np.random.Generator, amount: Float32Array, node: tuple[int, int], radius: float, thickness: float
) -> None:
    """Raise the amount by a heap at a node of the map: a few domes, the smaller ones at its sides."""
    lobes = 3 + int(radius / 90.0)
    away, turn = radius * 0.75 * np.sqrt(rng.random(lobes)), rng.uniform(0.0, 2.0 * np.pi, lobes)
    away[0] = 0.0
    wide = radius * rng.uniform(0.3, 0.65, lobes) * (1.0 - 0.35 * away / radius)
    reach = int(1.6 * radius / MAP_TEXEL) + 2
    steps = np.arange(-reach, reach + 1)
    x, y = np.meshgrid(steps * MAP_TEXEL, steps * MAP_TEXEL, indexing="ij")
    raised = np.zeros(x.shape)
    for r, a, w in zip(away, turn, wide, strict=True):
        near = 1.0 - ((x - r * np.cos(a)) ** 2 + (y - r * np.sin(a)) ** 2) / (w * w)
        raised = np.maximum(raised, 1.5 * w / thickness * np.sqrt(np.maximum(near, 0.0)))
    rows, columns = np.ix_((node[0] + steps) % MAP, (node[1] + steps) % MAP)
    amount[rows, columns] = np.maximum(amount[rows, columns], np.minimum(raised, 1.0))


def band_noise(rng: np.random.Generator, size: float, stretch: float = 1.0, rough: float = 1.84) -> Array:
    """Repeating noise (MAP, MAP) with features of ``size`` [m], ``stretch`` times longer along x, and finer ones.

    Amplitudes fall with frequency to the power of ``rough``: 1 is rough, 3 smooth.
    """
    frequency = np.fft.fftfreq(MAP, MAP_TEXEL)
    squared = (frequency[:, None] * stretch) ** 2 + frequency[None, :] ** 2
    squared[0, 0] = np.inf
    gain = np.exp(-0.25 / (squared * size * size)) * squared ** (-0.5 * rough)
    return np.asarray(np.fft.ifft2(np.fft.fft2(rng.standard_normal((MAP, MAP))) * gain).real)


def ranks(values: Array) -> Array:
    """Replace values by their share of smaller ones: uniform in [0, 1)."""
    order = np.argsort(values, axis=None, kind="stable")
    result = np.empty(values.size)
    result[order] = np.arange(values.size) / values.size
    return result.reshape(values.shape)


@cache
def billows() -> Float32Array:
    """Three octaves of cellular noise (Worley 1996) on a repeating cube, 1 at the cells' centres."""
    nodes = np.arange(NOISE) / NOISE
    points = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1)
    total, rng = np.zeros((NOISE,) * 3), np.random.default_rng(3)
    for octave, weight in enumerate((0.6, 0.28, 0.12)):
        cells = 4 * 2**octave
        corners = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing="ij"), axis=-1)
        centres = (corners + rng.random(corners.shape)).reshape(-1, 3) / cells % 1.0
        total -= weight * cells * cKDTree(centres, boxsize=np.ones(3)).query(points)[0]
    total -= total.min()
    return np.asarray(total / total.max(), np.float32)


def shade_of(clouds: Clouds, sun: Array, pool: ThreadPoolExecutor) -> Shade:
    """Sum the depth towards the sun at the nodes of a grid."""
    nodes, layers = int(MAP * MAP_TEXEL / SHADE_TEXEL), int(np.ceil(clouds.thickness / SHADE_TEXEL)) + 1
    depth = np.zeros((nodes, nodes, layers), np.float32)
    list(pool.map(lambda i: fill_shade(clouds, sun, i, depth[i]), range(nodes)))
    return Shade(depth, sun)


def cirrus(rng: np.random.Generator, cover: float, height: float) -> Layer:
    """Fibres of ice, drawn out along the wind."""
    bands, fibres, fine = (
        band_noise(rng, *size) for size in ((2600.0, 2.0, 2.4), (420.0, 6.0, 1.4), (90.0, 14.0, 1.1))
    )
    streaks = np.exp(0.75 * fibres / fibres.std() + 0.45 * fine / fine.std())
    veil = np.clip((ranks(bands + 0.35 * fibres * bands.std() / fibres.std()) - (1.0 - cover)) / 0.75, 0.0, 1.0)
    depth = 0.32 * veil**1.6 * streaks
    return Layer(depth.astype(np.float32), height, 0.22, _shift(rng), False, 0.0, 0.0)


def thick_layer(rng: np.random.Generator, height: float, depth: float, size: float, structure: float) -> Layer:
    """A layer of mean optical depth ``depth`` whose depth changes over ``size`` [m]."""
    noise = band_noise(rng, size, 1.6)
    varied = depth * np.exp(0.45 * noise / noise.std())
    return Layer(varied.astype(np.float32), height, 1.0, _shift(rng), True, depth, structure)


def _shift(rng: np.random.Generator) -> tuple[float, float]:
    return float(rng.uniform(0.0, 5000.0)), float(rng.uniform(0.0, 5000.0))


def passed_by(depth: float) -> float:
    """Share of light that leaves a cloud of optical depth ``depth`` below: two streams, asymmetry 0.85.

    Bohren, "Multiple scattering of light and some of its observable consequences" (1987), equation 13.
    """
    return 1.0 / (1.0 + 0.75 * (1.0 - 0.85) * depth)


DOME_TEXELS: Final = 2048
"""Texels along each side of the dome that photographs show; below 500 the horizon would be outside of it."""
_BASE: Final = {"cumulus": 1300.0, "broken": 1000.0, "cirrus": 9000.0, "stratus": 450.0, "overcast": 1200.0}
"""Height of the base of clouds above the ground [m]."""
LEVEL: Final = 0.93
"""Irradiance of open level ground for which a camera's exposure is 1."""
METER: Final = 0.12
WHITE: Final = 0.5
_SHIFTS: Final = 256
_OVERHEAD: Final = 3000.0
"""[m] along each side of the part of the sky whose cover is most like that of the whole."""
SHADOW_TEXEL: Final = 8.0  # [m] of the clouds' shadow on the ground
_ROWS: Final = 32  # at once
_SHARP: Final = 0.15
"""Difference between neighbours in what clouds stop, from which on their edge is marched for every texel."""


class Daylight(NamedTuple):
    """Light of the sky above a world."""

    sun: Array  # (3,) unit vector towards the sun
    sun_rgb: Float32Array  # (3,) irradiance of a surface that faces it, where no cloud with volume shades it
    disc: Float32Array  # (3,) radiance in the middle of its disc, seen from the middle of the world
    dome: Dome
    level: Float32Array  # (3,) irradiance of open level ground by all light
    cloud_sun: Grid  # share of sunlight that clouds with volume let through, at the ground
    unit: Float32Array  # (3,) irradiance [100 klx] of each channel that stands for 1


def sun_direction(azimuth_deg: float, elevation_deg: float) -> Array:
    """Unit vector (3,) towards the sun in the world frame (x north, y west, z up); azimuth clockwise from north."""
    azimuth, elevation = np.radians(azimuth_deg), np.radians(elevation_deg)
    return np.array([np.cos(azimuth) * np.cos(elevation), -np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])


def daylight(
    light: Light, size: tuple[float, float], rng: np.random.Generator, pool: ThreadPoolExecutor, texels: int
) -> Daylight:
    """Compute the light of the sky over a world.

    Args:
        light: sun, clouds and haze.
        size: sides of the world [m] along x and y.
        rng: shapes the clouds.
        pool: threads; the result does not depend on them.
        texels: of the dome along each side.
    """
    sun = sun_direction(light.azimuth_deg, light.elevation_deg)
    clear = clear_sky(np.radians(light.elevation_deg), light.turbidity, _BASE.get(light.clouds, 1200.0) / 1000.0)
    mean = clear_mean(clear, sun)
    level = np.pi * mean + clear.sun * max(sun[2], 0.0)
    shone = CloudLight(sun, clear.sun_above, mean, level)
    clouds = _volume(light, sun, size, rng)
    layer = _layer(light, rng)
    cloud_sun = _cloud_sun(clouds, sun, size)
    sun_rgb, haze, under = clear.sun, 1.0 - 0.5 * light.cover, level
    if layer is not None and layer.thick:
        under = level * passed_by(layer.mean)
        sun_rgb, haze = np.zeros(3), passed_by(layer.mean)
    elif layer is not None:
        sun_rgb, haze = clear.sun * _through_at_sun(layer, sun), 1.0
    elif clouds is None:
        haze = 1.0
    dome = make_dome(Sky(clear, shone, clouds, layer, under, haze), pool, texels)
    total = np.pi * dome.mean + sun_rgb * max(sun[2], 0.0)
    at_middle = float(cloud_sun.values[cloud_sun.values.shape[0] // 2, cloud_sun.values.shape[1] // 2])
    disc, one = DISC * at_middle * sun_rgb, np.ones(3, np.float32)
    rgb32, disc32, level32 = (np.asarray(each, np.float32) for each in (sun_rgb, disc, total))
    return Daylight(sun, rgb32, disc32, dome, level32, cloud_sun, one)


def metered_daylight(
    light: Light, size: tuple[float, float], rng: np.random.Generator, pool: ThreadPoolExecutor, texels: int
) -> Daylight:
    """Return ``daylight`` divided by ``unit``, which a camera's meter and white balance select for open level ground.

    The meter leaves METER of the range of daylight in the photographs, so that dusk is darker than noon; the white
    balance removes WHITE of the light's colour (von Kries).
    """
    day = daylight(light, size, rng, pool, texels)
    bright = float(day.level @ LUMINANCE)
    target = LEVEL * (bright / LEVEL) ** METER
    unit = (bright / target * (day.level / bright) ** WHITE).astype(np.float32)
    rgb, mean, horizon = (value / unit for value in day.dome)
    rgb = rgb.astype(np.float16).astype(np.float32)  # as it is kept on disk
    return day._replace(
        sun_rgb=day.sun_rgb / unit,
        disc=day.disc / unit,
        level=day.level / unit,
        dome=Dome(rgb, mean, horizon),
        unit=unit,
    )


def _volume(light: Light, sun: Array, size: tuple[float, float], rng: np.random.Generator) -> Clouds | None:
    """Clouds with volume. Fair-weather cumulus leave the sun over the world free; broken clouds shade a part of it."""
    if light.clouds not in ("cumulus", "broken") or light.cover == 0.0:
        return None
    fair = light.clouds == "cumulus"
    thickness = 900.0 if fair else 1400.0
    amount = cumulus_map(rng, light.cover, thickness)
    clouds = Clouds(amount, billows(), _BASE[light.clouds], thickness, 0.06, (0.0, 0.0))
    nodes = rng.integers(0, MAP, (_SHIFTS, 2))
    overhead = uniform_filter((amount > SEEN).astype(np.float32), int(_OVERHEAD / MAP_TEXEL), mode="wrap")
    differs = np.abs(overhead[nodes[:, 0], nodes[:, 1]] - light.cover)
    shifts = MAP_TEXEL * nodes[np.argsort(differs, kind="stable")]
    if sun[2] <= 0.0:
        return clouds._replace(shift=(float(shifts[0, 0]), float(shifts[0, 1])))
    points = _points(size, 9)
    best, chosen = -1.0, clouds
    for x, y in shifts:
        trial = clouds._replace(shift=(float(x), float(y)))
        seen = np.empty(len(points), np.float32)
        shadows(trial, sun, points, seen)
        score = float(seen.min()) if fair else float(seen.max() - seen.min())
        if score > best:
            best, chosen = score, trial
        if score > 0.99:
            break
    return chosen


def _layer(light: Light, rng: np.random.Generator) -> Layer | None:
    if light.clouds == "cirrus" and light.cover > 0.0:
        return cirrus(rng, light.cover, _BASE["cirrus"])
    if light.clouds == "stratus":
        return thick_layer(rng, _BASE["stratus"], 16.0, 900.0, 0.8)
    if light.clouds == "overcast":
        return thick_layer(rng, _BASE["overcast"], 24.0, 2200.0, 0.35)
    return None


def _through_at_sun(layer: Layer, sun: Array) -> float:
    """Share of sunlight that a thin layer lets through: half of what it scatters stays near the beam."""
    distance = layer.height / max(sun[2] + 0.02, 0.02)
    return float(np.exp(-0.5 * depth_at(layer, distance * sun[0], distance * sun[1]) / max(sun[2], 0.08)))


def _points(size: tuple[float, float], count: int) -> Array:
    axes = [np.linspace(-side / 2, side / 2, count) for side in size]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def _cloud_sun(clouds: Clouds | None, sun: Array, size: tuple[float, float]) -> Grid:
    """Shadow of the clouds on the world, blurred over the width of the sun's disc."""
    nodes = [max(2, int(np.ceil(side / SHADOW_TEXEL)) + 1) for side in size]
    shape = (nodes[0], nodes[1])
    corner = -(shape[0] - 1) * SHADOW_TEXEL / 2, -(shape[1] - 1) * SHADOW_TEXEL / 2
    share = np.ones(shape, np.float32)
    if clouds is not None and sun[2] > 0.0:
        x, y = (np.arange(n) * SHADOW_TEXEL + c for n, c in zip(shape, corner, strict=True))
        points, total = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2), np.zeros(shape)
        wide = np.tan(np.radians(RADIUS_DEG)) * clouds.base / sun[2]
        for angle in np.arange(6) * np.pi / 3:
            seen = np.empty(len(points), np.float32)
            shadows(clouds, sun, points + 0.7 * wide * np.array([np.cos(angle), np.sin(angle)]), seen)
            total += seen.reshape(shape) / 6.0
        share = total.astype(np.float32)
    return Grid(share, float(corner[0]), float(corner[1]), 1.0 / SHADOW_TEXEL)


class Sky(NamedTuple):
    """The air and clouds that make the dome."""

    clear: Clear
    light: CloudLight
    clouds: Clouds | None
    layer: Layer | None
    level: Array  # (3,) irradiance of level ground by a thick layer
    haze: float  # share of its light that the air below the clouds scatters: less where they shade it


def make_dome(sky: Sky, pool: ThreadPoolExecutor, size: int) -> Dome:
    """Compute the dome of ``size`` texels along each side. The result does not depend on the threads of ``pool``."""
    rgb = np.zeros((size, size, 3), np.float32)
    starts = range(0, size, _ROWS)
    seen = None if sky.clouds is None else _clouds_seen(sky, sky.clouds, pool, size)

    def rows(start: int) -> None:
        clear_rows(sky.clear, sky.light.sun, sky.haze, start, rgb[start : start + _ROWS])
        if seen is not None:
            cloud_rows(
                sky.clear, sky.light.sun, sky.haze, start, seen[start : start + _ROWS], rgb[start : start + _ROWS]
            )
        if sky.layer is not None:
            layer_rows(sky.clear, sky.layer, sky.light, sky.haze, sky.level, start, rgb[start : start + _ROWS])

    list(pool.map(rows, starts))
    return dome_of(rgb)


def _clouds_seen(sky: Sky, clouds: Clouds, pool: ThreadPoolExecutor, size: int) -> Float32Array:
    """Light of clouds and what they stop (size, size, 4): marched for a quarter of the texels, and for all at edges."""
    shade = shade_of(clouds, sky.light.sun, pool)

    def fill(seen: Float32Array, chosen: NDArray[np.bool_]) -> None:
        def rows(start: int) -> None:
            part = slice(start, start + _ROWS)
            march_rows(clouds, shade, sky.light, start, chosen[part], seen[part])

        list(pool.map(rows, range(0, len(seen), _ROWS)))

    half = np.zeros((size // 2, size // 2, 4), np.float32)
    fill(half, np.ones(half.shape[:2], np.bool_))
    stopped = half[..., 3]
    edges = maximum_filter(stopped, 3) - minimum_filter(stopped, 3) > _SHARP
    seen = _enlarged(half, size)
    fill(seen, edges.repeat(2, axis=0).repeat(2, axis=1))
    return seen


def dome_of(rgb: Float32Array) -> Dome:
    """Return the dome with the irradiance and the horizon of its image."""
    small = _averaged(rgb, min(len(rgb), 512))
    directions, weight = directions_of(len(small))
    z = directions[..., 2]
    mean = np.einsum("ijc,ij->c", small, weight * np.maximum(z, 0.0)) / np.pi
    horizon = small[(z > 0.005) & (z < 0.04) & (weight > 0)].mean(axis=0)
    return Dome(rgb, mean.astype(np.float32), horizon.astype(np.float32))


def _averaged(image: Float32Array, size: int) -> Float32Array:
    """Mean of the texels of an image (n, n, c) in each of (size, size) squares; n is a multiple of ``size``."""
    step = len(image) // size
    return np.asarray(image.reshape(size, step, size, step, -1).mean(axis=(1, 3)), np.float32)


def _enlarged(image: Float32Array, size: int) -> Float32Array:
    """Bilinear interpolation of an image (n, n, c) at the centres of (size, size) squares."""
    factor = size / len(image)
    return np.asarray(zoom(image, (factor, factor, 1), order=1, mode="nearest", grid_mode=True), np.float32)


def soft_dome(dome: Dome, texels: int = 32) -> Dome:
    """Return the dome as seen by few rays: averaged over ``texels`` along each side, with the same irradiance."""
    small = _averaged(dome.rgb, texels)
    soft = dome_of(_enlarged(small, len(dome.rgb)))
    gain = (dome.mean / np.maximum(soft.mean, np.float32(1e-9))).astype(np.float32)
    return Dome(soft.rgb * gain, dome.mean, dome.horizon)


def clear_mean(clear: Clear, sun: Array) -> Array:
    """Irradiance (3,) of level ground by the clear sky, divided by pi."""
    directions, weight = directions_of(128)
    total, radiance = np.zeros(3), np.zeros(3)
    for (x, y, z), share in zip(directions[weight > 0], weight[weight > 0], strict=True):
        radiance[:] = 0.0
        add_air(clear, sun, (x, y, z), BELOW, 1.0, radiance)
        add_air(clear, sun, (x, y, z), ABOVE, 1.0, radiance)
        total += share * z * radiance / np.pi
    return total


def directions_of(size: int) -> tuple[Array, Array]:
    """Unit vectors (size, size, 3) of the texels of a paraboloid map, and the solid angle [sr] of each."""
    nodes = _node(np.arange(float(size)), size)
    p, q = np.meshgrid(nodes, nodes, indexing="ij")
    radius = np.minimum(p * p + q * q, 1.0)
    directions = np.stack([2.0 * p, 2.0 * q, 1.0 - radius], axis=-1) / (1.0 + radius)[..., None]
    weight = np.where(p * p + q * q < 1.0, 4.0 / (1.0 + radius) ** 2, 0.0) * (2.0 / (size * EDGE)) ** 2
    return directions, weight * (2.0 * np.pi / weight.sum())


def _node(index: Array, size: int) -> Array:
    return (index - (size - 1) / 2) / (size / 2 * EDGE)
