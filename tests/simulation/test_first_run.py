# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Kernels compile in a second process that ends with the first, where that is of use."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numba
import pytest

from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment
from fieldtruth.render.bake import BakedScene, lit_scene
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.simulation import first_run, stepped

BEGIN = """
import sys, time
from fieldtruth.core import parallel
from fieldtruth.experiment.files import load_experiment
from fieldtruth.simulation import first_run
from fieldtruth.sensors.kind import SensorWorld
first_run.cpu_count = lambda: 2
for _ in range(2):
    first_run.compile_beside(load_experiment("park_1"))
print(*(process.pid for process in first_run._processes), flush=True)
time.sleep(float(sys.argv[1]))
"""


def begin(cache: Path, wait_s: float) -> "subprocess.Popen[str]":
    paths = [str(Path(first_run.__file__).parents[2]), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {"XDG_CACHE_HOME": str(cache), "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, "-c", BEGIN, str(wait_s)]
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)


def lives(pid: int) -> bool:
    """Return whether a process runs; one that has ended without being waited for does not."""
    status = Path(f"/proc/{pid}/stat")
    return status.exists() and status.read_text().rpartition(")")[2].split()[0] != "Z"


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs Linux's /proc")
@pytest.mark.parametrize("killed", [True, False], ids=["killed", "ended"])
def test_the_second_process_ends_with_the_first(tmp_path: Path, killed: bool) -> None:
    first = begin(tmp_path, 60.0 if killed else 0.0)
    assert first.stdout is not None
    (second,) = map(int, first.stdout.readline().split())
    if killed:
        assert lives(second)
        first.send_signal(signal.SIGKILL)
    first.wait()
    end = time.monotonic() + 120.0
    while lives(second):
        assert time.monotonic() < end
        time.sleep(0.1)


def test_there_is_no_second_process_where_nothing_can_be_kept(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    first = begin(tmp_path / "file" / "cache", 0.0)
    assert first.communicate()[0] == "\n"
    assert first.returncode == 0


def test_a_box_needs_the_kernels_of_a_real_world(park: SensorWorld, monkeypatch: pytest.MonkeyPatch) -> None:
    found = list[BakedScene]()

    def lit(*given: Any, **options: Any) -> BakedScene:
        found.append(lit_scene(*given, **options))
        return found[-1]

    monkeypatch.setattr(first_run, "lit_scene", lit)
    first_run.compile_kernels(load_experiment("park_1"))
    typeof: Any = numba.typeof
    assert typeof(found[0].shading) == typeof(park.baked.shading)


def test_kernels_of_cameras_that_are_not_read_are_not_compiled(
    park: SensorWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = list[Experiment]()
    monkeypatch.setattr(stepped, "compile_beside", given.append)
    for sensors in (["lidar"], ["stereo/left"]):
        assert stepped.Simulation("park_1", world=park.world, sensors=sensors).world is park.world
    assert [[each.name for each in experiment.rig.in_order()] for experiment in given] == [["lidar"], ["stereo"]]
