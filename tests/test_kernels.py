# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Kernels are leaves of the package: nearly every edit elsewhere compiles nothing again."""

import importlib
import pkgutil
import re
from pathlib import Path

import pytest
from numba.core.dispatcher import Dispatcher

import fieldtruth
from fieldtruth import kernels
from fieldtruth.core.cache import import_closure

ROOT = Path(fieldtruth.__file__).parents[1]
MODULES = [f"fieldtruth.kernels.{info.name}" for info in pkgutil.iter_modules(kernels.__path__)]
COMPILERS = ("compile", "packets", "bare", "swaying", "addresses")
"""Modules that use Numba itself: the decorators, the signatures of Embree's functions, and pointers."""


@pytest.mark.parametrize("module", MODULES)
def test_a_kernel_depends_on_fewer_than_5000_lines_and_no_data(module: str) -> None:
    closure = import_closure([module], ROOT)
    packages = {path.relative_to(ROOT).parts[1] for path in closure}
    assert packages <= {"__init__.py", "core", "kernels"}
    assert {path.suffix for path in closure} == {".py"}
    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in closure)
    assert 300 < lines < 5000  # photographs need the robot's boxes, too, for its shadow, and ruts


def test_every_compiled_function_is_a_kernel() -> None:
    names = [info.name for info in pkgutil.walk_packages(fieldtruth.__path__, "fieldtruth.")]
    modules = [importlib.import_module(name) for name in names if not name.endswith("__main__")]
    found = {f for module in modules for f in vars(module).values() if isinstance(f, Dispatcher)}
    assert len(found) > 150
    assert {f.py_func.__module__ for f in found} <= set(MODULES)


def test_numba_is_asked_by_the_decorators_only() -> None:
    allowed = {ROOT / "fieldtruth" / "kernels" / f"{name}.py" for name in COMPILERS}
    for path in (ROOT / "fieldtruth").rglob("*.py"):
        source = path.read_text(encoding="utf-8")
        assert path in allowed or not re.search(r"^\s*(from|import) numba\b", source, re.MULTILINE), path
        assert "kernels" in path.parts or not re.search(r"^\s*@(kernel|inlined|\w*jit)\b", source, re.MULTILINE), path


@pytest.mark.parametrize(
    "edited", ["core/errors.py", "core/files.py", "world/model.py", "world/data/trees/lime.yaml", "render/bake.py"]
)
def test_messages_species_and_models_are_in_no_kernel(edited: str) -> None:
    assert (ROOT / "fieldtruth" / edited).is_file()
    assert ROOT / "fieldtruth" / edited not in import_closure(MODULES, ROOT)
