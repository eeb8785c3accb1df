# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Output files: names checked before the work, written atomically and synced, with clear errors."""

import errno
import os
import platform
import shutil
from collections.abc import Iterator, Sequence
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
def output_errors(path: Path, *, resumes: bool = False) -> Iterator[None]:
    """Turn errors of the operating system while writing below ``path`` into one clear line.

    Args:
        path: what the line names.
        resumes: whether the same command goes on where this one stopped; the line of a full disk says so.

    Raises:
        OutputError: the path and the reason.
    """
    try:
        yield
    except OSError as error:
        reason = _REASONS.get(error.errno or 0)
        if reason is None and error.filename is not None and error.strerror:
            reason = error.strerror.lower()
        if reason is None:
            raise
        hint = "; free some space and run the same command again" + ": it resumes" * resumes
        raise OutputError(f"cannot write {path}: {reason}{hint * ('space' in reason)}") from error


@contextmanager
def atomic_output(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; what was written there, file or folder, replaces ``path`` at the end.

    If the block raises, ``path`` is as before and the temporary file or folder is removed. Host and process id are
    part of the temporary name, so that processes on several machines may write the same file of a cache.
    """
    part = path.with_name(f".{path.name}.{platform.node()}.{os.getpid()}.part")
    remove(part)
    try:
        yield part
        replace_synced(part, path)
    finally:
        remove(part)


def remove_abandoned(path: Path) -> None:
    """Remove temporary files of ``atomic_output`` that killed processes of this machine left beside ``path``."""
    stem = f".{path.name}.{platform.node()}."
    with suppress(OSError):  # the folder does not exist, or cannot be read
        for part in path.parent.iterdir():
            process = part.name.removeprefix(stem).removesuffix(".part")
            if part.name == f"{stem}{process}.part" and process.isdigit() and not _is_running(int(process)):
                remove(part)


def _is_running(process: int) -> bool:
    """Return whether a process exists; always true where a system cannot be asked without harm."""
    try:
        if os.name == "posix":
            os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # another user's, or none that can exist
        return True
    return True


def replace_synced(part: Path, path: Path) -> None:
    """Give a file or folder the name ``path`` after its content is on the disk, so that a power cut leaves no half."""
    if part.is_dir():
        os.sync()  # each of thousands of files alone takes minutes
    else:
        sync(part)
    part.replace(path)
    sync(path.parent)


def sync(path: Path) -> None:
    """Write a file, or the names in a folder, through to the disk; do nothing where a system cannot sync folders."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(number)


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


def output_path(
    out: Path | str,
    *,
    endings: Sequence[str] = (),
    single: bool = False,
    parents: bool = True,
    overwrite: bool | None = None,
    option: str = "--out",
) -> Path:
    """Check before the work whether a file or folder can be made, and return its path.

    Args:
        out: the path as the user gave it.
        endings: endings that the name of a file may have; empty: any.
        single: whether it is a file, whose name ends in no slash; with ``endings`` it always is.
        parents: whether folders that are missing above it are made.
        overwrite: whether it may replace what is there; None if there is no such option.
        option: the option that gives the path, for the text of errors.

    Raises:
        OutputError: the path is empty or names no new file or folder, has another ending or a control character, is
            too long or taken, or its folder cannot be written.
    """
    path = Path(out)
    with output_errors(path):
        if not os.fspath(out) or path.name in ("", ".."):
            raise OutputError(f"cannot write {os.fspath(out)!r}: it must be the name of a new file or folder")
        if endings and path.suffix.lower() not in endings:
            allowed = " or ".join(filter(None, (", ".join(endings[:-1]), endings[-1])))
            raise OutputError(f"cannot write {path}: its name must end in {allowed}")
        base = _check_names(path)
        if (endings or single) and (path.is_dir() or os.fspath(out).endswith(os.sep)):
            raise OutputError(f"cannot write {out}: it is a folder")
        if not parents and not path.parent.exists():
            raise OutputError(f"cannot write {path}: the folder {path.parent} does not exist")
        if os.path.lexists(path):
            _check_taken(path, overwrite, option)
            base = path.parent
        _check_writable(base, path)
    return path


def output_folder(out: Path | str, name: str = "") -> Path:
    """Check before the work whether files can be made in a folder, new or not, and return its path.

    With ``name``, whether they can be made in the folder of this name in it.

    Raises:
        OutputError: the path is empty or the root of the file system, has a control character, is too long or a file,
            or is not writable.
    """
    path = Path(out)
    with output_errors(path):
        if not os.fspath(out) or path == Path(path.anchor or os.sep):
            raise OutputError(f"cannot write {os.fspath(out)!r}: it must be a folder, not the root")
    made = path / name
    with output_errors(made):
        _check_writable(_check_names(made), made)
    return path


def _check_names(path: Path) -> Path:
    """Check the names that are new, and return the nearest folder that exists; OSError: it cannot be looked at."""
    text = os.fspath(path)
    if "\0" in text or not _encodes(text):
        raise OutputError(f"cannot write {text!r}: no file can have this name")
    base = path
    while not _exists(base):
        if any(ord(letter) < 32 or ord(letter) == 127 for letter in base.name):
            raise OutputError(f"cannot write {text!r}: its name must not have control characters")
        base = base.parent
    return base


def _exists(path: Path) -> bool:
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


def _encodes(text: str) -> bool:
    try:
        os.fsencode(text)
    except UnicodeEncodeError:
        return False
    return True


def _check_taken(path: Path, overwrite: bool | None, option: str) -> None:
    if overwrite is None:
        raise OutputError(f"{path} already exists; remove it, or choose another {option}")
    if not overwrite:
        raise OutputError(f"{path} already exists; choose another {option}, or use --overwrite to replace it")
    if not (path.is_symlink() or path.is_file() or path.is_dir()):
        raise OutputError(f"cannot write {path}: it is neither a file nor a folder")


def _check_writable(base: Path, path: Path) -> None:
    """Make and remove the longest temporary name; OSError if that fails. Permissions say nothing to root."""
    if not base.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(base))
    new = path.relative_to(base).parts if path.is_relative_to(base) else path.parts[-1:]
    longest = max((*new, path.name), key=lambda name: len(os.fsencode(name)))
    probe = base / f".{longest}.{platform.node()}.{os.getpid()}.part"
    probe.mkdir()
    probe.rmdir()
