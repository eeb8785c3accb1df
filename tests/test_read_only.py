# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The package works where it can write nothing but its results: in a read-only container, as a user without a home."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from small_park import in_small_park

import fieldtruth
from fieldtruth.core.cache import cache_folder
from fieldtruth.core.cache_folder import keep_temporary_files_in_memory
from fieldtruth.experiment.files import dump_experiment
from fieldtruth.experiment.rig import paper_rig
from fieldtruth.sensors.camera.config import StereoConfig

USE = """
import importlib, pkgutil
import fieldtruth
names = [info.name for info in pkgutil.walk_packages(fieldtruth.__path__, "fieldtruth.")]
for name in names:
    if not name.endswith("__main__"):
        importlib.import_module(name)
from fieldtruth.kernels.tyre import dot
print(len(names), dot((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)))
"""
COMMANDS = """
import sys
from fieldtruth.cli import main
for command in sys.argv[1:]:
    assert main(command.split()) == 0, command
"""


@pytest.fixture
def read_only(tmp_path: Path) -> dict[str, str]:
    """Environment variables of a package whose folder, cache and home cannot be written, by root neither."""
    shutil.copytree(
        Path(fieldtruth.__file__).parent, tmp_path / "fieldtruth", ignore=shutil.ignore_patterns("__pycache__")
    )
    for folder in [tmp_path / "fieldtruth", *(p for p in (tmp_path / "fieldtruth").rglob("*") if p.is_dir())]:
        (folder / "__pycache__").write_text("a file, where Python and Numba need a folder")
    nowhere = str(tmp_path / "fieldtruth" / "__pycache__" / "folder")
    hidden = dict.fromkeys(("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "NUMBA_CACHE_DIR"), nowhere)
    return os.environ | hidden | {"PYTHONPATH": str(tmp_path)}


def run(read_only: dict[str, str], folder: Path, *arguments: str) -> str:
    folder.mkdir(exist_ok=True)
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=read_only, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_every_module_is_imported_and_kernels_run(read_only: dict[str, str], tmp_path: Path) -> None:
    count, product = run(read_only, tmp_path / "work", "-c", USE).split()
    assert int(count) == len(list(Path(fieldtruth.__file__).parent.rglob("*.py"))) - 1  # without fieldtruth itself
    assert float(product) == 32.0
    assert not list((tmp_path / "work").iterdir())


@pytest.mark.slow
def test_runs_are_made_checked_and_annotated(read_only: dict[str, str], tmp_path: Path) -> None:
    """Three commands in one process, which compiles for itself."""
    work = tmp_path / "work"
    rig = paper_rig(cameras=StereoConfig(enabled=False))  # whose kernels take a minute to compile
    experiment = tmp_path / "small.yaml"
    experiment.write_text(dump_experiment(in_small_park(seconds=0.1, rig=rig)))
    commands = [
        f"generate {experiment} --out run",
        "validate run/small",
        "annotate run/small/small.bag --environment park --experiment run/small/experiment.yaml --lidar --out new.bag",
    ]
    assert " 0 failed" in run(read_only, work, "-c", COMMANDS, *commands)
    assert {path.name for path in work.iterdir()} == {"run", "new.bag"}


def test_a_user_without_a_home_has_no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless(*_: object) -> Path:
        raise RuntimeError("could not determine the home directory")

    monkeypatch.setattr("fieldtruth.core.cache.user_cache_path", homeless)
    assert not cache_folder().parent.is_dir()
    monkeypatch.setattr("fieldtruth.core.cache.user_cache_path", lambda *_: Path("~/.cache"))
    assert cache_folder().is_absolute()


def test_temporary_files_lie_in_memory_where_there_is_no_other_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_folder() -> str:
        raise FileNotFoundError("No usable temporary directory found")

    monkeypatch.setattr(tempfile, "tempdir", None)
    keep_temporary_files_in_memory()
    assert tempfile.tempdir != "/dev/shm"
    monkeypatch.setattr(tempfile, "gettempdir", no_folder)
    keep_temporary_files_in_memory()
    assert tempfile.tempdir == "/dev/shm"
