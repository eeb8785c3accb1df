# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Feet of people and animals: they stay where they carry, do not sink, and step as published."""

import math
import time
from collections.abc import Callable

import numpy as np
import pytest
from walks import STEP, Walk, depth, flat, placements, slope, walk

from fieldtruth.actors.animals import COW, DEER, DOG
from fieldtruth.actors.figure import Placement
from fieldtruth.actors.limbs import two_links
from fieldtruth.actors.person import ANKLE, HEEL, SHANK, THIGH

FOOT, TOES = (9, 13), (10, 14)
WAYS = {
    "slope": (placements(lambda t: 1.2, seconds=5), slope),
    "down": (placements(lambda t: 1.2, seconds=5), lambda x, y: -slope(x, y)),
    "curve": (placements(lambda t: 1.1, lambda t: 0.7, seconds=5), slope),
    "stop": (placements(lambda t: 1.4 * min(max(3.0 - t, 0.0), 1.0), seconds=5), flat),
    "go": (placements(lambda t: min(t, 3.0), seconds=5), flat),
    "turn": (placements(lambda t: 0.0, lambda t: 1.0 if 1 < t < 4 else 0.0, seconds=5), flat),
    "jog": (placements(lambda t: 2.8, lambda t: 0.3, seconds=4), flat),
}


def slip_of_person(done: Walk) -> float:
    """Greatest way [m] between two knots of the point of a foot that carries: the heel, or the ball."""
    stature, worst = done.figure.scale, 0.0
    for k in range(2):
        heel = done.points(FOOT[k], (HEEL * stature, 0, -ANKLE * stature))
        ball = done.points(TOES[k], (0, 0, 0))
        both = done.carries[1:, k] & done.carries[:-1, k]
        moved = [np.linalg.norm(np.diff(points, axis=0), axis=1)[both] for points in (heel, ball)]
        worst = max(worst, float(np.minimum(*moved).max()))
    return worst


@pytest.mark.parametrize("name", WAYS)
def test_feet_of_people_stay_where_they_carry(name: str) -> None:
    way, ground = WAYS[name]
    done = walk("person", way, ground)
    assert slip_of_person(done) < 0.001
    assert depth(done, (*FOOT, *TOES), ground) < 0.01
    assert done.carries.any(axis=0).all()
    wrong = done.angles.copy()
    wrong[:, [joint.name == "left_knee" for joint in done.figure.joints]] *= -1
    assert slip_of_person(done.with_angles(wrong)) > (0.01 if name != "turn" else 0.002)


def test_a_foot_that_carries_stays_for_its_whole_time_on_the_ground() -> None:
    """The ball of the foot, from the flat sole to the toes: also over many knots."""
    done = walk("person", *WAYS["curve"])
    ball = done.points(TOES[0], (0, 0, 0))
    begins = np.flatnonzero(np.diff(done.carries[:, 0].astype(int)) == 1)[:-1] + 1
    ends = [begin + int(np.argmin(done.carries[begin:, 0])) for begin in begins]
    assert len(begins) >= 3
    for begin, end in zip(begins, ends, strict=True):
        flat_on = begin + 20
        assert end - flat_on > 20
        assert np.linalg.norm(ball[flat_on:end] - ball[flat_on], axis=1).max() < 0.001


def test_legs_keep_their_lengths_and_reach_their_feet() -> None:
    done = walk("person", *WAYS["slope"])
    stature = done.figure.scale
    for hip, knee, ankle in ((7, 8, 9), (11, 12, 13)):
        places = done.parts[:, [hip, knee, ankle]][..., :3, 3]
        lengths = np.linalg.norm(np.diff(places, axis=1), axis=2)
        assert lengths == pytest.approx(np.tile([THIGH * stature, SHANK * stature], (len(lengths), 1)), abs=1e-9)


def landings(done: Walk, foot: int) -> int:
    return int((np.diff(done.carries[:, foot].astype(int)) == 1).sum())


def test_people_walk_at_the_published_cadence_and_run_with_a_flight() -> None:
    stroll = walk("person", placements(lambda t: 1.4, seconds=10))
    scale = math.sqrt(1.75 / stroll.figure.scale)
    assert sum(landings(stroll, k) for k in range(2)) / 10 == pytest.approx(1.9 * scale, rel=0.06)
    assert stroll.carries.any(axis=1).all()
    assert stroll.carries.mean() == pytest.approx(0.62, abs=0.03)
    run = walk("person", placements(lambda t: 3.2, seconds=5))
    assert run.carries.mean() == pytest.approx(0.39, abs=0.04)
    assert 0.1 < 1 - run.carries.any(axis=1).mean() < 0.4


@pytest.mark.parametrize(("rise", "speed"), [(0.0, 1.2), (0.0, 1.5), (0.06, 1.35), (-0.06, 1.35)])
def test_steps_are_as_long_over_their_rate_as_published_also_on_gentle_slopes(rise: float, speed: float) -> None:
    """The walk ratio is 0.6 to 0.65 cm min of people of 1.72 m; it grows with the stature, as the step rate falls."""
    ratios = []
    for seed in (2, 3):
        done = walk("person", placements(lambda t: speed, seconds=14), lambda x, y: rise * x, seed)
        lands = np.flatnonzero(np.diff(done.carries[200:].astype(int), axis=0).max(axis=1) == 1)
        per_minute = 60.0 * (len(lands) - 1) / (STEP * (lands[-1] - lands[0]))
        ratios.append(100.0 * 60.0 * speed / per_minute**2 * 1.72 / done.figure.scale)
    assert 0.59 < np.mean(ratios) < 0.66


def test_arms_swing_against_the_legs_and_knees_turn_to_the_back() -> None:
    done = walk("person", placements(lambda t: 1.4, seconds=4))
    later = slice(100, None)
    for arm, leg in (("left", "right"), ("right", "left")):
        shoulder, hip = done.column(f"{arm}_shoulder_y")[later], done.column(f"{leg}_hip_y")[later]
        assert np.corrcoef(shoulder, hip)[0, 1] > 0.8
        assert np.ptp(shoulder) > 0.3
        assert done.column(f"{arm}_knee").min() >= 0
        assert done.column(f"{arm}_elbow").max() <= 0


def test_a_person_who_stopped_stands_with_both_feet_below() -> None:
    done = walk("person", placements(lambda t: 1.4 if t < 2 else 0.0, seconds=5))
    assert done.carries[-100:].all()
    middle = done.parts[-1, FOOT, :2, 3].mean(axis=0)
    assert middle == pytest.approx(done.roots[-1, :2, 3], abs=0.06)
    assert np.abs(np.diff(done.angles[-100:], axis=0)).max() < 0.01
    assert np.abs(np.diff(done.angles[-100:], axis=0)).max() > 0  # but it breathes


def test_a_person_sits_on_a_bench_of_45_cm() -> None:
    way = [Placement(0, 0, 0, 0, 0, "sit")] * 50
    done = walk("person", way)
    assert done.parts[-1, 0, 2, 3] == pytest.approx(0.535, abs=0.01)
    assert done.column("left_knee")[-1] == pytest.approx(math.pi / 2, abs=0.4)
    assert depth(done, (*FOOT, *TOES), flat) < 0.001
    rises = walk("person", [*way, *[Placement(0, 0, 0, 0)] * 300])
    assert rises.parts[-1, 0, 2, 3] > 0.48 * rises.figure.scale
    assert slip_of_person(rises) < 0.001


@pytest.mark.parametrize("kind", ["person", "dog", "cow", "cyclist", "car", "robot", "multirotor"])
def test_leaps_and_sharp_corners_give_finite_poses(kind: str) -> None:
    """Scripts may start at any speed and turn on the spot; a leg that cannot reach its foot points at it."""
    rng = np.random.default_rng(1)
    way = [Placement(0.0, 0.0, 0.0, 0.0)]
    for k in range(300):
        x, y, heading, *_ = way[-1]
        if k % 60 == 0:
            heading += rng.uniform(-3, 3)
        speed = (0.0, 3.0, 0.2)[k // 30 % 3]
        leap = 5.0 if k == 150 else 0.0
        x, y = x + speed * 0.01 * math.cos(heading) + leap, y + speed * 0.01 * math.sin(heading)
        way.append(Placement(x, y, heading, speed, 3.0, ("walk", "sit", "graze")[k // 50 % 3]))
    done = walk(kind, way, lambda x, y: 0.3 * math.sin(2 * x))
    assert np.isfinite(done.parts).all()
    assert np.isfinite(done.angles).all()


def test_a_step_of_a_person_is_fast() -> None:
    """Well below 100 us on a processor of its own; here, beside others, four times that."""
    way = placements(lambda t: 1.4, seconds=3)
    start = time.process_time()
    walk("person", way)
    assert (time.process_time() - start) / len(way) < 400e-6


SPECIES = {"dog": DOG, "deer": DEER, "cow": COW}
ANIMAL_WAYS: dict[str, tuple[list[Placement], Callable[[float, float], float]]] = {
    "walk": (placements(lambda t: 0.8, lambda t: 0.3, seconds=4), slope),
    "trot": (placements(lambda t: 2.4, seconds=3), flat),
    "stop": (placements(lambda t: 0.9 * min(max(2.0 - t, 0.0), 1.0), seconds=4), flat),
    "turn": (placements(lambda t: 0.0, lambda t: 0.8, seconds=4), flat),
}


@pytest.mark.parametrize("kind", SPECIES)
@pytest.mark.parametrize("name", ANIMAL_WAYS)
def test_feet_of_animals_stay_where_they_carry(kind: str, name: str) -> None:
    way, ground = ANIMAL_WAYS[name]
    done = walk(kind, way, ground)
    size = done.figure.scale

    def slip(done: Walk) -> float:
        worst = 0.0
        for k in range(4):
            low = (SPECIES[kind].fore if k < 2 else SPECIES[kind].hind).lengths[2]
            moved = np.linalg.norm(np.diff(done.points(6 + 3 * k, (0, 0, -low * size)), axis=0), axis=1)
            worst = max(worst, float(moved[done.carries[1:, k] & done.carries[:-1, k]].max()))
        return worst

    assert slip(done) < 0.001
    assert depth(done, range(6, 16, 3), ground) < 0.01
    wrong = done.angles.copy()
    wrong[:, [joint.name == "left_hind_low" for joint in done.figure.joints]] *= -1
    assert slip(done.with_angles(wrong)) > 0.001


def test_animals_walk_with_one_foot_after_the_other_and_trot_with_diagonal_pairs() -> None:
    stroll = walk("cow", placements(lambda t: 0.8, seconds=8))
    first = {k: int(np.flatnonzero(np.diff(stroll.carries[400:, k].astype(int)) == -1)[0]) for k in range(4)}
    stride = np.diff(np.flatnonzero(np.diff(stroll.carries[400:, 2].astype(int)) == -1))[0]
    order = sorted(first, key=lambda k: (first[k] - first[2]) % stride)
    assert order == [2, 0, 3, 1]  # left hind, left fore, right hind, right fore
    assert stroll.carries.sum(axis=1).min() >= 2
    trot = walk("dog", placements(lambda t: 2.0, seconds=4)).carries[200:]
    assert (trot[:, 0] == trot[:, 3]).mean() > 0.95
    assert (trot[:, 0] == trot[:, 1]).mean() < 0.6


def test_strides_of_animals_follow_the_froude_number() -> None:
    done = walk("deer", placements(lambda t: 1.5, seconds=10))
    hips = 0.8 * done.figure.scale
    length = 2.4 * hips * (1.5**2 / (9.81 * hips)) ** 0.34
    assert landings(done, 0) / 10 == pytest.approx(1.5 / length, rel=0.08)


@pytest.mark.parametrize("kind", ["deer", "cow"])
def test_a_grazing_animal_has_its_muzzle_at_the_ground(kind: str) -> None:
    done = walk(kind, [Placement(0, 0, 0, 0, 0, "graze")] * 200)
    muzzle = SPECIES[kind].head[-1]
    size = done.figure.scale
    heights = done.points(2, (size * muzzle[0], 0, size * muzzle[1]))[:, 2]
    assert -0.02 < heights.min() < heights.max() < 0.22
    up = walk(kind, [Placement(0, 0, 0, 0)] * 200)
    assert up.points(2, (size * muzzle[0], 0, size * muzzle[1]))[:, 2].min() > 0.6 * size


@pytest.mark.parametrize(("bend", "side"), [(1.0, 1.0), (-1.0, -1.0)])
def test_two_links_end_where_they_should(bend: float, side: float) -> None:
    for x, z in ((0.3, -0.6), (-0.2, -0.5), (0.0, -0.79)):
        first, second = two_links(x, z, 0.45, 0.35, bend)
        knee = np.array([-0.45 * math.sin(first), -0.45 * math.cos(first)])
        end = knee - 0.35 * np.array([math.sin(first + second), math.cos(first + second)])
        assert end == pytest.approx([x, z], abs=1e-9)
        assert side * (knee[0] * z - knee[1] * x) < 0  # a knee is in front of the line from hip to foot
    first, second = two_links(1.0, -1.0, 0.4, 0.4, bend)
    assert first + second / 2 == pytest.approx(-math.pi / 4, abs=1e-6)  # nearly straight
