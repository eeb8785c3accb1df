# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Forces of stems on a robot that pushes them over: the law of one, and of a bed, against answers in closed form."""

import dataclasses
import re
from typing import Any

import numpy as np
import pytest
from drive_worlds import make_experiment, make_robot, make_world
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from fieldtruth.core import transforms
from fieldtruth.core.errors import ConfigurationError, RouteError
from fieldtruth.drive.physics import Command
from fieldtruth.drive.plan import plan_route
from fieldtruth.drive.simulate import Drive, SimulatedRobot
from fieldtruth.drive.stems import PRESSING, StemContact, elastica
from fieldtruth.experiment.config import geodetic_route
from fieldtruth.experiment.files import validated
from fieldtruth.experiment.rig import Rig
from fieldtruth.kernels.stems import AHEAD, BROKEN, ENERGY, MOMENT, RESIDUAL
from fieldtruth.world.library import validated as validated_species
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Collider, Instance, Swarm, World, make_mesh
from fieldtruth.world.plants import BUSHES, grow_bush
from fieldtruth.world.plants.species import GRASSES, GrassSpecies, Stems
from fieldtruth.world.stems import yields_of

F8 = NDArray[np.float64]
BEGIN, BED = 0.9, 0.7
LOW = 0.13  # [m] of a Husky's underside above hard ground, to a few millimetres


def bed(
    monkeypatch: pytest.MonkeyPatch, per_m2: float, stems: Stems, begin: float = BEGIN, end: float = BEGIN + BED
) -> World:
    """A plain with a square grid of tufts, of one stem each, from one x [m] to another."""
    own = {**GRASSES, "reed": dataclasses.replace(GRASSES["reed"], stems=stems)}
    monkeypatch.setattr("fieldtruth.world.stems.GRASSES", own)
    side = per_m2**-0.5
    x, y = np.meshgrid(np.arange(begin, end, side), np.arange(-1.5, 1.5, side), indexing="ij")
    poses = np.tile(np.eye(4), (x.size, 1, 1))
    poses[:, 0, 3], poses[:, 1, 3] = x.ravel(), y.ravel()
    tuft = make_mesh("tuft", np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 2)), [], ())
    species: GrassSpecies = own["reed"]
    height = sum(species.height) / 2
    tuft = dataclasses.replace(tuft, species=("reed",), tufts=np.array([[0, 0, height, 0]], np.float32))
    swarm = Swarm(
        name="reeds", kind="high_grass", object_id=2, meshes=("tuft",), mesh=np.zeros(x.size, np.int32),
        world_from_object=poses, tint=np.ones((x.size, 3), np.float32),
    )  # fmt: skip
    return dataclasses.replace(make_world(), meshes={"tuft": tuft}, swarms=(swarm,))


def robot_in(world: World) -> SimulatedRobot:
    robot = make_robot(world)
    robot.stems = StemContact(world, Rig())
    robot.spawn(np.zeros(2), np.array([10.0, 0.0]))
    return robot


SOFT = Stems(number=1, rigidity=0.05, recovers=0.0)


def test_a_stem_is_first_a_cantilever_and_at_last_lies_flat() -> None:
    table, most = elastica()
    u = most / (len(table) - 1)
    assert table[1, AHEAD] == pytest.approx(3 * u, rel=1e-3)
    assert table[1, ENERGY] == pytest.approx(1.5 * u**2, rel=1e-3)
    assert table[1, MOMENT] == pytest.approx(3 * u, rel=1e-3)
    assert table[-1, AHEAD] == pytest.approx(0.0, abs=1e-6)
    assert table[-1, ENERGY] == pytest.approx(1.19814023473559**2 / 2, rel=1e-6)  # lemniscate: B(3/4, 1/2) / 2
    travel = np.linspace(0.0, most, len(table))
    assert np.trapezoid(table[:, AHEAD], travel) == pytest.approx(table[-1, ENERGY], rel=1e-4)  # work is energy
    assert pytest.approx(table[-1, ENERGY], rel=1e-5) == PRESSING


@pytest.mark.parametrize("row", [40, 200, 450])
def test_the_shape_of_a_stem_solves_the_equation_of_the_rod(row: int) -> None:
    """Integrated from the foot: curvature is the moment of the load about each point; it is 0 at the edge."""
    table, most = elastica()
    travel, (ahead, up, length, moment, _) = row * most / (len(table) - 1), table[row]

    def slope(_: float, state: F8) -> Any:
        x, z, tilt = state
        return [np.sin(tilt), np.cos(tilt), ahead * (1.0 - z) + up * (travel - x)]

    end = solve_ivp(slope, (0.0, length), [0.0, 0.0, 0.0], rtol=1e-9, atol=1e-9).y[:, -1]
    assert end[:2] == pytest.approx([travel, 1.0], abs=1e-3)
    assert np.tan(end[2]) == pytest.approx(up / ahead, rel=5e-3)  # the load is at right angles to the stem
    assert moment == pytest.approx(ahead + up * travel, rel=1e-3)


def crossing(world: World, speed: float = 1.0, metres: float = 2.2) -> SimulatedRobot:
    robot = robot_in(world)
    robot.advance(Command(speed, 0.0), round(metres / speed * 1000))
    return robot


@pytest.mark.parametrize("per_m2", [40.0, 120.0])
def test_a_bed_takes_the_energy_of_its_stems(monkeypatch: pytest.MonkeyPatch, per_m2: float) -> None:
    """The mean force is n w 0.718 E I / h: twice the density, twice the force, and no stem is lost or counted twice."""
    world = bed(monkeypatch, per_m2, SOFT)
    robot = crossing(world)
    assert robot.stems is not None
    aside = np.abs(world.swarms[0].world_from_object[:, 1, 3])
    count = int((aside < Rig().robot.outline[1] / 2).sum())
    assert int((robot.stems.pressed > 0).sum()) == pytest.approx(count, abs=2)
    assert robot.stems.work == pytest.approx(count * PRESSING * SOFT.rigidity / LOW, rel=0.05)


def test_motors_pay_what_the_stems_take(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work of the motors is that of the same drive without plants, what the stems took, and what slips."""
    world = bed(monkeypatch, 100.0, SOFT)
    balances = []
    for given in (world, dataclasses.replace(world, swarms=())):
        robot, work = robot_in(given), 0.0
        data, rolls = robot.surroundings.data, Rig().wheels.radius
        for _ in range(2200):
            robot.advance(Command(1.0, 0.0), 1)
            torque = data.actuator_force
            work += float(torque @ data.qvel[6:]) / 1000
        assert robot.stems is not None
        balances.append((work, robot.stems.work, rolls * robot.wheel_angles.mean() - data.qpos[0]))
    (motor, stems, slid), (alone, none, slid_alone) = balances
    assert none == 0.0
    slip = stems / BED * (slid - slid_alone)  # the mean force on the tread times what it slid
    assert stems > 10.0
    assert motor - alone == pytest.approx(stems + slip, rel=0.03)


def test_a_stem_resists_either_way_and_not_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    stems = dataclasses.replace(SOFT, recovers=0.4, seconds=0.5)
    robot = crossing(bed(monkeypatch, 60.0, stems))
    assert robot.stems is not None
    first = robot.stems.work
    robot.advance(Command(-1.0, 0.0), 3200)
    back = robot.stems.work - first
    assert robot.pose[0][0] < 0.2  # backwards over the bed
    assert 0.2 * first < back < 0.4 * first  # some seconds later: 40 % at most


def test_a_robot_that_settles_among_stems_begins_without_their_work(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = robot_in(bed(monkeypatch, 100.0, SOFT, begin=-0.5, end=0.5))
    assert robot.stems is not None
    assert np.isfinite(robot.stems.pressed).any()
    assert robot.stems.work == 0.0


def test_beyond_the_worlds_edge_no_stem_acts(monkeypatch: pytest.MonkeyPatch) -> None:
    """On any side, wherever the table of squares would be read."""
    robot = robot_in(bed(monkeypatch, 100.0, SOFT))
    assert robot.stems is not None
    data = robot.surroundings.data
    for x, y in ((0.0, 1e4), (0.0, -1e4), (1e4, 0.0), (-1e4, 0.0), (1e4, 1e4)):
        data.qpos[:2], data.qfrc_applied[:6] = (x, y), 1.0
        robot.stems(data, 1.0, 0.001)
        assert not data.qfrc_applied[:6].any()


def test_only_living_bushes_with_one_cylinder_yield() -> None:
    mesh = grow_bush(BUSHES["heather"], name="heather", height=0.45, rng=np.random.default_rng(0), detail=0.1)
    box = Collider(shape="box", size=(0.1, 0.1, 0.1))
    assert yields_of(mesh) == "flexible"
    assert yields_of(dataclasses.replace(mesh, colliders=(*mesh.colliders, box))) == "solid"
    assert yields_of(dataclasses.replace(mesh, colliders=(box,))) == "solid"
    assert yields_of(dataclasses.replace(mesh, materials=("bark_dead", *mesh.materials[1:]))) == "solid"


def test_stems_break_or_stop_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    moment = 0.25 * SOFT.rigidity / LOW
    robot = crossing(bed(monkeypatch, 60.0, dataclasses.replace(SOFT, breaks=moment)))
    assert robot.stems is not None
    count = int((robot.stems.pressed == BROKEN).sum())
    assert count > 20
    # Up to the kink a cantilever, of which the energy is M^2 h / 6 E I; then a hinge, until the stem lies.
    bent, angle = moment**2 * LOW / (6 * SOFT.rigidity), np.arctan(elastica()[1]) - np.arctan(0.25 / 3)
    assert robot.stems.work == pytest.approx(count * (bent + RESIDUAL * moment * angle), rel=0.06)
    robot = crossing(bed(monkeypatch, 60.0, dataclasses.replace(SOFT, rigidity=3.0)), speed=0.3)
    assert robot.pose[0][0] < BEGIN - 0.3
    assert robot.stems is not None
    assert not (robot.stems.pressed > 0).any()


def test_steps_do_not_depend_on_how_a_drive_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    world = bed(monkeypatch, 60.0, SOFT)
    whole = crossing(world, metres=1.2)
    robot = robot_in(world)
    robot.head_for(Command(1.0, 0.0))
    robot.drive(700)
    saved = robot.save()
    robot.drive(500)
    assert np.array_equal(np.concatenate(robot.pose), np.concatenate(whole.pose))
    assert robot.stems is not None
    assert whole.stems is not None
    work = robot.stems.work
    robot.restore(saved)
    assert robot.stems.work < 0.7 * work
    for _ in range(50):
        robot.drive(10)
    assert np.array_equal(np.concatenate(robot.pose), np.concatenate(whole.pose))
    assert robot.stems.work == whole.stems.work == work
    assert np.array_equal(robot.stems.pressed, whole.stems.pressed)


def test_plants_resist_only_where_the_experiment_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    world = bed(monkeypatch, 60.0, SOFT)
    for yielding in (False, True):
        experiment = make_experiment([(10.0, 0.0)], plants={"yielding": yielding})
        robot = Drive(world, experiment, geodetic_route(experiment.route)).robot
        assert (robot.stems is not None) == yielding


@pytest.mark.parametrize(("through", "fails"), [("grass", ""), ("none", "reeds")])
def test_a_route_leads_through_what_the_plan_says(monkeypatch: pytest.MonkeyPatch, through: str, fails: str) -> None:
    world = bed(monkeypatch, 4.0, SOFT)
    experiment = make_experiment([(6.0, 0.0)], plan={"through": through})
    if not fails:
        assert plan_route(world, experiment).waypoints
        return
    with pytest.raises(RouteError, match=fails):
        plan_route(world, experiment)


def test_flexible_bushes_open_and_push_back() -> None:
    """A bush of heather stops a robot, unless plants yield: then its twigs take energy, and a route leads through."""
    mesh = grow_bush(BUSHES["heather"], name="heather", height=0.45, rng=np.random.default_rng(0), detail=0.1)
    bush = Instance(
        name="heather",
        kind="bush",
        mesh="heather",
        object_id=2,
        world_from_object=transforms.pose((3.0, 0, 0), (0, 0, 0)),
    )
    world = dataclasses.replace(make_world(), meshes={"heather": mesh}, instances=(bush,))
    own = {name: MATERIALS[name] for name in mesh.materials}
    world = dataclasses.replace(world, materials={**world.materials, **own})
    plan: dict[str, Any] = {"plan": {"through": "flexible"}, "plants": {"yielding": True}}
    with pytest.raises(RouteError, match="heather"):
        plan_route(world, make_experiment([(6.0, 0.0)]))
    experiment = make_experiment([(6.0, 0.0)], control={"speed": 1.0}, seconds=4.5, **plan)
    drive = Drive(world, experiment, plan_route(world, experiment))
    drive.finish()
    stems = BUSHES["heather"].stems
    assert stems is not None
    assert drive.robot.pose[0][0] > 3.9
    assert drive.robot.stems is not None
    height = float(mesh.colliders[0].size[1])
    whole = stems.number * PRESSING * stems.rigidity * (height / 0.45) ** 2 / LOW
    assert 0.8 * whole < drive.robot.stems.work < 1.02 * whole  # on its stems the robot rides higher


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"plan": {"through": "trees"}}, "plan.through must be none, grass or flexible, got 'trees'"),
        ({"plan": {"through": "flexible"}}, "plan.through flexible needs plants: {yielding: true}"),
        ({"plants": {"stiff": True}}, "unknown key 'plants.stiff'"),
        ({"plants": {"yielding": True}, "route": None, "frames": {"count": 2}}, "plants.yielding true excludes frames"),
    ],
)
def test_what_is_not_allowed_is_one_line(changes: dict[str, Any], text: str) -> None:
    values = make_experiment([(6.0, 0.0)]).model_dump(exclude_unset=True) | changes
    with pytest.raises(ConfigurationError, match=re.escape(text)):
        validated(values, "")


@pytest.mark.parametrize(
    ("stems", "text"),
    [
        ({"number": 0, "rigidity": 1.0}, "stems.number must be greater than or equal to 1, got 0"),
        ({"number": 5, "rigidity": -1.0}, "stems.rigidity must be greater than 0, got -1.0"),
        ({"number": 5, "rigidity": 1.0, "recovers": 2.0}, "stems.recovers must be less than or equal to 1"),
    ],
)
def test_stems_that_cannot_be_are_one_line(stems: dict[str, Any], text: str) -> None:
    reed = {**dataclasses.asdict(GRASSES["reed"]), "stems": stems}
    with pytest.raises(ConfigurationError, match=re.escape(text)):
        validated_species(GrassSpecies, reed, "reed.yaml")


def test_an_unknown_stiffness_is_one_line() -> None:
    reed = {**dataclasses.asdict(GRASSES["reed"]), "yields": "soft"}
    with pytest.raises(ConfigurationError, match="yields must be 'solid', 'flexible' or 'passable', got 'soft'"):
        validated_species(GrassSpecies, reed, "reed.yaml")
