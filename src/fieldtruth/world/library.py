# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Species, rock types, materials, textures and more as data: YAML files in ``data/``, read when they are first used.

A file's name is the name of its species, rock type or environment, its folder says which it is; files in folders of
these names in FIELDTRUTH_PATH count, too. Every file may also hold the sections of ``SHARED``, whose entries all files
share.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any, Final, TypeVar

import yaml
from pydantic import ConfigDict, TypeAdapter, ValidationError

from fieldtruth.core.errors import ConfigurationError, FieldtruthError, suggestion
from fieldtruth.core.registry import user_folders

FOLDER: Final = Path(__file__).parent / "data"  # written like this, `core.cache` finds the files
T = TypeVar("T")
Entry = Mapping[str, Any]
SHARED: Final = ("materials", "textures", "seasons", "litter", "furniture", "ground_types")
_SECTIONS: Final[dict[str, "Section[Any]"]] = {}
_ADAPTERS: Final[dict[type, TypeAdapter[list[Any]]]] = {}


@cache
def _files() -> dict[str, dict[str, Path]]:
    """Data files by folder and name: the package's, then those in folders of these names in FIELDTRUTH_PATH."""
    found = {
        folder.name: {path.stem: path for path in sorted(folder.glob("*.yaml"))}
        for folder in sorted(FOLDER.iterdir())
        if folder.is_dir()
    }
    for base in user_folders():
        for name, known in found.items():
            for path in sorted((base / name).glob("*.yaml")):
                _check_new(path, known)
                known[path.stem] = path
    return found


def _check_new(path: Path, known: Mapping[str, Path]) -> None:
    if path.stem in known:
        raise ConfigurationError(f"{path}: the name {path.stem!r} is already used by {known[path.stem]}")


def data_files() -> list[Path]:
    """Every data file in use, the package's and added ones."""
    return [path for folder in _files().values() for path in folder.values()]


@cache
def _document(path: Path) -> Entry:
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        document = yaml.load(path.read_bytes(), loader)
    except OSError as error:
        raise ConfigurationError(f"cannot read {path}: {error.strerror}") from error
    except yaml.YAMLError as error:
        raise ConfigurationError(f"{path}: broken YAML: {' '.join(str(error).split())}") from error
    if not isinstance(document, dict):
        raise ConfigurationError(f"{path} must be a mapping, got {document!r}")
    if path.parent.name == "materials" and (unknown := [str(key) for key in document if key not in SHARED]):
        raise ConfigurationError(f"{path}: unknown section {unknown[0]!r}; {suggestion(unknown[0], SHARED)}")
    return document


@cache
def _section(name: str) -> dict[str, tuple[Path, Entry]]:
    """Entries of one section of all files, each with its file."""
    entries: dict[str, tuple[Path, Entry]] = {}
    for path in data_files():
        section = _document(path).get(name, {})
        if not isinstance(section, dict) or not all(isinstance(entry, dict) for entry in section.values()):
            raise ConfigurationError(f"{path}: {name} must be a mapping of mappings, got {section!r}")
        for key, entry in section.items():
            if key in entries:
                raise ConfigurationError(f"{path}: {name}.{key} is already defined in {entries[key][0]}")
            entries[key] = path, entry
    return entries


class Library(Mapping[str, T]):
    """The models of one folder of data files by name; each file is read when its name is first looked up."""

    def __init__(
        self, folder: str, read: Callable[[str, Entry, Path], T], materials_of: Callable[[T], Iterable[str | None]]
    ) -> None:
        """``read`` makes a model from a name, the file's content without the shared sections, and the file's path."""
        self._folder = folder
        self._read = read
        self._materials_of = materials_of
        self._models: dict[str, T] = {}

    def __getitem__(self, name: str) -> T:
        if name not in self._models:
            path = _files()[self._folder][name]
            content = {key: value for key, value in _document(path).items() if key not in SHARED}
            model = self._read(name, deepcopy(content), path)
            if FOLDER not in path.parents:
                self._check_materials(model, path)
            self._models[name] = model
        return self._models[name]

    def __iter__(self) -> Iterator[str]:
        return iter(_files()[self._folder])

    def __len__(self) -> int:
        return len(_files()[self._folder])

    def add(self, path: Path) -> T:
        """Add a file from outside the package, and return its model; raises ConfigurationError if it is not valid."""
        known = _files()[self._folder]
        _check_new(path, known)
        known[path.stem] = path
        _document.cache_clear()
        _section.cache_clear()
        try:
            for name, section in _SECTIONS.items():
                for key, (file, _) in _section(name).items():
                    if file == path:
                        section[key]
            return self[path.stem]
        except FieldtruthError:
            self.remove(path.stem)
            raise

    def _check_materials(self, model: T, path: Path) -> None:
        for material in self._materials_of(model):
            if material not in (None, *_section("materials")):
                hint = suggestion(str(material), _section("materials"))
                raise ConfigurationError(f"{path}: unknown material {material!r}; {hint}")

    def remove(self, name: str) -> None:
        """Forget a file and its materials and textures."""
        _files()[self._folder].pop(name, None)
        self._models.pop(name, None)
        _section.cache_clear()


class Section(Mapping[str, T]):
    """The entries of one section of all data files by name: those of ``first`` in that order, then in files' order."""

    def __init__(self, name: str, read: Callable[[str, Entry, str], T], first: tuple[str, ...] = ()) -> None:
        """``read`` makes a model from a name, the entry, and its file and section for messages."""
        self._name = name
        self._read = read
        self._first = first
        _SECTIONS[name] = self

    def entry(self, name: str) -> Entry:
        """Return an entry as the file has it."""
        return _section(self._name)[name][1]

    def __getitem__(self, name: str) -> T:
        path, entry = _section(self._name)[name]
        return self._read(name, entry, f"{path}: {self._name}.{name}")

    def __contains__(self, name: object) -> bool:
        return name in _section(self._name)  # reads no entry

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys((*self._first, *_section(self._name))))

    def __len__(self) -> int:
        return len(_section(self._name))


def validated(model: type[T], values: Mapping[str, Any], source: str) -> T:
    """Make a frozen dataclass from plain data; raises ConfigurationError that names ``source``, key and value."""
    if model not in _ADAPTERS:  # a configuration reaches standard dataclasses only through a container
        _ADAPTERS[model] = TypeAdapter(list[model], config=ConfigDict(extra="forbid", allow_inf_nan=False))  # type: ignore[valid-type]
    try:
        result: T = _ADAPTERS[model].validate_python([values])[0]
        return result
    except ValidationError as report:
        # A misspelt key is also a missing one: report the cause.
        first = min(report.errors(), key=lambda e: e["type"] != "unexpected_keyword_argument")
        key = ".".join(str(step) for step in first["loc"][1:])
        if first["type"] == "unexpected_keyword_argument":
            raise ConfigurationError(f"{source}: unknown key {key!r}") from report
        if first["type"] in ("missing", "missing_keyword_only_argument"):
            raise ConfigurationError(f"{source}: {key} is missing") from report
        rule = f"{key} {first['msg'].replace('Input should be', 'must be')}".strip()
        raise ConfigurationError(f"{source}: {rule}, got {first['input']!r}") from report
