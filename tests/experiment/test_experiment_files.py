# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Experiment files: round trip, overrides, and one-line errors."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import fieldtruth
from fieldtruth import (
    ConfigurationError,
    Experiment,
    FieldtruthError,
    LidarConfig,
    Mount,
    RouteConfig,
    UnknownNameError,
)
from fieldtruth.core.yaml_io import parse_mapping
from fieldtruth.experiment.config import ControlConfig, metres_from_route
from fieldtruth.experiment.files import dump_experiment, load_experiment, parse_experiment, with_overrides
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.names import EXPERIMENTS, list_experiments
from fieldtruth.experiment.rig import paper_rig
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.world.build import check_experiment

SMALL = """\
name: tiny
environment: park
route:
  start: [49.9, 8.9]
  waypoints:
    - [49.9001, 8.9]
"""


@pytest.fixture
def park() -> Experiment:
    return load_experiment("park_1")


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_built_in_experiment_loads_by_name_and_stays_inside_its_world(name: str) -> None:
    experiment = load_experiment(name)
    assert experiment.name == name
    check_experiment(experiment)
    assert list_experiments()[name] == experiment.description != ""
    assert (abs(metres_from_route(experiment.route)) < (50.0, 25.0)).all()


def test_dump_has_every_value_and_loads_equal(park: Experiment) -> None:
    text = dump_experiment(park)
    assert parse_experiment(text) == park
    values = yaml.safe_load(text)
    assert values.pop("fieldtruth") == fieldtruth.__version__
    assert values["rig"].pop("models") == park.rig.models()
    unused: Any = {
        "robots": True,
        "namespace": True,
        "actors": True,
        "ground": True,
        "plan": True,
        "plants": True,
        "wind": True,
        "control": {"yield_to"},
    }
    one_robot = park.model_dump(mode="json", exclude=unused)
    for sensor in one_robot["rig"]["sensors"]:
        for extra in ("parts", "passability"):  # nor are these written where they are not used
            assert not sensor.pop(extra, False)
    assert values == one_robot
    [lidar] = [sensor for sensor in values["rig"]["sensors"] if sensor["kind"] == "lidar"]
    assert lidar["columns"] == 512  # a default that the built-in file does not set
    assert dump_experiment(parse_experiment(text)) == text


def test_defaults_match_the_paper() -> None:
    experiment = parse_experiment(SMALL)
    assert (experiment.seed, experiment.seconds, experiment.control.speed) == (0, None, 0.3)
    assert (experiment.rig.stereo.width, experiment.rig.stereo.height) == (1280, 720)
    assert experiment.rig.stereo.baseline == pytest.approx(0.12, abs=1e-12)


finite = st.floats(allow_nan=False, allow_infinity=False)
mounts = st.builds(Mount, xyz=st.tuples(finite, finite, finite), rpy_deg=st.tuples(finite, finite, finite))
above = st.builds(Mount, xyz=st.tuples(finite, finite, st.floats(min_value=1.0, allow_infinity=False)))
points = st.tuples(st.floats(-90, 90), st.floats(-180, 180))
experiments = st.builds(
    Experiment,
    name=st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}", fullmatch=True),
    description=st.text(
        st.characters(exclude_characters="\r\n\x85\u2028\u2029", exclude_categories=["Cs"]), max_size=200
    ),
    environment=st.just("park"),
    seed=st.integers(0, 2**63 - 1),
    seconds=st.none() | st.floats(0.001, 86_400),
    route=st.builds(RouteConfig, start=points, waypoints=st.lists(points, min_size=1, max_size=4).map(tuple)),
    control=st.builds(ControlConfig, heading_gain=st.floats(1e-300, 1e300)),
    light=st.builds(LightConfig, sun_azimuth_deg=st.floats(-360, 360)),
    rig=st.builds(
        paper_rig,
        imu=st.builds(ImuConfig, mount=mounts),
        lidar=st.builds(LidarConfig, mount=above, enabled=st.booleans(), columns=st.integers(8, 4096)),
    ),
)


@settings(deadline=None, max_examples=12)
@given(experiments)
def test_any_valid_experiment_survives_dump_and_load(experiment: Experiment) -> None:
    assert parse_experiment(dump_experiment(experiment)) == experiment


@settings(deadline=None, max_examples=150)
@given(st.text(max_size=60) | st.text("[]{}:,-&*!|>'\"%@?#\n ab10.e~\t", max_size=40))
def test_any_invalid_text_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(FieldtruthError) as refusal:
        parse_experiment(text, "x.yaml")
    assert str(refusal.value).startswith("x.yaml: ")
    assert "\n" not in str(refusal.value)


def test_overrides_return_a_validated_copy(park: Experiment) -> None:
    before = dump_experiment(park)
    changed = with_overrides(park, seconds=5, seed=7, cameras=False, lidar=False)
    assert (changed.seconds, changed.seed) == (5.0, 7)
    assert not changed.rig.stereo.enabled
    assert not changed.rig.lidar.enabled
    assert dump_experiment(park) == before
    assert with_overrides(park) == park
    assert with_overrides(changed, seed=0, cameras=True).rig.lidar.enabled is False
    with pytest.raises(ConfigurationError, match=r"^seconds must be a number between 0\.001 and 86400, got -5$"):
        with_overrides(park, seconds=-5)


def test_numbers_with_exponents_are_numbers_and_strings_stay_strings() -> None:
    assert parse_experiment(SMALL + "seconds: 1e1\n").seconds == 10.0
    for text in ("0E0", "1e3", "1.0e+3", "null", "yes", "1:30", "0x1F", "~", "2024-01-01", " a", "#"):
        experiment = parse_experiment(SMALL).model_copy(update={"description": text})
        assert parse_experiment(dump_experiment(experiment)).description == text


def test_file_is_loaded_by_its_path(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(SMALL)
    assert load_experiment(path) == load_experiment(str(path)) == parse_experiment(SMALL)


def test_built_in_name_takes_precedence_over_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("park_1").write_text(SMALL)
    Path("mine").write_text(SMALL)
    assert load_experiment("park_1").name == "park_1"
    assert load_experiment("./park_1").name == "tiny"
    assert load_experiment("mine").name == "tiny"


def test_unknown_experiment_suggests_the_closest_and_lists_all() -> None:
    with pytest.raises(
        UnknownNameError, match=r"^unknown experiment 'park-2'; did you mean 'park_2'\? Available: forest_1, "
    ):
        load_experiment("park-2")


def replaced(dump: str, key: str, value: str) -> str:
    """Set the first line of a dump that starts with ``key``."""
    lines = dump.splitlines()
    row = next(i for i, line in enumerate(lines) if line.strip().startswith(f"{key}:"))
    indent = len(lines[row]) - len(lines[row].lstrip())
    lines[row] = " " * indent + value
    return "\n".join(lines)


BAD_VALUES = [
    ("seed", "seed: -1", r"seed must be an integer between 0 and 9223372036854775807, got -1"),
    ("seed", "seed: true", r"seed must be an integer between 0 and \d+, got True"),
    ("seed", "seed: 1.5", r"seed must be an integer between 0 and \d+, got 1\.5"),
    ("seconds", "seconds: 0", r"seconds must be a number between 0\.001 and 86400, got 0"),
    ("seconds", "seconds: -.inf", r"seconds must be a number between 0\.001 and 86400, got -inf"),
    ("seconds", "seconds: soon", r"seconds must be a number between 0\.001 and 86400, got 'soon'"),
    ("name", "name: ../x", r"name must be a word of at most 64 letters, digits, - and _, got '\.\./x'"),
    (
        "description",
        'description: "a\\Nb"',
        r"description must be a single line of at most 200 characters, got 'a.x85b'",
    ),
    ("start", "start: [91, 0]", r"route\.start\[0\] must be a number between -90 and 90, got 91"),
    ("start", "start: [0]", r"route\.start\[1\] is required: a number between -180 and 180"),
    ("start", "start: [0, 1, 2]", r"route\.start must be \[latitude, longitude\] in degrees, got \[0, 1, 2\]"),
    ("speed", "speed: .nan", r"control\.speed must be a number above 0, got nan"),
    ("speed", "speed: yes", r"control\.speed must be a number above 0, got True"),
    ("columns", "columns: five", r"rig\.sensors\[3\]\.columns must be an integer between 8 and 8192, got 'five'"),
    ("columns", "columns: 7", r"rig\.sensors\[3\]\.columns must be an integer between 8 and 8192, got 7"),
    (
        "height",
        "height: 8193",
        r"rig\.sensors\[4\]\.height must be an integer between 2 and 8192, got 8193",
    ),
    ("spinning", "spinning: 1", r"rig\.sensors\[3\]\.spinning must be true or false, got 1"),
    ("min_range", "min_range: -1", r"rig\.sensors\[3\]\.min_range must be a number of at least 0, got -1"),
    ("min_range", "min_range: 120", r"rig\.sensors\[3\]: min_range must be below max_range 120\.0, got 120\.0"),
    (
        "rings",
        "ring: 64",
        r"unknown key 'rig\.sensors\[3\]\.ring'; did you mean 'rig\.sensors\[3\]\.rings'\? Available: kind, name, ",
    ),
    ("rings", "zzz: 64", r"unknown key 'rig\.sensors\[3\]\.zzz'; Available: kind, name, enabled, model, "),
    ("name", "nme: park_1", r"unknown key 'nme'; did you mean 'name'\? Available: name, .* \(and 1 more\)"),
    ("light", "lights:", r"unknown key 'lights'; did you mean 'light'\? Available: name, "),
]


@pytest.mark.parametrize(("key", "line", "message"), BAD_VALUES, ids=[line for _, line, _ in BAD_VALUES])
def test_invalid_value_is_reported_with_key_and_condition(park: Experiment, key: str, line: str, message: str) -> None:
    with pytest.raises(ConfigurationError, match=rf"^run\.yaml: {message}") as refusal:
        parse_experiment(replaced(dump_experiment(park), key, line), "run.yaml")
    assert "\n" not in str(refusal.value)


def test_number_instead_of_a_mapping_reports_its_keys() -> None:
    with pytest.raises(
        ConfigurationError,
        match=r"^rig\.gnss must be a mapping with the keys kind, name, enabled, model, rate_hz, topic, .*, got 4$",
    ):
        parse_experiment(SMALL + "rig: {gnss: 4}\n")


def test_cameras_must_be_a_rectified_stereo_pair() -> None:
    left = Mount(xyz=(0.15, 0.06, 0.72), rpy_deg=(0, 90, 0))
    for right in (
        Mount(xyz=(0.15, 0.18, 0.72), rpy_deg=(0, 90, 0)),  # right camera on the left
        Mount(xyz=(0.15, -0.06, 0.73), rpy_deg=(0, 90, 0)),  # higher
        Mount(xyz=(0.15, -0.06, 0.72), rpy_deg=(0, 90, 5)),  # other orientation
    ):
        with pytest.raises(ValueError, match="must have the same orientation"):
            StereoConfig.model_validate({"left": left, "right": right})
    turned = (10, 80, 30)
    across = Mount(xyz=(0, 0, 0), rpy_deg=turned).base_from_sensor[:3, 1] * -0.2
    right = Mount(xyz=(float(across[0]), float(across[1]), float(across[2])), rpy_deg=turned)
    pair = StereoConfig.model_validate({"left": Mount(xyz=(0, 0, 0), rpy_deg=turned), "right": right})
    assert pair.baseline == pytest.approx(0.2, abs=1e-12)
    np.testing.assert_allclose(pair.right.base_from_sensor, right.base_from_sensor, atol=1e-12)


def test_keys_of_a_merged_mapping_are_not_duplicates() -> None:
    text = "a: &a {b: 1, c: 2}\nd: &d\n  <<: *a\n  c: 3\n  e: 4\nf: {g: {h: {<<: *d, c: 5}}}\n"
    found = parse_mapping(text, "run.yaml")
    assert found["d"] == {"b": 1, "c": 3, "e": 4}
    assert found["f"]["g"]["h"] == {"b": 1, "c": 5, "e": 4}


BROKEN_TEXTS = [
    ("name: [a\nseed: 0\n", r"run\.yaml: invalid YAML at line 2, column 5: "),
    ("seed: 1\nname: a\nseed: 2\n", r"run\.yaml: invalid YAML at line 3, column 1: duplicate key 'seed'"),
    ("a: &a {b: 1}\nc:\n  <<: *a\n  d: 1\n  d: 2\n", r"run\.yaml: invalid YAML at line 5, column 3: duplicate key 'd'"),
    ("name: 2024-13-45\n", r"run\.yaml: invalid YAML: month must be in 1\.\.12"),
    ("name: a\nenvironment: \x07\n", r"run\.yaml: invalid YAML at line 2: special characters are not allowed"),
    (
        "name: !!python/object/apply:os.system [true]\n",
        r"run\.yaml: invalid YAML at line 1, column 7: could not determine",
    ),
    ("[" * 1000, r"run\.yaml: invalid YAML: nested too deeply"),
    ("", r"run\.yaml: must be a mapping"),
    ("- name\n", r"run\.yaml: must be a mapping"),
    ("1: 2\n", r"run\.yaml: unknown key '1'; Available: "),
    (
        "fieldtruth: 99.0.0\nunknown: 1\n",
        r"run\.yaml: written by fieldtruth 99\.0\.0, but version .* is installed; run: pip install",
    ),
    ("fieldtruth: latest\n", r"run\.yaml: fieldtruth must be a version such as 0\.1\.0, got 'latest'"),
]


@pytest.mark.parametrize(("text", "message"), BROKEN_TEXTS, ids=[text[:20] for text, _ in BROKEN_TEXTS])
def test_invalid_file_is_reported_with_its_position(text: str, message: str) -> None:
    with pytest.raises(ConfigurationError, match=f"^{message}") as refusal:
        parse_experiment(text, "run.yaml")
    assert "\n" not in str(refusal.value)


def test_files_of_this_or_an_older_version_are_accepted() -> None:
    for version in (fieldtruth.__version__, "0.0.1", "0.0"):
        assert parse_experiment(f"fieldtruth: {version}\n{SMALL}") == parse_experiment(SMALL)


def test_unreadable_file_is_reported(tmp_path: Path) -> None:
    binary = tmp_path / "bag.yaml"
    binary.write_bytes(b"#ROSBAG V2.0\n\xff\x00")
    huge = tmp_path / "huge.yaml"
    with huge.open("wb") as file:
        file.truncate(1 << 30)
    cases: list[tuple[Any, str]] = [
        (tmp_path / "none.yaml", r"cannot read .*none\.yaml: No such file or directory"),
        (f"{tmp_path}/", "is a folder; give a YAML file in it"),
        (binary, r"cannot read .*bag\.yaml: byte 13 is not UTF-8"),
        (huge, "too large for a configuration: more than 4 MiB"),
        ("a\0/b", "cannot read 'a.x00/b'"),
    ]
    for path, message in cases:
        with pytest.raises(ConfigurationError, match=message):
            load_experiment(path)
