# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Environments that are files: ``environment: campus.yaml``.

A file with the key ``centre`` is a site: its content is a layout of the environment ``site``, and its name that of the
world. An experiment keeps this layout in place of the path, so that it says all of its input. Wherever a layout has the
key ``file``, the value is a path; it may be relative to the YAML file that has it.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.yaml_io import parse_mapping, read_text

SITE: Final = "site"
"""Environment whose layouts say where it is and which maps it is made of."""
NAME: Final = "name"
"""Key of a layout with the name of the world."""
CENTRE: Final = "centre"
_FILE: Final = "file"
_ENDINGS: Final = (".yaml", ".yml")
_WORD: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")


def is_environment_file(environment: object) -> bool:
    """Return whether this is the path of an environment's file, not a name."""
    return isinstance(environment, str) and environment.endswith(_ENDINGS)


def world_name(environment: str) -> str:
    """Return the name of the worlds of an environment, or of the file of one."""
    return Path(environment).stem if is_environment_file(environment) else environment


def environment_of(world_name: str, layout: Mapping[str, Any]) -> str:
    """Return the environment whose layout this is, of a world of such a name; see ``world_name``."""
    return SITE if CENTRE in layout else world_name


class Chosen(NamedTuple):
    """An environment by its name, and changes to its layout."""

    environment: str
    layout: dict[str, Any]

    @property
    def world_name(self) -> str:
        """Name of the world: of the environment, or of its file."""
        return str(self.layout.get(NAME, self.environment))


def resolved(environment: str, layout: Mapping[str, Any] | None = None, folder: Path = Path()) -> Chosen:
    """Return name and layout of an environment, which may be the path of a file; ``layout`` is laid over the file's.

    Args:
        environment: a name, or a path that may be relative to ``folder``.
        layout: changes to the layout, key by key; relative paths in it are relative to the current folder.
        folder: by default the current one.

    Raises:
        ConfigurationError: the file cannot be read, or is no environment.
    """
    if not is_environment_file(environment):
        return Chosen(environment, dict(layout or {}))
    name, own = read_environment(folder / Path(environment).expanduser())
    return Chosen(name, {**own, **with_paths(layout or {}, Path())})


def read_environment(path: Path) -> Chosen:
    """Read a file, and say which environment its content is a layout of; errors as ``resolved``."""
    content = parse_mapping(read_text(path), str(path))
    if CENTRE not in content:
        raise ConfigurationError(
            f"{path}: no site, which has the key {CENTRE}: [latitude, longitude]; a file of layers is an environment "
            "by its name, in a folder environments of FIELDTRUTH_PATH"
        )
    if not _WORD.fullmatch(path.stem):
        raise ConfigurationError(f"{path}: must be named by at most 64 letters, digits, - and _; rename the file")
    return Chosen(SITE, {NAME: path.stem, **with_paths(content, path.parent)})


def with_paths(layout: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return a layout whose paths are absolute; relative ones are relative to a folder."""

    def made(key: object, value: Any) -> Any:
        if isinstance(value, Mapping):
            return with_paths(value, folder)
        if isinstance(value, list | tuple):
            return [made(None, each) for each in value]
        if key == _FILE and isinstance(value, str) and value:
            return str((folder / Path(value).expanduser()).absolute())
        return value

    return {key: made(key, value) for key, value in layout.items()}


def files_of(layout: Mapping[str, Any], at: str = "") -> Iterator[tuple[str, Path]]:
    """Yield the files that a layout names, each with its position in the layout."""
    for key, value in layout.items():
        here = f"{at}.{key}".removeprefix(".")
        if key == _FILE and isinstance(value, str):
            yield here, Path(value).expanduser()
        elif isinstance(value, Mapping):
            yield from files_of(value, here)
        elif isinstance(value, list | tuple):
            for i, each in enumerate(value):
                if isinstance(each, Mapping):
                    yield from files_of(each, f"{here}[{i}]")
