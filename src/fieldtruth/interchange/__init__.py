# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The world in the formats of other tools: the table of formats, and what all of them share.

Each format is a module with one function ``write(world, target, *, beyond)``. It writes a new file or folder under the
temporary name ``target``; the output gets its own name when it is complete.
"""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Final, NamedTuple

from fieldtruth.core.errors import OutputError, UnknownNameError
from fieldtruth.core.files import atomic_output, output_errors, output_path, remove
from fieldtruth.core.parallel import check_memory
from fieldtruth.core.yaml_io import package_data
from fieldtruth.world.model import World

_BASE: Final = 300_000_000
"""Memory [byte] for the textures and images of the ground, whatever the format."""


class Format(NamedTuple):
    """A row of the table."""

    module: str
    """Module of this package with the function ``write``."""
    suffix: str
    """Added to the world's name and seed for the default output path."""
    description: str
    holds: str = ""
    """A file that its folder always has, which marks it as replaceable; empty for a format of one file."""
    extra: str = ""
    """Extra of the package that it needs; empty: none."""
    plain: bool = False
    """True: it does without extensions of its file format, which not all tools know."""


FORMATS: Final = {name: Format(**row) for name, row in package_data("fieldtruth.interchange", "formats.yaml").items()}


def write_scene(
    world: World, out: Path | str | None = None, *, to: str, beyond: bool = True, overwrite: bool = False
) -> Path:
    """Write a world for other tools.

    Args:
        world: see ``load_world``.
        out: path of the file or folder, by default in the current folder and named after the world and its seed.
        to: the format, a key of ``FORMATS``.
        beyond: whether to include the land beyond the world's edge and the members of swarms there.
        overwrite: replace an existing output.

    Returns:
        Path of the output.

    Raises:
        UnknownNameError: an unknown format.
        OutputError: the output already exists or cannot be written, a library is missing, or the memory is too small.
    """
    target = check_scene_output(f"{world.name}_{world.seed}", out, to=to, overwrite=overwrite)
    write = _writer(to)
    with output_errors(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        with atomic_output(target) as part:
            write(world, part, beyond=beyond)
            if overwrite:
                remove(target)
    return target


def check_scene_output(stem: str, out: Path | str | None = None, *, to: str, overwrite: bool = False) -> Path:
    """Return the path of the output, before any work; raises as ``write_scene``."""
    if to not in FORMATS:
        raise UnknownNameError("format", to, FORMATS)
    suffix = FORMATS[to].suffix
    target = output_path(stem + suffix if out is None else out, single="." in suffix, overwrite=overwrite)
    with output_errors(target):
        if target.is_dir() and not (FORMATS[to].holds and (target / FORMATS[to].holds).is_file()):
            raise OutputError(f"{target} is a folder that does not hold format {to!r}; choose another --out")
    return target


def check_scene_memory(world: World, to: str, needed: int) -> None:
    """Check the memory before a format is written: ``needed`` [byte] and what every format takes for its images.

    Raises:
        OutputError: both figures.
    """
    check_memory(needed + _BASE, f"format {to!r} of {world.name}", "free some memory, or use --no-beyond")


def _writer(to: str) -> Callable[..., None]:
    row = FORMATS[to]
    try:
        write: Callable[..., None] = import_module(f"{__name__}.{row.module}").write
    except ModuleNotFoundError as error:
        if not row.extra or (error.name or "").startswith("fieldtruth"):
            raise
        raise OutputError(
            f"format {to!r} needs a library that is not installed; run: pip install 'fieldtruth[{row.extra}]'"
        ) from error
    return partial(write, instancing=False) if row.plain else write
