# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""COCO's two files, written row by row: a long drive has more annotations than memory should hold."""

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, TextIO

import fieldtruth
from fieldtruth.bag.run import Run
from fieldtruth.ontology.label_map import LabelMap

LICENCE: Final = {"id": 1, "name": "CC BY 4.0", "url": "https://creativecommons.org/licenses/by/4.0/"}


class Rows:
    """An array in a text file that grows."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._separator = "\n"

    def add(self, row: Mapping[str, Any]) -> None:
        """Add an object."""
        self._stream.write(self._separator + json.dumps(row, separators=(",", ":")))
        self._separator = ",\n"


@contextmanager
def document(path: Path, head: Mapping[str, Any], images: Path) -> Iterator[Rows]:
    """Write the keys in ``head``, the annotations that are added, and the images, whose rows lie in a file."""
    with path.open("w", encoding="utf-8") as stream:
        stream.write("{")
        for key, value in head.items():
            stream.write(f"{json.dumps(key)}:{json.dumps(value, ensure_ascii=False)},\n")
        stream.write('"annotations":[')
        yield Rows(stream)
        stream.write('\n],\n"images":[')
        with images.open(encoding="utf-8") as rows:
            shutil.copyfileobj(rows, stream)
        stream.write("\n]}\n")


def head_of(run: Run, label_map: LabelMap | None) -> dict[str, Any]:
    """Return what both files say of the whole: ``info`` and ``licenses``.

    Only bags that this package made are known to be free: the licences of others are not told.
    """
    info: dict[str, Any] = {
        "description": f"{run.name}: pictures with the true class and object of each pixel",
        "version": fieldtruth.__version__,
        "contributor": "fieldtruth",
        "run": run.name,
        "labels": "fieldtruth" if label_map is None else label_map.name,
    }
    if run.experiment is not None:
        info |= {"environment": run.experiment.environment, "seed": run.experiment.seed}
    return {"info": info, "licenses": [] if run.experiment is None else [LICENCE]}
