# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What is simulated: an experiment by name, or one for an environment, a world, a robot or a rig."""

from pathlib import Path
from typing import Any

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.catalogue import experiment_names
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment, validated
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.build import check_experiment
from fieldtruth.world.model import World

_FREE: float = 2.0
"""[m] from the end of the route in a world without an experiment to the world's edge."""


def experiment_for(
    experiment: Experiment | str | Path | None = None,
    *,
    environment: str | None = None,
    robot: str | None = None,
    rig: Rig | None = None,
    world: World | None = None,
) -> Experiment:
    """Return an experiment, with what is given in place of its own.

    Args:
        experiment: or its name, or the path of its file. None: the first built-in one in the environment; in a world,
            or without one, a straight route from the middle northwards.
        environment: whose experiment is meant; a ``world`` has one.
        robot: a name from ``fieldtruth list robots``; it has its own sensors.
        rig: the robot with its sensors.
        world: to drive in.

    Raises:
        UnknownNameError: an unknown name.
        ConfigurationError: a combination that is not allowed.
    """
    if experiment is not None and environment is not None:
        raise ConfigurationError("environment must be None where an experiment is given: the experiment has one")
    if robot is not None and rig is not None:
        raise ConfigurationError("robot must be None where a rig is given: the rig has one")
    if experiment is None and environment is None and world is None:
        raise ConfigurationError("one of experiment, environment and world is required")
    found = load_experiment(experiment) if isinstance(experiment, str | Path) else experiment
    if found is None:
        found = _in_environment(environment, world)
    changed: dict[str, Any] = {} if rig is None else {"rig": rig.model_dump()}
    if robot is not None:
        changed["rig"] = {"robot": robot}
    if changed:
        found = validated(found.model_dump() | changed, "")
    if world is None:
        check_experiment(found)
    return found


def _in_environment(environment: str | None, world: World | None) -> Experiment:
    name = environment or (world.name if world is not None else "")
    built_in = (load_experiment(each) for each in experiment_names())
    if world is None and (same := next((each for each in built_in if each.environment == name), None)) is not None:
        return same
    metres = [world.size[0] / 2 - _FREE if world is not None else 10.0, 0.0]
    route = {"metres": {"start": [0.0, 0.0], "waypoints": [metres]}}
    return validated({"name": name, "environment": name, "route": route}, "")
