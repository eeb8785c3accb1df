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
  One of diameter D covers (D / beam)^2 of the beam, as a surface of a reflectance of its own would. Numbers of drops by
  size are of Marshall and Palmer (1948), of flakes of Sekhon and Srivastava (1970).
"""

from typing import Final, NamedTuple

import numpy as np
from scipy.special import gamma, ndtr

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.light_config import WeatherConfig
from fieldtruth.kernels.lidar_noise import LEAST_POWER, SOFT_STEP, Air

WATER_INDEX: Final = 1.33
"""Refractive index (Hale and Querry 1973)."""
_ABSORBED_NM: Final = 1400.0
"""Wavelength [nm] from which a drop of 1 mm absorbs what passes through it (Hale and Querry 1973)."""
SNOW_LIDAR_RATIO: Final = 29.0
"""[sr] of ice crystals, 29 +- 12 (Chen, Chiang and Nee 2002)."""
FLAKE_DENSITY: Final = (0.178, -0.922)
"""Density of a flake over that of water at 1 mm, and its power law of the diameter (Brandes et al. 2007)."""
FLAKE_AREA: Final = 0.5
"""Share of the circle about a flake that it covers; extinction is then between those of wet and of dry snow of ITU-R
P.1814 at 1 mm/h."""


class Drops(NamedTuple):
    """Falling particles: n(D) = per_m3_mm exp(-per_mm D) of the melted diameter D [mm]."""

    per_m3_mm: float  # [1/(m^3 mm)]
    per_mm: float  # [1/mm]
    size: tuple[float, float]
    """Diameter [mm] of a disc of its area at a melted diameter of 1 mm, and its power law of the melted diameter."""
    reflectance: float  # of a Lambert surface with the same echo

    @property
    def extinction(self) -> float:
        """[1/m]: integral of pi / 4 diameter^2 n(D)."""
        scale, power = self.size
        moment = gamma(2 * power + 1) / self.per_mm ** (2 * power + 1)
        return float(1e-6 * np.pi / 4 * scale**2 * self.per_m3_mm * moment)

    @property
    def per_m3(self) -> float:
        """Number of particles per volume [1/m^3]."""
        return self.per_m3_mm / self.per_mm


def drop_reflectance(wavelength_nm: float) -> float:
    """Reflectance of the Lambert disc that sends as much light back as a drop, in geometric optics.

    The light comes from the front, a convex mirror, and from the back, a mirror behind a lens: F / 4 and
    (1 - F)^2 F (n / (2 - n))^2 / 4, F Fresnel's reflectance (van de Hulst 1957, section 12.21). The glory of a perfect
    sphere is brighter, but within 1 mrad (wavelength over diameter), and falling drops are no perfect spheres.
    """
    n = WATER_INDEX
    fresnel = ((n - 1) / (n + 1)) ** 2
    back = 0.0 if wavelength_nm > _ABSORBED_NM else (1 - fresnel) ** 2 * fresnel * (n / (2 - n)) ** 2
    return (fresnel + back) / 4


def rain(rate_mm_h: float, wavelength_nm: float) -> Drops:
    """Raindrops (Marshall and Palmer 1948)."""
    return Drops(8000.0, 4.1 * rate_mm_h**-0.21, (1.0, 1.0), drop_reflectance(wavelength_nm))


def snow(rate_mm_h: float) -> Drops:
    """Snowflakes (Sekhon and Srivastava 1970); extinction over backscatter makes their reflectance."""
    scale, power = FLAKE_DENSITY
    size = FLAKE_AREA**0.5 * scale ** (-1 / (3 + power)), 3 / (3 + power)  # density times diameter^3 remains
    reflectance = 2 * np.pi / SNOW_LIDAR_RATIO  # the ratio's extinction includes what is diffracted
    return Drops(2500.0 * rate_mm_h**-0.94, 2.29 * rate_mm_h**-0.45, size, reflectance)


LIGHT_SPEED: Final = 299_792_458.0  # [m/s]
CONTRAST: Final = 0.05
"""Contrast of a black object at the meteorological optical range (WMO-No. 8)."""
MOLECULES: Final = 1.162e-5
"""Extinction coefficient [1/m] of the molecules of air at sea level and 550 nm; Table 2 of Bucholtz 1995 has 1.149e-5,
which would change the bytes of photographs in clear air and hardly their look."""
FOG_BACKSCATTER: Final = 0.046
"""Backscatter coefficient [1/(m sr)] times visibility [m] (Rasshofer et al. 2011)."""
DUST_EXTINCTION: Final = 1.0
"""[m^2/g] of mineral dust near the ground: 0.5 to 2 (Shimizu et al. 2011, doi 10.2151/sola.7A-001), for every
wavelength, as its grains are larger than those."""
DUST_LIDAR_RATIO: Final = 55.0
"""Extinction over backscatter [sr] of desert dust: 55 +- 5 (Tesche et al. 2009, doi 10.1029/2009JD011862)."""
_MOST_POWER: Final = 10.0
_POWERS: Final = 129
_RANGES: Final = 65
_FINE: Final = 100  # steps of a pulse


class Beam(NamedTuple):
    """The beam of a LiDAR, as far as air acts on it."""

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


def falling(weather: WeatherConfig, wavelength_nm: float) -> tuple[Drops, ...]:
    """Particles of the weather that fall."""
    drops = (rain(weather.rain_mm_h, wavelength_nm),) if weather.rain_mm_h > 0 else ()
    return (*drops, snow(weather.snow_mm_h)) if weather.snow_mm_h > 0 else drops


def fog_extinction(visibility_m: float, wavelength_nm: float = 550.0) -> float:
    """Extinction coefficient of fog [1/m]; below a visibility of 500 m it is the same for every wavelength."""
    km = visibility_m / 1000
    size = 1.3 if km > 6 else 0.16 * km + 0.34 if km > 1 else max(km - 0.5, 0.0)
    return float(-np.log(CONTRAST) / visibility_m * (wavelength_nm / 550.0) ** -size)


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
    """Greatest power of the soft target, and where it is found, in front of surfaces at multiples of SOFT_STEP.

    A surface at R has its greatest power at R, so the pulse is centred: squared cosine over [-c tau / 2, c tau / 2],
    tau its width at half the power, which makes cells of c tau / 2.
    """
    seen = beam.width_m / beam.divergence_rad if beam.divergence_rad else 0.0  # from here on, power falls
    cells = int(np.ceil(max(3 * seen - beam.min_range, 0.0) / cell)) + 3
    step, last = 2 * cell / _FINE, beam.min_range + cells * cell
    at = np.asarray(beam.min_range + step * (np.arange(cells * _FINE // 2) + 0.5), np.float64)
    density: Array = strength * _overlap(at, beam) * np.exp(-2 * alpha * at) / at**2
    pulse = np.cos(np.pi * np.arange(-_FINE // 2, _FINE // 2 + 1) / _FINE) ** 2 * step
    surfaces = np.arange(0, last + SOFT_STEP, SOFT_STEP)
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
    below = ndtr((x - photons) / spread)
    below[:, np.arange(len(photons)), np.arange(len(photons))] = 1.0
    normal = np.exp(-(np.linspace(-6, 6, 301) ** 2) / 2.0) / np.sqrt(2.0 * np.pi)
    chance = (normal[:, None] * below.prod(axis=2)).sum(axis=0)
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
