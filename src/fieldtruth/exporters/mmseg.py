# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs in the layout of MMSegmentation's ``BaseSegDataset``, with a configuration file that reads it.

``img_dir/SPLIT/RUN_CAMERA_STAMP.jpg`` are the photographs (or .png, as recorded), ``ann_dir/SPLIT/...png`` their train
ids.
"""

from collections.abc import Sequence
from pathlib import Path
from string import Template
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import Run
from fieldtruth.core.classes import Label
from fieldtruth.core.png import encode_png
from fieldtruth.core.yaml_io import package_data
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import SPLITS, Frames, Member, require_frames, views_of
from fieldtruth.ontology import LabelMap, own_labels

IGNORED: Final = 255
"""Train id of pixels without a class; MMSegmentation's ignore_index."""
CONFIG: Final = "dataset.py"
_PARTS: Final = {name: Template(text) for name, text in package_data("fieldtruth.exporters", "mmseg.yaml").items()}
"""Of the configuration file."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder: photographs, train ids and dataset.py.

    Raises:
        BagError: a run has no photographs with tag images, or is damaged, or some photographs are JPEG and others PNG.
    """
    labels = options.labels
    numbers = train_ids(labels)
    present = [split for split in SPLITS if any(member.split == split for member in options.members)]
    for split in present:
        (target / "img_dir" / split).mkdir(parents=True)
        (target / "ann_dir" / split).mkdir(parents=True)
    suffixes = {suffix for member in options.members for suffix in _write_run(member, target, numbers, options)}
    if len(suffixes) > 1:
        raise BagError(f"MMSegmentation reads photographs of one format; those of these runs are {sorted(suffixes)}")
    (target / CONFIG).write_text(_config(labels, present, *suffixes), encoding="utf-8")


def train_ids(labels: LabelMap) -> NDArray[np.uint8]:
    """Train id by our class id (classes,): numbers without gaps in the order of the ontology's ids; void is ignored."""
    used = _classes(labels)
    numbers = [used.index(number) if number in used else IGNORED for number in labels.ids.tolist()]
    return np.array(numbers, np.uint8)


def _classes(labels: LabelMap) -> list[int]:
    """Ids of all classes of the ontology but void, so that networks trained on its own data have the same outputs."""
    return sorted({*labels.classes} - {int(labels.ids[Label.VOID])})


def _write_run(member: Member, target: Path, numbers: NDArray[np.uint8], options: Options) -> set[str]:
    """Write photographs and train ids of a run; return the endings of the photographs."""
    require_frames(member.run, clouds=False)
    every = [
        Frames(member.run, own_labels(options.classes), views, extras=()) for views in views_of(member.run).values()
    ]

    def save(frame_of: tuple[Frames, int]) -> set[str]:
        frame = frame_of[0][frame_of[1]]
        for label, view in frame.views.items():
            name = f"{member.name}_{label}_{frame.stamp_ns:019d}"
            (target / "img_dir" / member.split / f"{name}{view.suffix}").write_bytes(view.photo)
            (target / "ann_dir" / member.split / f"{name}.png").write_bytes(encode_png(np.take(numbers, view.mask)))
        return {view.suffix for view in frame.views.values()}

    jobs = [(frames, i) for frames in every for i in range(len(frames))]
    return {suffix for found in options.each(f"{member.name}: images", member.run, jobs, save) for suffix in found}


def _config(labels: LabelMap, present: Sequence[str], suffix: str) -> str:
    used = _classes(labels)
    head = _PARTS["head"].substitute(
        config=CONFIG,
        labels=labels.name,
        last=len(used) - 1,
        ignored=IGNORED,
        ids=", ".join(map(str, used)),
        classes=tuple(labels.classes[number].name for number in used),
        palette=[list(labels.classes[number].rgb) for number in used],
    )
    return head + "".join(_loader(split, suffix) for split in present)


def _loader(split: str, suffix: str) -> str:
    if split == "train":
        return _PARTS["loader"].substitute(
            split=split, suffix=suffix, batch=4, sampler="InfiniteSampler", shuffle=True, pipeline="train_pipeline"
        )
    values = {"batch": 1, "sampler": "DefaultSampler", "shuffle": False, "pipeline": "test_pipeline"}
    return _PARTS["loader"].substitute(values, split=split, suffix=suffix) + _PARTS["evaluator"].substitute(split=split)
