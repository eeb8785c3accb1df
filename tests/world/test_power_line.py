# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wires follow the closed-form catenary and end at the insulators; poles are in a row."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from fieldtruth.core.classes import Label
from fieldtruth.world.environments.lake.build import string_line
from fieldtruth.world.environments.lake.config import Config
from fieldtruth.world.furniture import make_furniture
from fieldtruth.world.grids import Line
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Heightfield
from fieldtruth.world.placement import CrowdedWorldError, WorldBuilder
from fieldtruth.world.power_lines import (
    BUNDLE_RADIUS,
    CHORD_ERROR,
    CONDUCTOR_RADIUS,
    Catenary,
    hang,
    make_cable,
    wire_points,
)

F8 = NDArray[np.float64]

LEVEL = ((0.0, 0.0, 9.0), (46.0, 0.0, 9.0))
RISING = ((3.0, -2.0, 8.6), (33.0, 38.0, 12.1))
STEEP = ((0.0, 0.0, 0.0), (6.0, -8.0, 9.0))
CONFIG = Config(line_y=17.0, pole_distance=46.0, sag=0.02)
ENDS = {"level": LEVEL, "rising": RISING, "steep": STEEP}


def flat_builder(corridors: list[Line] | None = None, *, height: float = 0.0) -> WorldBuilder:
    flat = Heightfield(heights=np.full((101, 51), height, np.float32), spacing=1.0, x0=-50.0, y0=-25.0)
    return WorldBuilder(flat, (100.0, 50.0), (), corridors or [])


@pytest.mark.parametrize("name", ENDS)
@pytest.mark.parametrize("sag", [0.2, 0.9, 4.0])
def test_wire_passes_through_both_ends_with_its_sag(name: str, sag: float) -> None:
    start, end = (np.array(p) for p in ENDS[name])
    wire = hang(start, end, sag=sag)
    ends = wire.points([0.0, wire.span])
    assert ends == pytest.approx(np.stack([start, end]), abs=1e-9)
    middle = (start[2] + end[2]) / 2 - float(wire.height_at(wire.span / 2))
    assert middle == pytest.approx(sag, abs=1e-9)


@pytest.mark.parametrize("name", ENDS)
def test_curve_is_a_catenary(name: str) -> None:
    """A catenary is the curve whose a z'' is sqrt(1 + z'^2): the weight between two points follows the arc's length."""
    wire = hang(*ENDS[name], sag=0.8)
    x, h = np.linspace(1.0, wire.span - 1.0, 9), 1e-3
    low, here, high = (wire.height_at(x + k * h) for k in (-1, 0, 1))
    slope, bend = (high - low) / (2 * h), (high - 2 * here + low) / h**2
    assert wire.parameter * bend == pytest.approx(np.hypot(1.0, slope), rel=2e-4)


def test_known_catenary() -> None:
    """z = 20 cosh(x / 20) from -15 to 15: the sag is 20 (cosh 0.75 - 1), the length 40 sinh 0.75."""
    wire = hang((0, 0, 5), (30, 0, 5), sag=20 * (np.cosh(0.75) - 1))
    assert wire.parameter == pytest.approx(20.0, rel=1e-9)
    assert wire.lowest == pytest.approx(15.0, abs=1e-9)
    along = wire.points(np.linspace(0.0, 30.0, 20_001))
    length = np.linalg.norm(np.diff(along, axis=0), axis=1).sum()
    assert length == pytest.approx(40 * np.sinh(0.75), abs=1e-6)


def test_impossible_wires_are_errors() -> None:
    with pytest.raises(ValueError, match=r"sag must be above .* m, got -1"):
        hang(*LEVEL, sag=-1)
    with pytest.raises(ValueError, match="horizontal distance of the ends must be above 0 m, got 0"):
        hang((1, 1, 0), (1, 1, 5), sag=1)


def off_curve(wire: Catenary, points: F8) -> F8:
    """Distance [m] of world points (n, 3) to the curve, from its closed form sampled every millimetre."""
    ahead = (wire.end - wire.start)[:2] / wire.span
    along = (points[:, :2] - wire.start[:2]) @ ahead
    near = along[:, None] + np.linspace(-0.05, 0.05, 101)
    curve = wire.points(near.ravel()).reshape(*near.shape, 3)
    return np.asarray(np.linalg.norm(points[:, None] - curve, axis=-1).min(axis=1))


@pytest.mark.parametrize("name", ENDS)
@pytest.mark.parametrize("radius", [CONDUCTOR_RADIUS, BUNDLE_RADIUS])
def test_mesh_follows_the_catenary(name: str, radius: float) -> None:
    wire = hang(*ENDS[name], sag=0.8)
    mesh, pose = make_cable("cable", wire, radius=radius)
    corners = mesh.vertices.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
    inner = np.abs(mesh.vertices[:, 0]) < wire.span / 2 - 0.06
    assert off_curve(wire, corners[inner]) == pytest.approx(np.full(inner.sum(), radius), abs=1e-4)
    # Rings of five corners and the seam's copy come first, then the two ends' five.
    rings = corners[:-10].reshape(-1, 6, 3)[:, :5].mean(axis=1)
    assert 2 < len(rings) < 60
    assert off_curve(wire, rings).max() < 1e-4
    assert rings[[0, -1]] == pytest.approx(np.stack([wire.start, wire.end]), abs=1e-4)
    # Between two rings the tube's straight axis leaves the curve by no more than CHORD_ERROR.
    assert off_curve(wire, (rings[1:] + rings[:-1]) / 2).max() < 1.05 * CHORD_ERROR + 1e-4 < 0.01


def test_cables_have_class_cable_and_no_colliders() -> None:
    mesh, _ = make_cable("cable", hang(*LEVEL, sag=0.8))
    assert {MATERIALS[n].label for n in mesh.materials} == {Label.CABLE}
    assert mesh.colliders == ()
    assert 100 < len(mesh.faces) < 600


@pytest.mark.parametrize("variant", [0, 1])
def test_poles_have_class_post_and_reach_into_the_ground(variant: int) -> None:
    mesh = make_furniture(f"power_pole_{variant}")
    assert {MATERIALS[n].label for n in mesh.materials} == {Label.POST}
    assert 8.0 < mesh.vertices[:, 2].max() < 10.0
    assert mesh.vertices[:, 2].min() < -1.0
    assert 1.7 < np.ptp(mesh.vertices[:, 1]) < 2.2
    (collider,) = mesh.colliders
    low = mesh.vertices[mesh.vertices[:, 2] < 2.0]
    assert collider.shape == "cylinder"
    assert np.hypot(low[:, 0], low[:, 1]).max() < collider.size[0] + 0.03
    assert collider.position[2] <= mesh.vertices[:, 2].min()


@pytest.mark.parametrize("variant", [0, 1])
def test_wires_end_at_insulators(variant: int) -> None:
    """The axis of each wire ends on the pole's surface: within 3 cm of a vertex of its insulator."""
    mesh, held = make_furniture(f"power_pole_{variant}"), wire_points(variant)
    assert held.shape == (4, 3)
    nearest = np.linalg.norm(mesh.vertices[:, None] - held, axis=-1).min(axis=0)
    assert nearest.max() < 0.03
    assert np.ptp(held[:2, 1]) > 1.5


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_power_line_across_a_world(seed: int) -> None:
    land = flat_builder(height=1.5)
    line = string_line(land, CONFIG, lambda xy: np.full(len(xy), 1.5), np.random.default_rng(seed), far=2)
    poles = [i for i in land.instances if i.kind == "power_pole"]
    cables = [i for i in land.instances if i.kind == "cable"]
    assert (len(poles), len(cables)) == (2, 12)
    assert {s.name: len(s.mesh) for s, _ in line.beyond} == {"power_poles_beyond": 4, "cables_beyond": 8}
    variant = int(poles[0].mesh[-1])
    held = np.concatenate([pole.world_from_object @ [*p, 1.0] for pole in poles for p in wire_points(variant)])
    held = held.reshape(-1, 4)[:, :3]
    ends = []
    for cable in cables:
        mesh, pose = land.meshes[cable.mesh], cable.world_from_object
        corners = mesh.vertices.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
        assert corners[:, 2].min() - 1.5 > 4.5
        order = np.argsort(mesh.vertices[:, 0])
        ends += [corners[order[:6]].mean(axis=0), corners[order[-6:]].mean(axis=0)]
    reached = np.linalg.norm(np.array(ends)[:, None] - held, axis=-1).min(axis=0)
    assert reached.max() < 0.02  # at each of the eight insulators wires end, two by two
    assert (np.linalg.norm(np.array(ends)[:, None] - held, axis=-1) < 0.02).sum() == 16
    apart = [float(np.hypot(*(b - a))) for a, b in pairwise(line.poles)]
    assert min(apart) > 40.0
    assert max(apart) < 52.0
    assert line.distance(line.poles) == pytest.approx(np.zeros(6), abs=1e-9)


def test_power_line_without_free_positions_is_an_error() -> None:
    everywhere = [Line.through([(-49.0, y), (49.0, y)], smooth=False) for y in (14.0, 16.0, 18.0, 20.0)]
    with pytest.raises(CrowdedWorldError, match="no two free positions"):
        string_line(flat_builder(everywhere), CONFIG, lambda xy: np.zeros(len(xy)), np.random.default_rng(0), far=0)
