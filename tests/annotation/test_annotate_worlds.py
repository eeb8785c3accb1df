# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A bag is annotated in the world where it was recorded, and refused in any other."""

import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from annotate_bags import odometry, states, true_pose, write
from kept_worlds import KEPT
from sense_worlds import without_textures
from small_park import LAYOUT, small_park

from fieldtruth import cli
from fieldtruth.annotation import check_objects
from fieldtruth.bag.run import open_run
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import FieldtruthError, FieldtruthWarning
from fieldtruth.gazebo import DEFAULT_LAYOUT
from fieldtruth.world.build import build_world, load_world
from fieldtruth.world.model import World

EXCERPT = Path(__file__).parent / "data" / "gazebo_park.bag"
ROCKS: dict[str, Any] = {
    "size": [30.0, 30.0], "individuals": 1, "beyond": False,
    **dict.fromkeys(("junipers", "gorse", "cushions", "pines", "oaks", "snags", "grass", "pebbles"), 0),
}  # fmt: skip
"""Layout of a hillside that is made in a second."""
Models = dict[str, Array]


def models_of(world: World) -> Models:
    """Poses (4, 4) by name, as Gazebo lists them, but in another order."""
    models = {name: np.eye(4) for name in reversed(world.object_names[1:])}
    for instance in world.instances:
        pose = instance.world_from_object.copy()
        pose[:3, :3] /= np.cbrt(np.linalg.det(pose[:3, :3]))
        models[instance.name] = pose
    return {**models, "husky": true_pose(0.0)}


def check(folder: Path, models: Models, world: World, **options: Any) -> None:
    run = open_run(write(folder / "x.bag", [states(1, models)]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_objects(run, world, **options)


@pytest.fixture(scope="module")
def park() -> World:
    return KEPT.load_world("park")


def made(environment: str, seed: int = 0, layout: dict[str, Any] | None = None) -> World:
    """A world without textures, which is not kept."""
    with without_textures():
        return build_world(environment, seed, layout)


@pytest.fixture(scope="module")
def rocks() -> World:
    return made("hillside", 0, ROCKS)


def test_a_bag_of_the_world_is_taken(park: World, tmp_path: Path) -> None:
    check(tmp_path, models_of(park), park)
    check_objects(open_run(EXCERPT), park)  # recorded by Gazebo, on ground of a coarser grid


@pytest.mark.slow
def test_a_full_forest_on_the_coarse_ground_for_gazebo_is_taken(tmp_path: Path) -> None:
    """It has the most objects, and most of their kinds, so that one which is elsewhere on coarse ground would show."""
    check(tmp_path, models_of(made("forest", 0, DEFAULT_LAYOUT)), load_world("forest"))


@pytest.mark.slow
def test_the_coarse_ground_of_a_steep_world_is_taken(rocks: World, tmp_path: Path) -> None:
    check(tmp_path, models_of(made("hillside", 0, ROCKS | DEFAULT_LAYOUT)), rocks)


@pytest.mark.parametrize("given", ["park", "hillside"])
def test_another_environment_is_refused(given: str, park: World, rocks: World, tmp_path: Path) -> None:
    world, recorded = (park, rocks) if given == "park" else (rocks, park)
    with pytest.raises(FieldtruthError) as error:
        check(tmp_path, models_of(recorded), world)
    found = re.search(rf"another world: (\d+) of the (\d+) objects of {given} with seed 0 match; ", str(error.value))
    assert found
    assert int(found[1]) < 10 < int(found[2]) == len(world.object_names) - 1
    assert "\n" not in str(error.value)


@pytest.mark.slow
def test_another_seed_is_refused(rocks: World, tmp_path: Path) -> None:
    with pytest.raises(FieldtruthError, match=r"objects of hillside with seed 1 match; .* is at x "):
        check(tmp_path, models_of(rocks), made("hillside", 1, ROCKS))


def test_another_layout_is_refused(tmp_path: Path) -> None:
    less, more = small_park(), made("park", 0, LAYOUT | {"benches": 2})
    for name, recorded, given in (("less", less, more), ("more", more, less)):
        (tmp_path / name).mkdir()
        with pytest.raises(FieldtruthError, match="was recorded in another world: "):
            check(tmp_path / name, models_of(recorded), given)


def without(name: str) -> Callable[[Models], Models]:
    return lambda models: {key: pose for key, pose in models.items() if key != name}


def turned(models: Models) -> Models:
    return {**models, "bench_1": models["bench_1"] @ transforms.pose((0.0, 0.0, 0.0), (0.0, 0.0, 15.0))}


def lost(models: Models) -> Models:
    pose = models["bench_1"].copy()
    pose[0, 3] = np.nan
    return {**models, "bench_1": pose}


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (without("bench_1"), "141 of the 142 objects of park with seed 0 match; 1 are missing, first 'bench_1'; give"),
        (without("park_ground"), "141 of the 142 objects .*; 1 are missing, first 'park_ground'; "),
        (turned, "141 of the 142 objects .*; 'bench_1' is at x .*, in this world at x "),
        (lost, "141 of the 142 objects .*; 'bench_1' is at x nan, "),
        (
            lambda models: {**models, "bench_77": np.eye(4)},
            "142 of the 142 objects .*; 1 are not in this world, first 'bench_77'; ",
        ),
        (
            lambda models: {"husky": models["husky"]},
            "0 of the 142 objects .*; 142 are missing, first 'park_ground'; ",
        ),
    ],
)
def test_one_object_that_differs_is_named(
    change: Callable[[Models], Models], line: str, park: World, tmp_path: Path
) -> None:
    with pytest.raises(FieldtruthError, match=line):
        check(tmp_path, change(models_of(park)), park)


def test_other_models_are_allowed_and_named(park: World, tmp_path: Path) -> None:
    models = {**models_of(park), "drone": true_pose(1.0), "jackal": true_pose(2.0), "park_backdrop": np.eye(4)}
    with pytest.raises(FieldtruthWarning, match=r"has models that park with seed 0 lacks, .* sees them: drone$"):
        check(tmp_path, models, park, robot="jackal")


def test_without_models_the_world_is_an_assumption(park: World, tmp_path: Path) -> None:
    run = open_run(write(tmp_path / "x.bag", [odometry(1, true_pose(0.0))]))
    with pytest.warns(FieldtruthWarning, match="nothing shows whether it was recorded in park with seed 0"):
        check_objects(run, park)


def test_an_experiment_in_which_something_moves_is_refused_for_a_bag_in_which_nothing_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = tmp_path / "windy.yaml", tmp_path / "out.bag"
    route = "route: {metres: {start: [0, 0], waypoints: [[3, 0]]}}"
    file.write_text(f"name: windy\nenvironment: park\n{route}\nplants: {{yielding: true}}\nwind: {{speed_m_s: 4}}\n")
    words = ["annotate", EXCERPT, "--environment", "park", "--experiment", file, "--out", out]
    assert cli.main([str(word) for word in words]) == 2
    what = "plants that yield and wind: what moves is labelled in runs that have their experiment.yaml"
    assert capsys.readouterr().err == f"error: {file} has {what}, and {EXCERPT} has none\n"
    assert [path.name for path in tmp_path.iterdir()] == ["windy.yaml"]
