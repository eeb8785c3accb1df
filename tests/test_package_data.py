# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Contents of a plain installation: every data file and every module that the core imports.

An editable installation finds data files that a wheel leaves out, and an environment for tests has more packages.
The lock file has those of the extra dev.
"""

import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Final

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT: Final = Path(__file__).parents[1]

# Imports every module with only the standard library and what ``dependencies`` bring; prints those that ask for more.
_IMPORT_ALL: Final = """
import importlib, pkgutil, re, sys
from importlib.metadata import PackageNotFoundError, packages_distributions, requires

def name_of(requirement):
    return re.sub("[-_.]+", "-", re.match("[A-Za-z0-9._-]+", requirement)[0]).lower()

installed, left = set(), ["fieldtruth"]
while left:
    name = left.pop()
    if name in installed:
        continue
    installed.add(name)
    try:
        needed = requires(name) or []
    except PackageNotFoundError:  # for another Python or system
        continue
    left += [name_of(r) for r in needed if "extra ==" not in r]
allowed = {m for m, names in packages_distributions().items() if installed & {name_of(n) for n in names}}

class OnlyTheCore:
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        if top in allowed or top in sys.stdlib_module_names or top.startswith("_"):
            return None
        raise ModuleNotFoundError(f"No module named {top!r}", name=top)

sys.meta_path.insert(0, OnlyTheCore())
import fieldtruth
modules = pkgutil.walk_packages(fieldtruth.__path__, "fieldtruth.", onerror=lambda name: None)
for module in modules:
    if module.name.endswith("__main__"):
        continue
    try:
        importlib.import_module(module.name)
    except (ModuleNotFoundError, fieldtruth.FieldtruthError) as error:
        missing = error if isinstance(error, ModuleNotFoundError) else error.__cause__
        print(module.name, missing.name)
"""
_OF_EXTRAS: Final = {
    **dict.fromkeys((f"fieldtruth.cluster.{name}" for name in ("engine", "worker")), "distributed"),
    "fieldtruth.exporters.huggingface": "pyarrow",
    "fieldtruth.bag.mcap_file": "zstandard",
    "fieldtruth.exporters.mcap": "mcap",
    "fieldtruth.exporters.stereo_depth": "cv2",
    "fieldtruth.exporters.video": "av",
    "fieldtruth.interchange.usd": "pxr",
    **dict.fromkeys(("fieldtruth.learning", "fieldtruth.live.score"), "gymnasium"),
}


@pytest.mark.slow
def test_the_core_imports_only_what_a_plain_installation_brings() -> None:
    result = subprocess.run([sys.executable, "-c", _IMPORT_ALL], capture_output=True, text=True, check=True)
    found = dict(line.split() for line in result.stdout.splitlines())
    assert found == _OF_EXTRAS


def test_every_data_file_is_in_the_wheel() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    patterns = settings["tool"]["setuptools"]["package-data"]["fieldtruth"]
    package = ROOT / "src/fieldtruth"
    packed = {path for pattern in patterns for path in package.glob(pattern)}
    files = {path for path in package.rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    assert sorted(str(path.relative_to(package)) for path in files - packed if path.suffix != ".py") == []


def test_the_lock_file_holds_every_package_that_the_extra_dev_asks_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    left, asked = [*project["dependencies"], *project["optional-dependencies"]["dev"]], set[str]()
    while left:
        requirement = Requirement(left.pop())
        asked.add(canonicalize_name(requirement.name))
        if requirement.name == "fieldtruth":
            left += [each for extra in requirement.extras for each in project["optional-dependencies"][extra]]
    lock = (ROOT / "requirements-dev.lock").read_text(encoding="utf-8")
    locked = {canonicalize_name(name) for name in re.findall(r"^([\w.-]+)==", lock, re.MULTILINE)}
    assert asked - locked == {"fieldtruth"}
