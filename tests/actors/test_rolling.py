# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wheels that roll, vehicles that lie on the ground, cyclists who lean, and multirotors that tilt: closed forms."""

import math

import numpy as np
import pytest
from walks import F8, Walk, flat, placements, slope, walk

from fieldtruth.actors import cyclist, multirotor
from fieldtruth.actors.figure import STEP
from fieldtruth.actors.person import FOREARM

SIDES = ("front_left", "front_right", "rear_left", "rear_right")


def paths(done: Walk, part: int) -> float:
    """Length [m] of the way of a part's origin, over the ground."""
    return float(np.linalg.norm(np.diff(done.parts[:, part, :2, 3], axis=0), axis=1).sum())


@pytest.mark.parametrize("kind", ["car", "tractor", "robot"])
@pytest.mark.parametrize("turn", [0.0, 0.25, -0.25])
def test_wheels_turn_by_their_way(kind: str, turn: float) -> None:
    done = walk(kind, placements(lambda t: 1.5, lambda t: turn, seconds=6))
    for k, side in enumerate(SIDES):
        radius = done.parts[0, 1 + k, 2, 3]
        rolled = np.ptp(done.column(f"{side}_wheel")) * radius
        assert rolled == pytest.approx(paths(done, 1 + k), rel=2e-3)
        assert done.column(f"{side}_wheel")[-1] > 0
    if turn:
        outer, inner = ("right", "left") if turn > 0 else ("left", "right")
        assert np.ptp(done.column(f"rear_{outer}_wheel")) > 1.02 * np.ptp(done.column(f"rear_{inner}_wheel"))


@pytest.mark.parametrize("kind", ["car", "tractor"])
def test_a_vehicle_that_steers_does_not_slide(kind: str) -> None:
    """Wheels move along their own planes: those of the rear axle, and those in front by their steering."""
    done = walk(kind, placements(lambda t: 2.0, lambda t: 0.3, seconds=6))
    for k in range(4):
        pose = done.parts[:, 1 + k]
        moved = np.diff(pose[:, :3, 3], axis=0)
        axle = (pose[1:, :3, 1] + pose[:-1, :3, 1]) / 2
        across = np.abs(np.einsum("ij,ij->i", moved, axle))[100:]
        assert across.max() < 2e-3 * np.linalg.norm(moved, axis=1).max()
    assert done.column("front_left_steer")[-1] > done.column("front_right_steer")[-1] > 0.1


@pytest.mark.parametrize("kind", ["car", "tractor", "robot", "cyclist"])
def test_vehicles_lie_on_a_slope(kind: str) -> None:
    done = walk(kind, placements(lambda t: 1.0, seconds=1), slope)
    root = done.roots[-1]
    ahead, left = root[:3, 0], root[:3, 1]
    assert ahead[2] / math.hypot(*ahead[:2]) == pytest.approx(0.2, abs=1e-3)
    if kind != "cyclist":
        assert left[2] / math.hypot(*left[:2]) == pytest.approx(0.1, abs=5e-3)
    assert root[2, 3] == pytest.approx(slope(*root[:2, 3]), abs=1e-3)


def test_a_vehicle_stands_still_when_its_placement_does() -> None:
    done = walk("car", placements(lambda t: 0.0, seconds=0.5))
    assert np.ptp(done.angles, axis=0) == pytest.approx(0.0)
    assert np.ptp(done.roots, axis=0) == pytest.approx(0.0)


def circle(speed: float, turn: float, kind: str) -> Walk:
    return walk(kind, placements(lambda t: speed, lambda t: turn, seconds=6, height=8.0))


def test_a_cyclist_leans_into_the_curve_and_holds_on() -> None:
    done = circle(4.0, 0.6, "cyclist")
    lean = math.asin(done.roots[-1, 2, 1])
    assert lean == pytest.approx(-math.atan(4.0 * 0.6 / 9.81), abs=0.01)  # its left side is lower
    assert math.asin(circle(4.0, -0.6, "cyclist").roots[-1, 2, 1]) == pytest.approx(-lean, abs=1e-6)
    stature = done.figure.scale
    reach = -(FOREARM + 0.045) * stature
    for hand, y in ((11, 1), (13, -1)):
        grip = done.points(1, (0.02, 0.26 * y, 0.25))
        assert np.linalg.norm(done.points(hand, (0, 0, reach)) - grip, axis=1).max() < 0.001
    for toes, pedal in ((17, 5), (21, 6)):
        apart = done.points(toes, (0, 0, 0)) - done.points(pedal, (0, 0, 0))
        assert np.linalg.norm(apart, axis=1).max() < 0.03
    rear = done.column("rear_wheel")
    assert np.ptp(rear) * cyclist.RADIUS == pytest.approx(paths(done, 3), rel=0.03)  # its hub leans inwards
    assert np.ptp(done.column("cranks")) == pytest.approx(np.ptp(rear) / 2.2, rel=1e-6)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_cyclist_who_stands_has_a_foot_on_the_ground(seed: int) -> None:
    """The ball of the left foot, beside the wheels, where it stays; before and after, it is on its pedal."""
    way = placements(lambda t: 3.0 * min(max(abs(2.5 - t) - 1.5, 0.0), 1.0), seconds=5)
    done = walk("cyclist", way, slope, seed)
    ball, pedal = done.points(17, (0, 0, 0)), done.points(5, (0, 0, 0))
    stands = slice(300, 350)
    ground = np.array([slope(x, y) for x, y in ball[stands, :2]])
    assert ball[stands, 2] == pytest.approx(ground, abs=0.01)
    assert np.ptp(ball[stands], axis=0).max() < 0.01
    aside = ball[stands, :2] - done.roots[stands, :2, 3]
    assert aside[:, 1] == pytest.approx(0.36, abs=0.03)  # to the left, as it goes along x
    assert np.linalg.norm((ball - pedal)[:90], axis=1).max() < 0.03
    assert np.linalg.norm((ball - pedal)[-60:], axis=1).max() < 0.03
    assert np.linalg.norm(done.points(21, (0, 0, 0)) - done.points(6, (0, 0, 0)), axis=1).max() < 0.03
    assert np.linalg.norm(np.diff(ball, axis=0), axis=1).max() < 0.06  # it does not leap


def test_wheels_of_a_cyclist_turn_by_their_way_and_stay_in_the_fork() -> None:
    done = walk("cyclist", placements(lambda t: 4.0, seconds=3))
    for part, name in ((2, "front_wheel"), (3, "rear_wheel")):
        assert np.ptp(done.column(name)) * cyclist.RADIUS == pytest.approx(paths(done, part), rel=1e-6)
        assert done.parts[:, part, 2, 3] == pytest.approx(cyclist.RADIUS, abs=1e-6)
    assert done.column("fork_steer") == pytest.approx(0.0)


def tilt(root: F8) -> tuple[float, F8]:
    """Angle [rad] of the thrust from upright, and its direction over the ground."""
    up = root[:3, 2]
    return math.acos(up[2]), up[:2] / max(math.hypot(*up[:2]), 1e-12)


def test_a_multirotor_tilts_by_its_acceleration_and_drag() -> None:
    speed, turn = 3.0, 0.8
    done = circle(speed, turn, "multirotor")
    inwards, forwards = speed * turn, multirotor.DRAG * speed
    angle, direction = tilt(done.roots[-1])
    assert angle == pytest.approx(math.atan(math.hypot(inwards, forwards) / 9.81), abs=0.01)
    heading = turn * (len(done.roots) - 1) * STEP
    ahead = np.array([math.cos(heading), math.sin(heading)])
    left = np.array([-ahead[1], ahead[0]])
    expected = (inwards * left + forwards * ahead) / math.hypot(inwards, forwards)
    assert direction == pytest.approx(expected, abs=0.15)
    assert done.roots[:, 2, 3] == pytest.approx(8.0)
    nose = done.roots[-1, :2, 0]
    assert nose / np.linalg.norm(nose) == pytest.approx(ahead, abs=0.03)


def test_a_multirotor_that_hovers_is_level_and_its_rotors_turn() -> None:
    done = walk("multirotor", placements(lambda t: 0.0, seconds=1, height=5.0))
    assert tilt(done.roots[-1])[0] < 1e-7
    rates = np.diff(done.angles, axis=0)[-1] / STEP / math.tau
    assert np.abs(rates) == pytest.approx(multirotor.SPIN, rel=0.03)
    assert np.sign(rates).tolist() == [1, -1, 1, -1]


def test_a_multirotor_flies_over_the_ground_below_it() -> None:
    done = walk("multirotor", placements(lambda t: 4.0, seconds=2, height=6.0), slope)
    assert done.roots[:, 2, 3] == pytest.approx([slope(*p) + 6.0 for p in done.roots[:, :2, 3]])
    assert flat(0, 0) == 0.0


@pytest.mark.parametrize("kind", ["car", "tractor", "cyclist"])
def test_a_vehicle_that_backs_keeps_its_heading(kind: str) -> None:
    """After a curve it is not along its placement; backwards, an axle that is drawn would turn it around."""
    way = placements(lambda t: 2.0 if t < 3 else -0.6, lambda t: 0.3 if t < 3 else 0.1, seconds=9)
    done = walk(kind, way)
    yaw = np.unwrap(np.arctan2(done.roots[:, 1, 0], done.roots[:, 0, 0]))
    lag = np.array([each.heading for each in way]) - yaw
    assert 0.02 < abs(lag[300]) < 0.4
    assert np.abs(lag[300:] - lag[300]).max() < 0.02
