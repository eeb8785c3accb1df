# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cards say what was simulated: no word about a robot, season, light or weather that an experiment does not have."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from record_fakes import make_experiment, make_track, make_world

from fieldtruth.bag.run import Run
from fieldtruth.experiment.config import Experiment, FramesConfig
from fieldtruth.experiment.light_config import LightConfig, WeatherConfig
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.exporters.frames import Member
from fieldtruth.exporters.huggingface_card import card_text, croissant_text
from fieldtruth.ontology import label_map_of
from fieldtruth.report.card import collection_of, conditions_of, data_card, robot_title

WORDS = {
    "husky": {"Husky", "four wheels", "the 50 kg", "summer", "preset summer_day", "clear air", "as on the real one"},
    "jackal": {"Jackal", "four wheels", "the 18.431 kg", "autumn", "preset overcast", "fog, visibility 80 m"},
    "generic_differential": {"differential robot of 25 kg", "two driven wheels and a caster", "winter", "rain 8 mm/h"},
}
EVERY = set[str]().union(*WORDS.values())


def experiment_of(robot: str) -> Experiment:
    """An experiment with one robot, season, light and weather each."""
    plain = make_experiment(name=robot)
    changed: dict[str, dict[str, Any]] = {
        "husky": {},
        "jackal": {
            "layout": {"season": "autumn"},
            "light": LightConfig(preset="overcast"),
            "weather": WeatherConfig(fog_visibility_m=80.0),
        },
        "generic_differential": {
            "layout": {"season": "winter"},
            "light": LightConfig(preset="noon"),
            "weather": WeatherConfig(rain_mm_h=8.0),
        },
    }
    rig = plain.rig.model_copy(update={"robot": RobotConfig(model=robot)})
    return plain.model_copy(update={"rig": rig, **changed[robot]})


def texts_of(experiment: Experiment) -> str:
    """The data card, and card and Croissant text of a published data set."""
    world = make_world()
    card = data_card(experiment, world, make_track(world, experiment), {})
    run = Run(Path(experiment.name), experiment, {}, {}, 0, 10**9)
    members = [Member(run, "train", experiment.name)]
    split = SimpleNamespace(rows=1, file_bytes=1, memory_bytes=1, files=())
    table = SimpleNamespace(name="images", splits={"train": split}, columns=())
    labels = label_map_of("rellis")
    published = card_text([cast("Any", table)], members, labels, [])
    croissant = json.loads(croissant_text(Path(), [cast("Any", table)], members, labels))
    return "\n".join([card, published, croissant["rai:dataCollection"], *croissant["rai:dataBiases"]])


@pytest.mark.parametrize("robot", WORDS)
def test_cards_have_the_words_of_their_experiment_and_no_others(robot: str) -> None:
    text = texts_of(experiment_of(robot))
    assert {word for word in WORDS[robot] if word not in text} == set()
    for word in EVERY - WORDS[robot]:
        assert word not in text.replace("a real Husky's driver", "").replace("model\n`husky`", ""), word


def test_several_experiments_are_all_named() -> None:
    made = [experiment_of(robot) for robot in WORDS]
    assert collection_of(made) == (
        "a Clearpath Husky, Clearpath Jackal and differential robot of 25 kg drives in generated natural environments"
    )
    seasons, air = "park, in summer, autumn and winter, with", "and clear air, fog, visibility 80 m and rain 8 mm/h;"
    assert seasons in conditions_of(made)
    assert air in conditions_of(made)
    still = made[1].model_copy(update={"frames": FramesConfig(count=3)})
    assert collection_of([still]).startswith("a Clearpath Jackal stands at random poses in")


def test_a_robot_with_other_figures_is_not_called_by_its_name() -> None:
    assert robot_title(RobotConfig()) == "Clearpath Husky"
    assert robot_title(RobotConfig(mass=80.0)) == "robot with figures other than a Clearpath Husky's"
