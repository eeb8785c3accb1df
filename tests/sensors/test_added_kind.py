# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A kind of sensor of another package, the sonar of docs/extending.md, on the command line in processes of its own."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_park import LAYOUT, ROUTE

from fieldtruth.bag.reader import open_bag
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.sensor_config import load_added_kinds

ROOT = Path(__file__).parents[2]
DOWN = {"xyz": [0.6, 0.0, 0.5], "rpy_deg": [0.0, 90.0, 0.0]}
SONAR = f"""\
name: heard
environment: park
layout: {LAYOUT}
seconds: 0.2
route: {ROUTE}
rig:
  sensors:
    - {{kind: sonar, name: below, mount: {DOWN}}}
    - {{kind: sonar, name: noisy, mount: {DOWN}, signal: {{noise_m: 0.1}}}}
    - {{kind: imu}}
    - {{kind: gnss}}
"""
INTERRUPTED = """\
import sys
from fieldtruth.cli import main
from fieldtruth.record.folder import RunFolder

def interrupt(*args):
    raise KeyboardInterrupt

RunFolder.finish = interrupt
sys.exit(main(sys.argv[1:]))
"""


def module() -> str:
    """Source of the sonar."""
    page = (ROOT / "docs/extending.md").read_text("utf-8")
    return str(re.findall(r'```python title="sonar.py"\n(.*?)```', page, flags=re.S)[0])


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder with an installed package of one module and an entry point, and an experiment."""
    info = tmp_path / "installed" / "sonar-1.0.dist-info"
    info.mkdir(parents=True)
    (tmp_path / "installed" / "sonar.py").write_text(module())
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: sonar\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[fieldtruth.sensors]\nsonar = sonar\n")
    (tmp_path / "heard.yaml").write_text(SONAR)
    return tmp_path


def run(folder: Path, *arguments: str, code: int = 0, script: str = "", **variables: str) -> str:
    """Run the command line in a new process and return what it prints."""
    path = os.pathsep.join([str(folder / "installed"), str(ROOT / "src")])
    start = ["-c", script] if script else ["-m", "fieldtruth.cli"]
    environment = {**os.environ, "PYTHONPATH": path, **variables}
    done = subprocess.run(
        [sys.executable, *start, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == code, done.stderr
    return done.stdout + done.stderr


def heard(bag: Path, topic: str) -> list[float]:
    """Ranges of a sonar."""
    with open_bag(bag) as stored:
        decode: Any = stored.types().deserialize_ros1
        return [decode(raw.data, raw.msgtype).range for raw in stored.messages([topic])]


def test_the_command_line_lists_it_from_an_entry_point_and_from_a_folder(package: Path, tmp_path: Path) -> None:
    assert re.search(r"sonar +A sonar, which listens along the x axis of its frame\.", run(package, "list", "sensors"))
    (tmp_path / "own" / "sensors").mkdir(parents=True)
    (tmp_path / "own" / "sensors" / "listener.py").write_text(module().replace('"sonar"', '"listener"'))
    listed = run(tmp_path / "own", "list", "sensors", FIELDTRUTH_PATH=str(tmp_path / "own"))
    assert re.search(r"listener +A sonar", listed)
    assert "sonar  " not in listed


def test_a_module_that_cannot_be_imported_is_an_error_of_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sensors").mkdir()
    (tmp_path / "sensors" / "broken.py").write_text("import nothing_of_this_name\n")
    monkeypatch.setenv("FIELDTRUTH_PATH", str(tmp_path))
    with pytest.raises(
        ConfigurationError, match=r"broken\.py: cannot use module of sensors 'broken': ModuleNotFoundError: No module"
    ):
        load_added_kinds()


@pytest.fixture
def recorded(package: Path) -> Path:
    """The package's folder with a run of the experiment."""
    run(package, "generate", "heard.yaml")
    return package


@pytest.mark.slow  # five processes
def test_all_commands_find_it_in_processes_of_their_own(recorded: Path) -> None:
    ranges, noisy = (heard(recorded / "data/heard/heard.bag", topic) for topic in ("/below", "/noisy"))
    assert len(ranges) == len(noisy) == 4
    np.testing.assert_allclose(ranges, 0.5 + 0.132, atol=0.15)
    assert np.abs(np.array(noisy) - ranges).max() > 0.02
    assert re.search(r"pass +other sensors +8 readings", run(recorded, "validate", "data/heard"))
    rig = SONAR.replace("below", "above").replace("noisy", "beside")
    (recorded / "more.yaml").write_text(rig)
    where = ("--environment", "park", "--experiment", "more.yaml")
    run(recorded, "annotate", "data/heard/heard.bag", *where, "--out", "more.bag")
    with open_bag(recorded / "more.bag") as stored:
        assert stored.counts["/above"] == 4
        assert stored.counts["/below"] == 4
    run(recorded, "export", "--to", "mcap", "data/heard")
    stored_experiment = (
        recorded / "data/heard/experiment.yaml"
    )  # of a park without bushes: no aerial view, which is slow
    stored_experiment.write_text(stored_experiment.read_text().replace("bushes: 2", "bushes: 0"))
    run(recorded, "report", "data/heard")
    assert "/below" in (recorded / "data/heard/heard_report.html").read_text("utf-8")


@pytest.mark.slow
def test_interrupted_runs_and_those_of_a_cluster_have_its_readings(package: Path) -> None:
    run(package, "generate", "heard.yaml", code=130, script=INTERRUPTED)
    bag = package / "data" / "heard" / "heard.bag"
    assert not bag.exists()
    run(package, "generate", "heard.yaml")  # resumes
    assert len(heard(bag, "/below")) == 4
    run(package, "export", "--to", "files", "data/heard")
    run(package, "generate", "heard.yaml", "--out", "clustered", "--local-cluster", "1")
    assert (package / "clustered" / "heard" / "heard.bag").read_bytes() == bag.read_bytes()


@pytest.mark.slow
def test_a_kind_that_gazebo_cannot_hold_is_named(package: Path) -> None:
    said = run(package, "gazebo", "park", "--flavour", "gz", "--experiment", "heard.yaml", "--out", "gz", code=2)
    line = "rig.sensors: below is of kind sonar, which a Gazebo package cannot hold; give enabled: false"
    assert said == f"error: {line}\n"
