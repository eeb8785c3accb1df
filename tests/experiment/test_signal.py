# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The key ``signal`` of a sensor, its forms, and what is refused; and seeds of parts."""

from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
import pytest

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.random import rng_of
from fieldtruth.experiment import catalogue
from fieldtruth.experiment.files import dump_experiment, parse_experiment, read_signal, with_overrides
from fieldtruth.experiment.sensor_config import KINDS, MountedConfig, SignalConfig

MODEL = {"description": "one", "figures": {}, "noise": {"sigma": {"value": 0.25, "source": "a test"}}}


class _Signal(SignalConfig):
    sigma: float = 0.0


@pytest.fixture
def _kind(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Add the kind thermometer, with one model."""
    models = catalogue.models
    monkeypatch.setattr(
        catalogue, "models", lambda kind: {"thermo_1": MODEL} if kind == "thermometer" else models(kind)
    )
    monkeypatch.setattr("fieldtruth.experiment.sensor_config.models", lambda kind: catalogue.models(kind))

    class _Thermometer(MountedConfig):
        datasheet: ClassVar[str] = "thermo_1"
        kind: Literal["thermometer"] = "thermometer"
        signal: _Signal | None = None

        def topics(self) -> tuple[()]:
            return ()

    yield
    del KINDS["thermometer"]


def _text(signal: str) -> str:
    return (
        "name: a\nenvironment: park\nroute: {metres: {start: [0, 0], waypoints: [[5, 0]]}}\n"
        "rig: {sensors: [{kind: thermometer, name: warm, rate_hz: 1.0, mount: {xyz: [0, 0, 1]}"
        f"{', signal: ' + signal if signal else ''}}}]}}\n"
    )


@pytest.mark.usefixtures("_kind")
@pytest.mark.parametrize(
    ("signal", "sigma"), [("", None), ("ideal", None), ("datasheet", 0.25), ("{sigma: 3.0}", 3.0), ("{}", 0.0)]
)
def test_forms(signal: str, sigma: float | None) -> None:
    experiment = parse_experiment(_text(signal))
    found: Any = experiment.rig.sensors[0].signal
    assert (found.sigma if found is not None else None) == sigma
    assert parse_experiment(dump_experiment(experiment)) == experiment


@pytest.mark.usefixtures("_kind")
def test_a_file_is_relative_to_the_experiment(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("sigma: 7.0\n")
    found: Any = parse_experiment(_text("mine.yaml"), "", tmp_path).rig.sensors[0].signal
    assert found == _Signal(sigma=7.0)
    with pytest.raises(ConfigurationError, match=r"cannot read .*gone.yaml: No such file"):
        parse_experiment(_text("gone.yaml"), "", tmp_path)


@pytest.mark.usefixtures("_kind")
@pytest.mark.parametrize(
    ("signal", "line"),
    [
        ("noisy", r"rig\.sensors\[0\]\.signal must be ideal, datasheet, .*; got 'noisy'"),
        ("3", r"rig\.sensors\[0\]\.signal must be a mapping with the keys sigma, got 3"),
        ("{sigma: x}", r"rig\.sensors\[0\]\.signal\.sigma must be a number"),
        ("{sigmas: 1.0}", r"unknown key 'rig\.sensors\[0\]\.signal\.sigmas'; did you mean"),
    ],
)
def test_what_is_refused_is_one_line(signal: str, line: str) -> None:
    with pytest.raises(ConfigurationError, match=line) as error:
        parse_experiment(_text(signal))
    assert "\n" not in str(error.value)


@pytest.mark.usefixtures("_kind")
def test_one_signal_for_all_sensors(tmp_path: Path) -> None:
    ideal = parse_experiment(_text(""))
    assert with_overrides(ideal, signal="datasheet") == parse_experiment(_text("datasheet"))
    assert with_overrides(parse_experiment(_text("{sigma: 3.0}")), signal="ideal") == ideal
    file = tmp_path / "all.yaml"
    file.write_text("thermometer: {sigma: 2.0}\n")
    assert with_overrides(ideal, signal=read_signal(str(file))) == parse_experiment(_text("{sigma: 2.0}"))
    file.write_text("warm: ideal\nthermometer: datasheet\n")
    assert with_overrides(ideal, signal=read_signal(str(file))) == ideal
    with pytest.raises(ConfigurationError, match="'lidar' must be a sensor of the rig or its kind: warm, thermometer"):
        with_overrides(ideal, signal={"lidar": "datasheet"})
    with pytest.raises(
        ConfigurationError, match="signal must be ideal, datasheet, clean, robot or the path of a YAML file, got 'x'"
    ):
        read_signal("x")


def test_child_seeds() -> None:
    draws = {
        rng_of(seed, *names).integers(2**63)
        for seed in (0, 1)
        for names in (("lidar", 0), ("lidar", 1), ("imu", 0), ("imu",), ("imu", "lidar"), ("lidar", "imu"))
    }
    assert len(draws) == 12
    assert rng_of(3, "imu", 5).normal() == rng_of(3, "imu", 5).normal()
    assert abs(np.corrcoef(rng_of(0, "a", 1).normal(size=10_000), rng_of(0, "a", 2).normal(size=10_000))[0, 1]) < 0.04


@pytest.mark.parametrize(
    ("sensor", "line"),
    [
        ("gnss: {signal: {mode: fast}}", "rig.gnss.signal.mode must be single, sbas or rtk, got 'fast'"),
        ("lidar: {signal: {returns: all}}", "rig.lidar.signal.returns must be strongest, last or two, got 'all'"),
    ],
)
def test_a_choice_is_refused_with_what_is_allowed(sensor: str, line: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        parse_experiment(
            "name: a\nenvironment: park\nroute: {metres: {start: [0, 0], waypoints: [[5, 0]]}}\n"
            f"rig: {{{sensor}}}\n"
        )
    assert str(error.value) == line
