# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The end of processes whose parent was killed."""

import multiprocessing
import os
from threading import Thread


def end_with_parent() -> None:
    """End this process as soon as its parent has ended, however; finished slices stay, others are temporary files."""
    Thread(target=_wait, daemon=True).start()


def _wait() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
