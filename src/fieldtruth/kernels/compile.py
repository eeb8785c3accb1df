# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Compilation of kernels: without the GIL, and cached on disk until one of their sources changes.

Numba's own cache checks only the file of the outermost function, so edited constants or callees in other files would
not reach a compiled kernel. Here the cache folder's name covers every module that the kernel's module imports. Numba
also keeps an index of numbered files for each function, in which two processes that save at once can exchange the code
of two signatures, it checks no file for damage, and it refuses to work where no folder can be written. Here each
signature has its own sealed file, which installations of the same code share wherever they are. While one process
compiles, others that need the same file wait for it; a lock ends with its process. Where no file can be saved, each
process compiles for itself.
"""

import hashlib
import os
import pickle
import platform
import warnings
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack, suppress
from functools import cache, partial
from pathlib import Path
from typing import Any, Final, TypeVar, overload

from filelock import FileLock
from numba import njit, types
from numba.core import serialize
from numba.core.compiler import CompileResult
from numba.core.registry import cpu_target

from fieldtruth.core.cache import SEAL_SIZE, add_seal, cache_key, is_sealed, kernel_folder

F = TypeVar("F", bound=Callable[..., Any])
_PATIENCE: Final = 900.0
"""Longest wait [s] for another process that compiles the same; then it is compiled twice."""


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


def callback(function: Callable[[Any], None]) -> Callable[[], int]:
    """Compile a function of one address, which C calls. Returns a function that gives its own address."""
    dispatcher: Any = _compiled(function, inline="never", _nrt=False, no_cpython_wrapper=True, no_cfunc_wrapper=False)

    @cache
    def address() -> int:
        dispatcher.compile((types.uint64,))
        result = dispatcher.overloads[(types.uint64,)]
        return int(result.library.get_pointer_to_function(result.fndesc.llvm_cfunc_wrapper_name))

    return address


def _compiled(function: F, **choices: object) -> F:
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True} | choices
    dispatcher: Any = njit(**options)(function)
    dispatcher._cache = _SealedFiles(function, dispatcher._compiler)
    dispatcher.get_call_template = partial(_template, dispatcher.get_call_template)
    compiled: F = dispatcher
    return compiled


def _template(resolve: Callable[..., Any], args: Iterable[Any], kws: Mapping[str, Any]) -> Any:
    """Return the code for a call of one kernel by another: a constant argument compiles no version of its own."""
    plain: Any = types.unliteral
    return resolve([plain(each) for each in args], {name: plain(each) for name, each in kws.items()})


def is_saved(function: Callable[..., Any]) -> bool:
    """Return whether a kernel was compiled and saved, for any signature and processor."""
    files: _SealedFiles | None = getattr(function, "_cache", None)
    return files is None or files.any_saved()


def can_save(function: Callable[..., Any]) -> bool:
    """Return whether what is compiled of a kernel can be saved, and creates its folder."""
    folder = Path(getattr(function, "_cache").cache_path)  # noqa: B009 (Numba's name)
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    return os.access(folder, os.W_OK)


def compiler_target() -> tuple[str, str, str]:
    """Return what kernels are compiled for: LLVM's triple, name and features (``+avx2,-sse4a``) of the processor."""
    codegen: Any = cpu_target.target_context.codegen()
    triple, name, features = codegen.magic_tuple()
    return triple, name, features


@cache
def _folder(module: str) -> Path:
    return kernel_folder(cache_key([module], libraries=("numba", "llvmlite", "embreex")))


class _SealedFiles:
    """The files of one function's compiled code, by signature and processor, as Numba's dispatcher asks for them."""

    def __init__(self, function: Any, compiler: Any) -> None:
        self._name = f"{function.__qualname__}-{function.__code__.co_firstlineno}".replace("<locals>", "")
        self._folder = _folder(function.__module__)
        cells = tuple(cell.cell_contents for cell in function.__closure__ or ())
        self._code = hashlib.sha256(function.__code__.co_code + _bytes_of(cells)).hexdigest()
        self._locks = ExitStack()
        self._compile, compiler.compile = compiler.compile, self._compile_or_release

    @property
    def cache_path(self) -> str:
        """Folder, as Numba's statistics show it."""
        return str(self._folder)

    def load_overload(self, signature: object, context: Any) -> Any:
        """Return what was saved for a signature; None if there is no intact file, which the caller then makes.

        Numba calls this, compiles and calls ``save_overload`` while it holds its lock for threads.
        """
        context.refresh()
        path, seal = self._file(signature, context.codegen())
        if (saved := _loaded(path, seal, context)) is None:
            self._lock(path.with_suffix(".lock"))
            if (saved := _loaded(path, seal, context)) is not None:
                self._locks.close()
        return saved

    def save_overload(self, signature: object, result: Any) -> None:
        """Save the code for a signature, if it depends on no address and the folder can be written."""
        with self._locks:
            if not result.library.has_dynamic_globals:
                self._save(signature, result)

    def any_saved(self) -> bool:
        """Return whether there is a file for any signature and processor."""
        return any(self._folder.glob(f"{self._name}-*.kernel"))

    def _lock(self, path: Path) -> None:
        """Wait until no other process compiles the same; where there are no locks, two may do so."""
        with suppress(OSError, NotImplementedError), warnings.catch_warnings(action="ignore"):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._locks.enter_context(FileLock(path, timeout=_PATIENCE))
            self._locks.callback(_remove, path)

    def _compile_or_release(self, *given: Any) -> Any:
        """Compile; what fails is not waited for."""
        try:
            return self._compile(*given)
        except BaseException:
            self._locks.close()
            raise

    def _save(self, signature: object, result: Any) -> None:
        path, seal = self._file(signature, result.library.codegen)
        part = path.with_name(f".{path.name}.{platform.node()}.{os.getpid()}.part")
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                with part.open("w+b") as file:
                    file.write(_bytes_of(result._reduce()))
                    add_seal(file, seal)
                part.replace(path)
            finally:
                part.unlink(missing_ok=True)

    def flush(self) -> None:
        """Do nothing: what was saved stays right."""

    def _file(self, signature: object, codegen: Any) -> tuple[Path, str]:
        seal = f"{self._name} {(signature, codegen.magic_tuple(), self._code)!r}"
        return self._folder / f"{self._name}-{hashlib.sha256(seal.encode()).hexdigest()[:16]}.kernel", seal


def _loaded(path: Path, seal: str, context: Any) -> Any:
    """Return what an intact file holds, or None."""
    if is_sealed(path, seal):
        rebuild: Any = CompileResult._rebuild
        with suppress(OSError):
            return rebuild(context, *pickle.loads(path.read_bytes()[:-SEAL_SIZE]))
    return None


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.unlink()


def _bytes_of(value: object) -> bytes:
    dumps: Any = serialize.dumps
    return bytes(dumps(value))
