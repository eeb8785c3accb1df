# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Table of what the package and its checks cost.

Usage: python .ci/table.py [FILE [JUNIT_XML ...]], FILE with lines of seconds, a tab and the name of a step.
"""

import ast
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]
LONG = 50
"""Lines above which a function is counted as long."""


def module_name(path: Path) -> str:
    """Dotted name of a module below ``src``."""
    name = ".".join(path.relative_to(ROOT / "src").with_suffix("").parts)
    return name.removesuffix(".__init__")


def imported(tree: ast.AST, modules: set[str]) -> set[str]:
    """Modules of the package that a file imports."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return found & modules


def sizes(folder: str) -> tuple[int, int, int]:
    """Lines, files and long functions below a folder."""
    lines = files = long = 0
    for path in sorted((ROOT / folder).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        lines, files = lines + text.count("\n"), files + 1
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                long += (node.end_lineno or node.lineno) - node.lineno + 1 > LONG
    return lines, files, long


def imported_once() -> int:
    """Number of modules of the package that one other module imports."""
    trees = {module_name(p): ast.parse(p.read_text(encoding="utf-8")) for p in sorted((ROOT / "src").rglob("*.py"))}
    count: Counter[str] = Counter()
    for name, tree in trees.items():
        count.update(imported(tree, set(trees)) - {name})
    return sum(number == 1 for number in count.values())


def slowest(reports: list[Path], number: int = 10) -> list[tuple[float, str]]:
    """Seconds and names of the tests that took longest, setup included."""
    cases = [case for report in reports for case in ET.parse(report).iter("testcase")]
    times = [(float(c.get("time", 0)), f"{c.get('classname', '')}::{c.get('name', '')}") for c in cases]
    return sorted(times, reverse=True)[:number]


def main(arguments: list[str]) -> None:
    """Print the table."""
    for folder in ("src", "tests"):
        lines, files, long = sizes(folder)
        print(f"{folder:<6}{lines:>8,} lines{files:>6} files{long:>5} functions above {LONG} lines")
    print(f"{imported_once()} modules that one other module imports")
    if arguments:
        for line in Path(arguments[0]).read_text(encoding="utf-8").splitlines():
            seconds, _, step = line.partition("\t")
            print(f"{seconds:>6} s  {step}")
    for duration, name in slowest([Path(argument) for argument in arguments[1:] if Path(argument).exists()]):
        print(f"{duration:>8.1f} s  {name}")


if __name__ == "__main__":
    main(sys.argv[1:])
