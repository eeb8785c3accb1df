# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Microrelief has the spectrum of its class of ISO 8608: as synthesized, mixed, and along the built-in routes."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.ndimage import map_coordinates
from scipy.signal import detrend, welch

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.build import check_layout, layout_model, load_world, reserved_corridors
from fieldtruth.world.materials import GROUND_TYPES, ISO_CLASSES, MATERIALS, Roughness
from fieldtruth.world.model import World
from fieldtruth.world.relief import BAND, shaped, white_noise, with_microrelief

F8 = NDArray[np.float64]
SPACING = 0.05
OCTAVES = ((0.15, 0.3), (0.3, 0.6), (0.6, 1.2), (1.2, 2.4), (2.4, 4.8), (4.8, 9.6))  # [cycles/m]


def profile_spectrum(field: F8, axis: int) -> tuple[F8, F8]:
    """Spatial frequencies [cycles/m], and the mean one-sided spectrum [m^3] of all periodic profiles along an axis."""
    rows = np.moveaxis(field, axis, -1)
    power = (np.abs(np.fft.rfft(rows, axis=-1)) ** 2).mean(axis=0) * 2.0 * SPACING / rows.shape[-1]
    return np.asarray(np.fft.rfftfreq(rows.shape[-1], SPACING)[1:], np.float64), np.asarray(power[1:])


def two_dimensional(q: F8 | float, waviness: float) -> F8:
    """Two-sided spectrum [m^4] whose profiles have Gd(n) = (n / 0.1)^-w, by the integral itself."""
    integral = quad(lambda m: (1.0 + m * m) ** (-(waviness + 1.0) / 2.0), -np.inf, np.inf)[0]
    return np.asarray(0.1**waviness / (2.0 * integral) * np.asarray(q) ** -(waviness + 1.0))


def expected(n: float, waviness: float) -> float:
    """Spectrum [m^3] of profiles of the band-limited field at a spatial frequency within the band."""
    beyond = np.sqrt(BAND[1] ** 2 - n * n)
    return 4.0 * quad(lambda m: float(two_dimensional(np.hypot(n, m), waviness)), 0.0, beyond)[0]


def relative_deviation(lowest: float, highest: float, axis: int, shape: tuple[int, int], waviness: float) -> float:
    """Relative deviation of an octave's mean of Gd n^w: it sums independent exponential numbers, one for each wave."""
    along, across = (np.fft.fftfreq(shape[k], SPACING) for k in (axis, 1 - axis))
    n = along[(along >= lowest) & (along < highest)]
    q = np.hypot(n[:, None], across)
    power = np.where(q < BAND[1], two_dimensional(q, waviness), 0.0) * n[:, None] ** waviness
    return float(np.sqrt((power**2).sum()) / power.sum())


@pytest.mark.parametrize("waviness", [2.0, *(pytest.param(w, marks=pytest.mark.slow) for w in (1.6, 2.5))])
def test_profiles_have_the_spectrum_asked_for(waviness: float) -> None:
    field = shaped(white_noise((720, 600), np.random.default_rng(4)), SPACING, waviness).astype(float)
    for axis in (0, 1):
        n, power = profile_spectrum(field, axis)
        for lowest, highest in OCTAVES:
            rows = np.flatnonzero((n >= lowest) & (n < highest))
            ratio = np.mean([power[k] / expected(n[k], waviness) for k in rows])
            deviation = relative_deviation(lowest, highest, axis, (field.shape[0], field.shape[1]), waviness)
            assert deviation < 0.35
            assert abs(ratio - 1.0) < 4.0 * deviation + 0.01, (axis, lowest, ratio, deviation)


def test_the_law_of_iso_8608_holds_but_for_what_lies_above_the_band() -> None:
    """For w = 2 the factor is sqrt(1 - (n / q_max)^2)."""
    for n in (0.2, 1.0, 3.0, 8.0):
        assert expected(n, 2.0) == pytest.approx((n / 0.1) ** -2.0 * np.sqrt(1.0 - (n / BAND[1]) ** 2), rel=1e-6)


def test_classes_are_a_factor_of_four_apart() -> None:
    assert ISO_CLASSES["A"] == 16e-6
    assert ISO_CLASSES["E"] == 4096e-6
    assert ISO_CLASSES["H"] == pytest.approx(262144e-6)
    assert GROUND_TYPES["lawn"].roughness.unevenness == ISO_CLASSES["D"]


def test_hills_are_kept_and_amplitudes_follow_the_cover() -> None:
    coarse = np.arange(0.0, 30.1, 0.2), np.arange(0.0, 20.1, 0.2)
    fine = np.linspace(0.0, 30.0, 601), np.linspace(0.0, 20.0, 401)
    hills = np.add.outer(np.sin(coarse[0] / 4.0), 0.3 * coarse[1])
    smooth = with_microrelief(hills, coarse, fine, [], np.random.default_rng(0))
    np.testing.assert_allclose(smooth, np.add.outer(np.sin(fine[0] / 4.0), 0.3 * fine[1]), rtol=0.0, atol=1e-5)
    rough = np.clip((coarse[0] - 14.0) / 2.0, 0.0, 1.0)[:, None] * np.ones(len(coarse[1]))
    cover = [(Roughness(ISO_CLASSES["B"]), 1.0 - rough), (Roughness(ISO_CLASSES["D"]), rough)]
    relief = with_microrelief(hills, coarse, fine, cover, np.random.default_rng(0)) - smooth
    white = shaped(white_noise(relief.shape, np.random.default_rng(0)), SPACING, 2.0)[:601, :401]
    np.testing.assert_allclose(relief[:280], np.sqrt(ISO_CLASSES["B"]) * white[:280], rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(relief[320:], np.sqrt(ISO_CLASSES["D"]) * white[320:], rtol=0.0, atol=1e-7)
    middle = 0.5 * (np.sqrt(ISO_CLASSES["B"]) + np.sqrt(ISO_CLASSES["D"])) * white[300]
    assert relief[300] == pytest.approx(middle, abs=1e-7)


WINDOW = 256
"""Samples of a window, 12.8 m: the law's steepness biases the lowest frequencies of shorter ones."""
HALF_TRACK = Rig().wheels.half_track


def ground_types(world: World, xy: F8) -> NDArray[np.str_]:
    """Name of the ground type that has the greatest share at positions (n, 2); empty near a trail's edge."""
    terrain = world.terrain
    names = np.array([MATERIALS[n].ground_type for n in terrain.ground_materials])
    types = names[terrain.cover.at(*xy.T).argmax(axis=-1)].astype("U20")
    distance = terrain.trail_distance.at(*xy.T)
    types[distance < 0.0] = MATERIALS[terrain.trail_material].ground_type
    types[np.abs(distance) < 0.15] = ""
    return np.asarray(types, np.str_)


def spectra_of_tracks(world: World, grounds: tuple[str, ...]) -> tuple[F8, F8]:
    """Frequencies [cycles/m] and spectra (windows, n) [m^3] of the wheel tracks of all routes on some ground types."""
    field, windows = world.terrain.field, []
    frequency = np.zeros(0)
    for line in reserved_corridors(world.name):
        left = np.column_stack([-line.tangents[:, 1], line.tangents[:, 0]])
        for side in (-HALF_TRACK, HALF_TRACK):
            track = line.points + side * left
            travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track, axis=0).T))])
            steps = np.arange(0.0, travelled[-1], SPACING)
            xy = np.column_stack([np.interp(steps, travelled, track[:, k]) for k in range(2)])
            nodes = (xy - (field.x0, field.y0)) / field.spacing
            heights = map_coordinates(field.heights.astype(float), nodes.T, order=3)
            own = np.isin(ground_types(world, xy), grounds)
            for first in range(0, len(heights) - WINDOW, WINDOW // 2):
                if own[first : first + WINDOW].mean() > 0.95:
                    part = np.asarray(detrend(heights[first : first + WINDOW]), np.float64)
                    frequency, power = welch(part, fs=1.0 / SPACING, nperseg=WINDOW, detrend=False)
                    windows.append(power)
    return frequency, np.array(windows)


@pytest.mark.parametrize(
    ("environment", "grounds", "law"),
    [
        ("park", ("lawn", "earth"), ("D", 2.0)),
        pytest.param("park", ("gravel",), ("C", 2.1), marks=pytest.mark.slow),
        pytest.param("lake", ("meadow", "dry_grass"), ("D", 2.0), marks=pytest.mark.slow),
        pytest.param("forest", ("trodden_earth",), ("D", 1.8), marks=pytest.mark.slow),
        pytest.param("hillside", ("stony_soil", "dry_turf"), ("E", 2.0), marks=pytest.mark.slow),
    ],
)
def test_routes_have_the_class_of_their_ground(
    environment: str, grounds: tuple[str, ...], law: tuple[str, float]
) -> None:
    """Level and slope of the spectrum along the wheel tracks, from 0.3 to 3 cycles/m.

    Windows that overlap by half are nearly independent after a Hann taper, neighbouring frequencies are correlated:
    m windows have about 2 m / 1.5 degrees of freedom a frequency. Tolerances are four deviations, and 12 % for roots,
    for the hills' share and for the band's end; a class reaches from half to twice its Gd(n0).
    """
    world = load_world(environment)
    n, power = spectra_of_tracks(world, grounds)
    assert len(power) >= 6
    octaves = ((0.3, 0.6), (0.6, 1.2), (1.2, 3.0))
    level, deviation, middle = [], [], []
    for lowest, highest in octaves:
        rows = (n >= lowest) & (n < highest)
        level.append((power[:, rows] * (n[rows] / 0.1) ** law[1]).mean())
        deviation.append(np.sqrt(2.0 / (len(power) * rows.sum() * 2.0 / 1.5)))
        middle.append(np.sqrt(lowest * highest))
    unevenness = float(np.exp(np.mean(np.log(level))))
    tolerance = 4.0 * float(np.hypot.reduce(deviation)) / 3.0 + 0.12
    assert tolerance < 0.5
    assert unevenness == pytest.approx(ISO_CLASSES[law[0]], rel=tolerance)
    waviness = law[1] - np.polyfit(np.log(middle), np.log(level), 1)[0]
    slope_deviation = float(np.hypot(deviation[0], deviation[2])) / np.log(middle[2] / middle[0])
    assert waviness == pytest.approx(law[1], abs=4.0 * slope_deviation + 0.15)


def test_classes_of_a_layout_are_checked_and_used() -> None:
    for layout, words in (
        ({"roughness": {"lawns": "C"}}, "did you mean 'lawn'"),
        ({"roughness": {"lawn": "Z"}}, "A, B, C, D, E, F, G, H"),
        ({"roughness": {"scree": "C"}}, "unknown ground type 'scree'"),
        ({"roughness": "C"}, "roughness"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            check_layout("park", layout)
    config = layout_model("park").model_validate({"roughness": {"lawn": "E"}})
    assert config.roughness_of("lawn").unevenness == ISO_CLASSES["E"]  # type: ignore[attr-defined]
    assert config.roughness_of("gravel").unevenness == ISO_CLASSES["C"]  # type: ignore[attr-defined]
