# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Locks of folders against other processes, on file systems with and without locks."""

import errno
import os
import platform
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fieldtruth.core.errors import OutputError
from fieldtruth.core.files import output_errors, write_atomically

if TYPE_CHECKING:
    from filelock import BaseFileLock

LOCK_OWNER: Final = ".lock.owner"
"""File in a locked folder: which process has locked it."""
_NO_LOCKS: Final = (errno.ENOSYS, errno.ENOLCK, errno.ENOTSUP)
"""Errors of ``flock`` on a file system that has no locks."""
_PATIENCE: Final = 0.3  # [s]


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a folder against other processes; the operating system releases it when the process ends.

    On a network folder without such locks, the lock is a file that a crash leaves behind; on the same machine it is
    then recognised as left behind.

    Raises:
        OutputError: another process has locked it; the text says which, on which machine.
    """
    from filelock import Timeout  # late: the command line imports this module for its errors

    path, owner = folder / ".lock", folder / LOCK_OWNER
    with ExitStack() as stack:
        try:
            with output_errors(folder):
                stack.callback(_lock(path).release)
                stack.callback(_forget, path)  # before the release, or another process may lock a file without a name
                stack.callback(_forget, owner)
                write_atomically(owner, f"process {os.getpid()} on {platform.node()}")
        except Timeout:
            raise OutputError(f"{folder} is in use by {_owner(owner)}; wait until it ends, or stop it") from None
        yield


def _lock(path: Path) -> "BaseFileLock":
    """Lock a file within 0.3 s, in which a lock that was left behind is removed; raises filelock's ``Timeout``."""
    from filelock import FileLock, SoftFileLock

    try:
        with warnings.catch_warnings(action="ignore"):  # about its own change to a soft lock
            lock: BaseFileLock = FileLock(path, timeout=_PATIENCE)
            lock.acquire()
    except (OSError, NotImplementedError) as error:
        if isinstance(error, OSError) and error.errno not in _NO_LOCKS:
            raise
        _forget(path)  # what the attempt has left
        lock = SoftFileLock(path.with_name(path.name + ".soft"), timeout=_PATIENCE)
        lock.acquire()
    return lock


def _owner(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8") or "another process"
    except (OSError, ValueError):  # it has only just locked the folder
        return "another process"


def _forget(path: Path) -> None:
    with suppress(OSError):
        path.unlink()
