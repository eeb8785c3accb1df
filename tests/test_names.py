# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Names of modules, functions and fields in docstrings, comments and documents are names that exist."""

import ast
import re
from collections import defaultdict
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "fieldtruth"
MODULES = sorted(SOURCE.rglob("*.py"))
TEMPLATES = sorted(SOURCE.rglob("*.jinja"))
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md")), *TEMPLATES]
CODE = [*MODULES, *(p for f in ("docs", "tests", "benchmarks", "examples") for p in sorted((ROOT / f).rglob("*.py")))]
QUOTED = re.compile(r"(?<!`)`{1,2}([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)(?:\(\))?`{1,2}(?!`)")
PATHS = re.compile(r"`((?:[a-z_]\w*/)+\w+\.py)`")
FOREIGN = {
    *("cv2", "distributed", "gazebo", "jinja2", "numpy", "pycocotools", "torch", "numba", "scipy", "IMU", "Stereo"),
    *("BaseSegDataset", "T_imu_cam", "checkGyroStatistics", "diff_drive_controller", "flock", "sha256sum", "usemtl"),
    *("rtcIntersect16", "contract"),
}
"""Names of other programs and libraries, or their first part."""
GROUPS = {"fieldtruth.formats", "fieldtruth.label_maps", "fieldtruth.robots", "fieldtruth.sensors.KIND"}
"""Of entry points."""
EXAMPLES = {"NAME_left", "RUN_STAMP", "_annotated", "b_from_a", "bench_3", "img_left", "power_pole_0"}
OBJECTS = {"bag", "drive", "experiment", "world"}
"""Folders of the package that are also names of variables, or of sections of an experiment."""
SUFFIXES = {
    *(
        "bag",
        "py",
        "pyi",
        "md",
        "yaml",
        "json",
        "csv",
        "txt",
        "tum",
        "jpg",
        "png",
        "npz",
        "glb",
        "sdf",
        "cpp",
        "hpp",
        "h",
    ),
    *("so", "toml", "sh", "mtl", "obj", "gpkg", "usdc", "xacro", "urdf", "config", "mcap", "sha256", "zip", "html"),
    *("xlsx", "service", "pt", "pgm", "tif", "jsonl"),
}
"""Of files, whose names are no names of code."""


def words_of(path: Path) -> set[str]:
    """Words of a file, of a module those outside of comments and docstrings."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        text = re.sub(r"#.*", "", re.sub(r'""".*?"""', "", text, flags=re.DOTALL))
    return set(re.findall(r"\w+", text))


def bound(body: list[ast.stmt]) -> set[str]:
    """Names that statements bind."""
    found: set[str] = set()
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            found |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.If | ast.Try | ast.With):
            found |= bound(node.body)
        else:
            found |= {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    return found


class Names:
    """Names of the package: words of its code, names in each module, fields and methods of its classes."""

    def __init__(self) -> None:
        data = [p for p in SOURCE.rglob("*") if p.suffix in {".yaml", ".toml", ".jinja", ".pyi", ".js"}]
        self.words = {word for path in [*MODULES, *data] for word in words_of(path)}
        self.words |= {path.stem for path in SOURCE.rglob("*")} | {"fieldtruth"}
        self.inside: dict[str, set[str]] = defaultdict(set)
        self.fields: set[str] = set()
        for path in MODULES:
            *folders, stem = path.relative_to(SOURCE).with_suffix("").parts
            tree = ast.parse(path.read_text(encoding="utf-8"))
            name = folders[-1] if stem == "__init__" and folders else stem
            self.inside[name] |= bound(tree.body)
            if folders:
                self.inside[folders[-1]].add(stem)
            for outer, inner in pairwise(folders):
                self.inside[outer].add(inner)
            for node in ast.walk(tree):
                if isinstance(node, ast.ClassDef):
                    self.fields |= bound(node.body)
        stub = ast.parse((SOURCE / "__init__.pyi").read_text(encoding="utf-8"))
        self.inside["ft"] = self.inside["fieldtruth"] = bound(stub.body) | {p.stem for p in SOURCE.iterdir()}

    def exist(self, name: str) -> bool:
        """Return whether a name in prose, such as ``core.cache.cache_key``, is one of code or of a configuration."""
        first, *others = name.split(".")
        if name in GROUPS or first in FOREIGN | EXAMPLES or (others and others[-1] in SUFFIXES):
            return True
        if not {first if first != "ft" else "fieldtruth", *others} <= self.words:
            return False
        inside = self.inside.get(first)
        if not others or inside is None or others[0] in inside:
            return True
        return others[0] in self.fields and (first in OBJECTS or not (SOURCE / first).is_dir())


@pytest.fixture(scope="module")
def names() -> Names:
    return Names()


def gone(path: Path, names: Names) -> list[str]:
    """Names in the prose of a file that do not exist; single words count where they are in double quotes of code."""
    found = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if "`" not in line:
            continue
        for match in QUOTED.finditer(line):
            single = "." not in match[1]
            if not (single and (path.suffix != ".py" or "``" not in match[0])) and not names.exist(match[1]):
                found.append(f"{path.relative_to(ROOT)}:{number}: {match[1]}")
    return found


def test_names_in_prose_exist(names: Names) -> None:
    found = [line for path in [*MODULES, *DOCUMENTS] for line in gone(path, names)]
    assert not found, "\n".join(found)


def test_paths_in_prose_exist() -> None:
    files = [f"/{path.relative_to(ROOT).as_posix()}" for path in CODE]
    found = [
        f"{path.relative_to(ROOT)}:{number}: {match[1]}"
        for path in [*CODE, *DOCUMENTS]
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        for match in PATHS.finditer(line)
        if (SOURCE / match[1].split("/")[0]).exists() or (ROOT / match[1].split("/")[0]).exists()
        if not any(file.endswith(f"/{match[1]}") for file in files)
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("name", ["bench.bare", "lens_effects.point_spread", "drive.servo", "ft.scan_of", "half_of_it"])
def test_name_that_is_gone_is_found(name: str, names: Names, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), "ROOT", tmp_path)
    (tmp_path / "module.py").write_text(f'"""One, see ``{name}``."""\n', encoding="utf-8")
    assert gone(tmp_path / "module.py", names) == [f"module.py:1: {name}"]
