# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The cache folder of worlds, baked light and compiled kernels, which many processes share.

Files appear atomically, and each is sealed under its name, which contains the key of its inputs: a damaged file, or one
under another's name, is made again. What was not used for the longest time is removed when the folder grows above its
limit.
"""

import os
import tempfile
import warnings
from collections.abc import Callable, Iterable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Final, NamedTuple, TypeVar

from filelock import FileLock

from fieldtruth.core.cache import KERNELS, add_seal, is_sealed, mark_used
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.files import atomic_output, remove

T = TypeVar("T")

SIZE_VARIABLE: Final = "FIELDTRUTH_CACHE_SIZE"
"""Environment variable: limit of the folder in GB."""
SIZE: Final = 10.0
"""Limit [GB] without that variable."""
_LOCK: Final = ".lock"
_IN_MEMORY: Final = "/dev/shm"
_PATIENCE: Final = 900.0
"""Longest wait [s] for another process that makes the same file; then it is made twice."""


class Entry(NamedTuple):
    """A file in the cache folder, or the folder of a module's kernels."""

    path: Path
    size: int
    """[byte]"""
    used: float
    """Time of its last use [s since the epoch]."""


def size_limit() -> float:
    """Size [byte] above which files are removed.

    Raises:
        ConfigurationError: the environment variable is not a positive number.
    """
    text = os.environ.get(SIZE_VARIABLE, str(SIZE))
    with suppress(ValueError):
        if float(text) > 0:
            return float(text) * 1e9
    raise ConfigurationError(f"{SIZE_VARIABLE} must be a number of GB above 0, got {text!r}")


def load_or_make(path: Path, load: Callable[[Path], T], make: Callable[[], T], save: Callable[[Path, T], None]) -> T:
    """Return the value that is stored at ``path``, or make and store it; a second process waits for the first.

    ``load`` reads an intact file that ``save`` wrote. A folder that cannot be written is not used; in one without
    locks, two processes may make the same file.
    """
    limit = size_limit()
    if stored := _stored(path, load):
        return stored[0]
    lock = Path(f"{path}{_LOCK}")
    with ExitStack() as stack:
        with suppress(OSError, NotImplementedError), warnings.catch_warnings(action="ignore"):
            path.parent.mkdir(parents=True, exist_ok=True)
            stack.enter_context(FileLock(lock, timeout=_PATIENCE))
            stack.callback(lock.unlink, missing_ok=True)
        if stored := _stored(path, load):
            return stored[0]
        value = make()
        with suppress(OSError):
            with atomic_output(path) as part:
                save(part, value)
                with part.open("r+b") as file:
                    add_seal(file, path.name)
            trim(path.parent, limit, keep=path)
    return value


def keep_temporary_files_in_memory() -> None:
    """Let temporary files, of matplotlib for example, lie in memory where the system has no other folder for them."""
    try:
        tempfile.gettempdir()
    except OSError:
        if os.access(_IN_MEMORY, os.W_OK):
            tempfile.tempdir = _IN_MEMORY


def entries(folder: Path) -> list[Entry]:
    """Return the entries of a cache folder, the last used first; unfinished files of killed processes, too."""
    found = []
    with suppress(OSError):
        paths = [path for path in folder.iterdir() if path.is_file() and path.suffix != _LOCK]
        kernels = folder / KERNELS
        for path in [*paths, *(kernels.iterdir() if kernels.is_dir() else ())]:
            with suppress(OSError):  # another process has removed it
                files = [path, *path.rglob("*")]
                found.append(Entry(path, sum(file.stat().st_size for file in files), path.stat().st_mtime))
    return sorted(found, key=lambda entry: (-entry.used, entry.path))


def trim(folder: Path, limit: float, keep: Path) -> None:
    """Remove what was not used for the longest time until the rest has at most ``limit`` bytes; ``keep`` stays."""
    total = 0
    for entry in entries(folder):
        total += entry.size
        if total > limit and entry.path != keep:
            remove_entries([entry])


def remove_entries(found: Iterable[Entry]) -> int:
    """Remove entries, also while other processes use the folder; returns the bytes that became free."""
    freed = 0
    for entry in found:
        with suppress(OSError):
            remove(entry.path)
            freed += entry.size
    return freed


def _stored(path: Path, load: Callable[[Path], T]) -> tuple[T] | None:
    """Return the value of an intact file, or None."""
    with suppress(OSError):  # another process may remove it
        if is_sealed(path, path.name):
            mark_used(path)
            return (load(path),)
    return None
