# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Entries by name: those of the package, of other packages (entry points) and of a user's folders (FIELDTRUTH_PATH).

What is added is found where it is first looked for, by Python, YAML and the command line alike, so that processes that
start later, workers on other machines included, find it without an import. Listing imports no package that adds data.
"""

import os
import sys
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any, Final, Generic, TypeVar

from fieldtruth.core.errors import ConfigurationError, FieldtruthError, UnknownNameError

T = TypeVar("T")

VARIABLE: Final = "FIELDTRUTH_PATH"
"""Environment variable with a user's folders, separated as in PATH."""

Source = Path | EntryPoint


class Registry(MutableMapping[str, T], Generic[T]):
    """Entries of one kind by name, read when they are first used. Python code adds one with ``registry[name] = entry``.

    Args:
        kind: what one is called in messages.
        folder: subfolder of the package's data and of a user's folders; with dots for slashes and ``fieldtruth.`` in
            front, the group of entry points.
        ending: of files, whose names without it are the names; empty for folders.
        read: makes an entry of its name and the file, or of what the entry point names.
        builtin: those of the package, or the folders in which their files are.
    """

    def __init__(
        self,
        kind: str,
        folder: str,
        ending: str,
        read: Callable[[str, Any], T],
        builtin: Mapping[str, T] | Path | tuple[Path, ...],
    ) -> None:
        self.kind = kind
        self._folder, self._ending, self._read = folder, ending, read
        folders = (builtin,) if isinstance(builtin, Path) else builtin if isinstance(builtin, tuple) else ()
        self._own = {} if isinstance(builtin, Path | tuple) else dict(builtin)
        self._files = {name: path for folder in folders for name, path in _entries(folder, ending).items()}
        self._made: dict[Source, T] = {}

    def __getitem__(self, name: str) -> T:
        """Return an entry.

        Raises:
            KeyError: none has the name.
            ConfigurationError: it cannot be read.
        """
        if name in self._own:
            return self._own[name]
        source = self._files[name] if name in self._files else self._added()[name]
        if source not in self._made:
            self._made[source] = self._make(name, source)
        return self._made[source]

    def __setitem__(self, name: str, entry: T) -> None:
        """Add an entry, or replace one, for this process."""
        self._own[name] = entry

    def __delitem__(self, name: str) -> None:
        """Remove an entry that Python code has added."""
        del self._own[name]

    def __iter__(self) -> Iterator[str]:
        """Yield the names: those of the package, then added ones."""
        return iter({**self._own, **self._files, **self._added()})

    def __len__(self) -> int:
        """Return the number of names."""
        return len(list(iter(self)))

    def find(self, name: str, source: str = "") -> T:
        """Return an entry.

        Raises:
            UnknownNameError: none has the name; the text starts with ``source``, a file's name for example.
            ConfigurationError: it cannot be read.
        """
        try:
            return self[name]
        except KeyError:
            raise UnknownNameError(self.kind, name, self, source) from None

    def _added(self) -> dict[str, Source]:
        """Return what entry points and a user's folders add.

        Raises:
            ConfigurationError: a name is taken.
        """
        found: dict[str, Source] = {}
        for name, source in _added(self._folder, self._ending, os.environ.get(VARIABLE, ""), tuple(sys.path)):
            if name in found or name in self._files or name in self._own:
                raise ConfigurationError(f"{_where(source)}: another {self.kind} has the name {name!r} already")
            found[name] = source
        return found

    def _make(self, name: str, source: Source) -> T:
        try:  # not by EntryPoint: the backport importlib_metadata, which Dask imports, returns a class of its own
            return self._read(name, source if isinstance(source, Path) else source.load())
        except FieldtruthError:
            raise
        except Exception as error:  # of a module of another package, or a mistake in its data
            text = f"{type(error).__name__}: {error}".partition("\n")[0]
            raise ConfigurationError(f"{_where(source)}: cannot use {self.kind} {name!r}: {text}") from error


def user_folders() -> list[Path]:
    """Folders of FIELDTRUTH_PATH.

    Raises:
        ConfigurationError: one does not exist.
    """
    folders = [Path(part).expanduser() for part in os.environ.get(VARIABLE, "").split(os.pathsep) if part]
    for folder in folders:
        if not folder.is_dir():
            raise ConfigurationError(f"{VARIABLE} has {str(folder)!r}, which is not a folder")
    return folders


def load_module(name: str, path: Path) -> ModuleType:
    """Import a file, once, as a module of a name that no other file has."""
    if name in sys.modules:
        return sys.modules[name]
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ConfigurationError(f"{path} is no Python module")
    module = sys.modules[name] = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


@cache
def _added(folder: str, ending: str, _variable: str, _path: tuple[str, ...]) -> list[tuple[str, Source]]:
    """List what a folder's group of entry points has, and a user's folders; found once for their values."""
    group = f"fieldtruth.{folder.replace('/', '.')}"
    points: list[tuple[str, Source]] = [(point.name, point) for point in sorted(entry_points(group=group))]
    return points + [entry for base in user_folders() for entry in _entries(base / folder, ending).items()]


def _entries(folder: Path, ending: str) -> dict[str, Path]:
    """Return files with an ending by name, or with an empty one folders, sorted."""
    if not folder.is_dir():
        return {}
    found = sorted(path for path in folder.iterdir() if path.name[0] not in "._" and path.name.endswith(ending))
    return {path.name.removesuffix(ending): path for path in found if path.is_dir() == (not ending)}


def _where(source: Source) -> str:
    if isinstance(source, Path):
        return str(source)
    return f"entry point {source.value!r}" + (f" of {source.dist.name}" if source.dist is not None else "")
