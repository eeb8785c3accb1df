# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Steps of a relief and grids about a world, on planes and profiles with known heights; rocks that lie in a slope."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from fieldtruth.core.arrays import Array
from fieldtruth.world.environments.layered.expressions import Expression
from fieldtruth.world.environments.layered.fields import Fields
from fieldtruth.world.environments.layered.steps import Relief, shape
from fieldtruth.world.environments.layered.surroundings import FADES, Surroundings, shape_surroundings
from fieldtruth.world.grids import Line, grid_axes
from fieldtruth.world.relief import collapsed, eroded

SIZE = (20.0, 10.0)
X, Y = np.meshgrid(*grid_axes(SIZE, 0.2), indexing="ij")


def fields(rules: Mapping[str, str] | None = None, **parameters: float) -> Fields:
    corridor = Line.through([(-20, 0), (20, 0)])
    known = {name: Expression(text) for name, text in (rules or {}).items()}
    return Fields(known, parameters, 0, SIZE, grid_axes(SIZE, 0.2), [], [corridor], {})


def relief(layers: Mapping[str, Any], known: Fields | None = None) -> Array:
    read = TypeAdapter(dict[str, Relief]).validate_python(layers)
    return shape(known or fields(), read, np.zeros(X.shape), "relief")


def test_erosion_is_that_of_the_relief_before_it_with_rules_for_its_numbers() -> None:
    streams = {"strength": "0.01 * (x > 0)", "repose_deg": "steep", "creep": 0.01, "steps": 5}
    found = relief({"plane": "0.5 * y + 0.1 * sin(x)", "streams": {"erode": streams}}, fields(steep=50.0))
    plane = 0.5 * Y + 0.1 * np.sin(X)
    expected = eroded(plane, 0.2, strength=np.where(X > 0, 0.01, 0.0), creep=0.01, repose_deg=50.0, steps=5).heights
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert np.abs(found - plane)[X > 1].max() > 3 * np.abs(found - plane)[X < -1].max()


def test_what_is_too_steep_collapses() -> None:
    tower = "3 * (max(abs(x), abs(y)) < 0.9)"
    found = relief({"tower": tower, "fallen": {"collapse": {"repose_deg": 35, "steps": 300}}})
    before = np.where(np.maximum(np.abs(X), np.abs(Y)) < 0.9, 3.0, 0.0)
    np.testing.assert_allclose(found, collapsed(before, 0.2, repose_deg=35, steps=300), atol=1e-9)
    assert found.sum() == pytest.approx(before.sum())
    assert np.abs(np.diff(found, axis=0)).max() / 0.2 < 1.03 * np.tan(np.radians(35))


def test_slopes_are_limited_about_the_corridor_only() -> None:
    layers = {"flank": "0.6 * y", "track": {"limit_slope": {"within": "gentle", "beyond": 45, "near": 1, "far": 3}}}
    slope = np.degrees(np.arctan(np.gradient(relief(layers, fields(gentle=10.0)), 0.2, axis=1)))
    assert slope.min() > -1e-6  # it rises as it did
    assert slope[np.abs(Y) < 0.9].max() < 10.5
    assert slope[np.abs(Y) > 3.2].min() > 30.0


def test_a_profile_has_its_slopes_and_goes_on_beyond_its_ends() -> None:
    slopes = {"of": "y", "slopes_deg": [[-2, 0], [1, 0], [1.5, 20], [4, 20]]}
    found = relief({"before": "0.1 * x", "flank": {"profile": slopes}}) - 0.1 * X
    np.testing.assert_allclose(found[np.abs(Y) < 0.05], 0.0, atol=1e-9)
    np.testing.assert_allclose(found[Y < 1], 0.0, atol=1e-9)
    rising = np.diff(found, axis=1) / 0.2
    np.testing.assert_allclose(rising[:, Y[0, :-1] > 1.5], np.tan(np.radians(20)), atol=1e-9)


def test_a_world_begins_with_the_grid_about_it_and_the_land_goes_on() -> None:
    grids = {
        "region": Surroundings.model_validate({"margin": 400, "spacing": 10, "relief": {"tilt": "0.2 * y"}}),
        "near": Surroundings.model_validate({"margin": 40, "spacing": 1, "relief": {"bank": "2 + 0 * height"}}),
    }
    known = fields()
    land = shape_surroundings(known, grids)
    assert land is not None
    np.testing.assert_allclose(land(X, Y), 0.2 * Y + 2, atol=1e-6)
    away = np.array([0.0, FADES[0] * 40 - 0.1, FADES[1] * 40 + 0.1, 300.0, 900.0])
    heights = land(np.zeros(5), away + SIZE[1] / 2)
    np.testing.assert_allclose(heights, 0.2 * np.minimum(away + 5, 405) + [2, 2, 0, 0, 0], atol=1e-6)
    between = land(np.linspace(10, 50, 400), np.zeros(400))
    assert (np.diff(between) <= 1e-9).all()


def test_the_land_above_drains_through_the_world() -> None:
    """On an inclined plane a node's drained area is the strip above it, up to the upper edge of the grid about it."""
    strip = Surroundings.model_validate({"margin": 30, "spacing": 1, "relief": {"tilt": "0.3 * y"}})
    known = fields()
    known.land = shape_surroundings(known, {"flank": strip})
    known.height = 0.3 * Y
    at = np.array([[0.0, -4.0], [3.0, 0.0], [-7.0, 4.0]])
    np.testing.assert_allclose(known.at(Expression("drained"), at), 35 - at[:, 1], rtol=0.04)
    alone = fields()
    alone.height = 0.3 * Y
    inside = alone.at(Expression("drained"), np.array([[0.0, -4.0], [0.0, 2.0]]))
    np.testing.assert_allclose(inside, 0.2 * (5 - np.array([-4.0, 2.0])), rtol=0.06)


def test_uphill_looks_up_the_slope() -> None:
    """What lies 2 m above is seen below it, whatever the slope's direction."""
    for dx, dy in ((0.0, 1.0), (1.0, 0.0), (0.6, -0.8)):
        known = fields({"above": "uphill(x, 2) - x + 10 * (uphill(y, 2) - y)"})
        known.height = 0.4 * (dx * X + dy * Y)
        found = known.at(Expression("above"), np.array([[0.0, 0.0], [3.0, 1.0]]))
        np.testing.assert_allclose(found, 2 * dx + 20 * dy, atol=1e-3)
