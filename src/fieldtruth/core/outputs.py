# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Names of outputs, checked before the work: may a file or folder be made, and can its folder be written."""

import errno
import os
import platform
from collections.abc import Sequence
from pathlib import Path

from fieldtruth.core.errors import OutputError
from fieldtruth.core.files import output_errors


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
