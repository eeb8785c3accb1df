# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Additions of a package (entry points) and of a user's folder (FIELDTRUTH_PATH) are found by new processes."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from fieldtruth.core.classes import CLASSES
from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.core.registry import VARIABLE, Registry

ROOT = Path(__file__).parents[2]
FORMAT = '''
"""Counts of clouds."""
from fieldtruth.exporters import Format
FORMAT = Format("", "_count.txt", "number of messages", relabels=True)
def write(runs, target, options):
    target.write_text(f"{options.label_map.name} {sum(1 for _ in runs)}\\n")
'''
ENTRIES = """[fieldtruth.environments]
meadow = acme.meadow
[fieldtruth.robots]
rabbit = acme:ROBOT
[fieldtruth.sensors.lidar]
tiny = acme:LIDAR
[fieldtruth.label_maps]
two = acme:LABELS
[fieldtruth.formats]
count = acme.count
"""
EXPERIMENT = {
    "name": "acme_1",
    "environment": "meadow",
    "layout": {"bushes": 2, "grass": 0.5},
    "route": {"metres": {"start": [-20.0, 0.0], "waypoints": [[-10.0, 1.5]]}},
    "rig": {
        "robot": {"model": "rabbit"},
        "sensors": [{"kind": "lidar", "name": "top", "model": "tiny", "mount": {"xyz": [0.0, 0.0, 0.6]}}],
    },
}


def write_parts(folder: Path, package: str) -> None:
    """Write all additions below a folder, in the layout of FIELDTRUTH_PATH."""
    models = ROOT / "src/fieldtruth/experiment/models"
    robot = (models / "robot/jackal.yaml").read_text(encoding="utf-8").replace("Clearpath Jackal", "Rabbit")
    lidar = (models / "lidar/vlp_16.yaml").read_text(encoding="utf-8").replace("Velodyne VLP-16", "Tiny")
    classes = {0: {"name": "void", "rgb": [0, 0, 0]}, 1: {"name": "solid", "rgb": [9, 9, 9]}}
    labels = yaml.safe_dump({"classes": classes, "ids": {row.name: int(row.name != "void") for row in CLASSES}})
    parts = {"robots/rabbit.yaml": robot, "sensors/lidar/tiny.yaml": lidar, "label_maps/two.yaml": labels}
    for name, text in {**parts, "formats/count.py": FORMAT}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    page = (ROOT / "docs/extending.md").read_text(encoding="utf-8")
    blocks = dict(re.findall(r'```python title="meadow/(\w+\.py)"\n(.*?)```', page, re.DOTALL))
    meadow = folder / "environments" / "meadow"
    meadow.mkdir(parents=True)
    for name, text in {**blocks, "__init__.py": '"""Meadow: gentle hills."""\n'}.items():
        (meadow / name).write_text(text.replace("from meadow", f"from {package}meadow"), encoding="utf-8")


def as_package(folder: Path) -> dict[str, str]:
    """Make a package with entry points, and return the environment in which it is installed."""
    write_parts(folder / "acme", "acme.")
    (folder / "acme/environments/meadow").rename(folder / "acme/meadow")
    (folder / "acme/formats/count.py").rename(folder / "acme/count.py")
    paths = {"ROBOT": "robots/rabbit.yaml", "LIDAR": "sensors/lidar/tiny.yaml", "LABELS": "label_maps/two.yaml"}
    lines = [f"{name} = Path(__file__).parent / {path!r}" for name, path in paths.items()]
    (folder / "acme/__init__.py").write_text("\n".join(["from pathlib import Path", *lines, ""]))
    info = folder / "acme-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRIES)
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])}


def as_folder(folder: Path) -> dict[str, str]:
    """Make a user's folder, and return the environment that names it."""
    write_parts(folder, "")
    return os.environ | {VARIABLE: str(folder)}


Adding = Callable[[Path], dict[str, str]]
ADDINGS = pytest.mark.parametrize("adding", [pytest.param(as_package, marks=pytest.mark.slow), as_folder])


LISTS = """
from fieldtruth.cli import main
for what in ("environments", "robots", "sensors", "label-maps", "formats"):
    assert main(["list", what]) == 0
    print("----")
"""


def fieldtruth(env: dict[str, str], cwd: Path, *arguments: str) -> str:
    """Run the command line in a new process, and return what it prints."""
    return python(env, cwd, "-m", "fieldtruth.cli", *arguments)


def python(env: dict[str, str], cwd: Path, *arguments: str) -> str:
    command = [sys.executable, *arguments]
    ended = subprocess.run(command, env=env, cwd=cwd, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


@ADDINGS
def test_additions_are_listed(adding: Adding, tmp_path: Path) -> None:
    env = adding(tmp_path)
    environments, robots, sensors, maps, formats, _ = python(env, tmp_path, "-c", LISTS).split("----\n")
    assert re.search(r"^  meadow +Meadow: gentle hills$", environments, re.MULTILINE)
    assert re.search(r"^  rabbit +Rabbit: 18 kg", robots, re.MULTILINE)
    assert re.search(r"^  tiny +Tiny \(Puck\)", sensors, re.MULTILINE)
    assert re.search(r"^  two +2 classes$", maps, re.MULTILINE)
    assert re.search(r"^  count +number of messages$", formats, re.MULTILINE)


@pytest.mark.slow
@ADDINGS
def test_additions_are_used(adding: Adding, tmp_path: Path) -> None:
    env = adding(tmp_path)
    (tmp_path / "acme_1.yaml").write_text(yaml.safe_dump(EXPERIMENT))
    fieldtruth(env, tmp_path, "generate", "acme_1.yaml", "--seconds", "0.1", "--out", "data")
    assert "FAIL" not in fieldtruth(env, tmp_path, "validate", "data/acme_1")
    fieldtruth(env, tmp_path, "export", "data/acme_1", "--to", "count", "--label-map", "two", "--out", "count.txt")
    assert (tmp_path / "count.txt").read_text() == "two 1\n"


def names() -> Registry[str]:
    return Registry("word", "words", ".txt", lambda name, path: path.read_text(), {"one": "1"})


def test_a_file_that_is_dropped_in_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "words").mkdir()
    (tmp_path / "words/two.txt").write_text("2")
    assert list(names()) == ["one"]
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    words = names()
    assert dict(words) == {"one": "1", "two": "2"}
    words["three"] = "3"
    assert words.find("three") == "3"
    with pytest.raises(
        UnknownNameError, match=r"^unknown word 'tow'; did you mean 'two'\? Available: one, three, two$"
    ):
        words.find("tow")


def test_a_name_that_is_taken_and_a_folder_that_is_missing_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "words").mkdir()
    (tmp_path / "words/one.txt").write_text("2")
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    with pytest.raises(ConfigurationError, match=r"one\.txt: another word has the name 'one' already$"):
        list(names())
    monkeypatch.setenv(VARIABLE, str(tmp_path / "none"))
    with pytest.raises(ConfigurationError, match=r"^FIELDTRUTH_PATH has '.*none', which is not a folder$"):
        list(names())


def test_a_thing_that_cannot_be_read_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "words/bad.txt").mkdir(parents=True)
    (tmp_path / "words/worse.txt").write_bytes(b"\xff")
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    assert list(names()) == ["one", "worse"]
    with pytest.raises(ConfigurationError, match=r"^.*worse\.txt: cannot use word 'worse': UnicodeDecodeError: .*$"):
        names().find("worse")
