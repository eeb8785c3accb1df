# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Folders and files of the format ``files``, and the README.txt that describes them."""

from collections.abc import Collection, Iterator, Sequence
from textwrap import fill, wrap
from typing import Final, NamedTuple

import fieldtruth
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core.classes import CLASSES
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.exporters.files_text import TextFile
from fieldtruth.ontology.label_map import LabelMap

README: Final = "README.txt"
SHEET: Final = "data_proportion.xlsx"
CALIBRATION: Final = "calibration.yaml"
OBJECTS: Final = "instances.csv"


class Folder(NamedTuple):
    """A folder with a file per message of a topic."""

    topic: str
    msgtype: str
    path: str
    suffix: str
    about: str


def folders(sources: Collection[Source], label_map: LabelMap | None) -> Iterator[Folder]:
    """Folders of all topics that a run with these sensors may have."""
    for kind, of in ((Image, _image_folders), (Cloud, _cloud_folders)):
        for source in sources:
            if source.type is kind:
                yield from of(source, label_map)


def _image_folders(view: Source, label_map: LabelMap | None) -> Iterator[Folder]:
    def folder(part: str, path: str, about: str, suffix: str = ".png") -> Folder:
        topic = view.topics[part]
        return Folder(topic, view.msgtypes[topic], path, suffix, about)

    name = view.label
    yield folder("photo", f"img_{name}", f"photographs of the {name} camera, RGB")
    yield folder("label", f"img_{name}_tag", "tag images: each pixel in the flat colour of its class")
    if label_map is not None:
        yield folder("label", f"img_{name}_label_id", f"tag images as {label_map.name} ids, grey, 8 bits")
        yield folder("label", f"img_{name}_label_color", f"tag images in {label_map.name}'s colours, RGB")
    yield folder(
        "depth",
        f"depth_{name}",
        "depth along the optical axis in millimetres, grey, 16 bits; 0: no surface, or beyond 65.535 m",
    )
    yield folder(
        "depth",
        f"depth_{name}_raw",
        "depth in metres as in the bag, float32, infinite where no surface is: numpy.load(path)",
        ".npy",
    )
    yield folder(
        "instance",
        f"instances_{name}",
        "instance id of each pixel, grey, 16 bits (beyond id 65,535: R + 256 G + 65536 B); 0: no object",
    )
    yield folder(
        "normal",
        f"normals_{name}",
        "unit normals towards the camera in its optical frame (x right, y down, z forward), RGB, 16 bits: "
        "(sample - 32768) / 32767; 0 0 0: sky",
    )
    yield folder(
        "flow",
        f"flow_{name}",
        "optical flow to the next image in pixels, KITTI's RGB, 16 bits: to the right (R - 32768) / 64, down likewise "
        "of G; B = 0: outside the next image, hidden there, or 512 pixels or more",
    )
    yield folder(
        "flow",
        f"flow_{name}_raw",
        "optical flow as in the bag, Middlebury's .flo, float32: above 1e9 where it is not known",
        ".flo",
    )


def _cloud_folders(lidar: Source, label_map: LabelMap | None) -> Iterator[Folder]:
    kind, name = lidar.msgtypes[lidar.topic], lidar.name
    axes = f"metres in {lidar.frame} (x forward, y left, z up), and the class id"
    yield Folder(lidar.topic, kind, name, ".csv", f"columns x,y,z,reflectivity: {axes}")
    if label_map is not None:
        about = f"{label_map.name} id of each line of {name}/, uint32, little-endian: numpy.fromfile(path, '<u4')"
        yield Folder(lidar.topic, kind, f"{name}_label", ".label", about)


def readme(
    run: Run,
    all_folders: Sequence[Folder],
    all_texts: Sequence[TextFile],
    per_run: Sequence[tuple[str, str]],
    label_map: LabelMap | None,
) -> str:
    """Text of the README: existing and missing files.

    Args:
        run: the run.
        all_folders: folders of every topic; the run may lack some.
        all_texts: text files of every topic.
        per_run: names of the other files, with a description of each.
        label_map: the ontology of labels that were written beside ours.
    """
    here = [(f"{f.path}/<ns>{f.suffix}", f.about) for f in all_folders if f.topic in run.counts]
    texts = [text for text in all_texts if text.topic in run.counts]
    missing = [f"{f.path}/ ({f.topic})" for f in all_folders if f.topic not in run.counts]
    missing += [f"{text.path} ({text.topic})" for text in all_texts if text.topic not in run.counts]
    blocks = [
        f"{run.name}, {run.duration_s:.3f} s, in the format of the paper below.\n"
        f"Written by fieldtruth {fieldtruth.__version__} from {run.bag.name}.",
        fill(_STAMPS, 110),
        _section("A file per message; <ns> is its stamp", here),
        _section(
            "A line per message; columns are separated by spaces", [(t.path, f"{t.columns}\n{t.about}") for t in texts]
        ),
        fill(_NUMBERS, 110),
        _section("One file per run", per_run),
        _section("Missing, because the bag does not have the topic", [(each, "") for each in missing]),
        _classes(),
        "" if label_map is None else _other_classes(label_map),
        _PAPER,
    ]
    return "\n\n".join(block for block in blocks if block) + "\n"


def _section(title: str, rows: Sequence[tuple[str, str]]) -> str:
    if not rows:
        return ""
    width = max(len(name) for name, _ in rows) + 2
    lines = [title, "-" * len(title)]
    for name, about in rows:
        first, *rest = [text for part in about.split("\n") for text in wrap(part, 110 - width) or [""]]
        lines.append(f"{name:<{width}}{first}".rstrip())
        lines += [" " * width + text for text in rest]
    return "\n".join(lines)


def _classes() -> str:
    rows = [(f"{row.label:>3}  {row.name}", " ".join(map(str, row.rgb))) for row in CLASSES if row.rgb is not None]
    return _section("Classes: id, name, colour in the tag images (red, green, blue)", rows)


def _other_classes(label_map: LabelMap) -> str:
    """Which class of the ontology each of our classes becomes."""
    rows = []
    for row in CLASSES:
        if row.rgb is not None:
            number = int(label_map.ids[row.label])
            other = label_map.classes[number]
            rows.append(
                (f"{row.label:>3}  {row.name}", f"{number} {other.name}, colour {' '.join(map(str, other.rgb))}")
            )
    return _section(f"Classes in {label_map.name}", rows)


_STAMPS: Final = (
    "Stamps are integer nanoseconds of simulated time. They name the files and begin each line of text; readings with "
    "the same stamp were taken at the same instant. They are the stamps of the message headers. Wheel speeds and model "
    "states have no header: their stamps, and those of headers whose stamp is 0, are the bag's."
)
_NUMBERS: Final = (
    "Text files have no header line; the names of their columns are listed above. Numbers keep every bit of the bag: "
    "float32 in clouds and wheel speeds, float64 elsewhere."
)
_PAPER: Final = (
    "M. Sánchez, J. Morales, J. L. Martínez, J. J. Fernández-Lozano, A. García-Cerezo:\n"
    "Automatically Annotated Dataset of a Ground Mobile Robot in Natural Environments via Gazebo Simulations.\n"
    "Sensors 2022, 22(15), 5599. https://doi.org/10.3390/s22155599"
)
