# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Words of cards about what was simulated: robot, environments, seasons, light and weather of experiments."""

from collections.abc import Iterable, Sequence

from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.experiment.robot_models import robot_data


def robot_title(robot: RobotConfig) -> str:
    """Return the robot with its article: that of its model, or one with figures of its own."""
    name = str(robot_data(robot.model)["description"]).partition(":")[0].removesuffix(" A200")
    if name.startswith("A robot"):
        return f"{robot.drive.replace('_', '-')} robot of {robot.mass:g} kg"
    return name if robot == RobotConfig(model=robot.model) else f"robot with figures other than a {name}'s"


def body_words(robot: RobotConfig) -> dict[str, str]:
    """Return the words of the card's part about physics that depend on the robot."""
    return {
        "wheels": "four wheels" if robot.caster is None else "two driven wheels and a caster",
        "as_real": ", as on the real one" if robot.model == "husky" else "",
        "mass": f"{robot.mass:g}",
        "torque": f"{robot.max_torque:g}",
    }


def collection_of(experiments: Sequence[Experiment]) -> str:
    """Return a sentence about how the sensors moved in experiments: which robots drove, stood or followed poses."""
    groups = {
        "drives": [e for e in experiments if e.frames is None and e.drive is None],
        "stands at random poses": [e for e in experiments if e.frames is not None and e.drive is None],
        "follows given poses, without physics,": [e for e in experiments if e.drive is not None],
    }
    parts = [f"a {_list(robot_title(e.rig.robot) for e in made)} {verb}" for verb, made in groups.items() if made]
    return f"{'; '.join(parts)} in generated natural environments"


def conditions_of(experiments: Sequence[Experiment]) -> str:
    """Return a sentence about the environments, seasons, light and weather that experiments have."""
    environments = _list(e.environment for e in experiments)
    seasons = _list(str(e.layout.get("season", "summer")) for e in experiments)
    light, weather = _list(_light(e.light) for e in experiments), _list(e.weather.text for e in experiments)
    return (
        f"Vegetation, relief and ground follow models of Central European landscapes: {environments}, in {seasons}, "
        f"with light of {light} and {weather}; all others are missing."
    )


def _light(light: LightConfig) -> str:
    words = f"preset {light.preset}"
    own = light.model_dump(exclude={"preset"}, exclude_defaults=True)
    return words + f" with own {', '.join(own)}" * bool(own)


def _list(words: Iterable[str]) -> str:
    *others, last = dict.fromkeys(words)
    return f"{', '.join(others)} and {last}" if others else last
