# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sub-command cache: what is in the cache folder, and to empty it."""

import argparse
import time
from typing import TYPE_CHECKING

from fieldtruth.cli.arguments import AddCommand
from fieldtruth.cli.streams import print_line

if TYPE_CHECKING:
    from fieldtruth.core.cache_folder import Entry


def _cache(options: argparse.Namespace) -> None:
    from fieldtruth.core.cache import cache_folder
    from fieldtruth.core.cache_folder import SIZE_VARIABLE, entries, remove_entries, size_limit

    folder, limit = cache_folder(), size_limit()
    found = entries(folder)
    if options.clear:
        print_line(f"{folder}: {remove_entries(found) / 1e6:.0f} MB removed")
        return
    for entry in found:
        used = time.strftime("%Y-%m-%d %H:%M", time.localtime(entry.used))
        print(f"{_kind(entry):<10}  {entry.size / 1e6:8.1f} MB  last used {used}  {entry.path.name}")
    size = sum(entry.size for entry in found)
    print(f"{folder}: {size / 1e9:.2f} of {limit / 1e9:g} GB; {SIZE_VARIABLE} sets the limit in GB")


def _kind(entry: "Entry") -> str:
    name = entry.path.name
    if entry.path.is_dir():
        return "kernels"
    return "unfinished" if name.endswith(".part") else "light" if name.startswith("light-") else "world"


def add_commands(command: AddCommand) -> None:
    """Add the sub-command."""
    cache = command("cache", _cache, "List the cached worlds, baked light and compiled kernels.")
    cache.add_argument("--clear", action="store_true", help="remove them; later commands make them again")
