# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The flat namespace: every public name resolves, type checkers see the same names, and importing it is light."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import fieldtruth


@pytest.mark.parametrize("name", fieldtruth.__all__)
def test_every_public_name_resolves(name: str) -> None:
    assert getattr(fieldtruth, name) is not None
    assert name in dir(fieldtruth)


def test_type_checkers_see_what_is_there() -> None:
    tree = ast.parse(Path(fieldtruth.__file__).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {alias.name for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert (seen - {"version"}) | {"__version__"} == set(fieldtruth.__all__)
    assert len(set(fieldtruth.__all__)) == len(fieldtruth.__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'lidr'"):
        _ = fieldtruth.lidr


def test_the_import_alone_brings_nothing_heavy() -> None:
    code = "import sys, fieldtruth; print({'numpy', 'pydantic', 'numba', 'scipy'} & set(sys.modules))"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == "set()"
