# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The flat namespace: every public name resolves, nothing shadows it, and importing it is light."""

import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import fieldtruth

USER_VERBS = [
    "generate",
    "export",
    "annotate",
    "validate",
    "write_report",
    "view",
    "open_run",
    "RunDataset",
    "preview",
    "class_shares",
]


def test_every_public_name_resolves() -> None:
    for name in (*fieldtruth.__all__, "__version__"):
        assert getattr(fieldtruth, name) is not None, name


def test_the_page_of_the_api_has_every_public_name() -> None:
    page = Path(__file__).parent.parent / "docs" / "api.md"
    documented = {line.removeprefix("::: ") for line in page.read_text().splitlines() if line.startswith("::: ")}
    public = {name: getattr(fieldtruth, name) for name in fieldtruth.__all__ if name != "__version__"}
    names = {
        value.__name__ if isinstance(value, ModuleType) else f"fieldtruth.{name}" for name, value in public.items()
    }
    assert names - documented == set()
    assert {name for name in documented - names if not name.startswith("fieldtruth.core.")} == set()


@pytest.mark.parametrize("name", USER_VERBS)
def test_public_functions_are_not_shadowed_by_packages(name: str) -> None:
    assert name in fieldtruth.__all__
    assert callable(getattr(fieldtruth, name))
    assert not (Path(fieldtruth.__file__).parent / name).exists()


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="No fieldtruth attribute lidr"):
        _ = fieldtruth.lidr  # type: ignore[attr-defined]


def test_the_import_alone_loads_nothing_heavy() -> None:
    heavy = {"numpy", "pydantic", "numba", "scipy", "rosbags", "importlib.metadata", "fcntl"}
    code = f"import sys, fieldtruth; print({heavy!r} & set(sys.modules))"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == "set()"


def test_the_import_and_light_commands_need_no_module_that_only_linux_has() -> None:
    code = """
import os, sys
for name in ("fcntl", "resource", "termios", "pwd", "grp", "syslog"):
    sys.modules[name] = None
del os.sched_getaffinity
from fieldtruth.cli import main
main(["list"])
main(["generate", "--help"])
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    assert "park_1" in ended.stdout
    assert "--seconds" in ended.stdout
