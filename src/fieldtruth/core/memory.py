# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A check before work that would need more memory than there is."""

import contextlib
from pathlib import Path
from typing import Final

from fieldtruth.core.errors import OutputError

_SYSTEM: Final = Path("/proc/meminfo")
_LIMIT, _USED = Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory.current")


def available_memory() -> int | None:
    """Memory [byte] that the system, or the container's limit, still grants; None where neither can be read."""
    found = []
    with contextlib.suppress(OSError, KeyError, ValueError):
        lines = dict(line.split(":", 1) for line in _SYSTEM.read_text().splitlines())
        found.append(int(lines["MemAvailable"].split()[0]) * 1024)
    with contextlib.suppress(OSError, ValueError):  # "max": no limit
        found.append(int(_LIMIT.read_text()) - int(_USED.read_text()))
    return min(found, default=None)


def check_memory(needed: int, task: str, remedy: str) -> None:
    """Check that about ``needed`` bytes of memory are available for a task.

    Raises:
        OutputError: both figures and what can be done instead.
    """
    available = available_memory()
    if available is not None and needed > available:
        raise OutputError(
            f"{task} needs about {needed / 1e9:.1f} GB of memory, but {available / 1e9:.1f} GB are available; {remedy}"
        )
