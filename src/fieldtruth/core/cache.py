# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The one key under which results are kept in the cache folder and in a run's slices, and the seal of their files.

A result may be used again only if everything that shaped it is the same: the code, the data files that the code reads,
the versions of the libraries, and the input values. ``cache_key`` covers all four. A seal is a digest of content and
name at the end of a file, which shows damage, and a file under a wrong name: BLAKE2b, which reads some 1.3 GB/s on one
core.
"""

import dataclasses
import hashlib
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from glob import escape
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from platformdirs import user_cache_path

SEAL_SIZE: Final = 32  # [byte]
_SEAL_BLOCK: Final = 2**20  # [byte]
_ROOT: Final = Path(__file__).parents[2]
_PACKAGE: Final = "fieldtruth"
KERNELS: Final = "kernels"
"""Folder in the cache folder that holds the kernels of each key in a folder of their own."""
_IMPORT: Final = re.compile(
    rf"^[ \t]*(?:from ({_PACKAGE}[\w.]*) import (\([^)]*\)|[^\n]+)|import ({_PACKAGE}[\w.]*))", re.MULTILINE
)
_DATA: Final = re.compile(r'Path\(__file__\)\.parent / "(\w+)"')


def cache_folder() -> Path:
    """Folder for worlds, baked light and compiled kernels, such as ``~/.cache/fieldtruth``; it may not exist yet.

    For a user without a home it is one that cannot exist, so that everything is made in memory.
    """
    with suppress(RuntimeError):
        folder = user_cache_path(_PACKAGE)
        if folder.is_absolute():
            return folder
    return Path(os.devnull) / _PACKAGE


def kernel_folder(key: str) -> Path:
    """Folder for the compiled kernels of one key, marked as used."""
    folder = cache_folder() / KERNELS / key
    mark_used(folder)
    return folder


def mark_used(path: Path) -> None:
    """Set the time of a file's or folder's last use to now, if that can be written."""
    with suppress(OSError):
        os.utime(path)


def add_seal(file: BinaryIO, name: str) -> None:
    """Seal an open file, readable and writable, at its end; ``name`` says what it holds: a key of its inputs."""
    file.seek(0)
    digest = hashlib.blake2b(name.encode() + b"\0", digest_size=SEAL_SIZE)
    while block := file.read(_SEAL_BLOCK):
        digest.update(block)
    file.write(digest.digest())


def is_sealed(path: Path, name: str) -> bool:
    """Return whether a file is as it was sealed under this name; False, too, if it is missing or cannot be read."""
    digest = hashlib.blake2b(name.encode() + b"\0", digest_size=SEAL_SIZE)
    try:
        with path.open("rb") as file:
            left = path.stat().st_size - SEAL_SIZE
            while left > 0 and (block := file.read(min(left, _SEAL_BLOCK))):
                digest.update(block)
                left -= len(block)
            return left == 0 and file.read() == digest.digest()
    except OSError:
        return False


def file_digests(paths: Iterable[Path]) -> list[bytes]:
    """Digests of files, each with those beside it that have its name with another ending, as of a Shapefile."""
    found = []
    for path in paths:
        beside = {each for each in path.parent.glob(f"{escape(path.stem)}.*") if each.is_file()}
        for each in sorted({path, *beside}):
            with each.open("rb") as file:
                found.append(each.suffix.encode() + hashlib.file_digest(file, "blake2b").digest())
    return found


def cache_key(modules: Iterable[str], *inputs: object, libraries: Sequence[str] = ()) -> str:
    """Digest of modules with everything that they import of this package, of libraries' versions and of inputs.

    Args:
        modules: names of the modules that make the result. Modules that are imported by a computed name are not found
            through imports and must be listed here. Of modules outside this package, their own source counts.
        inputs: dataclasses, mappings, sequences, arrays, bytes or plain values; compared by value.
        libraries: distributions whose version shapes the result.

    Returns:
        32 hexadecimal digits.
    """
    digest = hashlib.sha256(_sources_digest(tuple(modules)))
    _update(digest, [sys.version_info[:2], [(name, version(name)) for name in libraries], inputs])
    return digest.hexdigest()[:32]


@cache
def _sources_digest(modules: tuple[str, ...]) -> bytes:
    digest = hashlib.sha256()
    for path in import_closure(modules, _ROOT):
        _update(digest, [path.relative_to(_ROOT).as_posix(), path.read_bytes()])
    for name in modules:
        if name.partition(".")[0] != _PACKAGE:  # an environment of a user
            spec = find_spec(name)
            _update(digest, [name, Path(spec.origin).read_bytes() if spec and spec.origin else b""])
    return digest.digest()


def import_closure(modules: Iterable[str], root: Path) -> list[Path]:
    """Files below ``root`` on which modules depend, sorted: their sources, those of all that they import, and data.

    Late imports count, too. Data files are those beside a module in its folder (``*.yaml`` and the like)
    and in folders that a module names as ``Path(__file__).parent / "NAME"``.
    """
    found: dict[str, Path] = {}
    data: set[Path] = set()
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        path = _source(name, root)
        if name in found or path is None:
            continue
        found[name] = path
        source = path.read_text(encoding="utf-8")
        waiting += _imports(source)
        data |= {p for name in _DATA.findall(source) for p in (path.parent / name).rglob("*") if p.is_file()}
        waiting.append(name.rpartition(".")[0])  # importing a.b.c runs a.b/__init__.py
    data |= {p for source in found.values() for p in source.parent.iterdir() if p.is_file() and p.suffix not in _CODE}
    return sorted({*found.values(), *data})


_CODE: Final = (".py", ".pyi", ".pyc", ".typed", ".part")


def _source(name: str, root: Path) -> Path | None:
    stem = root / name.replace(".", "/") if name else None
    candidates = [] if stem is None else [stem.with_suffix(".py"), stem / "__init__.py"]
    return next((path for path in candidates if path.is_file()), None)


def _imports(source: str) -> Iterator[str]:
    for parent, names, module in _IMPORT.findall(source):
        if module:
            yield module
            continue
        yield parent
        for name in re.sub(r"#[^\n]*|[()\s]", " ", names).split(","):
            yield f"{parent}.{(name.split() or [''])[0]}"


def _update(digest: Any, value: object) -> None:
    """Feed a value to a hash object; values of different type or structure never feed the same bytes."""
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape}".encode())
        digest.update(np.ascontiguousarray(value).data)
    elif dataclasses.is_dataclass(value):
        _update(digest, [(field.name, getattr(value, field.name)) for field in dataclasses.fields(value)])
    elif isinstance(value, Mapping):
        _update(digest, list(value.items()))
    elif isinstance(value, bytes):
        digest.update(f"{len(value)}:".encode() + value)
    elif isinstance(value, Sequence) and not isinstance(value, str):
        digest.update(f"{len(value)}:".encode())
        for item in value:
            _update(digest, item)
    else:
        digest.update(repr(value).encode())
