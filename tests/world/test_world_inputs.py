# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Inputs of a world: corridors are data of an environment, not of the experiments; the cache key covers every file."""

from pathlib import Path

import numpy as np
import pytest

from fieldtruth.core import cache
from fieldtruth.experiment.config import metres_from_route
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.names import EXPERIMENTS
from fieldtruth.world.build import layout_model, reserved_corridors, world_key
from fieldtruth.world.environments import ENVIRONMENTS, Environment
from fieldtruth.world.grids import Line


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_route_of_each_builtin_experiment_is_in_a_corridor(name: str) -> None:
    experiment = load_experiment(name)
    if experiment.plants.yielding:
        return  # it drives through what stands in its way
    route = Line.through([(float(x), float(y)) for x, y in metres_from_route(experiment.route)], smooth=False)
    corridors = reserved_corridors(experiment.environment)
    distance = np.min([corridor.distance(route.points) for corridor in corridors], axis=0)
    assert distance.max() < 0.01


@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_corridors_are_in_the_world(environment: str) -> None:
    corridors = reserved_corridors(environment)
    size = layout_model(environment)().model_dump()["size"]
    assert corridors
    assert all((np.abs(corridor.points) < np.array(size) / 2).all() for corridor in corridors)


def test_another_builtin_experiment_changes_no_world(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Neither the corridors nor the cache key; no file of the built-in experiments is an input of a world."""
    keys = {name: world_key(name) for name in ENVIRONMENTS}
    corridors = {name: [line.points.tobytes() for line in reserved_corridors(name)] for name in ENVIRONMENTS}
    text = EXPERIMENTS["park_1"].replace("name: park_1", "name: park_9")
    monkeypatch.setattr(EXPERIMENTS, "_files", {})
    monkeypatch.setitem(EXPERIMENTS, "park_9", text)
    cache._sources_digest.cache_clear()
    assert tuple(EXPERIMENTS) == ("park_9",)
    assert {name: world_key(name) for name in ENVIRONMENTS} == keys
    assert {n: [line.points.tobytes() for line in reserved_corridors(n)] for n in ENVIRONMENTS} == corridors
    source = Path(cache.__file__).parents[2]
    modules = [f"{ENVIRONMENTS['park'].package}.build", "fieldtruth.world.build"]
    inputs = [path.relative_to(source).as_posix() for path in cache.import_closure(modules, source)]
    assert not [path for path in inputs if path.startswith("fieldtruth/experiment/builtin/")]
    assert "fieldtruth/experiment/names.py" not in inputs


@pytest.mark.parametrize(
    "file",
    [
        "world/environments/layered/build.py",
        "world/environments/layered/config.py",
        "world/environments/layered/trails_beyond.py",
        "world/environments/layout.py",
        "world/data/environments/park.yaml",
        "world/plants/growth.py",
        "world/data/trees/birch.yaml",
        "world/data/materials/furniture.yaml",
        "world/build.py",
        "core/transforms.py",
        "core/classes.py",
    ],
)
def test_world_key_covers_every_input(file: str) -> None:
    source = Path(cache.__file__).parents[2]
    modules = [f"{ENVIRONMENTS['park'].package}.{name}" for name in ("build", "config")]
    inputs = cache.import_closure(["fieldtruth.world.build", *modules], source)
    assert source / "fieldtruth" / file in inputs


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_worlds_stay_where_a_sensor_or_the_robot_changes(name: str) -> None:
    source = Path(cache.__file__).parents[2]
    modules = [f"{ENVIRONMENTS[name].package}.{module}" for module in ("build", "config")]
    inputs = cache.import_closure(["fieldtruth.world.build", *modules], source)
    others = {path.relative_to(source / "fieldtruth").as_posix() for path in inputs if path.parts[-2] != "fieldtruth"}
    assert {file for file in others if not file.startswith(("core/", "kernels/", "world/"))} == {
        "experiment/__init__.py",
        "experiment/environment_file.py",
        "experiment/fields.py",
    }


def test_world_key_of_one_environment_does_not_depend_on_the_others() -> None:
    """Environments of layers share their code, and all share the data."""
    assert len({world_key(name) for name in ENVIRONMENTS}) == len({each.package for each in ENVIRONMENTS.values()})


def test_world_key_covers_an_environment_outside_the_package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    folder = tmp_path / "my_steppe"
    folder.mkdir()
    (folder / "build.py").write_text("GRASS = 1\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(ENVIRONMENTS, "steppe", Environment("grass", "my_steppe"))
    first = world_key("steppe")
    assert world_key("steppe") == first
    (folder / "build.py").write_text("GRASS = 2\n")
    assert world_key("steppe") != first
