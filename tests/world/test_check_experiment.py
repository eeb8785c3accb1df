# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Environment and layout of an experiment are checked by the world, and each command reports them on one line."""

from pathlib import Path

import pytest

from fieldtruth.cli import main
from fieldtruth.core.errors import ConfigurationError, OutputError, UnknownNameError
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, load_experiment, parse_experiment
from fieldtruth.world.build import build_world, check_experiment
from fieldtruth.world.environments import ENVIRONMENTS


@pytest.fixture
def park() -> Experiment:
    return load_experiment("park_1")


def test_unknown_environment_lists_the_known_ones(park: Experiment) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown environment 'parc'; did you mean 'park'\? Available: forest"):
        check_experiment(park.model_copy(update={"environment": "parc"}))


@pytest.mark.parametrize("layout", [{"bushs": 3}, {"bushes": "three"}, {"bushes": -1}])
def test_layout_that_is_not_allowed_names_source_and_key(park: Experiment, layout: dict[str, object]) -> None:
    with pytest.raises(ConfigurationError, match=r"^mine\.yaml: layout\b.*bushe?s"):
        check_experiment(park.model_copy(update={"layout": layout}), "mine.yaml")


def test_value_of_one_of_two_types_is_one_error_and_names_both(park: Experiment) -> None:
    text = r"^layout: beyond must be a number between 0 and 1, or false, got 'maybe'$"
    with pytest.raises(ConfigurationError, match=text):
        check_experiment(park.model_copy(update={"layout": {"beyond": "maybe"}}))


def test_grid_is_limited_and_its_memory_is_checked_before_it_is_made() -> None:
    with pytest.raises(ConfigurationError, match=r"^layout: grid must be a number between 0\.01 and 1, got 0\.001$"):
        build_world("park", 0, {"grid": 0.001})
    with pytest.raises(OutputError, match=r"^a world of 90000 m x 90000 m .*; make layout\.grid larger"):
        build_world("park", 0, {"size": [90000, 90000]})


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_default_layout_is_allowed(park: Experiment, name: str) -> None:
    check_experiment(park.model_copy(update={"environment": name}))


@pytest.mark.parametrize("command", ["generate", "shares"])
@pytest.mark.parametrize("change", [{"environment": "parc"}, {"layout": {"bushs": 3}}])
def test_commands_fail_with_one_line_and_exit_code_2(
    park: Experiment, tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str, change: dict[str, object]
) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(dump_experiment(park.model_copy(update=change)))
    assert parse_experiment(path.read_text()).name == "park_1"  # a valid file, but not for this environment
    assert main([command, str(path), *(["--out", str(tmp_path / "data")] if command == "generate" else [])]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert not (tmp_path / "data").exists()
