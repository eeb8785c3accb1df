# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Read and write YAML: safe types only, duplicate keys are errors, ``1e3`` is a number, floats keep every bit."""

import re
from collections.abc import Mapping, Sequence
from importlib import resources
from operator import attrgetter
from pathlib import Path
from typing import Any, Final

import yaml

from fieldtruth.core.errors import ConfigurationError

MAX_FILE_SIZE: Final = 4 << 20  # [byte]; enough for 50,000 waypoints, and keeps bags from being parsed
_EXPONENT: Final = re.compile(r"^[-+]?[0-9]+(?:\.[0-9]*)?[eE][-+]?[0-9]+$")


class _Loader(yaml.SafeLoader):
    """Safe YAML 1.1, except that a duplicate key is an error and ``1e3`` is a number as in YAML 1.2."""

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        node: yaml.MappingNode = super().compose_mapping_node(anchor)
        keys = [key for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
        for i, key in enumerate(keys):
            if key.value in [other.value for other in keys[:i]]:
                raise yaml.constructor.ConstructorError(None, None, f"duplicate key {key.value!r}", key.start_mark)
        return node


class _Dumper(yaml.SafeDumper):
    """Block style, except that a list of scalars is written on one line."""


def _represent_list(dumper: yaml.SafeDumper, data: Sequence[object]) -> yaml.Node:
    plain = not any(isinstance(item, list | dict) for item in data)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=plain)


for _side in (_Loader, _Dumper):  # the writer too, so that it quotes a string such as "1e3"
    _side.add_implicit_resolver("tag:yaml.org,2002:float", _EXPONENT, list("-+0123456789"))
_Dumper.add_representer(list, _represent_list)


def parse_mapping(text: str, source: str) -> dict[str, Any]:
    """Read one mapping.

    Raises:
        ConfigurationError: invalid YAML (with line and column), or not a mapping. ``source`` is put in front.
    """
    try:
        data = yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f" at line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise ConfigurationError(f"{source}: invalid YAML{where}: {error.problem or error.context}") from error
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise ConfigurationError(f"{source}: invalid YAML at line {line}: {error.reason}") from error
    except RecursionError as error:
        raise ConfigurationError(f"{source}: invalid YAML: nested too deeply") from error
    except ValueError as error:  # a date or a number that does not exist
        raise ConfigurationError(f"{source}: invalid YAML: {error}") from error
    if not isinstance(data, dict):
        raise ConfigurationError(f"{source}: must be a mapping of keys to values (key: value), got {data!r:.60}")
    return data


def read_data(name: str, given: Any) -> dict[str, Any]:
    """Return what a registry has by a name: the mapping in a file, or one that an entry point names.

    Raises:
        ConfigurationError: it cannot be read, or is neither.
    """
    if isinstance(given, str | Path):
        return parse_mapping(read_text(Path(given)), str(given))
    if not isinstance(given, Mapping):
        raise ConfigurationError(f"{name}: must be the path of a YAML file or a mapping, got {given!r:.60}")
    return dict(given)


def package_data(package: str, name: str) -> dict[str, Any]:
    """Return the mapping in a YAML file of a package: its texts or tables."""
    return parse_mapping(resources.files(package).joinpath(name).read_text(encoding="utf-8"), name)


def filled(node: Any, values: Mapping[str, Any]) -> Any:
    """Fill a template: text ``$name.attribute`` becomes that attribute of one of the values, all else is copied."""
    if isinstance(node, dict):
        return {key: filled(each, values) for key, each in node.items()}
    if not (isinstance(node, str) and node.startswith("$")):
        return [filled(each, values) for each in node] if isinstance(node, list) else node
    name, _, attribute = node[1:].partition(".")
    found = attrgetter(attribute)(values[name]) if attribute else values[name]
    return list(found) if isinstance(found, list) else found  # a copy: YAML would refer to the first of two


def write_mapping(data: Mapping[str, object]) -> str:
    """Write a mapping of plain values in its own order; :func:`parse_mapping` reads back an equal one."""
    return yaml.dump(dict(data), Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=120)


def read_text(path: Path) -> str:
    """Read a configuration file.

    Raises:
        ConfigurationError: it cannot be read, is not UTF-8, or is too large for a configuration.
    """
    try:
        if path.is_dir():
            raise ConfigurationError(f"{path} is a folder; give a YAML file in it")
        if path.stat().st_size > MAX_FILE_SIZE:
            raise ConfigurationError(f"{path} is too large for a configuration: more than {MAX_FILE_SIZE >> 20} MiB")
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigurationError(f"cannot read {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"cannot read {path}: byte {error.start} is not UTF-8") from error
    except ValueError as error:  # a path with a null byte
        raise ConfigurationError(f"cannot read {str(path)!r}: {error}") from error
