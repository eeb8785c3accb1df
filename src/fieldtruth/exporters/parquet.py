# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tables in Parquet files of limited size, with the metadata that Hugging Face's ``datasets`` reads as features."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

_GROUP_BYTES: Final = 32 * 10**6
"""Rows are written together up to this size, which is in memory."""
_IMAGE: Final = pa.struct([("bytes", pa.binary()), ("path", pa.string())])


class Column(NamedTuple):
    """A column of a table."""

    name: str
    kind: str
    """``image``, ``classes``, or an Arrow type by name, with ``[]`` for a list of it: ``int64``, ``float32[]``."""
    about: str

    @property
    def is_list(self) -> bool:
        """Whether a cell has several values."""
        return self.kind.endswith("[]") or self.kind == "classes"

    @property
    def dtype(self) -> str:
        """Name of the type of a value."""
        return "int64" if self.kind == "classes" else self.kind.removesuffix("[]")

    def arrow(self) -> Any:
        """Return the Arrow type."""
        if self.kind == "image":
            return _IMAGE
        value = getattr(pa, self.dtype)()
        return pa.list_(value) if self.is_list else value

    def feature(self, names: Sequence[str]) -> dict[str, Any]:
        """Return the feature as ``datasets`` stores it in a file; ``names`` are those of the classes."""
        if self.kind == "image":
            return {"_type": "Image"}
        value: dict[str, Any] = {"dtype": self.dtype, "_type": "Value"}
        if self.kind == "classes":
            value = {"names": list(names), "_type": "ClassLabel"}
        return {"feature": value, "_type": "Sequence"} if self.is_list else value

    def card(self, names: Sequence[str]) -> dict[str, Any]:
        """Return the feature as it is written in the card's header."""
        if self.kind == "classes":
            named = {str(number): name for number, name in enumerate(names)}
            return {"name": self.name, "sequence": {"class_label": {"names": named}}}
        return {"name": self.name, "sequence" if self.is_list else "dtype": self.dtype}


class Written(NamedTuple):
    """Size of the files of a split."""

    files: tuple[Path, ...]
    rows: int
    memory_bytes: int

    @property
    def file_bytes(self) -> int:
        """Bytes on disk."""
        return sum(path.stat().st_size for path in self.files)


class Table(NamedTuple):
    """A configuration of a data set for Hugging Face."""

    name: str
    columns: tuple[Column, ...]
    splits: Mapping[str, Written]


class ParquetFiles:
    """Files ``SPLIT-00000-of-00003.parquet`` of a split, as a context; ``written`` is known at its end."""

    def __init__(self, folder: Path, split: str, columns: Sequence[Column], names: Sequence[str], most: int) -> None:
        self._folder, self._split, self._most = folder, split, most
        features = {column.name: column.feature(names) for column in columns}
        metadata = {"huggingface": json.dumps({"info": {"features": features}})}
        self._schema = pa.schema([(column.name, column.arrow()) for column in columns], metadata=metadata)
        self._rows: list[Mapping[str, Any]] = []
        self._waiting = self._size = self._count = self._total = 0
        self._writer: pq.ParquetWriter | None = None
        self._parts: list[Path] = []
        self.written = Written((), 0, 0)

    def __enter__(self) -> "ParquetFiles":
        return self

    def add(self, row: Mapping[str, Any], size: int) -> None:
        """Add a row that has ``size`` bytes; missing columns are null."""
        if self._waiting and self._waiting + size > min(_GROUP_BYTES, self._most):
            self._flush()
        self._rows.append(row)
        self._waiting += size

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if kind is None and self._rows:
            self._flush()
        if self._writer is not None:
            self._writer.close()
        if kind is None:
            self.written = Written(tuple(self._numbered()), self._count, self._total)

    def _flush(self) -> None:
        columns = [pa.array([row.get(field.name) for row in self._rows], field.type) for field in self._schema]
        table = pa.Table.from_arrays(columns, schema=self._schema)
        if self._writer is None or self._size + table.nbytes > self._most:
            self._writer = self._next_file()
        self._writer.write_table(table, row_group_size=len(table))
        self._count += len(table)
        self._size += table.nbytes
        self._total += table.nbytes
        self._rows, self._waiting = [], 0

    def _next_file(self) -> pq.ParquetWriter:
        if self._writer is not None:
            self._writer.close()
        self._folder.mkdir(exist_ok=True)
        path = self._folder / f"{self._split}.{len(self._parts)}"
        self._parts.append(path)
        self._size = 0
        return pq.ParquetWriter(path, self._schema, compression="zstd", use_dictionary=["run", "camera", "lidar"])

    def _numbered(self) -> list[Path]:
        """Rename the files, whose number is now known."""
        count = len(self._parts)
        return [
            part.rename(self._folder / f"{self._split}-{k:05d}-of-{count:05d}.parquet")
            for k, part in enumerate(self._parts)
        ]
