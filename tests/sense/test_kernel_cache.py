# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels are reused only while all their sources are unchanged."""

import importlib
import os
import pkgutil
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from numba.core.dispatcher import Dispatcher

import fieldtruth

CLASSIFY_A_MISS = """
import numpy as np
from fieldtruth.kernels.packets import Grid, HitTable, classify
none = [np.zeros(0, kind) for kind in (np.int32, np.uint32, np.int32, np.int64, np.uint8)]
table = HitTable(*none, Grid(np.ones((2, 2), np.float32), 0.0, 0.0, 1.0))
print(*classify(table, -1, 0, 0.0, 0.0))
"""


def classify_a_miss(source: Path, cache: Path) -> str:
    environment = os.environ | {"PYTHONPATH": str(source), "XDG_CACHE_HOME": str(cache)}
    command = [sys.executable, "-c", CLASSIFY_A_MISS]
    return subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout.strip()


@pytest.mark.slow  # three processes
def test_kernels_are_shared_by_installations_and_edited_class_ids_reach_them(tmp_path: Path) -> None:
    first, source = tmp_path / "first", tmp_path / "src"
    shutil.copytree(Path(fieldtruth.__file__).parent, first / "fieldtruth")
    assert classify_a_miss(first, tmp_path) == "15 0"
    kernels = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.kernel")}
    assert kernels
    first.rename(source)
    assert classify_a_miss(source, tmp_path) == "15 0"
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.kernel")} == kernels
    classes = source / "fieldtruth" / "core" / "classes.py"
    classes.write_text(classes.read_text(encoding="utf-8").replace("SKY = 15", "SKY = 16"), encoding="utf-8")
    assert classify_a_miss(source, tmp_path) == "16 0"


def test_no_kernel_leaves_rounding_to_the_compiler() -> None:
    found = (info.name for info in pkgutil.walk_packages(fieldtruth.__path__, "fieldtruth."))
    names = [name for name in found if not name.endswith("__main__")]
    kernels = [f for name in names for f in vars(importlib.import_module(name)).values() if isinstance(f, Dispatcher)]
    assert len(kernels) > 100
    options = [f.targetoptions for f in kernels]
    assert not any(each.get("fastmath") for each in options)
