# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""An experiment is what its file says, survives being written and read, and says in one line what is wrong with it."""

from pathlib import Path
from typing import Any

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
from fieldtruth.experiment.catalogue import experiment_names, list_experiments
from fieldtruth.experiment.config import ControlConfig, LightConfig
from fieldtruth.experiment.files import dump_experiment, load_experiment, parse_experiment, with_overrides
from fieldtruth.experiment.rig import CameraConfig, Rig
from fieldtruth.experiment.route import metres_from_route
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


@pytest.mark.parametrize("name", experiment_names())
def test_every_shipped_experiment_loads_under_its_own_name_and_stays_inside_its_world(name: str) -> None:
    experiment = load_experiment(name)
    assert experiment.name == name
    check_experiment(experiment)
    assert list_experiments()[name] == experiment.description != ""
    assert (abs(metres_from_route(experiment.route)) < (50.0, 25.0)).all()


def test_a_dump_holds_every_value_and_reads_back_equal(park: Experiment) -> None:
    text = dump_experiment(park)
    assert parse_experiment(text) == park
    values = yaml.safe_load(text)
    assert values.pop("fieldtruth") == fieldtruth.__version__
    assert values == park.model_dump(mode="json")
    assert values["rig"]["lidar"]["columns"] == 512  # a default that the shipped file does not name
    assert dump_experiment(parse_experiment(text)) == text


def test_defaults_are_the_papers() -> None:
    experiment = parse_experiment(SMALL)
    assert (experiment.seed, experiment.seconds, experiment.control.speed) == (0, None, 0.3)
    assert (experiment.rig.cameras.width, experiment.rig.cameras.height) == (1280, 720)
    assert experiment.rig.cameras.baseline == pytest.approx(0.12, abs=1e-12)


finite = st.floats(allow_nan=False, allow_infinity=False)
mounts = st.builds(Mount, xyz=st.tuples(finite, finite, finite), rpy_deg=st.tuples(finite, finite, finite))
points = st.tuples(st.floats(-90, 90), st.floats(-180, 180))
experiments = st.builds(
    Experiment,
    name=st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}", fullmatch=True),
    description=st.text(st.characters(exclude_characters="\r\n", exclude_categories=["Cs"]), max_size=200),
    environment=st.just("park"),
    seed=st.integers(0, 2**63 - 1),
    seconds=st.none() | st.floats(0.001, 86_400),
    route=st.builds(RouteConfig, start=points, waypoints=st.lists(points, min_size=1, max_size=4).map(tuple)),
    control=st.builds(ControlConfig, heading_gain=st.floats(1e-300, 1e300)),
    light=st.builds(LightConfig, sun_azimuth_deg=st.floats(-360, 360)),
    rig=st.builds(
        Rig,
        base_footprint=mounts,
        lidar=st.builds(LidarConfig, mount=mounts, enabled=st.booleans(), columns=st.integers(8, 4096)),
    ),
)


@settings(deadline=None, max_examples=150)
@given(experiments)
def test_whatever_is_allowed_survives_being_written_and_read(experiment: Experiment) -> None:
    assert parse_experiment(dump_experiment(experiment)) == experiment


@settings(deadline=None, max_examples=150)
@given(st.text(max_size=60) | st.text("[]{}:,-&*!|>'\"%@?#\n ab10.e~\t", max_size=40))
def test_any_text_is_read_or_refused_in_one_line(text: str) -> None:
    with pytest.raises(FieldtruthError) as refusal:
        parse_experiment(text, "x.yaml")
    assert str(refusal.value).startswith("x.yaml: ")
    assert "\n" not in str(refusal.value)


def test_overrides_make_a_checked_copy_and_leave_the_original_alone(park: Experiment) -> None:
    before = dump_experiment(park)
    changed = with_overrides(park, seconds=5, seed=7, cameras=False, lidar=False)
    assert (changed.seconds, changed.seed) == (5.0, 7)
    assert not changed.rig.cameras.enabled
    assert not changed.rig.lidar.enabled
    assert dump_experiment(park) == before
    assert with_overrides(park) == park
    assert with_overrides(changed, seed=0, cameras=True).rig.lidar.enabled is False
    with pytest.raises(ConfigurationError, match=r"^seconds is -5; allowed is a number from 0\.001 up to 86400$"):
        with_overrides(park, seconds=-5)


def test_a_number_with_an_exponent_is_a_number_and_a_text_stays_a_text() -> None:
    assert parse_experiment(SMALL + "seconds: 1e1\n").seconds == 10.0
    for text in ("0E0", "1e3", "1.0e+3", "null", "yes", "1:30", "0x1F", "~", "2024-01-01", " a", "#"):
        experiment = parse_experiment(SMALL).model_copy(update={"description": text})
        assert parse_experiment(dump_experiment(experiment)).description == text


def test_a_file_is_read_by_its_path(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(SMALL)
    assert load_experiment(path) == load_experiment(str(path)) == parse_experiment(SMALL)


def test_a_name_wins_over_a_file_of_that_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("park_1").write_text(SMALL)
    Path("mine").write_text(SMALL)
    assert load_experiment("park_1").name == "park_1"
    assert load_experiment("./park_1").name == "tiny"
    assert load_experiment("mine").name == "tiny"


def test_an_unknown_experiment_lists_those_that_exist_nearest_first() -> None:
    with pytest.raises(UnknownNameError, match=r"^no experiment 'park-2'; there is: park_2, park_1"):
        load_experiment("park-2")


def replaced(dump: str, key: str, value: str) -> str:
    """Set the first line of a dump that starts with ``key``."""
    lines = dump.splitlines()
    row = next(i for i, line in enumerate(lines) if line.strip().startswith(f"{key}:"))
    indent = len(lines[row]) - len(lines[row].lstrip())
    lines[row] = " " * indent + value
    return "\n".join(lines)


BAD_VALUES = [
    ("seed", "seed: -1", r"seed is -1; allowed is a whole number from 0 below 9223372036854775808"),
    ("seed", "seed: true", r"seed is True; allowed is a whole number from 0"),
    ("seed", "seed: 1.5", r"seed is 1\.5; allowed is a whole number"),
    ("seconds", "seconds: 0", r"seconds is 0; allowed is a number from 0\.001 up to 86400"),
    ("seconds", "seconds: -.inf", r"seconds is -inf; allowed is a number"),
    ("seconds", "seconds: soon", r"seconds is 'soon'; allowed is a number"),
    ("name", "name: ../x", r"name is '\.\./x'; allowed is a word of at most 64 letters, digits, - and _"),
    ("start", "start: [91, 0]", r"route\.start\[0\] is 91; allowed is a number from -90 up to 90"),
    ("start", "start: [0]", r"route\.start\[1\] is missing; needed is a number from -180 up to 180"),
    ("start", "start: [0, 1, 2]", r"route\.start is \[0, 1, 2\]; allowed is \[latitude, longitude\] in degrees"),
    ("speed", "speed: .nan", r"control\.speed is nan; allowed is a number above 0 up to 1"),
    ("speed", "speed: yes", r"control\.speed is True; allowed is a number"),
    ("columns", "columns: 7", r"rig\.lidar\.columns is 7; allowed is a whole number from 8 up to 4096"),
    ("width", "width: 1281", r"rig\.cameras\.width is 1281; allowed is .* in steps of 8"),
    ("spinning", "spinning: 1", r"rig\.lidar\.spinning is 1; allowed is true or false"),
    ("min_range", "min_range: 120", r"rig\.lidar: min_range 120\.0 must be below max_range 120\.0"),
    ("rings", "ring: 64", r"no key 'rig\.lidar\.ring'; there is: rig\.lidar\.rings, "),
    ("name", "nme: park_1", r"no key 'nme'; there is: name, .* \(and 1 more\)"),
    ("light", "lights:", r"no key 'lights'; there is: light, "),
]


@pytest.mark.parametrize(("key", "line", "complaint"), BAD_VALUES, ids=[line for _, line, _ in BAD_VALUES])
def test_a_bad_value_is_named_with_what_is_allowed(park: Experiment, key: str, line: str, complaint: str) -> None:
    with pytest.raises(ConfigurationError, match=rf"^run\.yaml: {complaint}") as refusal:
        parse_experiment(replaced(dump_experiment(park), key, line), "run.yaml")
    assert "\n" not in str(refusal.value)


def test_a_number_where_a_mapping_belongs_names_its_keys() -> None:
    with pytest.raises(
        ConfigurationError, match=r"^rig\.gnss is 4; allowed is a mapping with the keys rate_hz, mount$"
    ):
        parse_experiment(SMALL + "rig: {gnss: 4}\n")


def test_a_pair_that_no_baseline_describes_is_refused() -> None:
    left = Mount(xyz=(0.15, 0.06, 0.72), rpy_deg=(0, 90, 0))
    for right in (
        Mount(xyz=(0.15, 0.18, 0.72), rpy_deg=(0, 90, 0)),  # the right one on the left
        Mount(xyz=(0.15, -0.06, 0.73), rpy_deg=(0, 90, 0)),  # higher
        Mount(xyz=(0.15, -0.06, 0.72), rpy_deg=(0, 90, 5)),  # looking elsewhere
    ):
        with pytest.raises(ValueError, match="must look the same way"):
            CameraConfig(left=left, right=right)
    turned = (10, 80, 30)
    across = Mount(xyz=(0, 0, 0), rpy_deg=turned).base_from_sensor[:3, 1] * -0.2
    right = Mount(xyz=(float(across[0]), float(across[1]), float(across[2])), rpy_deg=turned)
    assert CameraConfig(left=Mount(xyz=(0, 0, 0), rpy_deg=turned), right=right).baseline == pytest.approx(
        0.2, abs=1e-12
    )


BROKEN_TEXTS = [
    ("name: [a\nseed: 0\n", r"run\.yaml: broken YAML at line 2, column 5: "),
    ("seed: 1\nname: a\nseed: 2\n", r"run\.yaml: broken YAML at line 3, column 1: key 'seed' stands twice"),
    ("name: 2024-13-45\n", r"run\.yaml: broken YAML: month must be in 1\.\.12"),
    ("name: a\nenvironment: \x07\n", r"run\.yaml: broken YAML at line 2: special characters are not allowed"),
    (
        "name: !!python/object/apply:os.system [true]\n",
        r"run\.yaml: broken YAML at line 1, column 7: could not determine",
    ),
    ("[" * 5000, r"run\.yaml: broken YAML: nested too deeply"),
    ("", r"run\.yaml: an experiment is a mapping"),
    ("- name\n", r"run\.yaml: an experiment is a mapping"),
    ("1: 2\n", r"run\.yaml: no key '1'; there is: "),
    ("fieldtruth: 99.0.0\nwhatever: 1\n", r"run\.yaml: written by fieldtruth 99\.0\.0, this is .*; run: pip install"),
    ("fieldtruth: latest\n", r"run\.yaml: fieldtruth is 'latest'; allowed is a version such as"),
]


@pytest.mark.parametrize(("text", "complaint"), BROKEN_TEXTS, ids=[text[:20] for text, _ in BROKEN_TEXTS])
def test_a_broken_file_says_where(text: str, complaint: str) -> None:
    with pytest.raises(ConfigurationError, match=f"^{complaint}") as refusal:
        parse_experiment(text, "run.yaml")
    assert "\n" not in str(refusal.value)


def test_a_file_of_this_or_an_older_version_is_read() -> None:
    for version in (fieldtruth.__version__, "0.0.1", "0.0"):
        assert parse_experiment(f"fieldtruth: {version}\n{SMALL}") == parse_experiment(SMALL)


def test_what_cannot_be_read_is_said(tmp_path: Path) -> None:
    binary = tmp_path / "bag.yaml"
    binary.write_bytes(b"#ROSBAG V2.0\n\xff\x00")
    huge = tmp_path / "huge.yaml"
    with huge.open("wb") as file:
        file.truncate(1 << 30)
    cases: list[tuple[Any, str]] = [
        (tmp_path / "none.yaml", r"cannot read .*none\.yaml: No such file or directory"),
        (f"{tmp_path}/", "is a folder; needed is the experiment's YAML file in it"),
        (binary, r"bag\.yaml: broken YAML: byte 13 is no UTF-8"),
        (huge, "no experiment: larger than 4 MiB"),
        ("a\0/b", "cannot read 'a.x00/b'"),
    ]
    for path, complaint in cases:
        with pytest.raises(ConfigurationError, match=complaint):
            load_experiment(path)
