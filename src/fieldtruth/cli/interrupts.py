# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C: the first one stops the work in order, a second one ends the process at once, and either is one line."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final, NoReturn

INTERRUPTED: Final = 130
"""Exit code."""
_SHOW_CURSOR: Final = "\x1b[?25h\n"  # bars of progress hide it


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
