# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wind, and how plants lean in it: a closed form of place and time, so that no reading depends on another.

Gusts are sums of waves with random phases (spectral representation: Shinozuka and Jan 1972, J. Sound and Vibration 25)
of the spectra of Kaimal et al. (1972, Quart. J. R. Met. Soc. 98), along the mean wind and across it, for a height of
10 m. The mean wind carries them (Taylor's frozen turbulence): the wave number along it is the angular frequency over
the mean speed. Across it, wave numbers are drawn from a Cauchy distribution, whose characteristic function is the
exponential coherence of Davenport (1961, Quart. J. R. Met. Soc. 87): exp(-DECAY f d / U) at a distance d.

A plant is a damped oscillator about its foot, as trees are to first order (Moore and Maguire 2004, Trees 18). The mean
drag, which grows with the speed to the power of 2 + VOGEL because plants streamline (Vogel 1989, J. Exp. Botany 40; de
Langre 2008, Annu. Rev. Fluid Mech. 40), gives the mean lean. Gusts change it in proportion, times the oscillator's
response at each frequency.

Groups of a tree's limbs (``sense.limbs``) are oscillators on top of that, in the same gusts. The drag on the middle of
a group turns it about the axis across the drag and the arm from its foot: what stands across the wind swings sideways,
what points along it stays. On average it stands as it has grown. Leaves do not move on their own.
"""

from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Index
from fieldtruth.core.classes import Label
from fieldtruth.core.random import rng_of
from fieldtruth.experiment.wind_config import WindConfig
from fieldtruth.kernels.leaning import add_waves
from fieldtruth.sense.leaning import Lean, Leaning, Plants, plants_of
from fieldtruth.sense.limbs import with_limbs
from fieldtruth.sense.ripples import Ripples
from fieldtruth.world.model import Mesh, World

WAVES: Final = 96
"""Waves of each of the two components."""
BAND_HZ: Final = (0.004, 4.0)
"""Frequencies between which the waves are, evenly in the logarithm; the first one has what is below, too."""
HEIGHT: Final = 10.0
"""[m] of the given speed and of the spectra."""
DECAY: Final = 10.0
"""Of the coherence across the wind, in the range of measured ones (7 to 20); assumed."""
ROUGHNESS: Final = 0.05
"""[m] Roughness length of the profile of the mean wind, of open land; assumed."""
VOGEL: Final = -0.7
"""Exponent of the drag's reduction, between those of trees and of grasses (de Langre 2008, section 3)."""
ACROSS: Final = 0.75
"""Standard deviation across the wind over that along it (Kaimal et al. 1972: the roots of 2.68 and 4.77)."""
SLENDER: Final = 0.015
"""Diameter of a tree's stem over its height, at most."""
MOST_LEAN: Final = 0.8
"""[rad] Greatest mean lean."""
LIMB: Final = 0.06
"""[rad] Turn of limbs in the drag of a steady wind of 10 m/s, of which gusts are a share; assumed."""
SPREAD: Final = 0.1
"""Relative difference at most of a group's frequency from that of its size; assumed."""


def share_below(hertz: Array, speed: float, scale: float) -> Array:
    """Share of a component's variance below a frequency: the integral of Kaimal's spectrum.

    n S(n) / variance = (2/3) ``scale`` f / (1 + ``scale`` f)^(5/3), with f = n HEIGHT / speed; the scale is 33 along
    the wind and 9.5 across it.
    """
    return np.asarray(1.0 - (1.0 + scale * HEIGHT / speed * hertz) ** (-2.0 / 3.0))


class Waves(NamedTuple):
    """Waves of a component of the wind: cos(omega t - k . xy + phase), with amplitudes relative to the mean speed."""

    omega: Array  # (WAVES,) [rad/s]
    amplitude: Array  # (WAVES,)
    k: Array  # (WAVES, 2) [rad/m] in the world
    phase: Array  # (WAVES,) [rad]

    @classmethod
    def drawn(cls, config: WindConfig, across: bool, rng: np.random.Generator) -> Self:
        """Draw the waves along or across the mean wind."""
        speed, heading = config.speed_m_s, np.array(config.heading)
        edges = np.geomspace(*BAND_HZ, WAVES + 1)
        hertz = edges[:-1] * (edges[1:] / edges[:-1]) ** rng.random(WAVES)
        shares = np.diff(share_below(np.append(0.0, edges[1:]), speed, 9.5 if across else 33.0))
        wave = 2.0 * np.pi * hertz
        side = DECAY * hertz / speed * rng.standard_cauchy(WAVES)
        k = wave[:, None] / speed * heading + side[:, None] * np.array([-heading[1], heading[0]])
        deviation = config.gusts * (ACROSS if across else 1.0)
        return cls(wave, deviation * np.sqrt(2.0 * shares), k, rng.uniform(0.0, 2.0 * np.pi, WAVES))


class Wind:
    """Wind of an experiment. Threads may share it."""

    def __init__(self, config: WindConfig, seed: int) -> None:
        self.config, self.seed, self.heading = config, seed, np.array(config.heading)
        rngs = rng_of(seed, "wind", "along"), rng_of(seed, "wind", "across")
        self.waves = (
            [Waves.drawn(config, across, rng) for across, rng in zip((False, True), rngs, strict=True)]
            if config.speed_m_s
            else []
        )

    def at(self, xy: Array, seconds: Array) -> Array:
        """Wind (t, n, 2) [m/s] in the world at HEIGHT above positions (n, 2) [m], at times (t,) [s]."""
        parts = np.zeros((len(seconds), len(xy), 2))
        parts[..., 0] = 1.0
        for axis, (omega, amplitude, k, phase) in enumerate(self.waves):
            turns = seconds[:, None, None] * omega - xy @ k.T + phase
            parts[..., axis] += np.cos(turns) @ amplitude
        x, y = self.heading
        return np.asarray(self.config.speed_m_s * parts @ np.array([[x, y], [-y, x]]))


class Oscillators(NamedTuple):
    """How plants (n,) answer to wind."""

    hertz: Array  # natural frequency
    damping: Array  # ratio to the critical one
    lean: Array  # [rad] in a steady wind of 10 m/s at the plant's top; of limbs the one that gusts have a share of

    def response(self, omega: Array) -> NDArray[np.complex128]:
        """Lean (n, w) at angular frequencies (w,) [rad/s] over the lean in a steady wind of the same drag."""
        own = 2.0 * np.pi * self.hertz[:, None]
        return np.asarray(own**2 / (own**2 - omega**2 + 2j * self.damping[:, None] * own * omega))


def sway_hertz(diameter: Array, height: Array) -> Array:
    """Natural frequency [Hz] of trees of a diameter at breast height [m] and a height [m].

    Of 602 conifers of eight species (Moore and Maguire 2004; coefficients from memory), with the diameter in cm.
    """
    return np.asarray(0.0948 + 3.4317 * 100.0 * diameter / height**2)


_FASTEST: Final = 2.5
"""[Hz] Natural frequency at most: the motion has ten knots a second."""


def oscillators(world: World, plants: Plants, rng: np.random.Generator) -> Oscillators:
    """Return how plants answer to wind, by their class and size, and how limbs do, with random differences.

    Trees: by ``sway_hertz``, 10 % of critical damping (Moore and Maguire 2004 for unpruned Douglas-firs: 8 % and more),
    2 deg at 10 m/s. The rest of a stem thicker than SLENDER of the height bears a heavier crown. Grass, herbs and
    crops: 1 Hz at 1.1 m, and faster the shorter they are (Py, de Langre and Moulia 2006, J. Fluid Mech. 568, from
    memory: about 1 to 2.5 Hz for alfalfa and wheat), 20 % and 28 deg; bushes between them. Leans, damping of these, and
    SLENDER, which also stands for trees without a collider, are assumed.

    Limbs: the tree's frequency times the root of its height over their reach, 1 to 3 times, as stems are whose diameter
    grows with the length to the power of 1.5 (McMahon and Kronauer 1976, J. Theor. Biol. 59); modes of branches lie
    close together above the trunk's (Rodriguez, de Langre and Moulia 2008, Am. J. Botany 95; from memory). Damping as
    the tree's (assumed).
    """
    names, row = np.unique(plants.mesh, return_inverse=True)
    meshes = [world.meshes[name] for name in names.tolist()]
    woody = np.array([_is_woody(world, mesh) for mesh in meshes], np.bool_)[row]
    tree = np.array([_is_tree(world, mesh) for mesh in meshes], np.bool_)[row]
    own = np.array([max((each.size[0] for each in mesh.colliders), default=0.0) for mesh in meshes])[row]
    scale, height = np.linalg.norm(plants.world_from_object[:, :3, 2], axis=1), np.maximum(plants.height, 0.05)
    diameter = np.minimum(np.where(own > 0.0, 2.0 * own * scale, np.inf), SLENDER * height)
    hertz = np.where(tree, sway_hertz(diameter, height), np.where(woody, 1.5 * np.sqrt(1.5 / height), 1.1 / height))
    damping, lean = (np.where(tree, a, np.where(woody, b, c)) for a, b, c in ((0.1, 0.15, 0.2), (0.035, 0.08, 0.5)))
    limb = np.flatnonzero(plants.parent >= 0)
    bearing = plants.parent[limb]
    # Diameters that grow with the length to the power of 1.5 give frequencies that fall with its root.
    ratio = np.clip(np.sqrt(plants.height[bearing] / plants.height[limb]), 1.0, 3.0)
    hertz[limb] = hertz[bearing] * ratio * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, len(limb))
    lean[limb] = LIMB
    return Oscillators(np.minimum(hertz, _FASTEST), damping, lean)


def _is_tree(world: World, mesh: Mesh) -> bool:
    return any(world.materials[name].label in (Label.TRUNK, Label.TREETOP) for name in mesh.materials)


def _is_woody(world: World, mesh: Mesh) -> bool:
    return _is_tree(world, mesh) or any(world.materials[name].label == Label.BUSH for name in mesh.materials)


def leaning_of(config: WindConfig | None, world: World, seed: int, *further: Lean) -> Leaning | None:
    """Return the plants of a world that lean in a wind, and from further causes; None where none does.

    The seed is that of the gusts: robots of one experiment have the same wind.
    """
    if (config is None or not config.speed_m_s) and not further:
        return None
    plants, blows = plants_of(world), config is not None and config.speed_m_s > 0.0
    if blows:
        plants = with_limbs(world, plants)
    wind = [WindLean(world, plants, Wind(config, seed))] if config is not None else []
    ripples = Ripples.drawn(config, seed) if config is not None and blows else None
    return Leaning(plants, [*wind, *further], ripples)


class WindLean:
    """The lean of all plants of a world in a wind; see ``leaning.Lean``."""

    def __init__(self, world: World, plants: Plants, wind: Wind) -> None:
        count = len(plants.top) if wind.waves else 0
        self.rows: Index = np.arange(count)
        self._omega = [waves.omega for waves in wind.waves]
        if not count:
            return
        kinds, (x, y) = oscillators(world, plants, rng_of(wind.seed, "wind", "limbs")), wind.heading
        limb = plants.parent >= 0
        height = np.where(limb, plants.height[plants.parent], plants.height)
        profile = np.log1p(height / ROUGHNESS) / np.log1p(HEIGHT / ROUGHNESS)
        speed = wind.config.speed_m_s * profile
        mean = np.minimum(kinds.lean * (speed / 10.0) ** (2.0 + VOGEL), MOST_LEAN)
        axes = [np.cross(plants.ahead, [*drag, 0.0]) for drag in ((x, y), (-y, x))]  # about which along and across lean
        self._mean = np.where(limb, 0.0, mean)[:, None] * axes[0]
        self._waves = []
        for (omega, amplitude, k, phase), gain, axis in zip(wind.waves, (2.0 + VOGEL, 1.0), axes, strict=True):
            answer = gain * mean[:, None] * amplitude * kinds.response(omega)
            answer = answer * np.exp(1j * (phase - plants.foot[:, :2] @ k.T))
            table = np.concatenate([answer.real, -answer.imag], axis=1).T
            self._waves.append((np.ascontiguousarray(table, np.float32), axis))

    def __call__(self, rows: Index, knots_ns: NDArray[np.int64]) -> Array:
        """Rotation vectors (k, n, 3) [rad] of plants (n,) at knots (k,) [ns]; only limbs turn about z."""
        found = np.repeat(self._mean[None, rows], len(knots_ns), axis=0)
        for omega, (table, axis) in zip(self._omega, self._waves, strict=True):
            own = table if np.array_equal(rows, self.rows) else np.ascontiguousarray(table[:, rows])
            for k, turn in enumerate((knots_ns / 1e9)[:, None] * omega):
                lean = np.zeros(len(rows), np.float32)
                add_waves(own, np.concatenate([np.cos(turn), np.sin(turn)]).astype(np.float32), lean)
                found[k] += lean[:, None].astype(np.float64) * axis[rows]
        return found
