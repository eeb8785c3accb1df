# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Plants that a robot presses, against the angles of straight stems over an edge, and against the box of its hull."""

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import make_world

from fieldtruth.core import transforms
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.leaning import LEAN_KNOT_NS, Leaning, bunches_of, plants_of
from fieldtruth.sense.moving import KNOT_NS, KnotPoses
from fieldtruth.sense.pressed import FLAT, PressedPlants
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Mesh, Swarm, World, make_mesh
from fieldtruth.world.plants import GRASSES, grow_clump

F8 = NDArray[np.float64]
LENGTH, WIDTH, HEIGHT = Rig().robot.outline
LOW = Rig().robot.ground_clearance
SPEED = 0.3
WAY = [np.array([[-5.0, 0.0], [5.0, 0.0]])]


def meadow(mesh: Mesh, feet: F8) -> World:
    poses = np.tile(np.eye(4), (len(feet), 1, 1))
    poses[:, :2, 3] = feet
    swarm = Swarm(
        name="grass", kind="high_grass", object_id=2, meshes=(mesh.name,), mesh=np.zeros(len(feet), np.int32),
        world_from_object=poses, tint=np.ones((len(feet), 3), np.float32),
    )  # fmt: skip
    world = make_world([])
    own = {name: MATERIALS[name] for name in mesh.materials}
    return dataclasses.replace(world, meshes={mesh.name: mesh}, swarms=(swarm,), materials={**world.materials, **own})


def stem(height: float) -> Mesh:
    """A straight stem of reed, half a millimetre wide."""
    vertices = [(0, -2e-4, -0.05), (0, 2e-4, -0.05), (0, 2e-4, height), (0, -2e-4, height)]
    mesh = make_mesh(
        "stem", vertices, np.tile([1.0, 0, 0], (4, 1)), np.zeros((4, 2)), [[0, 1, 2], [0, 2, 3]], ["blade_reed"],
        footprint=0.1, species=("reed",),
    )  # fmt: skip
    return dataclasses.replace(mesh, tufts=np.array([[0, 0, height, 0]], np.float32))


def driven(x: F8, *, turned: bool = False) -> KnotPoses:
    """Poses of a robot that is at x [m] at the knots of bodies, on flat ground."""
    poses = KnotPoses()
    poses.add(np.array([transforms.pose((each, 0.0, LOW), (0.0, 0.0, 180.0 * turned)) for each in x]))
    return poses


def there(seconds: float, speed: float = SPEED, start: float = -1.5) -> F8:
    return start + speed * np.arange(0, seconds + 1e-9, KNOT_NS / 1e9)


def pressed(world: World, poses: KnotPoses) -> tuple[PressedPlants, Leaning]:
    plants = plants_of(world)
    cause = PressedPlants(world, plants, {"": (Rig(), poses)}, WAY)
    return cause, Leaning(plants, [cause])


def knots(count: int) -> NDArray[np.int64]:
    return np.arange(count, dtype=np.int64) * LEAN_KNOT_NS


def test_a_straight_stem_lies_over_the_lower_edge_of_the_front() -> None:
    cause, _ = pressed(meadow(stem(1.2), np.zeros((1, 2))), driven(there(12.0)))
    leans = cause(np.array([0]), knots(110))[:, 0]
    assert np.abs(leans[:, 0]).max() < 1e-12
    edge = -1.5 + LENGTH / 2 + SPEED * 0.1 * (np.arange(110) + 1)  # a knot ahead
    before, over = edge < -0.05, (edge > 0.1) & (edge < 0.9)
    assert (leans[before, 1] == 0.0).all()
    angle = np.minimum(np.minimum(np.arctan2(edge, LOW), np.arccos(LOW / 1.2)), FLAT)[over]
    around = np.minimum(np.arctan2(edge + 0.03, LOW - 0.01), FLAT)[over]  # margins of the hull
    assert leans[over, 1] == pytest.approx(around, abs=0.12)
    assert (leans[over, 1] > angle - 0.04).all()


def test_a_pressed_stem_rises_in_its_own_time_and_not_wholly() -> None:
    cause, _ = pressed(meadow(stem(1.2), np.zeros((1, 2))), driven(there(12.0)))
    stems = GRASSES["reed"].stems
    assert stems is not None
    late = cause(np.array([0]), knots(1_500))[:, 0, 1]
    behind = int(np.flatnonzero(late < np.roll(late, 1))[1])
    lean = late[behind - 1]
    assert 1.4 < lean <= FLAT
    seconds = 0.1 * (np.arange(behind, 1_500) - behind + 1)
    expected = lean * (1 - stems.recovers * (1 - np.exp(-seconds / stems.seconds)))
    assert late[behind:] == pytest.approx(expected, rel=1e-9)
    assert late[-1] == pytest.approx((1 - stems.recovers) * lean, rel=0.01)


def reeds() -> World:
    rng = np.random.default_rng(3)
    clump = grow_clump({GRASSES["reed"]: 1.0}, name="clump", radius=0.5, per_m2=13, rng=rng, detail=0.55)
    return meadow(clump, np.array([[-0.4, 0.1], [0.3, -0.3]]))


def in_hull(world: World, leaning: Leaning, rows: NDArray[np.intp], poses: KnotPoses, stamp_ns: int) -> int:
    """Points of triangles inside the box of the hull at a stamp, a knot of bodies."""
    matrices = leaning.at(rows, np.array([stamp_ns]))[0]
    base_from_world = np.linalg.inv(poses([stamp_ns])[0])
    found = 0
    for row, matrix in zip(rows.tolist(), matrices, strict=True):
        points = points_of(world.meshes[str(leaning.plants.mesh[row])], int(leaning.plants.bunch[row]))
        placed = points @ matrix[:, :3].T + matrix[:, 3]
        local = placed[placed[:, 2] > 0.0] @ base_from_world[:3, :3].T + base_from_world[:3, 3]
        inside = (np.abs(local[:, :2]) < (LENGTH / 2, WIDTH / 2)).all(axis=1)
        found += int((inside & (local[:, 2] > 0.0) & (local[:, 2] < HEIGHT - LOW)).sum())
    return found


SEEN: dict[tuple[int, int], F8] = {}


def points_of(mesh: Mesh, bunch: int) -> F8:
    """Some 20 points in each triangle of a bunch."""
    key = id(mesh), bunch
    if key not in SEEN:
        corners = mesh.vertices.astype(np.float64)[mesh.faces[bunches_of(mesh) == bunch]]
        shares = np.random.default_rng(0).dirichlet((1.0, 1.0, 1.0), 20)
        SEEN[key] = np.einsum("sc,fcj->fsj", shares, corners).reshape(-1, 3)
    return SEEN[key]


@pytest.mark.parametrize("speed", [pytest.param(0.3, marks=pytest.mark.slow), 1.0])
def test_no_plant_stands_in_the_hull_on_the_way_and_back(speed: float) -> None:
    world, seconds = reeds(), 3.0 / speed
    x = np.concatenate([there(seconds, speed), there(seconds, speed)[::-1][1:]])
    poses = driven(x)
    cause, leaning = pressed(world, poses)
    upright = Leaning(leaning.plants, [])
    stamps = (np.arange(20, len(x) - 30, 83) * KNOT_NS).tolist()
    standing = [in_hull(world, upright, cause.rows, poses, each) for each in stamps]
    assert max(standing) > 500
    assert max(in_hull(world, leaning, cause.rows, poses, each) for each in stamps) == 0


def test_a_wrong_sign_leaves_plants_in_the_hull() -> None:
    world, poses = reeds(), driven(there(12.0))
    cause, leaning = pressed(world, poses)

    class Wrong:
        rows = cause.rows

        def __call__(self, rows: NDArray[np.intp], knots_ns: NDArray[np.int64]) -> F8:
            return -cause(rows, knots_ns)

    wrong = Leaning(leaning.plants, [Wrong()])
    stamps = (np.arange(300, 900, 200) * KNOT_NS).tolist()
    assert max(in_hull(world, wrong, cause.rows, poses, each) for each in stamps) > 50


def test_leans_do_not_depend_on_when_they_are_asked_for() -> None:
    world, poses = reeds(), driven(there(4.0, 0.6))
    whole, _ = pressed(world, poses)
    step, _ = pressed(world, poses)
    rows = whole.rows
    at_once = whole(rows, knots(40))
    for k in (3, 20, 21, 39):
        step(rows, knots(40)[k : k + 1])
    step.restart()
    assert np.array_equal(step(rows[::2], knots(40)), at_once[:, ::2])
    assert np.abs(at_once).max() > 1.0


class Blown:
    """A wind of 0.3 rad towards -x, against the robot."""

    def __init__(self, count: int) -> None:
        self.rows = np.arange(count)

    def __call__(self, rows: NDArray[np.intp], knots_ns: NDArray[np.int64]) -> F8:
        return np.tile([0.0, -0.3], (len(knots_ns), len(rows), 1))


def test_wind_does_not_turn_what_a_hull_holds() -> None:
    """The wind is whole before the front and nothing at the lean FLAT, as below a wheel, in any order of causes."""
    world = meadow(stem(1.2), np.array([[0.0, Rig().wheels.half_track]]))
    cause, alone = pressed(world, driven(there(12.0)))
    rows, wind = np.array([0]), Blown(1)
    leans = alone.vectors(rows, knots(110))[:, 0]
    both = [Leaning(alone.plants, causes).vectors(rows, knots(110))[:, 0] for causes in ((wind, cause), (cause, wind))]
    assert np.array_equal(both[0], both[1])
    stands, flat = leans[:, 1] == 0.0, leans[:, 1] > FLAT - 1e-9
    assert stands.any()
    assert flat.any()
    assert both[0][stands, 1] == pytest.approx(-0.3)
    assert both[0][flat] == pytest.approx(leans[flat])
    upright, crushed = leans[:, 2] == 0.0, leans[:, 2] >= 1e-3
    assert crushed.any()
    assert both[0][crushed] == pytest.approx(leans[crushed])
    expected = leans[:, 1] - 0.3 * np.maximum(1.0 - leans[:, 1] / FLAT, 0.0)
    assert both[0][upright, 1] == pytest.approx(expected[upright])


def test_plants_far_from_the_way_stand() -> None:
    cause, _ = pressed(meadow(stem(1.2), np.array([[0.0, 0.0], [0.0, 4.0]])), driven(there(1.0)))
    assert cause.rows.tolist() == [0]
