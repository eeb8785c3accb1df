# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The terminal: standard output and error that may be closed, full or unable to hold a character, and Ctrl-C.

A command's exit code is that of its work. A reader that goes away (``| head``) is no error, and what is printed after
that is dropped; letters that the encoding lacks are replaced. A device that is full is an error where the text is the
result, and a warning where it only names the file that was written.

The first Ctrl-C stops the work in order, a second one ends the process at once; either is one line.
"""

import errno
import io
import os
import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final, NoReturn, TextIO, cast

from fieldtruth.core.errors import FieldtruthWarning, OutputError

_GONE: Final = (errno.EPIPE, errno.ECONNRESET, errno.ESHUTDOWN)
"""Errors of a pipe or socket whose reader has ended."""
INTERRUPTED: Final = 130
"""Exit code."""
_SHOW_CURSOR: Final = "\x1b[?25h\n"  # bars of progress hide it


class _Guarded:
    """A text stream that takes everything: after its first error it drops what comes."""

    def __init__(self, stream: TextIO, *, is_result: bool) -> None:
        self._stream, self._is_result = stream, is_result
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")

    def write(self, text: str) -> int:
        """Write a text; raises OutputError if it is part of a result and the device cannot take it."""
        self._try(self._stream.write, text)
        return len(text)

    def flush(self) -> None:
        """Write what is buffered; raises as ``write``."""
        self._try(self._stream.flush)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _try(self, call: Any, *arguments: str) -> None:
        try:
            call(*arguments)
        except OSError as error:
            self._drop()
            if self._is_result and error.errno not in _GONE:
                reason = (error.strerror or str(error)).lower()
                raise OutputError(f"cannot write to standard output: {reason}") from error

    def _drop(self) -> None:
        """Lead the stream to nowhere, also what is buffered, which Python would try to write when it ends."""
        with suppress(OSError):
            number, nowhere = self._stream.fileno(), os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, number)
            os.close(nowhere)


@contextmanager
def standard_streams() -> Iterator[None]:
    """Guard standard output and standard error; where one is closed, what is printed there is dropped."""
    usual = sys.stdout, sys.stderr
    with Path(os.devnull).open("w", encoding="utf-8") as nowhere:  # takes the number of a closed one
        sys.stdout = cast("TextIO", _Guarded(sys.stdout or nowhere, is_result=True))
        sys.stderr = cast("TextIO", _Guarded(sys.stderr or nowhere, is_result=False))
        try:
            yield
        finally:
            sys.stdout, sys.stderr = usual


def print_line(text: str) -> None:
    """Print a line about work that is done, which stays done where the line cannot be printed."""
    try:
        print(text, flush=True)
    except OutputError as error:
        warnings.warn(str(error), FieldtruthWarning, stacklevel=2)


def print_output(path: Path, what: str = "") -> None:
    """Print the path of an output, what it is, for a folder the number of its files, and its size."""
    files = [file for file in path.rglob("*") if file.is_file()] if path.is_dir() else [path]
    count = f"{len(files)} file{'s' * (len(files) != 1)}"
    size = f"{sum(file.stat().st_size for file in files) / 1e6:.1f} MB"
    parts = [what, count if path.is_dir() else "", size]
    print_line(f"{path}: {', '.join(filter(None, parts))}")


@contextmanager
def interrupts(line: str, *, restore: bool) -> Iterator[None]:
    """Raise KeyboardInterrupt at the first Ctrl-C; at a second one print ``line`` and end the process, as a kill would.

    After a KeyboardInterrupt, more of them are ignored; with ``restore``, until the context has ended. Where Ctrl-C
    has another meaning (in a thread, in a background job), nothing changes.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return

    def stop(number: int, frame: object) -> NoReturn:
        signal.signal(signal.SIGINT, end)
        raise KeyboardInterrupt

    def end(number: int, frame: object) -> NoReturn:
        cursor = _SHOW_CURSOR if sys.stderr.isatty() else ""
        with suppress(OSError):  # it has no reader
            os.write(2, f"{cursor}{line}\n".encode())
        os._exit(INTERRUPTED)

    try:
        signal.signal(signal.SIGINT, stop)
    except ValueError:  # not the main thread
        yield
        return
    try:
        yield
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # while the process ends
        raise
    finally:
        if restore:
            signal.signal(signal.SIGINT, signal.default_int_handler)
