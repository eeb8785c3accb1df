# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What lies where in the human-readable form of a run, and the README.txt that says so."""

from collections.abc import Iterator, Sequence
from textwrap import fill, wrap
from typing import Final, NamedTuple

import fieldtruth
from fieldtruth.bag import topics as table
from fieldtruth.bag.run import Run
from fieldtruth.core.classes import CLASSES
from fieldtruth.exporters.text_files import TextFile
from fieldtruth.ontology.label_map import LabelMap

README: Final = "README.txt"
SHEET: Final = "data_proportion.xlsx"
CALIBRATION: Final = "calibration.yaml"
OBJECTS: Final = "instances.csv"
LIDAR: Final = "lidar"
LIDAR_LABEL: Final = "lidar_label"


class Folder(NamedTuple):
    """A folder with a file per message of a topic."""

    topic: str
    path: str
    ending: str
    about: str


def folders(label_map: LabelMap | None) -> Iterator[Folder]:
    """Folders of all topics that a run could have."""
    for side in table.SIDES:
        yield Folder(table.photograph(side), f"img_{side}", ".png", f"photographs of the {side} camera, RGB")
        yield Folder(
            table.tag(side), f"img_{side}_tag", ".png", "their tags: each pixel in the flat colour of its class"
        )
        if label_map is not None:
            yield Folder(
                table.tag(side), f"img_{side}_label_id", ".png", f"the tags as {label_map.name} ids, grey, 8 bits"
            )
            yield Folder(
                table.tag(side), f"img_{side}_label_color", ".png", f"the same in {label_map.name}'s colours, RGB"
            )
        yield Folder(
            table.depth(side),
            f"depth_{side}",
            ".png",
            "distance along the optical axis in millimetres, grey, 16 bits; 0: nothing there, or beyond 65.535 m",
        )
        yield Folder(
            table.depth(side),
            f"depth_{side}_raw",
            ".npy",
            "the same in metres as the bag has it, float32, infinite where nothing is: numpy.load(path)",
        )
        yield Folder(
            table.instances(side), f"instances_{side}", ".png", "object of each pixel, grey, 16 bits; 0: nothing"
        )
    axes = "metres in os1_lidar (x forward, y left, z up), and the class id"
    yield Folder(table.POINTS, LIDAR, ".csv", f"columns x,y,z,reflectivity: {axes}")
    if label_map is not None:
        about = f"{label_map.name} id of each line of {LIDAR}/, uint32, little-endian: numpy.fromfile(path, '<u4')"
        yield Folder(table.POINTS, LIDAR_LABEL, ".label", about)


def readme(
    run: Run,
    all_folders: Sequence[Folder],
    all_texts: Sequence[TextFile],
    beside: Sequence[tuple[str, str]],
    label_map: LabelMap | None,
) -> str:
    """Text of the README: what is there and what is missing.

    Args:
        run: the bag.
        all_folders: those of every topic; the run may lack some.
        all_texts: text files of every topic.
        beside: other files that were written, with a word about each.
        label_map: other labels that were written, too.
    """
    here = [(f"{f.path}/<ns>{f.ending}", f.about) for f in all_folders if f.topic in run.counts]
    texts = [text for text in all_texts if text.topic in run.counts]
    missing = [f"{f.path}/ ({f.topic})" for f in all_folders if f.topic not in run.counts]
    missing += [f"{text.path} ({text.topic})" for text in all_texts if text.topic not in run.counts]
    blocks = [
        f"{run.name}, {run.duration_s:.3f} s, in the human-readable form of the paper below.\n"
        f"Written by fieldtruth {fieldtruth.__version__} from {run.bag.name}.",
        fill(_STAMPS, 110),
        _section("A file per message; <ns> is its stamp", here),
        _section(
            "A line per message; columns are separated by a blank", [(t.path, f"{t.columns}\n{t.about}") for t in texts]
        ),
        fill(_NUMBERS, 110),
        _section("Once", beside),
        _section("Not here, because the bag does not have it", [(each, "") for each in missing]),
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
    return _section("Classes: id, name, colour in the tags (red, green, blue)", rows)


def _other_classes(label_map: LabelMap) -> str:
    """Ids there of our classes, and what they mean there."""
    rows = []
    for row in CLASSES:
        if row.rgb is not None:
            number = int(label_map.ids[row.label])
            other = label_map.classes[number]
            rows.append(
                (f"{row.label:>3}  {row.name}", f"{number} {other.name}, colour {' '.join(map(str, other.rgb))}")
            )
    return _section(f"What they become in {label_map.name}", rows)


_STAMPS: Final = (
    "Stamps are nanoseconds of simulated time, whole numbers. They name the files and begin each line of text; what "
    "has the same stamp was measured at the same instant. They are those of the messages' headers; wheel speeds and "
    "model states have none, so there, and where a header holds 0, they are the bag's."
)
_NUMBERS: Final = (
    "No file has a line of headings, so that every line is a reading; where a program wants one, the columns' names "
    "above belong on top. Numbers keep every bit of the bag's: float32 in clouds and wheel speeds, float64 elsewhere."
)
_PAPER: Final = (
    "M. Sánchez, J. Morales, J. L. Martínez, J. J. Fernández-Lozano, A. García-Cerezo:\n"
    "Automatically Annotated Dataset of a Ground Mobile Robot in Natural Environments via Gazebo Simulations.\n"
    "Sensors 2022, 22(15), 5599. https://doi.org/10.3390/s22155599"
)
