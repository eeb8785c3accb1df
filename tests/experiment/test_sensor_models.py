# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Data files of the sensors by name: each figure has a source, is allowed, and is what the documents state."""

import math
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.experiment.catalogue import datasheet_of, figures_of, list_models, models
from fieldtruth.experiment.files import dump_experiment, parse_experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import KINDS, SensorConfig

ROUTE = "route: {start: [49.9, 8.9], waypoints: [[49.9001, 8.9]]}"
PAGE = (Path(__file__).parents[2] / "docs" / "sensors.md").read_text(encoding="utf-8")
MODELS = [(kind, name) for kind in ("imu", "gnss", "wheel_odometry", "lidar", "camera") for name in list_models(kind)]
NOT_KEYS = {"lidar": {"firing_cycle_ns"}, "camera": {"baseline"}}
"""Figures that are not keys of a kind: a LiDAR's columns follow from it, and a single camera ignores it."""
RADIANS, GRAVITY = math.pi / 180.0, 9.80665
UNITS = {
    "deg/s": RADIANS,
    "deg/s/sqrt(Hz)": RADIANS,
    "deg/h": RADIANS / 3600.0,
    "deg": RADIANS,
    "g": GRAVITY,
    "mg": GRAVITY * 1e-3,
    "ug": GRAVITY * 1e-6,
    "ug/sqrt(Hz)": GRAVITY * 1e-6,
    "%": 0.01,
}
STATED = re.compile(
    rf": ([\d.]+(?:, [\d.]+)*) ({'|'.join(map(re.escape, sorted(UNITS, key=len, reverse=True)))})(?=;|$)"
)


def stated_of(figure: dict[str, Any]) -> tuple[list[str], str]:
    """Numbers and unit of the data sheet, which the source of an IMU's figure repeats."""
    [(numbers, unit)] = STATED.findall(figure["source"])
    return numbers.split(", "), unit


def sensor(kind: str, **values: Any) -> SensorConfig:
    """The sensor of a rig with one."""
    own = {} if kind == "wheel_odometry" else {"mount": {"xyz": [0, 0, 2]}}
    return Rig.model_validate({"sensors": [{"kind": kind, "name": "own", **own, **values}]}).sensors[0]


@pytest.mark.parametrize(("kind", "name"), MODELS)
def test_every_figure_has_a_source(kind: str, name: str) -> None:
    model = models(kind)[name]
    assert model.keys() - {"noise", "stored"} == {"description", "figures"}
    assert model["figures"].keys() - NOT_KEYS.get(kind, set()) <= KINDS[kind].model_fields.keys()
    for block in model.keys() - {"description"}:
        for key, figure in model[block].items():
            assert figure.keys() == {"value", "source"}, key
            assert len(figure["source"]) > 10, key
            assert figure["source"] == " ".join(figure["source"].split()), key


@pytest.mark.parametrize(("kind", "name"), [*MODELS, *(("stereo", name) for name in list_models("camera"))])
def test_every_model_gives_its_figures_to_a_sensor_of_any_name(kind: str, name: str) -> None:
    own = sensor(kind, model=name).model_dump(mode="json")
    figures = figures_of(KINDS[kind].family, name)
    assert figures
    for key in figures.keys() - NOT_KEYS.get(kind, set()):
        given = figures[key] | {k: v for k, v in own[key].items() if k not in figures[key]} if key == "lens" else None
        assert own[key] == (figures[key] if given is None else given)
    assert sensor(kind, model=name, rate_hz=12.0).rate_hz == 12.0


REAL = [(k, n) for k, n in MODELS if k in ("imu", "gnss", "wheel_odometry", "lidar") and "noise" in models(k)[n]]


@pytest.mark.parametrize(("kind", "name"), REAL)
def test_noise_is_the_signal_of_a_data_sheet(kind: str, name: str) -> None:
    config = sensor(kind, model=name, signal="datasheet")
    assert config.signal is not None
    assert config.signal.model_fields_set == models(kind)[name]["noise"].keys()


def test_there_are_models_of_every_kind() -> None:
    assert {"3dm_gx5_25", "vn_100", "mti_630", "bmi088", "adis16470"} <= set(list_models("imu"))
    assert {"neo_m8n", "zed_f9p", "duro"} <= set(list_models("gnss"))
    assert {"husky_a200", "encoder_1024"} <= set(list_models("wheel_odometry"))
    wanted = {
        "zed_2",
        "zed_x",
        "realsense_d435i",
        "realsense_d455",
        "blackfly_s_6mm",
        "oak_d",
        "fisheye_190",
        "panorama",
    }
    assert wanted <= set(list_models("camera"))


@pytest.mark.parametrize("name", list_models("imu"))
def test_the_figures_of_imus_are_those_of_the_sheets_in_si_units(name: str) -> None:
    noise = models("imu")[name]["noise"]
    assert len(noise) >= 7
    for key, figure in noise.items():
        if key != "no_attitude":
            numbers, unit = stated_of(figure)
            values = figure["value"] if isinstance(figure["value"], list) else [figure["value"]]
            assert values == pytest.approx([float(number) * UNITS[unit] for number in numbers], rel=1e-12), key
            assert ("sqrt" in unit) == ("density" in key), key
            assert unit in ("deg", "%") or unit.startswith("deg") == key.startswith("gyroscope"), key
    config: Any = sensor("imu", model=name, signal="datasheet")
    assert {key: getattr(config.signal, key) for key in noise} == {
        key: tuple(figure["value"]) if isinstance(figure["value"], list) else figure["value"]
        for key, figure in noise.items()
    }


def test_the_noise_of_imus_agrees_with_the_random_walk_that_is_stated_beside_it() -> None:
    """A random walk [deg/sqrt(h)] is 60 times the density [deg/s/sqrt(Hz)] of white noise; sheets round both."""
    noise = models("imu")["adis16470"]["noise"]
    for key, unit, factor, rel in (
        ("gyroscope_noise_density", "deg", RADIANS, 0.45),
        ("accelerometer_noise_density", "m/s", 1.0, 0.65),
    ):
        [walk] = re.findall(rf"([\d.]+) {unit}/sqrt\(h\)", noise[key]["source"])
        assert 60.0 * noise[key]["value"] == pytest.approx(float(walk) * factor, rel=rel)


def test_the_counts_of_the_husky_are_its_78000_ticks_per_metre() -> None:
    counts = models("wheel_odometry")["husky_a200"]["noise"]["counts_per_revolution"]["value"]
    assert counts == round(78_000 * 2 * math.pi * 0.1651)


@pytest.mark.parametrize(
    ("item", "message"),
    [
        ("{kind: imu, name: a, model: vn100, mount: {xyz: [0, 0, 2]}}", "imu, nearest first: vn_100, .*; got 'vn100'"),
        ("{kind: gnss, name: a, model: f9p, mount: {xyz: [0, 0, 2]}}", "gnss, nearest first: zed_f9p, .*; got 'f9p'"),
        ("{kind: camera, name: a, model: vlp_16, mount: {xyz: [0, 0, 2]}}", "camera, nearest first: .*; got 'vlp_16'"),
        ("{kind: wheel_odometry, model: husky}", "wheel_odometry, nearest first: husky_a200, .*; got 'husky'"),
    ],
)
def test_an_unknown_model_is_named_by_its_key(item: str, message: str) -> None:
    text = f"{{name: a, environment: park, {ROUTE}, rig: {{sensors: [{{kind: gnss}}, {item}]}}}}"
    with pytest.raises(
        ConfigurationError, match=rf"^a\.yaml: rig\.sensors\[1\]\.model must be a model of kind {message}$"
    ):
        parse_experiment(text, "a.yaml")


def test_names_of_another_kind_are_unknown() -> None:
    with pytest.raises(UnknownNameError, match="unknown model of kind imu 'vlp_16'"):
        figures_of("imu", "vlp_16")
    assert list_models("radar") == {}


def row_of(name: str) -> list[str]:
    """Cells of the row of a model in the documents, after its name."""
    [row] = re.findall(rf"^\| `{name}` \|(.*)\|$", PAGE, re.M)
    return [cell.strip() for cell in row.split("|")]


@pytest.mark.parametrize("name", list_models("lidar"))
def test_the_documents_state_the_figures_of_a_lidar(name: str) -> None:
    config: Any = sensor("lidar", model=name)
    _, rings, elevations, columns, limits, *_ = row_of(name)
    stated = [float(number) for number in re.findall(r"-?[\d.]+", elevations)]
    if config.pattern is None:
        first, last = config.elevations_deg[0], config.elevations_deg[-1]
        assert rings == f"{config.rings}, ring 0 {'highest' if first > last else 'lowest'}"
        assert stated == pytest.approx([first, last], abs=0.06)
    else:
        assert rings == f"{config.rings} lines"
        assert stated[1] - stated[0] == pytest.approx(config.vertical_fov_deg)
    assert columns == str(config.columns)
    assert limits == f"{config.min_range:g} to {config.max_range:g}"


@pytest.mark.parametrize(("kind", "name"), [(k, n) for k, n in MODELS if k in ("imu", "wheel_odometry")])
def test_the_documents_state_rates_and_noise(kind: str, name: str) -> None:
    product, rate, *noise = row_of(name)
    config = sensor(kind, model=name)
    assert product in list_models(kind)[name]
    assert rate == f"{config.rate_hz:g}"
    stored = models(kind)[name]["noise"]
    if kind == "imu":  # the page has the units of the sheets
        shown = (key for key in stored if key.endswith(("_range", "_density", "_instability")))
        values = [f"{float(number):g}" for key in shown for number in stated_of(stored[key])[0]]
    else:
        found = (figure["value"] for figure in stored.values())
        values = [f"{v:g}" for value in found for v in (value if isinstance(value, list) else [value])]
    assert sorted(re.findall(r"\d+(?:\.\d+)?", " ".join(noise))) == sorted(v for v in values)


def stored_with(at: str, model: str | None, **rig: Any) -> str:
    """Text of a stored experiment in which a user has changed the ``model`` of a sensor, or of the robot."""
    given = {"name": "a", "environment": "park", **yaml.safe_load(ROUTE), "rig": rig}
    experiment = parse_experiment(yaml.safe_dump(given))
    values = yaml.safe_load(dump_experiment(experiment))
    part = values["rig"]["robot"] if at == "robot" else values["rig"]["sensors"][int(at)]
    part["model"] = model
    return yaml.safe_dump(values, sort_keys=False)


@pytest.mark.parametrize(
    ("at", "model", "rig", "line"),
    [
        ("3", "vlp_16", {}, r"rig\.sensors\[3\]\.model is vlp_16, but .* those of a sensor without a model; "),
        ("3", "os1_128", {"lidar": {"model": "os0_128"}}, r"\.model is os1_128, .* of os0_128; leave out"),
        ("4", "zed_x", {}, r"\.model is zed_x, .*; leave out what zed_x shall give, and rig\.models\.sensors\.stereo$"),
        ("0", "vn_100", {"imu": {"signal": "datasheet"}}, r"\.model is vn_100, .*of a sensor without a model; "),
        ("0", "vn_100", {}, r"rig\.sensors\[0\]\.model is vn_100, .*those of a sensor without a model; "),
        ("0", "bmi088", {"imu": {"model": "vn_100"}}, r"\.model is bmi088, but .* those of vn_100; "),
        ("0", None, {"imu": {"model": "vn_100"}}, r"\.model is null, .* those of vn_100; name vn_100$"),
        ("1", "neo_m8n", {"gnss": {"model": "duro"}}, r"\.model is neo_m8n, but .* of duro; leave out what"),
        (
            "0",
            "encoder_1024",
            {"sensors": [{"kind": "wheel_odometry", "model": "husky_a200"}]},
            r"\.model is encoder_1024, .* of husky_a200; leave",
        ),
        (
            "robot",
            "jackal",
            {},
            r"robot\.model is jackal, but .* those of husky; .* give, and rig\.models\.robot$",
        ),
    ],
)
def test_the_values_of_another_model_are_refused(at: str, model: str | None, rig: dict[str, Any], line: str) -> None:
    with pytest.raises(ConfigurationError, match=rf"^stored\.yaml: .*{line}"):
        parse_experiment(stored_with(at, model, **rig), "stored.yaml")


def test_a_model_is_changed_with_the_values_that_it_gives() -> None:
    values = yaml.safe_load(stored_with("0", "bmi088", imu={"model": "vn_100"}))
    del values["rig"]["sensors"][0]["rate_hz"], values["rig"]["models"]["sensors"]["imu"]
    assert parse_experiment(yaml.safe_dump(values)).rig.imu.rate_hz == figures_of("imu", "bmi088")["rate_hz"]


@pytest.mark.parametrize(
    ("kind", "model", "signal"),
    [
        ("lidar", "os1_64_rev7", datasheet_of("lidar", "vlp_16")),
        ("stereo", "zed_x", datasheet_of("camera", "zed_2")),
        ("wheel_odometry", "husky_a200", {"counts_per_revolution": 1024}),  # that of another model
        ("imu", "vn_100", {}),
    ],
)
def test_a_model_may_have_the_noise_of_another(kind: str, model: str, signal: dict[str, Any]) -> None:
    config: Any = sensor(kind, model=model, signal=signal)
    assert config.signal == type(config.signal)(**signal)
    assert figures_of(config.family, model).keys() & config.model_fields_set


@pytest.mark.parametrize("kind", ["imu", "gnss", "wheel_odometry", "lidar", "camera", "stereo"])
def test_every_stored_model_reads_with_values_of_its_own_and_with_others_beside_them(kind: str) -> None:
    for name in list_models(KINDS[kind].family):
        for values in ({}, {"rate_hz": 5.0, "signal": "datasheet", "topic": "/own", "enabled": False}):
            rig = Rig(sensors=(sensor(kind, model=name, **values),))
            experiment = parse_experiment(f"{{name: a, environment: park, {ROUTE}}}").model_copy(update={"rig": rig})
            assert parse_experiment(dump_experiment(experiment)) == experiment
