# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wires follow the closed-form catenary and end at the insulators; poles are in a row."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from test_layered import environment

from fieldtruth.core.classes import Label
from fieldtruth.world.build import build_world
from fieldtruth.world.environments.layered.config import model_of
from fieldtruth.world.furniture import make_furniture
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.placement import CrowdedWorldError
from fieldtruth.world.power_lines import (
    BUNDLE_RADIUS,
    CHORD_ERROR,
    CONDUCTOR_RADIUS,
    Catenary,
    hang,
    make_cable,
    wire_points,
)

pytestmark = pytest.mark.usefixtures("untextured")

F8 = NDArray[np.float64]

LEVEL = ((0.0, 0.0, 9.0), (46.0, 0.0, 9.0))
RISING = ((3.0, -2.0, 8.6), (33.0, 38.0, 12.1))
STEEP = ((0.0, 0.0, 0.0), (6.0, -8.0, 9.0))
ENDS = {"level": LEVEL, "rising": RISING, "steep": STEEP}


TEXT = """
description: "a plain with a power line"
parameters: {line_y: 17}
ground: {meadow: 1}
groups:
  grass: {form: tuft, name: "{species}_{k}", species: {meadow: [0.2, 0.3]}, detail: 0.3}
objects:
  wires: {type: power_line, y: line_y, sag: 0.02}
plants:
  grass: {group: grass, kind: high_grass, per_m2: 0.5, where: wires < 2}
beyond: {hills: 0, land: 0.02 * x}
litter_amount: 0
"""


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


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
def test_power_line_across_a_world(seed: int, tmp_path: Path) -> None:
    with environment(tmp_path / "plain.yaml", TEXT) as name:
        assert "wires" not in model_of(name).model_fields
        world = build_world(name, seed, {"grid": 0.5})
    poles = [i for i in world.instances if i.kind == "power_pole"]
    cables = [i for i in world.instances if i.kind == "cable"]
    assert (len(poles), len(cables)) == (2, 12)
    far = {s.name: s.world_from_object for s in world.swarms}
    assert {name: len(poses) for name, poses in far.items() if name != "grass"} == {
        "power_poles_beyond": 4,
        "cables_beyond": 8,
    }
    variant = int(poles[0].mesh[-1])
    held = np.concatenate([pole.world_from_object @ [*p, 1.0] for pole in poles for p in wire_points(variant)])
    held = held.reshape(-1, 4)[:, :3]
    ends = []
    for cable in cables:
        mesh, pose = world.meshes[cable.mesh], cable.world_from_object
        corners = mesh.vertices.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
        assert corners[:, 2].min() > 4.5
        order = np.argsort(mesh.vertices[:, 0])
        ends += [corners[order[:6]].mean(axis=0), corners[order[-6:]].mean(axis=0)]
    reached = np.linalg.norm(np.array(ends)[:, None] - held, axis=-1).min(axis=0)
    assert reached.max() < 0.02  # at each of the eight insulators wires end, two by two
    assert (np.linalg.norm(np.array(ends)[:, None] - held, axis=-1) < 0.02).sum() == 16
    beyond = far["power_poles_beyond"][:, :3, 3]
    assert beyond[:, 2] == pytest.approx(0.02 * beyond[:, 0], abs=0.4)  # on the land, which the plain's edge bends
    row = np.array(sorted([*(pole.world_from_object[:2, 3].tolist() for pole in poles), *beyond[:, :2].tolist()]))
    apart = np.linalg.norm(np.diff(row, axis=0), axis=1)
    assert np.abs(row[:, 1] - 17.0).max() < 5.0
    assert apart.min() > 40.0
    assert apart.max() < 52.0
    assert off_segments(row, far["grass"][:, :2, 3]).max() == pytest.approx(2.0, abs=0.1)


def off_segments(row: F8, xy: F8) -> F8:
    """Distance [m] of positions (n, 2) to the segments between corners (m, 2)."""
    a, along = row[:-1], np.diff(row, axis=0)
    share = np.einsum("nmi,mi->nm", xy[:, None] - a, along) / (along**2).sum(axis=1)
    foot = a + np.clip(share, 0.0, 1.0)[..., None] * along
    return np.asarray(np.linalg.norm(xy[:, None] - foot, axis=-1).min(axis=1))


def test_power_line_without_free_positions_is_an_error(tmp_path: Path) -> None:
    lines = [[[-49.0, y], [49.0, y]] for y in (14.0, 16.0, 18.0, 20.0)]
    with (
        environment(tmp_path / "full.yaml", TEXT + f"corridors: {lines}\n") as name,
        pytest.raises(CrowdedWorldError, match="no two free positions for poles 46 m apart near y = 17 m"),
    ):
        build_world(name, 0, {"grid": 0.5})


def test_poles_in_a_long_world_are_objects(tmp_path: Path) -> None:
    """Four of six are in it, with the five spans that touch it; those beyond are one swarm."""
    with environment(tmp_path / "long.yaml", TEXT) as name:
        world = build_world(name, 0, {"grid": 0.5, "size": [180, 40]})
    half = np.array(world.size) / 2
    poles = [each for each in world.instances if each.kind == "power_pole"]
    [outer] = [swarm.world_from_object[:, :2, 3] for swarm in world.swarms if swarm.name == "power_poles_beyond"]
    assert len(poles) + len(outer) == 6
    assert all((np.abs(each.world_from_object[:2, 3]) < half).all() for each in poles)
    assert (np.abs(outer) > half).any(axis=1).all()
    assert len(poles) == 4
    assert sum(each.kind == "cable" for each in world.instances) == 4 * 5
