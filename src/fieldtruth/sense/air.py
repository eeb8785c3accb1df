# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Weather in a laser beam: how much it takes from an echo, and the echoes of its own particles.

Powers are relative to a white Lambert surface at 1 m in clear air that faces the beam: a surface of reflectance rho at
range R [m] has rho cos(theta) exp(-2 alpha R) / R^2.

- Extinction alpha [1/m]: fog ln 20 / visibility (Koschmieder 1924, 5 % contrast) at 550 nm, at other wavelengths after
  Kim, McArthur and Korevaar (2001); rain and snow the cross-section of their particles, whose diameters are
  exponentially distributed (as much again is diffracted, but by 1 mrad and less: it stays in the beam); dust in
  proportion to its mass.
- Fog may thin with height as exp(-height / scale): a path in it counts as one of ``fog_length`` where it is densest.
- Fog and dust are a soft target (Rasshofer, Spies and Spies, Adv. Radio Sci. 9, 2011): the echo is the pulse, a squared
  sine, convolved with beta overlap(R) exp(-2 alpha R) / R^2; beta = 0.046 / visibility [1/(m sr)] for fog. It is flat
  over metres, so that the noise of counted photons decides where its maximum is found.
- A receiver whose field of view is as wide as the beam sees (divergence R / width)^2 of it where that is below 1 (the
  geometric compression of a coaxial lidar; Halldorsson and Langerholc 1978).
- Drops and flakes are few: each is an echo of its own, and their number in a part of the beam is Poisson distributed.
  One of diameter D covers (D / beam)^2 of the beam, as a surface of a reflectance of its own would.
"""

from typing import Final, NamedTuple

import numpy as np
from scipy.stats import norm

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.weather_config import WeatherConfig
from fieldtruth.kernels.compile import inlined
from fieldtruth.sense.drops import Drops, rain, snow

LIGHT_SPEED: Final = 299_792_458.0  # [m/s]
CONTRAST: Final = 0.05
"""Contrast of a black object at the meteorological optical range (WMO-No. 8)."""
MOLECULES: Final = 1.162e-5
"""Extinction coefficient [1/m] of the molecules of air at sea level and 550 nm (Bucholtz 1995)."""
FOG_BACKSCATTER: Final = 0.046
"""Backscatter coefficient [1/(m sr)] times visibility [m] (Rasshofer et al. 2011)."""
DUST_EXTINCTION: Final = 1.0
"""[m^2/g] of mineral dust near the ground: 0.5 to 2 (Shimizu et al. 2011, doi 10.2151/sola.7A-001), for every
wavelength, as its grains are larger than those."""
DUST_LIDAR_RATIO: Final = 55.0
"""Extinction over backscatter [sr] of desert dust: 55 +- 5 (Tesche et al. 2009, doi 10.1029/2009JD011862)."""
LEAST_POWER: Final = 1e-7
"""Weaker echoes of single particles are left out: a black surface (1 %) at 300 m is as weak."""
_MOST_POWER: Final = 10.0
_POWERS: Final = 129
_RANGES: Final = 65
_SOFT_STEP: Final = 0.1  # [m]
_FINE: Final = 100  # steps of a pulse


class Beam(NamedTuple):
    """What the air needs to know of a LiDAR."""

    wavelength_nm: float
    width_m: float
    """Diameter of the beam where it leaves the sensor."""
    divergence_rad: float
    """Full angle by which the diameter grows."""
    pulse_ns: float
    """Width of the pulse at half its power."""
    min_range: float
    max_range: float
    gain: float = 0.0
    """Photons of an echo of power 1. 0: no noise."""


class Air(NamedTuple):
    """The weather in one LiDAR's beam. Clear air has ``extinction`` 0 and ``has_echoes`` False."""

    extinction: float  # [1/m], of fog that thins with height where it is densest
    fog: float  # [1/m] part of it that thins
    fog_scale: float  # [m] height over which it does, see fog_length; 0 without
    fog_echo: float  # part of the soft target's echo that thins
    has_echoes: bool
    soft_power: Array  # (s,) greatest power of the soft target in front of a surface at k _SOFT_STEP, the last one any
    soft_share: Array  # (s, c) probability that it is found in one of the cells up to a cell
    cell: float  # [m] length of a cell, within which the pulse merges echoes; the first begins at min_range
    min_range: float  # [m]
    first_log_power: float  # of numbers
    per_log_power: float  # rows of numbers
    first_log_range: float
    per_log_range: float  # columns of numbers
    numbers: Array  # (p, r) mean number of particles nearer than a range whose echo is stronger than a power


def falling(weather: WeatherConfig, wavelength_nm: float) -> tuple[Drops, ...]:
    """Particles of the weather that fall."""
    drops = (rain(weather.rain_mm_h, wavelength_nm),) if weather.rain_mm_h > 0 else ()
    return (*drops, snow(weather.snow_mm_h)) if weather.snow_mm_h > 0 else drops


def fog_extinction(visibility_m: float, wavelength_nm: float = 550.0) -> float:
    """Extinction coefficient of fog [1/m]; below a visibility of 500 m it is the same for every wavelength."""
    km = visibility_m / 1000
    size = 1.3 if km > 6 else 0.16 * km + 0.34 if km > 1 else max(km - 0.5, 0.0)
    return float(-np.log(CONTRAST) / visibility_m * (wavelength_nm / 550.0) ** -size)


@inlined
def fog_length(above: float, rise: float, length: float, scale: float) -> float:
    """Length [m] of a path in the densest fog with the same extinction, for cameras and LiDARs.

    The path begins ``above`` [m] the densest fog, is ``length`` [m] long and ends ``rise`` [m] higher. It is the
    integral of exp(-height / scale) along it; a ``scale`` of 0 is that of fog which is as dense at every height.
    """
    if scale == 0.0:
        return length
    low, high = above / scale, (above + rise) / scale
    x = high - low
    if abs(x) < 0.02:
        return length * np.exp(-low) * (1.0 - x * (0.5 - x / 6.0))  # type: ignore[no-any-return]
    return length * (np.exp(-low) - np.exp(-high)) / x  # type: ignore[no-any-return]


def clear_extinction(visibility_m: float, wavelength_nm: float) -> float:
    """Extinction coefficient [1/m] of air without fog: of its molecules, and of aerosol, which is the rest.

    Molecules at sea level scatter 1.162e-5 / m at 550 nm, with the power -4.09 of the wavelength (Bucholtz, Appl. Opt.
    34, 1995); aerosol has the power -1.3 (Angstrom 1929, the usual value over land).
    """
    ratio = wavelength_nm / 550.0
    aerosol = max(float(-np.log(CONTRAST)) / visibility_m - MOLECULES, 0.0)
    return float(MOLECULES * ratio**-4.09 + aerosol * ratio**-1.3)


def extinction(weather: WeatherConfig, wavelength_nm: float) -> float:
    """Extinction coefficient of all that is in the air [1/m]."""
    fog = 0.0 if weather.fog_visibility_m is None else fog_extinction(weather.fog_visibility_m, wavelength_nm)
    return (
        fog + DUST_EXTINCTION * weather.dust_g_m3 + sum(drops.extinction for drops in falling(weather, wavelength_nm))
    )


def backscatter(weather: WeatherConfig) -> float:
    """Backscatter coefficient of fog and dust [1/(m sr)]."""
    fog = 0.0 if weather.fog_visibility_m is None else FOG_BACKSCATTER / weather.fog_visibility_m
    return fog + DUST_EXTINCTION * weather.dust_g_m3 / DUST_LIDAR_RATIO


def make_air(weather: WeatherConfig | None, beam: Beam) -> Air:
    """Tables of the weather in a beam; None is clear air."""
    weather = WeatherConfig() if weather is None else weather
    alpha = extinction(weather, beam.wavelength_nm)
    cell = LIGHT_SPEED / 2e9 * max(beam.pulse_ns, 1e-6)
    soft_power, soft_share = _soft_target(np.pi * backscatter(weather), alpha, beam, cell)
    log_powers = np.linspace(np.log(LEAST_POWER), np.log(_MOST_POWER), _POWERS)
    log_ranges = np.linspace(np.log(beam.min_range), np.log(beam.max_range), _RANGES)
    return Air(
        extinction=alpha,
        fog=fog_extinction(weather.fog_visibility_m, beam.wavelength_nm) if weather.fog_visibility_m else 0.0,
        fog_scale=weather.fog_height_m or 0.0,
        fog_echo=FOG_BACKSCATTER / weather.fog_visibility_m / backscatter(weather) if weather.fog_visibility_m else 0.0,
        has_echoes=not weather.is_clear,
        soft_power=soft_power,
        soft_share=soft_share,
        cell=cell,
        min_range=beam.min_range,
        first_log_power=float(log_powers[0]),
        per_log_power=float(1 / (log_powers[1] - log_powers[0])),
        first_log_range=float(log_ranges[0]),
        per_log_range=float(1 / (log_ranges[1] - log_ranges[0])),
        numbers=sum(
            (_counts(d, alpha, beam, log_powers) for d in falling(weather, beam.wavelength_nm)),
            np.zeros((_POWERS, _RANGES)),
        ),
    )


def _overlap(range_m: Array, beam: Beam) -> Array:
    """Share of the beam that the receiver sees; all of it without a divergence."""
    seen = np.minimum((beam.divergence_rad * range_m / beam.width_m) ** 2, 1.0) if beam.divergence_rad else 1.0
    return np.asarray(np.where(range_m < beam.min_range, 0.0, seen), np.float64)


def _soft_target(strength: float, alpha: float, beam: Beam, cell: float) -> tuple[Array, Array]:
    """Greatest power of the soft target, and where it is found, in front of surfaces at multiples of _SOFT_STEP.

    A surface at R has its greatest power at R, so the pulse is centred: squared cosine over [-c tau / 2, c tau / 2],
    tau its width at half the power, which makes cells of c tau / 2.
    """
    seen = beam.width_m / beam.divergence_rad if beam.divergence_rad else 0.0  # from here on, power falls
    cells = int(np.ceil(max(3 * seen - beam.min_range, 0.0) / cell)) + 3
    step, last = 2 * cell / _FINE, beam.min_range + cells * cell
    at = np.asarray(beam.min_range + step * (np.arange(cells * _FINE // 2) + 0.5), np.float64)
    density: Array = strength * _overlap(at, beam) * np.exp(-2 * alpha * at) / at**2
    pulse = np.cos(np.pi * np.arange(-_FINE // 2, _FINE // 2 + 1) / _FINE) ** 2 * step
    surfaces = np.arange(0, last + _SOFT_STEP, _SOFT_STEP)
    powers, shares = np.zeros(len(surfaces)), np.ones((len(surfaces), cells))
    for k, surface in enumerate(surfaces):
        echo = np.convolve(np.where(at < surface, density, 0.0), pulse, mode="same")
        best = np.where(at < surface, echo, 0.0).reshape(cells, -1).max(axis=1)
        powers[k], shares[k] = best.max(), np.cumsum(_chance_of_most(beam.gain * best, best))
    return powers, shares


def _chance_of_most(photons: Array, powers: Array) -> Array:
    """Probability of each cell that most photons are counted there: normal with the variance of Poisson's law."""
    if photons.max() == 0.0:
        return np.asarray(np.arange(len(powers)) == powers.argmax(), np.float64)
    spread = np.sqrt(np.maximum(photons, 1e-12))
    x = np.linspace(-6, 6, 301)[:, None, None] * spread[:, None] + photons[:, None]  # (301, of cell, against cell)
    below = norm.cdf((x - photons) / spread)
    below[:, np.arange(len(photons)), np.arange(len(photons))] = 1.0
    chance = (norm.pdf(np.linspace(-6, 6, 301))[:, None] * below.prod(axis=2)).sum(axis=0)
    return np.asarray(chance / chance.sum(), np.float64)


def _counts(drops: Drops, alpha: float, beam: Beam, log_powers: Array) -> Array:
    """Mean number of particles (p, r) nearer than a range whose echo is stronger than a power."""
    fine = 16
    at = np.exp(np.linspace(np.log(beam.min_range), np.log(beam.max_range), (_RANGES - 1) * fine + 1))
    width = beam.width_m + beam.divergence_rad * at
    with np.errstate(divide="ignore"):
        whole = drops.reflectance * _overlap(at, beam) * np.exp(-2 * alpha * at) / at**2  # it would fill the beam
        covered = np.sqrt(np.exp(log_powers)[:, None] / whole)  # D over the beam's diameter
        melted_mm = (1000 * width * covered / drops.size[0]) ** (1 / drops.size[1])
    stronger = np.where(covered < 1, drops.per_m3 * np.exp(-drops.per_mm * melted_mm), 0.0)
    per_metre = stronger * np.pi / 4 * width**2
    steps = (per_metre[:, 1:] + per_metre[:, :-1]) / 2 * np.diff(at)
    total = np.concatenate([np.zeros((len(log_powers), 1)), np.cumsum(steps, axis=1)], axis=1)
    return np.asarray(total[:, ::fine])


@inlined
def _between(values: Array, row: int, column: int, share: float) -> float:
    """Entry of a row between two columns."""
    begin: float = values[row, column]
    end: float = values[row, column + 1]
    return begin + share * (end - begin)


@inlined
def _soft_range(air: Air, k: int, u: float) -> float:
    """Range at which the greatest power of a soft target is found, by a number u in (0, 1]."""
    j, begin = 0, 0.0
    while j < air.soft_share.shape[1] - 1 and air.soft_share[k, j] < u:
        begin = air.soft_share[k, j]
        j += 1
    share = (u - begin) / max(air.soft_share[k, j] - begin, 1e-12)
    return float(air.min_range + air.cell * (j + min(share, 1.0)))


@inlined
def transmitted(air: Air, range_m: float, above: float, slope: float) -> float:
    """Share of a surface's power that the air leaves, there and back.

    The beam begins ``above`` [m] the densest fog, and ``slope`` is the sine of its elevation.
    """
    thin = range_m - fog_length(above, slope * range_m, range_m, air.fog_scale)
    return np.exp(-2.0 * (air.extinction * range_m - air.fog * thin))  # type: ignore[no-any-return]


@inlined
def _soft_share(air: Air, range_m: float, above: float, slope: float) -> float:
    """Echo of the soft target at a range over that where the fog is densest everywhere."""
    if air.fog_scale == 0.0:
        return 1.0
    density = np.exp(-(above + slope * range_m) / air.fog_scale)
    less = np.exp(2.0 * air.extinction * range_m) * transmitted(air, range_m, above, slope)
    return (1.0 - air.fog_echo * (1.0 - density)) * less  # type: ignore[no-any-return]


@inlined
def strongest_echo(
    air: Air, power: float, range_m: float, beam: tuple[float, float], u1: float, u2: float
) -> tuple[float, float, bool]:
    """Power and range [m] of the strongest echo of a ray, and whether it is a particle's.

    ``power`` is the surface's in this air and ``range_m`` its range; a ray that meets none has power 0 and the LiDAR's
    max_range. ``beam`` is where it begins and its slope, as for ``transmitted``. ``u1`` and ``u2`` are uniform in
    (0, 1].
    """
    particle, at, table, rows = False, range_m, air.numbers, air.numbers.shape[0]
    k = min(int(range_m / _SOFT_STEP), air.soft_power.shape[0] - 1)
    if air.soft_power[k] > 0.0:
        found = min(_soft_range(air, k, u2), range_m)
        soft = air.soft_power[k] * _soft_share(air, found, beam[0], beam[1])
        if soft > power:
            power, at, particle = soft, found, True
    column = (np.log(range_m) - air.first_log_range) * air.per_log_range
    if column <= 0.0:
        return power, at, particle
    last = min(int(column), table.shape[1] - 2)
    share = min(column - last, 1.0)
    rarity = -np.log(u1)  # the strongest one's power is that of which so many are expected to be stronger
    row = (np.log(max(power, LEAST_POWER)) - air.first_log_power) * air.per_log_power
    low = min(int(row), rows - 2)
    below, above = _between(table, low, last, share), _between(table, low + 1, last, share)
    if rarity >= below + (row - low) * (above - below):
        return power, at, particle
    high = rows - 1
    while high - low > 1:
        middle = (low + high) // 2
        if _between(table, middle, last, share) > rarity:
            low = middle
        else:
            high = middle
    below, above = _between(table, low, last, share), _between(table, low + 1, last, share)
    power = np.exp(air.first_log_power + (low + (below - rarity) / (below - above)) / air.per_log_power)
    wanted = u2 * (below - above)  # particles of about this power, by range
    left, right = 0, last + 1
    while right - left > 1:
        middle = (left + right) // 2
        if table[low, middle] - table[low + 1, middle] < wanted:
            left = middle
        else:
            right = middle
    begin = table[low, left] - table[low + 1, left]
    end = table[low, left + 1] - table[low + 1, left + 1]
    column = left + (wanted - begin) / max(end - begin, 1e-300)
    return power, min(np.exp(air.first_log_range + column / air.per_log_range), range_m), True
