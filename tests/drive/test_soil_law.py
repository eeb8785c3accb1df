# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The law of wheel and soil against integrals, a worked example of the literature and published coefficients."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from soil_slip import LOAD, TYRE, climbing_slip

from fieldtruth.core.arrays import Array
from fieldtruth.drive.soil import SOILS, soil_rows
from fieldtruth.experiment.robot_config import WheelConfig
from fieldtruth.kernels.ruts import CELLS, NO_RUTS, RutTable
from fieldtruth.kernels.soil import (
    Mixture,
    Wheels,
    compaction,
    mix_soils,
    mobilized,
    patch_length,
    sinkage,
    slip_factor,
    step_soil,
    strength,
    traction,
)


def row(name: str) -> Array:
    return np.asarray(soil_rows((name,))[0])


@pytest.mark.parametrize(
    ("name", "tolerance"), [("forest_floor", 1e-9), ("earth", 3e-3), ("sand", 0.03), ("mud", 0.07)]
)
def test_pressure_below_a_rigid_wheel_carries_the_load(name: str, tolerance: float) -> None:
    """The integral of Bekker's pressure over the chord; Bekker's closed form of it is exact for n = 1."""
    soil = row(name)
    width, diameter, _ = TYRE
    depth = sinkage(LOAD, TYRE, soil)
    stiffness = soil[0] / width + soil[1]
    carried, _ = quad(
        lambda t: width * stiffness * (depth - t * t) ** soil[2] * math.sqrt(diameter), 0, math.sqrt(depth)
    )
    assert carried == pytest.approx(LOAD, rel=tolerance)


@pytest.mark.parametrize("name", ["earth", "sand", "mud"])
def test_work_of_compaction_is_the_integral_of_the_pressure(name: str) -> None:
    soil = row(name)
    depth = sinkage(LOAD, TYRE, soil)
    work, _ = quad(lambda z: TYRE[0] * (soil[0] / TYRE[0] + soil[1]) * z ** soil[2], 0, depth)
    assert compaction(LOAD, depth, TYRE, soil) == pytest.approx(work, rel=1e-6)


@pytest.mark.parametrize("slip", [1e-9, 0.003, 0.1, 0.9])
def test_traction_is_the_integral_of_the_shear_stress(slip: float) -> None:
    """Janosi and Hanamoto: stress (c + p tan phi) (1 - exp(-j / K)) at the shear displacement j = i x."""
    soil = row("earth")
    depth = sinkage(LOAD, TYRE, soil)
    length = patch_length(LOAD, depth, TYRE)
    pressure = LOAD / (length * TYRE[0])
    stress = soil[3] + pressure * soil[4]
    force, _ = quad(lambda x: TYRE[0] * stress * -math.expm1(-slip * x / soil[5]), 0, length)
    assert traction(slip, LOAD, depth, TYRE, soil) == pytest.approx(force, rel=1e-6)


def test_worked_example_of_a_tracked_vehicle() -> None:
    """Wong, Theory of Ground Vehicles, example of two tracked vehicles (quoted from memory).

    135 kN on 7.2 m^2, 3.6 m long, in snow of n 1.6, c 1.0 kPa, phi 19.7 deg, K 5 cm at 20 % of slip: thrust 51.7 kN.
    """
    soil = np.array([4370.0, 196_720.0, 1.6, 1000.0, math.tan(math.radians(19.7)), 0.05, 0.0])
    diameter = 3.6**2 / 0.2270  # so that the chord at its sinkage is the track's length
    tracks = (2.0, diameter, 1e15)
    assert patch_length(135e3, 0.2270, tracks) == pytest.approx(3.6, rel=1e-4)
    assert traction(0.2, 135e3, 0.2270, tracks, soil) == pytest.approx(51.7e3, rel=2e-3)


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("paving", 0.02, 0.03), ("rock", 0.02, 0.03), ("gravel", 0.01, 0.04), ("trodden_earth", 0.04, 0.08),
        ("lawn", 0.055, 0.065), ("earth", 0.08, 0.15), ("pebbles", 0.04, 0.1), ("sand", 0.1, 0.39),
    ],
)  # fmt: skip
def test_resistance_is_within_published_coefficients(name: str, low: float, high: float) -> None:
    soil = row(name)
    resistance = compaction(LOAD, sinkage(LOAD, TYRE, soil), TYRE, soil) + soil[6] * LOAD
    assert low <= round(resistance / LOAD, 2) <= high


def test_slip_uphill_is_small_on_paving_and_tens_of_per_cent_on_loose_ground() -> None:
    assert climbing_slip("paving", 13.0) < 0.02
    assert 0.02 < climbing_slip("trodden_earth", 13.0) < 0.05
    assert 0.2 < climbing_slip("scree", 13.0) < 0.6
    assert 0.2 < climbing_slip("sand", 5.0) < 0.6
    with pytest.raises(ValueError, match="f\\(a\\) and f\\(b\\) must have different signs"):
        climbing_slip("sand", 13.0)  # dry sand does not carry it up


def test_firm_soils_transmit_more_than_farm_soil_and_less_than_a_road() -> None:
    """Brixius: 0.88 * 7.5 of the load per unit of slip on firm farm soil; about 20 on a road."""
    for name in ("gravel", "trodden_earth", "stony_soil", "lawn", "meadow"):
        soil = row(name)
        depth = sinkage(LOAD, TYRE, soil)
        assert 5.0 < traction(1e-4, LOAD, depth, TYRE, soil) / LOAD / 1e-4 < 15.0, name


def test_slip_deepens_the_rut() -> None:
    assert slip_factor(0.0) == 1.0
    assert slip_factor(0.5) == 2.0
    assert slip_factor(1.0) == 4.0


HALVES = np.array([[[1.0, 0.0]] * 2, [[0.0, 1.0]] * 2], np.float32)  # earth at x <= 0, mud at x >= 1
DISTANCE = np.array([[[1.0]] * 2, [[0.0]] * 2, [[-1.0]] * 2], np.float32)  # a trail's edge at x = 1
STONES = np.array([[[0.0]] * 2, [[0.0]] * 2, [[1.0]] * 2], np.float32)  # at x >= 6
GROUND = (HALVES, 0.0, 0.0, 1.0), (DISTANCE, 0.0, 0.0, 1.0), (STONES, 4.0, 0.0, 1.0), 0.3


def test_soils_are_mixed_by_cover_trail_and_border() -> None:
    weights = np.empty(5)
    expected = {
        0.25: (0.75, 0.25, 0, 0, 0), 0.8: (0.2, 0.8, 0, 0, 0), 1.0: (0, 0.5, 0, 0.5, 0), 1.2: (0, 0, 0, 1, 0),
        1.3: (0, 0, 0.5, 0.5, 0), 1.9: (0, 0, 1, 0, 0), 5.25: (0, 0, 0.75, 0, 0.25), 8.0: (0, 0, 0, 0, 1),
    }  # fmt: skip
    for x, shares in expected.items():
        mix_soils(GROUND, x, 0.5, weights)
        np.testing.assert_allclose(weights, shares, atol=1e-5)
    steps = []
    for x in np.linspace(-1, 7, 8001):
        mix_soils(GROUND, x, 0.5, weights)
        assert weights.sum() == pytest.approx(1.0)
        steps.append(weights.copy())
    assert np.abs(np.diff(steps, axis=0)).max() < 0.0101  # 1 mm of 0.1 m


SOILS_HERE = soil_rows(("earth", "mud", "sand", "gravel", "rock"))


def advance(
    velocity: tuple[float, float], tread: float, seconds: float, state: Array, ruts: RutTable = NO_RUTS
) -> Wheels:
    """The wheels after ``seconds`` on earth at constant velocity of the axle and the tread."""
    wheels = Wheels(
        position=np.tile((-1.0, 0.5, 0.0), (4, 1)),
        load=np.full(4, LOAD),
        velocity=np.tile(velocity, (4, 1)),
        rolling=np.full(4, tread),
        friction=np.empty((4, 2)),
        drag=np.empty(4),
        torque=np.empty(4),
        sinkage=np.empty(4),
        ahead=np.tile((1.0, 0.0, 0.0), (4, 1)),
    )
    mixture = Mixture(SOILS_HERE, GROUND, ruts, TYRE, np.empty(len(SOILS_HERE)))
    for _ in range(round(seconds / 0.001)):
        step_soil(mixture, wheels, state, 0.001)
    return wheels


def test_standing_wheel_sinks_as_bekker_says_and_holds_with_all_its_strength() -> None:
    soil = row("earth")
    depth = sinkage(LOAD, TYRE, soil)
    wheels = advance((0.0, 0.0), 0.0, 2.0, np.zeros((4, 3)))
    np.testing.assert_allclose(wheels.sinkage, depth, rtol=1e-6)
    np.testing.assert_allclose(wheels.friction, strength(LOAD, depth, TYRE, soil) / LOAD, rtol=1e-6)
    np.testing.assert_array_equal([wheels.drag, wheels.torque], 0.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("forward", "lateral", "tread"), [(0.2, 0.0, 0.3), (0.3, 0.0, 0.2), (0.3, 0.12, 0.3)])
def test_moving_wheel_follows_the_closed_forms(forward: float, lateral: float, tread: float, sign: float) -> None:
    """Driven, braked and skidding sideways, in both directions."""
    soil = row("earth")
    wheels = advance((sign * forward, lateral), sign * tread, 3.0, np.zeros((4, 3)))
    depth = sinkage(LOAD, TYRE, soil) * slip_factor(max(1 - forward / tread, 0.0))
    slip = math.hypot(tread - forward, lateral) / max(forward, tread)
    np.testing.assert_allclose(wheels.sinkage, depth, rtol=1e-3)
    np.testing.assert_allclose(wheels.friction, traction(slip, LOAD, depth, TYRE, soil) / LOAD, rtol=1e-3)
    np.testing.assert_allclose(wheels.drag, -sign * compaction(LOAD, depth, TYRE, soil), rtol=1e-3)
    np.testing.assert_allclose(wheels.torque, -sign * soil[6] * LOAD * WheelConfig().radius, rtol=1e-3)
    assert 0.0 < mobilized(slip, LOAD, depth, TYRE, soil) < 1.0


def rutted(before: float, behind: float) -> RutTable:
    """Ruts of a depth [m] at x above that of the wheels, and of another behind it."""
    depth = np.full((1, CELLS + 1, CELLS + 1), before, np.float32)
    depth[:, : CELLS // 2] = behind
    return RutTable(np.zeros((1, 1), np.int32), depth, -1.0 - 0.05 * CELLS / 2, 0.0, 1 / 0.05)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_in_a_rut_a_wheel_works_only_below_what_is_pressed(sign: float) -> None:
    """What is pressed behind a wheel, which it did itself, does not count."""
    soil = row("earth")
    depth = sinkage(LOAD, TYRE, soil) * slip_factor(0.5)
    rut = 0.7 * depth
    found = advance((sign * 0.2, 0.0), sign * 0.4, 3.0, np.zeros((4, 3)), rutted(*(rut, 0.0)[:: int(sign)]))
    least = compaction(LOAD, depth, TYRE, soil) * (1 - 0.7 ** (soil[2] + 1))
    np.testing.assert_allclose(found.drag, -sign * least, rtol=2e-3)
    np.testing.assert_allclose(found.sinkage, depth, rtol=1e-3)
    own = advance((sign * 0.2, 0.0), sign * 0.4, 3.0, np.zeros((4, 3)), rutted(*(0.0, rut)[:: int(sign)]))
    np.testing.assert_allclose(own.drag, -sign * compaction(LOAD, depth, TYRE, soil), rtol=2e-3)
    deeper = advance((sign * 0.2, 0.0), sign * 0.4, 3.0, np.zeros((4, 3)), rutted(1.5 * depth, 1.5 * depth))
    np.testing.assert_allclose(deeper.sinkage, 1.5 * depth, rtol=1e-3)
    np.testing.assert_array_equal(deeper.drag, 0.0)


def test_rut_stays_when_the_wheel_stops() -> None:
    state = np.zeros((4, 3))
    rut = advance((0.2, 0.0), 0.4, 2.0, state).sinkage
    np.testing.assert_allclose(rut, 2 * sinkage(LOAD, TYRE, row("earth")), rtol=1e-2)
    np.testing.assert_allclose(advance((0.0, 0.0), 0.0, 2.0, state).sinkage, rut, rtol=5e-3)


def test_every_soil_is_plausible() -> None:
    for name, soil in SOILS.items():
        assert 0.2 <= soil.friction <= 0.9, name
        assert 0.0005 <= soil.shear <= 0.03, name
        assert 0.02 <= soil.rolling <= 0.04, name
        depth = sinkage(LOAD, TYRE, row(name))
        assert depth < 0.03, name
        # The tyre stays round where it sinks by more than a millimetre.
        pressure = (soil.k_c / TYRE[0] + soil.k_phi) * depth**soil.n
        assert depth < 1e-3 or pressure < 100e3, name
