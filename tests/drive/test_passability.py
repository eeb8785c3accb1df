# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Force that presses down an object, and its passability, against answers by hand and the forces of the physics."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from drive_worlds import make_world
from numpy.typing import NDArray

from fieldtruth.core.classes import Label
from fieldtruth.drive.passability import GRIP, Passability, forces_of_copies, forces_on, passability_of, pressing_work
from fieldtruth.drive.stems import PRESSING, elastica
from fieldtruth.experiment.robot_config import GRAVITY, RobotConfig
from fieldtruth.kernels.stems import RESIDUAL, push_stem
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Collider, Instance, Mesh, Swarm, make_mesh
from fieldtruth.world.plants.species import GRASSES, Stems
from fieldtruth.world.stems import SAPLING, bends, yields_of

ROBOT = RobotConfig()
LOW, WIDTH = ROBOT.ground_clearance, ROBOT.outline[1]
FLAT = elastica()[1]
TALL = 2.0  # [m]


def stem(height: float, rigidity: float = 0.2, breaks: float = np.inf) -> NDArray[Any]:
    return np.array([0.0, 0.0, 0.0, 1.0, rigidity, breaks, height, 0.5, 20.0])


def tuft(patch: pytest.MonkeyPatch, stems: Stems, places: Any = ((0.0, 0.0),), radius: float = 1e-9) -> Mesh:
    """A clump of tufts of a species whose mean height is their own, so that strength is that of ``stems``."""
    species = dataclasses.replace(GRASSES["reed"], height=(TALL, TALL), radius=radius, stems=stems, yields="flexible")
    patch.setattr("fieldtruth.world.stems.GRASSES", {**GRASSES, "reed": species})
    mesh = make_mesh("tuft", np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 2)), [], ())
    rows = np.array([[x, y, TALL, 0] for x, y in places], np.float32)
    return dataclasses.replace(mesh, species=("reed",), tufts=rows)


def test_the_force_on_reeds_is_that_by_hand_and_doubles_with_their_number(monkeypatch: pytest.MonkeyPatch) -> None:
    found = [
        forces_on(tuft(monkeypatch, Stems(number=number, rigidity=0.2)), np.eye(4)[None], ROBOT)[0]
        for number in (6, 12)
    ]
    assert found[0] == pytest.approx(6 * 0.717769 * 0.2 / LOW / (1.669 * LOW), rel=1e-3)  # 30.5 N
    assert found[1] == pytest.approx(2 * found[0], rel=1e-6)


def test_a_wide_clump_takes_the_force_of_a_bed(monkeypatch: pytest.MonkeyPatch) -> None:
    side, radius = 0.1, 6.0
    x, y = (axis.ravel() for axis in np.meshgrid(*2 * (np.arange(-radius, radius + side / 2, side),)))
    inside = np.hypot(x, y) <= radius
    mesh = tuft(monkeypatch, Stems(number=1, rigidity=0.2), np.column_stack([x, y])[inside])
    bed = WIDTH / side**2 * PRESSING * 0.2 / LOW
    turned = np.array([np.eye(4), np.eye(4)])
    turned[1, :2, :2], turned[1, :2, 3] = [[0.6, -0.8], [0.8, 0.6]], (3.0, -20.0)
    assert forces_on(mesh, turned, ROBOT) == pytest.approx([bed, bed], rel=0.03)


@pytest.mark.parametrize("height", [0.12, 0.15, 0.2, 0.27, 2.0])
@pytest.mark.parametrize("breaks", [0.3, 1.0, np.inf])
def test_the_work_is_that_of_the_forces_of_the_physics(height: float, breaks: float) -> None:
    """Summed over the travel, from a stem that stands to one that lies or has slid off, with a kink on the way."""
    own, table, out = stem(height, breaks=breaks), elastica(), np.empty(2)
    step, work, share = 1e-5, 0.0, 1.0
    for k in range(int(2.5 * LOW / step)):
        found = push_stem(own, table[0], table[1], ((k + 0.5) * step, LOW), share, out)
        work += out[0] * step
        share = -1.0 if found == 3.0 else share
        if found == 2.0:
            break
    assert pressing_work(own, LOW) == pytest.approx(work, rel=2e-3, abs=1e-6)


def test_long_stems_take_the_energy_in_closed_form_and_short_ones_nothing() -> None:
    assert pressing_work(stem(TALL), LOW) == pytest.approx(PRESSING * 0.2 / LOW, rel=1e-5)
    assert pressing_work(stem(0.9 * LOW), LOW) == 0.0
    weak = pressing_work(stem(TALL, breaks=1e-9), LOW)
    assert weak == pytest.approx(RESIDUAL * 1e-9 * np.arctan(FLAT), rel=1e-2)


def test_passability_is_the_share_of_the_traction_that_is_left() -> None:
    most = GRIP * ROBOT.mass * GRAVITY  # 294 N
    assert passability_of(np.array([0.0, most / 4, most, 2 * most, np.inf]), ROBOT).tolist() == [1, 0.75, 0, 0, 0]


def thing(name: str, material: str, *, collides: bool, species: tuple[str, ...] = ()) -> Mesh:
    corners = [[0, 0, 0], [1, 0, 0], [0, 0, 1]]
    mesh = make_mesh(name, corners, np.zeros((3, 3)), np.zeros((3, 2)), [[0, 1, 2]], (material,))
    own = (Collider(shape="cylinder", size=(0.2, 1.0)),) if collides else ()
    return dataclasses.replace(mesh, colliders=own, species=species)


def test_each_copy_has_its_own_value_in_the_order_of_the_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    """Trunk, rock and person are solid; lawn, pebbles and what lies loose are free; two reeds differ by their size."""
    reed = tuft(monkeypatch, Stems(number=6, rigidity=0.2))
    lawn = dataclasses.replace(reed, name="lawn", tufts=np.array([[0, 0, 0.06, 0]], np.float32))
    trunk = thing("trunk", "bark_oak", collides=True, species=("oak",))
    rock, pebble = (thing(name, "rock_granite", collides=name == "rock") for name in ("rock", "pebble"))
    meshes = {each.name: each for each in (reed, lawn, trunk, rock, pebble)}
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[1, :3, :3] *= 2.0
    instances = tuple(
        Instance(name=f"{name}_{k}", kind=name, mesh=name, object_id=k, world_from_object=np.eye(4))
        for k, name in ((2, "rock"), (3, "trunk"))
    )
    swarm = Swarm(
        name="mixed", kind="high_grass", object_id=4, meshes=("tuft", "lawn", "pebble"),
        mesh=np.array([0, 0, 1, 2], np.int32), world_from_object=poses, tint=np.ones((4, 3), np.float32),
    )  # fmt: skip
    materials = {**MATERIALS, "rock_granite": dataclasses.replace(MATERIALS["bark_oak"], label=Label.ROCK)}
    world = dataclasses.replace(
        make_world(), meshes=meshes, instances=instances, swarms=(swarm,), materials=materials, backdrop=None
    )
    share, force = Passability(world, ROBOT, bodies=1).values.T
    one = forces_on(reed, np.eye(4)[None], ROBOT)[0]
    assert force == pytest.approx([0, 0, np.inf, np.inf, one, 4 * one, 0, 0, np.inf])  # rigidity: height squared
    assert share == pytest.approx([1, 1, 0, 0, *passability_of(np.array([one, 4 * one]), ROBOT), 1, 1, 0])
    assert not forces_of_copies(world, "litter", rock, poses, ROBOT).any()
    behind = Passability(dataclasses.replace(world, backdrop=trunk), ROBOT)
    number, label = np.array([2, 2, 1], np.uint32), np.array([Label.TREETOP, Label.GROUND, Label.TRAIL], np.uint8)
    assert behind.of(number, label).tolist() == [[0, np.inf], [1, 0], [1, 0]]


def test_stems_of_bushes_bend_as_the_species_says_and_branches_of_trees_by_thickness() -> None:
    thick = np.array([0.01, 0.03])
    for name, expected in (("grey_willow", [True, True]), ("hazel", [False, False]), ("oak", [True, False])):
        assert bends(thing(name, "bark_oak", collides=True, species=(name,)), thick).tolist() == expected


def test_a_tree_without_a_collider_bends_below_3_m_and_one_with_a_collider_is_solid() -> None:
    world = dataclasses.replace(make_world(), materials=dict(MATERIALS))
    for height, collides, expected in ((0.9, False, 0.0), (1.1, False, np.inf), (0.9, True, np.inf)):
        mesh = thing("tree", "bark_oak", collides=collides, species=("oak",))
        mesh = dataclasses.replace(mesh, vertices=(mesh.vertices * SAPLING * height).astype(np.float32))
        assert yields_of(mesh) == ("flexible" if expected == 0.0 else "solid")
        assert forces_of_copies(world, "sapling", mesh, np.eye(4)[None], ROBOT).tolist() == [expected]
        assert bends(mesh, np.array([0.01, 0.03])).tolist() == [True, expected == 0.0]
