# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Output files: written atomically, locked against a second process, with clear errors."""

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from fieldtruth.core.errors import OutputError

_REASONS: Final = {
    errno.ENOSPC: "no space left",
    errno.EDQUOT: "no space left in your quota",
    errno.EFBIG: "the file system allows no file of this size",
    errno.EACCES: "permission denied",
    errno.EPERM: "permission denied",
    errno.EROFS: "the file system is read-only",
    errno.ENOTDIR: "a part of the path is a file, not a folder",
    errno.EEXIST: "a file exists where a folder is needed",
    errno.ENAMETOOLONG: "the path is too long",
    errno.EIO: "the disk reports an error",
}


@contextmanager
def output_errors(path: Path) -> Iterator[None]:
    """Turn errors of the operating system while writing below ``path`` into one clear line.

    Raises:
        OutputError: the path and the reason; for a full disk, that the same command resumes.
    """
    try:
        yield
    except OSError as error:
        reason = _REASONS.get(error.errno or 0)
        if reason is None and error.filename is not None and error.strerror:
            reason = error.strerror.lower()
        if reason is None:
            raise
        hint = "; free some space and run the same command again: it resumes" if "space" in reason else ""
        raise OutputError(f"cannot write {path}: {reason}{hint}") from error


@contextmanager
def atomic_output(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; what was written there, file or folder, replaces ``path`` at the end.

    If the block raises, ``path`` is as before and the temporary file or folder is removed. The process id is part of
    the temporary name, so that two processes may write the same file of a cache.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    remove(part)
    try:
        yield part
        part.replace(path)
    finally:
        remove(part)


def write_atomically(path: Path, data: bytes | str) -> None:
    """Write a file (text as UTF-8) atomically."""
    with atomic_output(path) as part:
        part.write_bytes(data.encode() if isinstance(data, str) else data)


def remove(path: Path) -> None:
    """Remove a file, a link or a folder with its content; do nothing if it does not exist."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a folder against other processes; the operating system releases it when the process ends.

    Raises:
        OutputError: another process has locked it.
    """
    from filelock import FileLock, Timeout  # late: the command line imports this module for its errors

    lock = FileLock(folder / ".lock", blocking=False)
    try:
        with lock:
            try:
                yield
            finally:
                with suppress(OSError):  # Windows does not remove open files
                    (folder / ".lock").unlink()
    except Timeout:
        raise OutputError(f"{folder} is in use by another process; wait until it ends, or stop it") from None
