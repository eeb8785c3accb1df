# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The container of glTF 2.0: JSON and one binary buffer in a GLB file, which is written as a stream."""

import json
import shutil
import struct
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.errors import OutputError

VERTICES, INDICES = 34962, 34963
"""Targets of buffer views (ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER)."""
LARGEST: Final = 2**32 - 2**27
"""Largest buffer [byte]: lengths in a GLB are 32 bits; the JSON needs some, too."""

_COMPONENTS: Final = {"f4": 5126, "u1": 5121, "u2": 5123, "u4": 5125}
_TYPES: Final = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


class Glb:
    """A GLB file that grows: ``add`` items to the JSON's lists, arrays and images to the buffer, then ``save``.

    The buffer is a temporary file beside the output, so that a scene larger than the memory can be written.
    """

    def __init__(self, folder: Path, head: Mapping[str, object]) -> None:
        """``head``: the JSON's items that are not lists."""
        self._json: dict[str, Any] = dict(head)
        self._buffer = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115
        self._length = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._buffer.close()

    def add(self, key: str, item: Mapping[str, object]) -> int:
        """Append an item to one of the JSON's lists (nodes, meshes, ...) and return its index."""
        items: list[Mapping[str, object]] = self._json.setdefault(key, [])
        items.append(item)
        return len(items) - 1

    def array(self, values: NDArray[Any], *, target: int | None = None, bounds: bool = False) -> int:
        """Append an array (n,) or (n, 2 to 4) of float32 or unsigned integers; return the index of its accessor.

        ``bounds`` adds the smallest and largest values, which positions must have.
        """
        rows = values.reshape(len(values), -1)
        accessor: dict[str, object] = {
            "bufferView": self._view(np.ascontiguousarray(values).tobytes(), target),
            "componentType": _COMPONENTS[values.dtype.str[1:]],
            "count": len(values),
            "type": _TYPES[rows.shape[1]],
        }
        if bounds:
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        return self.add("accessors", accessor)

    def image(self, name: str, jpeg: bytes) -> int:
        """Append a JPEG and return the index of the image."""
        return self.add("images", {"name": name, "mimeType": "image/jpeg", "bufferView": self._view(jpeg, None)})

    def _view(self, data: bytes, target: int | None) -> int:
        view: dict[str, object] = {"buffer": 0, "byteOffset": self._length, "byteLength": len(data)}
        padding = -len(data) % 4
        if self._length + len(data) + padding > LARGEST:
            raise OutputError(f"the scene is larger than a GLB file can be ({LARGEST / 1e9:.1f} GB); use --no-beyond")
        self._buffer.write(data + bytes(padding))
        self._length += len(data) + padding
        return self.add("bufferViews", view if target is None else view | {"target": target})

    def save(self, path: Path) -> None:
        """Write the file."""
        self._json["buffers"] = [{"byteLength": self._length}]
        text = json.dumps(self._json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        with path.open("wb") as stream:
            stream.write(struct.pack("<4s2I", b"glTF", 2, 12 + 8 + len(text) + 8 + self._length))
            stream.write(struct.pack("<I4s", len(text), b"JSON") + text)
            stream.write(struct.pack("<I4s", self._length, b"BIN\0"))
            self._buffer.seek(0)
            shutil.copyfileobj(self._buffer, stream, 1 << 20)
