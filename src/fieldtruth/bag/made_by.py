# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What made the readings of a run, made_by.json beside the bag: processors as they were used, and libraries.

It is a list, because the workers of a cluster, or the processes that resumed a run, may differ. Where all entries are
those of this process, it makes the same bytes again.
"""

import hashlib
import json
import sys
from collections.abc import Iterable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from fieldtruth.bag.run import MADE_BY
from fieldtruth.core.files import write_atomically
from fieldtruth.sense.embree import processor

LIBRARIES: Final = ("numpy", "scipy", "numba", "embreex", "simplejpeg", "lz4", "rosbags")
"""Distributions whose version shapes the bytes of a bag."""

Maker = dict[str, str]
"""What makes readings, by name; empty if it is unknown."""


@cache
def this_process() -> Maker:
    """Return what makes readings in this process."""
    python = ".".join(map(str, sys.version_info[:2]))
    return processor() | {"Python": python} | {name: version(name) for name in LIBRARIES}


def note(folder: Path, makers: Iterable[Maker]) -> None:
    """Keep in a folder of slices what makes some of them."""
    for maker in makers:
        text = json.dumps(maker, indent=1)
        write_atomically(folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.maker", text)


def noted(folder: Path) -> str:
    """Return the text of made_by.json for the slices of a folder."""
    return json.dumps([json.loads(path.read_bytes()) for path in sorted(folder.glob("*.maker"))], indent=1) + "\n"


def makers_of(folder: Path) -> list[Maker]:
    """Read what made the run in a folder; one unknown maker if made_by.json is missing or cannot be read."""
    try:
        found: Any = json.loads((folder / MADE_BY).read_bytes())
        return [{str(name): str(value) for name, value in maker.items()} for maker in found] or [{}]
    except (OSError, ValueError, AttributeError, TypeError):
        return [{}]


def difference(makers: Iterable[Maker]) -> str:
    """Say in what makers differ from this process; empty if this process makes the same bytes."""
    here, names = this_process(), dict[str, None]()
    for maker in makers:
        if not maker:
            return f"no {MADE_BY} says what made it"
        names |= dict.fromkeys(name for name in here | maker if maker.get(name) != here.get(name))
    return f"made with other {', '.join(names)}" if names else ""
