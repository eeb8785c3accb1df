# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The cache key changes with everything that can change a result, and with nothing else."""

import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import fieldtruth
from fieldtruth.core import cache
from fieldtruth.core.cache import cache_key, import_closure

SOURCE = Path(fieldtruth.__file__).parents[1]


@pytest.fixture
def copied_source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the package's source that may be edited, on which ``cache_key`` works."""
    shutil.copytree(SOURCE / "fieldtruth", tmp_path / "fieldtruth", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(cache, "_ROOT", tmp_path)
    cache._sources_digest.cache_clear()
    return tmp_path / "fieldtruth"


def key_after_edit(path: Path, *modules: str) -> str:
    path.write_text(path.read_text() + "\n# edited\n")
    cache._sources_digest.cache_clear()
    return cache_key(modules)


@pytest.mark.parametrize("edited", ["core/classes.py", "kernels/compile.py"])
def test_the_key_of_the_lidar_changes_with_every_module_that_it_imports(copied_source: Path, edited: str) -> None:
    before = cache_key(["fieldtruth.sensors.lidar.sensing"])
    assert key_after_edit(copied_source / edited, "fieldtruth.sensors.lidar.sensing") != before


@pytest.mark.parametrize("edited", ["trees/lime.yaml", "rocks/slab.yaml", "materials/ground.yaml"])
def test_the_key_of_worlds_changes_with_every_species_rock_type_and_material(copied_source: Path, edited: str) -> None:
    before = cache_key(["fieldtruth.world.environments.layered.build"])
    assert (
        key_after_edit(copied_source / "world" / "data" / edited, "fieldtruth.world.environments.layered.build")
        != before
    )


@pytest.mark.parametrize("edited", ["report/card.py", "cli/__init__.py", "validation/__init__.py"])
def test_the_key_of_the_lidar_does_not_change_with_other_modules(copied_source: Path, edited: str) -> None:
    before = cache_key(["fieldtruth.sensors.lidar.sensing"])
    assert key_after_edit(copied_source / edited, "fieldtruth.sensors.lidar.sensing") == before


def write(folder: Path, **sources: str) -> Path:
    for name, text in sources.items():
        path = folder / "fieldtruth" / (name.replace("__", "/") + ".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder


def names_of(folder: Path, *modules: str) -> set[str]:
    return {p.relative_to(folder / "fieldtruth").as_posix() for p in import_closure(modules, folder)}


def test_the_closure_holds_late_imports_parents_and_data_beside_modules(tmp_path: Path) -> None:
    write(
        tmp_path,
        a="from fieldtruth.b import c\ndef f():\n    from fieldtruth.d import (\n        x,  # w\n        y,\n    )\n",
        b__c="import fieldtruth.e\n",
        d__y="",
        e="",
        other="",
    )
    (tmp_path / "fieldtruth/b/__init__.py").write_text("from fieldtruth import g\n")
    (tmp_path / "fieldtruth/d/__init__.py").write_text("")
    (tmp_path / "fieldtruth/g.py").write_text("")
    (tmp_path / "fieldtruth/b/table.yaml").write_text("1")
    (tmp_path / "fieldtruth/b/deeper").mkdir()
    (tmp_path / "fieldtruth/b/deeper/table.yaml").write_text("1")
    expected = {"a.py", "b/__init__.py", "b/c.py", "b/table.yaml", "d/__init__.py", "d/y.py", "e.py", "g.py"}
    assert names_of(tmp_path, "fieldtruth.a") == expected


def test_the_source_of_a_module_outside_the_package_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "outside_of_it.py").write_text("x = 1\n")
    before = cache_key(["outside_of_it"])
    assert key_after_edit(tmp_path / "outside_of_it.py", "outside_of_it") != before


class Pair(NamedTuple):
    x: int
    y: object


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1, 2),
        (1, 1.0),
        ("ab", b"ab"),
        (["ab", "c"], ["a", "bc"]),
        ([[1], 2], [[1, 2]]),
        ({"a": 1}, {"a": 2}),
        (np.zeros(4), np.zeros(4, np.float32)),
        (np.zeros((2, 2)), np.zeros(4)),
        (Pair(1, None), Pair(1, "None")),
    ],
)
def test_different_inputs_have_different_keys(one: object, other: object) -> None:
    assert cache_key((), one) == cache_key((), one)
    assert cache_key((), one) != cache_key((), other)


def test_the_versions_of_libraries_are_part_of_the_key() -> None:
    assert cache_key((), libraries=["numpy"]) != cache_key((), libraries=["scipy"]) != cache_key(())
