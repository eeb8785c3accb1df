# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Functions and classes of a user, by name: of a file, or of a module that can be imported."""

import importlib
import importlib.util
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

from fieldtruth.core.errors import ConfigurationError, UnknownNameError


def named_function(kind: str, name: str, built_in: Iterable[str] = ()) -> Any:
    """Return the function or class that FILE.py:NAME or MODULE:NAME names, always the same.

    Args:
        kind: what it is to the caller, for messages.
        name: its name.
        built_in: names of the caller's own, for messages.

    Raises:
        UnknownNameError: a name of another form.
        ConfigurationError: it cannot be imported, or cannot be called.
    """
    where, colon, what = name.rpartition(":")
    if not colon or not where or not what:
        raise UnknownNameError(kind, name, [*built_in, "FILE.py:NAME", "MODULE:NAME"])
    return _found(kind, where, what)


@cache
def _found(kind: str, where: str, what: str) -> Any:
    name = f"{kind} {where}:{what}"
    try:
        module = _module_of_file(Path(where)) if where.endswith(".py") else importlib.import_module(where)
        found = getattr(module, what)
    except Exception as error:  # it is the user's code
        raise ConfigurationError(f"{name}: {type(error).__name__}: {error}") from error
    if not callable(found):
        raise ConfigurationError(f"{name} must be a function or a class, got {type(found).__name__}")
    return found


def _module_of_file(path: Path) -> Any:
    """Return the module of a file, whose folder can be imported from."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise FileNotFoundError(f"no such file: {path}")
    sys.path.insert(0, str(path.parent.resolve()))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
