# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How kernels are compiled: without the GIL, and kept on disk until any file of this package changes.

Numba's own cache looks only at the file of the outermost function, so a kernel that calls one from another file would
go on running the old one. Here the folder's name is a digest of the whole package.
"""

import hashlib
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from numba import config, njit

from fieldtruth.world.build import default_cache

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile a function with NumPy's rules of division, so that no branch for an exception hinders the compiler."""
    return _compiled(function, inline="never")


def inlined(function: F) -> F:
    """Compile like ``kernel``, but into its callers: for the few lines that stand in an inner loop."""
    return _compiled(function, inline="always")


def _compiled(function: F, inline: str) -> F:
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "inline": inline}
    settings: Any = config
    elsewhere, settings.CACHE_DIR = settings.CACHE_DIR, str(_folder())
    try:
        compiled: F = njit(cache=True, **options)(function)
    except (RuntimeError, OSError):  # nowhere to write: compile in each process
        compiled = njit(**options)(function)
    finally:
        settings.CACHE_DIR = elsewhere
    return compiled


@cache
def _folder() -> Path:
    digest = hashlib.blake2b(f"{version('numba')} {version('embreex')}".encode(), digest_size=8)
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return default_cache() / f"kernels-{digest.hexdigest()}"
