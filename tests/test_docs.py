# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Documents are correct: tables against the code, snippets against the examples, links against the files."""

import itertools
import re
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from pydantic import BaseModel

from fieldtruth import exporters
from fieldtruth.cli import main
from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.experiment.config import Experiment, metres_from_route
from fieldtruth.experiment.fields import Mount, condition_at, models_of
from fieldtruth.experiment.files import load_experiment, parse_experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import FORMS, KINDS, MountedConfig, SensorConfig
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.gnss.config import GnssConfig
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.kind import SENSORS, SensorWorld
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig
from fieldtruth.validation.runner import validate
from fieldtruth.world.build import layout_model
from fieldtruth.world.classes import OwnClass
from fieldtruth.world.environments import ENVIRONMENTS, PAPER
from fieldtruth.world.environments.layout import GroundConfig
from fieldtruth.world.environments.site.config import Config as Site
from fieldtruth.world.environments.site.config import ElevationFile
from fieldtruth.world.model import World
from fieldtruth.world.objects.config import ObjectConfig, ScatterConfig
from fieldtruth.world.plants import TREES

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXPERIMENTS = (ROOT / "docs/experiments.md").read_text(encoding="utf-8")
RIG = (ROOT / "docs/rig.md").read_text(encoding="utf-8")
OBJECTS = (ROOT / "docs/objects.md").read_text(encoding="utf-8")
SITES = (ROOT / "docs/sites.md").read_text(encoding="utf-8")
PLACES = (ROOT / "docs/environments.md").read_text(encoding="utf-8")
DOCUMENTS = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
TUTORIALS = sorted((ROOT / "docs/tutorials").glob("*.md"))


def table_rows(text: str) -> Iterator[list[str]]:
    """Cells of every table row."""
    for line in text.splitlines():
        if line.startswith("|") and not line.startswith("|--"):
            yield [cell.strip() for cell in line.strip("|").split("|")]


def expanded(text: str) -> list[str]:
    """Expand braces as a shell does: /{a,b}_{c,d} is four names."""
    parts = [part[1:-1].split(",") if part.startswith("{") else [part] for part in re.split(r"(\{[^}]*\})", text)]
    return ["".join(choice) for choice in itertools.product(*parts)]


def configuration_keys(model: type[BaseModel], prefix: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Every key of a configuration that holds a value; a mount is one value."""
    for name, field in model.model_fields.items():
        homes = [home for home in models_of(field.annotation) if home is not Mount]
        for home in homes:
            yield from configuration_keys(home, (*prefix, name))
        if not homes:
            yield (*prefix, name)


def default_of(key: tuple[str, ...]) -> object:
    """Value in an experiment with only the required keys."""
    route, track = "route: {start: [49.9, 8.9], waypoints: [[49.9001, 8.9]]}", "drive: {track: a.csv}"
    windy = f"{route}, wind: {{speed_m_s: 5}}"
    motion = {"drive": track, "frames": "frames: {count: 1}", "wind": windy}.get(key[0], route)
    text = f"{{name: a, environment: park, {motion}}}"
    value: object = parse_experiment(text).model_dump(mode="json")
    for step in key:
        assert isinstance(value, dict)
        value = value[step]
    return value


def test_the_reference_names_every_value_with_its_default_and_what_is_allowed() -> None:
    described = {cells[0].strip("`"): cells for cells in table_rows(EXPERIMENTS) if cells[0].startswith("`")}
    keys = list(configuration_keys(Experiment))
    assert [".".join(key) for key in keys] == sorted(described, key=[".".join(k) for k in keys].index)
    for key in keys:
        _, default, allowed, meaning = described[".".join(key)]
        if default not in ("(required)", "(the paper's)"):
            assert yaml.safe_load(default.strip("`")) == default_of(key), key
        assert allowed in (condition_at(Experiment, key), "a mount"), key
        assert meaning


def test_the_page_on_sensors_names_every_value_with_its_default_and_what_is_allowed() -> None:
    """Keys of every sensor are in one table, those of a kind in another below its heading."""
    common = set(MountedConfig.model_fields)
    every = {cells[0].strip("`"): cells[1] for cells in table_rows(section(RIG, "Every sensor"))}
    paper = {cells[0].strip("`"): cells[1:] for cells in table_rows(section(RIG, "Every sensor")) if len(cells) == 6}
    for heading, config in (
        ("Cameras", StereoConfig),
        ("LiDARs", LidarConfig),
        ("IMU", ImuConfig),
        ("GNSS receiver", GnssConfig),
        ("Wheel odometry", WheelOdometryConfig),
    ):
        default = config().model_dump(mode="json")
        described = {cells[0].strip("`"): cells for cells in table_rows(section(RIG, heading)) if cells[0] != "key"}
        keys = [".".join(key) for key in configuration_keys(config) if key[0] not in common]
        assert sorted(described) == sorted(keys), heading
        for key, (_, written, allowed, meaning) in described.items():
            value: object = default
            for step in key.split("."):
                value = value[step]  # type: ignore[index]
            assert yaml.safe_load(written.strip("`")) == value, key
            assert allowed == condition_at(config, key.split(".")), key
            assert meaning
        name, topic, frame, rate, _ = (cell.strip("`") for cell in paper[default["kind"]])
        assert (name, topic, frame or None) == (default["name"], default["topic"], default.get("frame"))
        assert rate == f"{default['rate_hz']:g} Hz"
    assert every["signal"] == FORMS
    for key in common - {"kind", "mount", "signal"}:
        assert every[key] == condition_at(MountedConfig, [key]), key


def test_the_forms_of_a_rig_are_the_same() -> None:
    short, listed = re.findall(r"```\n(rig:.*?)```", section(RIG, "The short form"), flags=re.S)
    assert Rig.model_validate(yaml.safe_load(short)["rig"]) == Rig.model_validate(yaml.safe_load(listed)["rig"])
    [example] = re.findall(r"```yaml\n(.*?)```", RIG, flags=re.S)
    assert len(parse_experiment(example).rig.imagers) == 4


def section(page: str, heading: str) -> str:
    """Text below a heading of the second level, up to the next."""
    return page.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]


def test_the_example_of_the_reference_is_an_experiment() -> None:
    [text] = re.findall(r"```yaml\n(.*?)```", EXPERIMENTS, flags=re.S)
    experiment = parse_experiment(text)
    assert (experiment.seed, experiment.rig.lidar.columns, experiment.rig.stereo.enabled) == (7, 1024, False)


@pytest.mark.parametrize("name", PAPER)
def test_the_layout_of_each_environment_is_described(name: str) -> None:
    own, common = (
        {cells[0].strip("`"): cells for cells in table_rows(PLACES.partition(f"\n{heading}\n")[2].partition("\n#")[0])}
        for heading in (f"### {name.capitalize()}", "## Keys of all environments")
    )
    config = layout_model(name)
    defaults = config().model_dump(mode="json")
    described = {key: cells for key, cells in (common | own).items() if key != "key"}
    assert list(described) == list(config.model_fields)
    for key, (_, default, allowed, meaning) in described.items():
        count = {"(two)": 2}.get(default)
        assert (yaml.safe_load(default.strip("`")) if count is None else count) == (
            defaults[key] if count is None else len(defaults[key])
        ), key
        assert allowed == condition_at(config, (key,)), key
        assert meaning, key


@pytest.mark.parametrize(
    ("heading", "model"), [("Keys", ObjectConfig), ("Classes", OwnClass), ("Scatter", ScatterConfig)]
)
def test_every_key_of_an_own_object_is_described(heading: str, model: type[BaseModel]) -> None:
    described = {cells[0].strip("`"): cells for cells in table_rows(section(OBJECTS, heading)) if cells[0][0] == "`"}
    assert list(described) == list(model.model_fields)
    for key, (_, default, allowed, meaning) in described.items():
        info = model.model_fields[key]
        if not info.is_required():
            plain = list(info.default) if isinstance(info.default, tuple) else info.default
            assert yaml.safe_load(default.strip("`")) == plain, key
        assert allowed == condition_at(model, (key,)), key
        assert meaning, key


def test_every_key_of_a_site_is_described() -> None:
    rows = [cells for cells in table_rows(section(SITES, "Keys")) if cells[0].startswith("`")]
    own = [key for key in Site.model_fields if key not in GroundConfig.model_fields]
    models = [(Site, key) for key in own] + [(ElevationFile, key) for key in ElevationFile.model_fields]
    assert [cells[0].strip("`") for cells in rows] == [key for _, key in models]
    for (model, key), (_, default, allowed, meaning) in zip(models, rows, strict=True):
        if not model.model_fields[key].is_required():
            assert yaml.safe_load(default.strip("`")) == model.model_fields[key].default, key
        assert allowed == condition_at(model, (key,)), key
        assert meaning, key


def test_the_examples_of_a_site_are_one_and_its_experiment(tmp_path: Path) -> None:
    site, drive = re.findall(r"```yaml\n# (?:.*?)\n(.*?)```", SITES, flags=re.S)
    (tmp_path / "campus.yaml").write_text(site, encoding="utf-8")
    experiment = parse_experiment(drive, "drive.yaml", tmp_path)
    made = Site.model_validate(experiment.layout)
    assert made.elevation is not None
    assert made.elevation.path == tmp_path / "maps/dtm.tif"
    assert np.abs(metres_from_route(experiment.route, experiment.origin)).max() < 75.0  # in the world


def test_the_example_of_own_objects_is_an_experiment() -> None:
    text, *_ = re.findall(r"```yaml\n(.*?)```", OBJECTS, flags=re.S)
    experiment = parse_experiment(text)
    layout_model(experiment.environment).model_validate(experiment.layout)


def test_the_layers_of_each_landscape_are_described() -> None:
    rows = table_rows(PLACES.partition("\n## Further landscapes\n")[2].partition("\n## ")[0])
    described = {cells[0].strip("`"): cells for cells in rows if cells[0].startswith("`")}
    assert sorted(described) == sorted(name for name in ENVIRONMENTS if name not in PAPER)
    common = {*layout_model("park").model_fields, "trails", "trail_width"}
    for name, (_, meaning, objects, plants) in described.items():
        assert meaning
        layers = [
            f"{key}: {field.default}" for key, field in layout_model(name).model_fields.items() if key not in common
        ]
        assert re.findall(r"`([^`]+)`", f"{objects}, {plants}") == layers, name


def test_the_example_of_a_layout_is_an_experiment() -> None:
    text, *_ = re.findall(r"```yaml\n(.*?)```", PLACES, flags=re.S)
    experiment = parse_experiment(text)
    assert layout_model(experiment.environment).model_validate(experiment.layout).model_fields_set == {
        "old_trees",
        "species",
    }


def test_the_readme_lists_the_classes() -> None:
    rows = [cells for cells in table_rows(README.partition("## Classes")[2]) if cells[0].isdigit()]
    listed = {int(c[i]): (c[i + 1], c[i + 2]) for c in rows for i in (0, 4) if c[i]}
    for label, name, rgb in CLASSES:
        if label is not Label.VOID and rgb is not None:
            assert listed[label][0].removesuffix(" (images only)") == name
            assert listed[label][1] == " ".join(map(str, rgb))
    assert len(listed) == len(CLASSES) - 1


def test_the_readme_lists_the_topics_with_types_and_rates() -> None:
    topics = pytest.importorskip("fieldtruth.bag.topics")
    listed: dict[str, tuple[str, str]] = {}
    for names, kind, rate in (c for c in table_rows(README) if c[0].startswith("`/")):
        patterns = re.findall(r"`([^`]+)`", names)
        rates = rate.split(", ") if "," in rate else [rate] * len(patterns)
        for pattern, own_rate in zip(patterns, rates, strict=True):
            listed |= {name: (re.split(r"[:,]", kind)[0], own_rate) for name in expanded(pattern)}
    true = {
        topic.name: (topic.msgtype.replace("/msg/", "/"), f"{topic.rate_hz:g}" if topic.rate_hz else "once")
        for topic in topics.PAPER_TOPICS
    }
    assert {name: (kind.partition(" ")[0], rate) for name, (kind, rate) in listed.items()} == true


def test_the_readmes_script_runs(park: SensorWorld, capsys: pytest.CaptureFixture[str]) -> None:
    """With a short drive in the park's world for each of its two."""
    [snippet] = re.findall(r"```python\n(.*?)```", README, flags=re.S)
    assert snippet in (ROOT / "docs/simulation.md").read_text(encoding="utf-8")
    assert len([line for line in snippet.splitlines() if line]) <= 10
    values = load_experiment("park_1").model_dump() | {"seconds": 0.2}
    values["rig"]["cameras"] = {"width": 32, "height": 24}
    short = f"Experiment.model_validate({values!r}), world=park.world, scene=park.scene"
    for name in ("park_1", "forest_1"):
        assert f'"{name}"' in snippet
        snippet = snippet.replace(f'"{name}"', short)
    exec(compile(snippet.replace("seed=3", "seed=0"), "README.md", "exec"), {"Experiment": Experiment, "park": park})
    lines = capsys.readouterr().out.splitlines()
    assert [line.count("(24, 32, 3)") for line in lines] == [1] * len(lines[:-2]) + [0, 0]
    assert lines[-1].startswith("200000000 [")


@pytest.mark.parametrize(
    "page",
    [pytest.param(p, marks=pytest.mark.slow if p.name == "first-run.md" else ()) for p in TUTORIALS],
    ids=lambda path: path.name,
)
def test_tutorials_can_be_followed(
    page: Path, small_run: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Commands and Python run in order; only the run itself is the small one of these tests."""
    for library in ("torch", "kiss_icp"):
        if f"import {library}" in page.read_text("utf-8") or f"from {library}" in page.read_text("utf-8"):
            pytest.importorskip(library)
    monkeypatch.chdir(tmp_path)
    shutil.copytree(small_run, tmp_path / "data" / small_run.name)
    follow(page)


@pytest.mark.slow
@pytest.mark.usefixtures("in_park")
def test_the_page_on_extending_can_be_followed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    request.addfinalizer(lambda: SENSORS.pop(KINDS.pop("sonar", SensorConfig), None))  # it changes keys
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("fieldtruth.exporters.__path__", [*exporters.__path__, str(tmp_path / "exporters")])
    monkeypatch.setitem(exporters.FORMATS, "wheels", exporters.FORMATS["tum"])  # removed again at the end
    monkeypatch.setitem(ENVIRONMENTS, "meadow", ENVIRONMENTS["park"])
    try:
        names = follow(ROOT / "docs/extending.md")
    finally:
        TREES.remove("rowan")
    world = names["world"]
    assert isinstance(world, World)
    assert sum(name.startswith("hazel") for name in world.object_names) == 5
    sonar: Any = names["sonar"]
    true = sonar.Sonar.truth

    def changed(self: Any, output: Any, at: Any) -> Any:
        found = true(self, output, at)
        return replace(found, range_m=found.range_m + 0.01)

    monkeypatch.setattr(sonar.Sonar, "truth", changed)
    [check] = [check for check in validate(Path("data/park_1")) if check.name == "other sensors"]
    assert check.passed is False
    assert "/altimeter at " in check.text


@pytest.mark.usefixtures("in_park")
def test_the_page_on_tracks_can_be_followed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    follow(ROOT / "docs/tracks.md")
    assert main(["generate", "helix.yaml", "--seconds", "0.1", "--no-cameras"]) == 0
    stored = (tmp_path / "data/helix/track.csv").read_text("utf-8")
    assert stored.startswith("t,x,y,z,qx,qy,qz,qw\n0.000000000,9.0,0.0,12.0,")


def follow(page: Path) -> dict[str, object]:
    """Write the files of a page (blocks with a title), run its commands and its Python in order; return the names."""
    names: dict[str, object] = {"__name__": page.stem}
    blocks = re.findall(r'```(sh|python|yaml)(?: title="([^"]+)")?\n(.*?)```', page.read_text("utf-8"), flags=re.S)
    for kind, title, code in blocks:
        if title:
            Path(title).parent.mkdir(exist_ok=True)
            Path(title).write_text(code, "utf-8")
        elif kind == "python":
            exec(compile(code, str(page), "exec"), names)
        elif kind == "sh":
            for line in filter(None, code.splitlines()):
                program, *arguments = shlex.split(line, comments=True)
                assert program == "fieldtruth"
                assert arguments[0] == "generate" or main(arguments) == 0, line
    return names


def test_links_lead_to_files() -> None:
    missing = []
    for document in DOCUMENTS:
        targets = re.findall(r"\]\(([^)#]+)\)", document.read_text(encoding="utf-8"))
        own = [target for target in targets if not target.startswith("http")]
        missing += [f"{document.name}: {target}" for target in own if not (document.parent / target).exists()]
    assert not missing
