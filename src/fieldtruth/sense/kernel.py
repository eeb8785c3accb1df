# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Compilation of kernels: without the GIL, and cached on disk until one of their sources changes.

Numba's own cache checks only the file of the outermost function, so edited constants or callees in other files would
not reach a compiled kernel. Here the cache folder's name covers every module that the kernel's module imports. Numba
also keeps an index of numbered files for each function, in which two processes that save at once can exchange the code
of two signatures, and it checks no file for damage. Here each signature has its own sealed file, which installations of
the same code share wherever they are.
"""

import hashlib
import pickle
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import Any, TypeVar, overload

from numba import config, njit
from numba.core import serialize

from fieldtruth.core.cache import cache_key
from fieldtruth.core.cache_folder import kernel_folder
from fieldtruth.core.files import atomic_output
from fieldtruth.core.seal import SEAL_SIZE, add_seal, is_sealed

F = TypeVar("F", bound=Callable[..., Any])


@overload
def kernel(function: F) -> F: ...
@overload
def kernel(*, inner: bool = False, allocates: bool = False) -> Callable[[F], F]: ...
def kernel(function: F | None = None, *, inner: bool = False, allocates: bool = False) -> F | Callable[[F], F]:
    """Compile a function with NumPy's division rules: a branch that raises would keep loops from being vectorized.

    No rounding is left to the compiler (as LLVM's fast-math flag ``contract`` would): each kernel's machine code also
    holds copies of the functions that it calls, optimized with it, and which copy a process runs depends on what it
    loaded first.

    Args:
        function: what is compiled; None returns a decorator.
        inner: only kernels call it. To compile calls from Python takes long where there are large tables.
        allocates: it makes arrays, so that references to arrays are counted (Numba's run-time, NRT). That took more
            than half of the time of loops that pass tuples of arrays to functions.
    """
    if function is None:
        return partial(_compiled, inline="never", _nrt=allocates, no_cpython_wrapper=inner)
    return _compiled(function, inline="never", _nrt=False)


def inlined(function: F) -> F:
    """Compile like ``kernel``, and inline into callers: for short functions in inner loops."""
    return _compiled(function, inline="always", _nrt=False)


def _compiled(function: F, **choices: object) -> F:
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True} | choices
    settings: Any = config
    previous, settings.CACHE_DIR = settings.CACHE_DIR, str(_folder(function.__module__))
    try:
        compiled: F = njit(cache=True, **options)(function)
        store: Any = compiled
        store._cache._cache_file = _SealedFiles(_folder(function.__module__), store._cache._impl.filename_base)
    except (RuntimeError, OSError):  # the cache is not writable: compile in each process
        compiled = njit(**options)(function)
    finally:
        settings.CACHE_DIR = previous
    return compiled


@cache
def _folder(module: str) -> Path:
    return kernel_folder(cache_key([module], libraries=("numba", "llvmlite", "embreex")))


class _SealedFiles:
    """The files of one function's compiled code, by signature and processor, as Numba's dispatcher asks for them."""

    def __init__(self, folder: Path, name: str) -> None:
        self._folder = folder
        self._name = name

    def load(self, key: object) -> object:
        """Return what was saved under a key; None if there is no intact file."""
        path, seal = self._file(key)
        if is_sealed(path, seal):
            with suppress(OSError):
                return pickle.loads(path.read_bytes()[:-SEAL_SIZE])
        return None

    def save(self, key: object, data: object) -> None:
        """Save what belongs to a key, if the folder can be written."""
        path, seal = self._file(key)
        dumps: Any = serialize.dumps
        with suppress(OSError), atomic_output(path) as part, part.open("w+b") as file:
            file.write(dumps(data))
            add_seal(file, seal)

    def _file(self, key: object) -> tuple[Path, str]:
        seal = f"{self._name} {key!r}"
        return self._folder / f"{self._name}-{hashlib.sha256(seal.encode()).hexdigest()[:16]}.kernel", seal
