# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Compilation of kernels: without the GIL, and cached on disk until one of their sources changes.

Numba's own cache checks only the file of the outermost function, so edited constants or callees in other files would
not reach a compiled kernel. Here the cache folder's name covers every module that the kernel's module imports.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from numba import config, njit

from fieldtruth.core.cache import cache_folder, cache_key

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile a function with NumPy's division rules: a branch that raises would keep loops from being vectorized."""
    return _compiled(function, inline="never")


def inlined(function: F) -> F:
    """Compile like ``kernel``, and inline into callers: for short functions in inner loops."""
    return _compiled(function, inline="always")


def _compiled(function: F, inline: str) -> F:
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "inline": inline}
    settings: Any = config
    previous, settings.CACHE_DIR = settings.CACHE_DIR, str(_folder(function.__module__))
    try:
        compiled: F = njit(cache=True, **options)(function)
    except (RuntimeError, OSError):  # the cache is not writable: compile in each process
        compiled = njit(**options)(function)
    finally:
        settings.CACHE_DIR = previous
    return compiled


@cache
def _folder(module: str) -> Path:
    return cache_folder() / "kernels" / cache_key([module], libraries=("numba", "llvmlite", "embreex"))
