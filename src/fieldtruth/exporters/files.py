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
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import depth, flow, image, instances, labels, normals, reading_stamp, stamp_ns
from fieldtruth.bag.model_states import read_objects
from fieldtruth.bag.reader import BagError, BagReader, RawMessage, decoder, open_bag
from fieldtruth.bag.run import Run
from fieldtruth.core.arrays import Counts
from fieldtruth.core.classes import CLASSES
from fieldtruth.core.parallel import in_order
from fieldtruth.core.png import encode_png, ids_png
from fieldtruth.core.progress import timed
from fieldtruth.exporters import Options
from fieldtruth.exporters.depth_files import metres_npy, millimetres_png
from fieldtruth.exporters.files_layout import CALIBRATION, OBJECTS, README, SHEET, Folder, folders, readme
from fieldtruth.exporters.files_sheet import write_sheet
from fieldtruth.exporters.files_text import (
    TextFile,
    calibration_yaml,
    line,
    points_csv,
    text_files,
)
from fieldtruth.exporters.geometry_files import flow_flo, flow_png, normals_png
from fieldtruth.exporters.sequences import returns
from fieldtruth.ontology.label_map import LabelMap

_PER_RUN: Final = {
    CALIBRATION: "projection of the cameras, their baseline, and the pose of every sensor",
    OBJECTS: "columns id,name: the objects in the instance images",
    SHEET: "number of pixels and points of each class, with their shares and a chart",
}


class _Encoded(NamedTuple):
    """Files of a message, bytes by folder, and counts by class id (18,) of "pixels" or "points" of a sensor."""

    files: Mapping[str, bytes]
    counts: Mapping[tuple[str, str], Counts] = {}


_Encoder = Callable[[Any], _Encoded]


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``, with a README.txt that describes what it has and what is missing.

    Raises:
        BagError: the bag has no messages of sensors, a topic has another type, two messages of a topic have the same
            stamp, an image or cloud cannot be read or has an unknown class, or the bag is damaged.
    """
    (run,) = runs
    all_folders, all_texts = list(folders(run.rig, options.label_map)), list(text_files(run))
    outputs: list[Folder | TextFile] = [*all_folders, *all_texts]
    known = {each.topic: each.msgtype for each in outputs}
    topics = [topic for topic in known if topic in run.counts]
    _check(run, known)
    _check_paths(run, [each.path for each in outputs])
    suffixes = {folder.path: folder.suffix for folder in all_folders if folder.topic in run.counts}
    for path in suffixes:
        (target / path).mkdir(parents=True)
    counts: dict[tuple[str, str], Counts] = {}
    with (
        ExitStack() as stack,
        open_bag(run.bag, true_stamps=run.clocked) as bag,
        options.progress.stage("write files", run.duration_s) as advance,
    ):
        write_line = _line_writers(stack, bag, target, [text for text in all_texts if text.topic in topics])
        work = partial(_save, run, decoder(bag), _encoders(run, options.label_map), target, suffixes)
        messages = timed(bag.messages(topics), advance, run.start_ns)
        for found in in_order(_images_and_clouds(messages, write_line), work, options.workers):
            for key, more in found.items():
                counts[key] = counts.get(key, 0) + more
    per_run = _write_per_run(run, target, counts, options.label_map)
    text = readme(run, all_folders, all_texts, per_run, options.label_map)
    (target / README).write_text(text, encoding="utf-8")


def _check(run: Run, known: Mapping[str, str]) -> None:
    sensors = [topic for topic in known if topic not in (table.MODEL_STATES, table.ODOMETRY)]
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
# Lines of text, in the reading thread


def _line_writers(
    stack: ExitStack, bag: BagReader, target: Path, texts: Sequence[TextFile]
) -> Mapping[str, Callable[[RawMessage], object]]:
    """Functions that write a message as a line, for each topic with a text file."""
    decode = decoder(bag)

    def writer(text: TextFile) -> Callable[[RawMessage], object]:
        path, row = target / text.path, text.make_row(decode)
        path.parent.mkdir(parents=True, exist_ok=True)
        file = stack.enter_context(path.open("w", encoding="ascii", newline="\n"))
        return lambda raw: file.write(line(*row(raw)))

    return {text.topic: writer(text) for text in texts}


def _images_and_clouds(
    messages: Iterator[RawMessage], write_line: Mapping[str, Callable[[RawMessage], object]]
) -> Iterator[RawMessage]:
    """Messages of images and clouds; the others are written as lines of text."""
    for raw in messages:
        if raw.topic in write_line:
            write_line[raw.topic](raw)
        else:
            yield raw


# ---------------------------------------------------------------------------------------------------------------------
# Images and clouds, in the workers


def _save(
    run: Run,
    decode: Callable[[RawMessage], Any],
    encoders: Mapping[str, _Encoder],
    target: Path,
    suffixes: Mapping[str, str],
    raw: RawMessage,
) -> Mapping[tuple[str, str], Counts]:
    message = decode(raw)
    stamp = reading_stamp(raw.stamp_ns, message.header)
    encoded = encoders[raw.topic](message)
    for folder, data in encoded.files.items():
        try:
            with (target / folder / f"{stamp}{suffixes[folder]}").open("xb") as file:
                file.write(data)
        except FileExistsError:
            raise BagError(f"{run.bag}: {raw.topic} has two messages with the stamp {stamp} ns") from None
    return encoded.counts


def _encoders(run: Run, label_map: LabelMap | None) -> Mapping[str, _Encoder]:
    images: dict[str, _Encoder] = {}
    for imager in run.rig.imagers:
        name = imager.name
        images |= {
            imager.topic_of("photograph"): partial(_photograph, name),
            imager.topic_of("tag"): partial(_tag, name, label_map),
            imager.topic_of("depth"): partial(_depth, name),
            imager.topic_of("instances"): partial(_instances, name),
            imager.topic_of("normals"): partial(_normals, name),
            imager.topic_of("flow"): partial(_flow, name),
        }
    named = {topic: partial(_with_context, run, topic, make) for topic, make in images.items()}
    return named | {lidar.topic: partial(_cloud, run, lidar.name, label_map) for lidar in run.rig.lidars}


def _with_context(run: Run, topic: str, make: _Encoder, message: Any) -> _Encoded:
    try:
        return make(message)
    except BagError as error:
        raise BagError(f"{run.bag}: {topic} at {stamp_ns(message.header)} ns: {error}") from error


def _photograph(name: str, message: Any) -> _Encoded:
    return _Encoded({f"img_{name}": encode_png(image(message))})


def _tag(name: str, label_map: LabelMap | None, message: Any) -> _Encoded:
    colours = image(message)
    label = labels(colours)
    files = {f"img_{name}_tag": encode_png(colours)}
    if label_map is not None:
        ids = label_map.ids[label]
        files |= {
            f"img_{name}_label_id": encode_png(ids),
            f"img_{name}_label_color": encode_png(label_map.colours()[ids]),
        }
    return _Encoded(files, {("pixels", name): _count(label)})


def _depth(name: str, message: Any) -> _Encoded:
    metres = depth(message)
    return _Encoded({f"depth_{name}": millimetres_png(metres), f"depth_{name}_raw": metres_npy(metres)})


def _instances(name: str, message: Any) -> _Encoded:
    return _Encoded({f"instances_{name}": ids_png(instances(message))})


def _normals(name: str, message: Any) -> _Encoded:
    return _Encoded({f"normals_{name}": normals_png(normals(message))})


def _flow(name: str, message: Any) -> _Encoded:
    pixels = flow(message)
    return _Encoded({f"flow_{name}": flow_png(pixels), f"flow_{name}_raw": flow_flo(pixels)})


def _cloud(run: Run, name: str, label_map: LabelMap | None, message: Any) -> _Encoded:
    rows, label = returns(message, run)
    names = rows.dtype.names or ()
    reflectivity = rows["intensity"] if "intensity" in names else label
    kind = np.result_type(np.float32, *(rows.dtype[axis] for axis in "xyz"))
    columns = [rows["x"], rows["y"], rows["z"], reflectivity]
    files = {name: points_csv(np.stack(columns, axis=1, dtype=kind))}
    if label_map is not None:
        files[f"{name}_label"] = label_map.ids[label].astype("<u4").tobytes()
    return _Encoded(files, {("points", name): _count(label)})


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
    has_instances = any(imager.topic_of("instances") in run.counts for imager in run.rig.imagers)
    if table.MODEL_STATES in run.counts and has_instances:
        (target / OBJECTS).write_text(_objects(run), encoding="utf-8")
    if any(found.any() for found in counts.values()):
        pixels = {each.name: counts["pixels", each.name] for each in run.rig.imagers if ("pixels", each.name) in counts}
        points = {each.name: counts["points", each.name] for each in run.rig.lidars if ("points", each.name) in counts}
        write_sheet(target / SHEET, run.name, pixels, points, label_map)
    return [(name, about) for name, about in _PER_RUN.items() if (target / name).exists()]


def _objects(run: Run) -> str:
    """CSV of the ids and names of all objects, which are the rows of the topic with the objects."""
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows(enumerate(read_objects(run)[0]))
    return text.getvalue()
