# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export a run as images, CSV, text files and class shares, as the paper publishes it (section 5).

The bag is read once. Several threads write images and clouds and count classes; the reading thread writes the text.
"""

import csv
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any, Final, NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import read_objects
from fieldtruth.bag.readings import Readings
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import sources_of
from fieldtruth.core.arrays import Counts
from fieldtruth.core.classes import CLASSES, PALETTE
from fieldtruth.core.parallel import in_order
from fieldtruth.core.png import encode_png, ids_png
from fieldtruth.core.progress import counted
from fieldtruth.core.readings import Cloud, Image, Message
from fieldtruth.exporters import Options
from fieldtruth.exporters.depth_files import metres_npy, millimetres_png
from fieldtruth.exporters.files_layout import CALIBRATION, OBJECTS, README, SHEET, Folder, folders, readme
from fieldtruth.exporters.files_sheet import write_sheet
from fieldtruth.exporters.files_text import Row, TextFile, calibration_yaml, line, points_csv, pose_lines, text_files
from fieldtruth.exporters.geometry_files import flow_flo, flow_png, normals_png
from fieldtruth.ontology.label_map import LabelMap

_POSES: Final = (table.MODEL_STATES, table.ODOMETRY)
"""Topics of the true poses."""
_PER_RUN: Final = {
    CALIBRATION: "projection of the cameras, their baseline, and the pose of every sensor",
    OBJECTS: "columns id,name: the objects in the instance images",
    SHEET: "number of pixels and points of each class, with their shares and a chart",
}


class _Encoded(NamedTuple):
    """Files of a reading, bytes by folder, and counts by class id (18,) of "pixels" or "points" of a sensor."""

    files: Mapping[str, bytes]
    counts: Mapping[tuple[str, str], Counts] = {}


class _Writer(NamedTuple):
    """Readings, and what makes files of one, or a line of a text file."""

    readings: Readings
    encode: Callable[[Any], _Encoded | str]
    path: str = ""
    """Of the text file."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``, with a README.txt that describes what it has and what is missing.

    Raises:
        BagError: the bag has no messages of sensors, a topic has another type, two messages of a topic have the same
            stamp, an image or cloud cannot be read or has an unknown class, or the bag is damaged.
    """
    (run,) = runs
    sources = sources_of(run.rig, disabled=True).values()
    all_folders, all_texts = list(folders(sources, options.label_map)), list(text_files(run, sources))
    outputs: list[Folder | TextFile] = [*all_folders, *all_texts]
    known = {each.topic: each.msgtype for each in outputs}
    _check(run, known)
    _check_paths(run, [each.path for each in outputs])
    suffixes = {folder.path: folder.suffix for folder in all_folders if folder.topic in run.counts}
    for path in suffixes:
        (target / path).mkdir(parents=True)
    run.streams([topic for topic in {*known, table.ODOMETRY} - {table.MODEL_STATES} if topic in run.counts])
    writers = [*_image_writers(run, options.label_map), *_text_writers(run, all_texts)]
    counts = _write_readings(run, writers, suffixes, target, options)
    for text in all_texts:
        if text.topic in run.counts and text.topic in _POSES:
            with (target / text.path).open("w", encoding="ascii", newline="\n") as file:
                file.writelines(pose_lines(run, text.topic))
    per_run = _write_per_run(run, target, counts, options.label_map)
    about = readme(run, all_folders, all_texts, per_run, options.label_map)
    (target / README).write_text(about, encoding="utf-8")


def _check(run: Run, known: Mapping[str, str]) -> None:
    sensors = [topic for topic in known if topic not in _POSES]
    if run.counts.keys().isdisjoint(sensors):
        has = ", ".join(sorted(run.counts))
        raise BagError(f"{run.bag} has no messages of sensors; expected {', '.join(sensors)}; available: {has}")
    for topic, msgtype in known.items():
        if topic in run.counts and run.msgtypes[topic] != msgtype:
            raise BagError(f"{topic} of {run.bag} must be {msgtype}, got {run.msgtypes[topic]}")


def _check_paths(run: Run, paths: Sequence[str]) -> None:
    """Check that no two topics have the same path, as those of a LiDAR ``img_left`` and a camera ``left`` would."""
    if twice := next((path for path in paths if paths.count(path) > 1), None):
        raise BagError(f"{run.bag}: two sensors of the rig would have the same path {twice} in this format")


# ---------------------------------------------------------------------------------------------------------------------
# Readings, in time order


def _write_readings(
    run: Run, writers: Sequence[_Writer], suffixes: Mapping[str, str], target: Path, options: Options
) -> dict[tuple[str, str], Counts]:
    """Write files and lines of all readings; return the counts of the classes."""
    jobs = sorted(
        (stamp, k, row) for k, each in enumerate(writers) for row, stamp in enumerate(each.readings.stamps_ns.tolist())
    )
    counts: dict[tuple[str, str], Counts] = {}

    def work(job: tuple[int, int, int]) -> tuple[str, str] | Mapping[tuple[str, str], Counts]:
        stamp, k, row = job
        encoded = writers[k].encode(writers[k].readings.read(row))
        if isinstance(encoded, str):
            return writers[k].path, encoded
        for folder, data in encoded.files.items():
            (target / folder / f"{stamp}{suffixes[folder]}").write_bytes(data)
        return encoded.counts

    with ExitStack() as stack, options.progress.stage("write files", run.duration_s) as advance:
        files = {path: stack.enter_context(_opened(target / path)) for path in {each.path for each in writers} - {""}}
        for found in counted(in_order(jobs, work, options.workers), advance, run.duration_s, len(jobs)):
            if isinstance(found, tuple):
                files[found[0]].write(found[1])
            else:
                for key, more in found.items():
                    counts[key] = counts.get(key, 0) + more
    return counts


def _opened(path: Path) -> TextIO:
    path.parent.mkdir(parents=True, exist_ok=True)
    return path.open("w", encoding="ascii", newline="\n")


def _text_writers(run: Run, texts: Sequence[TextFile]) -> Iterator[_Writer]:
    for text in texts:
        if text.topic in run.counts and text.topic not in _POSES:
            yield _Writer(run.messages(text.topic), partial(_line, text.row), text.path)


def _line(row: Row, reading: Message) -> str:
    return line(reading.stamp_ns, row(reading.value))


def _image_writers(run: Run, label_map: LabelMap | None) -> Iterator[_Writer]:
    """Each part of the images is written, also at a stamp at which another is missing."""
    encoders: Mapping[str, Callable[[str, Any], _Encoded]] = {
        "photo": lambda name, image: _Encoded({f"img_{name}": encode_png(image.photo)}),
        "label": partial(_tag, label_map),
        "depth": _depth,
        "instance": lambda name, image: _Encoded({f"instances_{name}": ids_png(image.instance)}),
        "normal": lambda name, image: _Encoded({f"normals_{name}": normals_png(image.normal)}),
        "flow": _flow,
    }
    for view in run.of(Image, recorded=False):
        for part in view.recorded(run.counts):
            yield _Writer(run.readings(view.name, [part]), partial(encoders[part], view.label))
    for lidar in run.of(Cloud):
        yield _Writer(run[lidar.name], partial(_cloud, lidar.name, label_map))


def _tag(label_map: LabelMap | None, name: str, image: Image) -> _Encoded:
    assert image.label is not None
    label = image.label
    files = {f"img_{name}_tag": encode_png(PALETTE[label])}
    if label_map is not None:
        ids = label_map.ids[label]
        files |= {
            f"img_{name}_label_id": encode_png(ids),
            f"img_{name}_label_color": encode_png(label_map.colours()[ids]),
        }
    return _Encoded(files, {("pixels", name): _count(label)})


def _depth(name: str, image: Any) -> _Encoded:
    return _Encoded({f"depth_{name}": millimetres_png(image.depth), f"depth_{name}_raw": metres_npy(image.depth)})


def _flow(name: str, image: Any) -> _Encoded:
    return _Encoded({f"flow_{name}": flow_png(image.flow), f"flow_{name}_raw": flow_flo(image.flow)})


def _cloud(name: str, label_map: LabelMap | None, cloud: Cloud) -> _Encoded:
    last = cloud.others.get("intensity", cloud.label)
    files = {name: points_csv(np.concatenate([cloud.xyz, last[:, None]], axis=1, dtype=cloud.xyz.dtype))}
    if label_map is not None:
        files[f"{name}_label"] = label_map.ids[cloud.label].astype("<u4").tobytes()
    return _Encoded(files, {("points", name): _count(cloud.label)})


def _count(label: NDArray[np.uint8]) -> Counts:
    return np.bincount(label.reshape(-1), minlength=len(CLASSES))


# ---------------------------------------------------------------------------------------------------------------------
# Files of the whole run


def _write_per_run(
    run: Run, target: Path, counts: Mapping[tuple[str, str], Counts], label_map: LabelMap | None
) -> list[tuple[str, str]]:
    """Write calibration, names of objects and class shares as far as the run has them; return file names and texts."""
    if calibration := calibration_yaml(run):
        (target / CALIBRATION).write_text(calibration, encoding="utf-8")
    if table.MODEL_STATES in run.counts and run.of(Image, "instance"):
        (target / OBJECTS).write_text(_objects(run), encoding="utf-8")
    if any(found.any() for found in counts.values()):
        labels = [view.label for view in run.sensors.values()]
        pixels, points = (
            {name: counts[what, name] for name in labels if (what, name) in counts} for what in ("pixels", "points")
        )
        write_sheet(target / SHEET, run.name, pixels, points, label_map)
    return [(name, about) for name, about in _PER_RUN.items() if (target / name).exists()]


def _objects(run: Run) -> str:
    """CSV of the ids and names of all objects, which are the rows of the topic with the objects."""
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows(enumerate(read_objects(run)[0]))
    return text.getvalue()
