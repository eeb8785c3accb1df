# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs in the layout of MMSegmentation's ``BaseSegDataset``, with a configuration file that reads it.

``img_dir/SPLIT/RUN_CAMERA_STAMP.jpg`` are the photographs, ``ann_dir/SPLIT/RUN_CAMERA_STAMP.png`` their train ids.
"""

from collections.abc import Sequence
from pathlib import Path
from string import Template
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.run import Run
from fieldtruth.core.classes import Label
from fieldtruth.core.parallel import in_order
from fieldtruth.core.png import encode_png
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import SPLITS, Frames, Member, cameras_of, require_frames
from fieldtruth.ontology import OWN, LabelMap

IGNORED: Final = 255
"""Train id of pixels without a class; MMSegmentation's ignore_index."""
CONFIG: Final = "dataset.py"

_HEAD: Final = Template("""\
# Data set for MMSegmentation 1.x. In a configuration: _base_ = ['.../$config'], then model and schedule.
#
# Pixels of ann_dir are train ids 0 to $last, in the order of `classes`; $ignored is ignored in training and evaluation.
# So reduce_zero_label must be False: 0 is a class. Class ids of $labels by train id: $ids.
dataset_type = 'BaseSegDataset'
data_root = '{{ fileDirname }}'
metainfo = dict(
    classes=$classes,
    palette=$palette)
crop_size = (512, 512)

train_pipeline = [
    dict(type='LoadImageFromFile'),
    dict(type='LoadAnnotations'),
    dict(type='RandomCrop', crop_size=crop_size, cat_max_ratio=0.75),
    dict(type='RandomFlip', prob=0.5),
    dict(type='PhotoMetricDistortion'),
    dict(type='PackSegInputs'),
]
test_pipeline = [
    dict(type='LoadImageFromFile'),
    dict(type='LoadAnnotations'),
    dict(type='PackSegInputs'),
]
""")
_LOADER: Final = Template("""
${split}_dataloader = dict(
    batch_size=$batch,
    num_workers=4,
    persistent_workers=True,
    sampler=dict(type='$sampler', shuffle=$shuffle),
    dataset=dict(
        type=dataset_type,
        data_root=data_root,
        data_prefix=dict(img_path='img_dir/$split', seg_map_path='ann_dir/$split'),
        img_suffix='.jpg',
        seg_map_suffix='.png',
        metainfo=metainfo,
        reduce_zero_label=False,
        pipeline=$pipeline))
""")
_EVALUATOR: Final = Template("${split}_evaluator = dict(type='IoUMetric', iou_metrics=['mIoU'])\n")


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder: photographs, train ids and dataset.py.

    Raises:
        BagError: a run has no photographs with tag images, or is damaged.
    """
    labels = options.label_map or OWN
    numbers = train_ids(labels)
    present = [split for split in SPLITS if any(member.split == split for member in options.members)]
    for split in present:
        (target / "img_dir" / split).mkdir(parents=True)
        (target / "ann_dir" / split).mkdir(parents=True)
    for member in options.members:
        _write_run(member, target, numbers, options)
    (target / CONFIG).write_text(_config(labels, numbers, present), encoding="utf-8")


def train_ids(labels: LabelMap) -> NDArray[np.uint8]:
    """Train id by our class id (18,): numbers without gaps in the order of the ontology's ids; void is ignored."""
    used = _classes(labels)
    numbers = [used.index(number) if number in used else IGNORED for number in labels.ids.tolist()]
    return np.array(numbers, np.uint8)


def _classes(labels: LabelMap) -> list[int]:
    """Ids of all classes of the ontology but void, so that networks trained on its own data have the same outputs."""
    return sorted({*labels.classes} - {int(labels.ids[Label.VOID])})


def _write_run(member: Member, target: Path, numbers: NDArray[np.uint8], options: Options) -> None:
    require_frames(member.run, clouds=False)
    cameras = [Frames(member.run, OWN, views, extras=()) for views in cameras_of(member.run).values()]

    def save(frame_of: tuple[Frames, int]) -> None:
        frame = frame_of[0][frame_of[1]]
        for camera, view in frame.views.items():
            name = f"{member.name}_{camera}_{frame.stamp_ns:019d}"
            (target / "img_dir" / member.split / f"{name}.jpg").write_bytes(view.jpeg)
            (target / "ann_dir" / member.split / f"{name}.png").write_bytes(encode_png(np.take(numbers, view.mask)))

    step = member.run.duration_s / sum(map(len, cameras))
    with options.progress.stage(f"{member.name}: images", member.run.duration_s) as advance:
        for _ in in_order(((frames, i) for frames in cameras for i in range(len(frames))), save, options.workers):
            advance(step)


def _config(labels: LabelMap, numbers: NDArray[np.uint8], present: Sequence[str]) -> str:
    used = _classes(labels)
    head = _HEAD.substitute(
        config=CONFIG,
        labels=labels.name,
        last=len(used) - 1,
        ignored=IGNORED,
        ids=", ".join(map(str, used)),
        classes=tuple(labels.classes[number].name for number in used),
        palette=[list(labels.classes[number].rgb) for number in used],
    )
    return head + "".join(map(_loader, present))


def _loader(split: str) -> str:
    if split == "train":
        return _LOADER.substitute(
            split=split, batch=4, sampler="InfiniteSampler", shuffle=True, pipeline="train_pipeline"
        )
    loader = _LOADER.substitute(split=split, batch=1, sampler="DefaultSampler", shuffle=False, pipeline="test_pipeline")
    return loader + _EVALUATOR.substitute(split=split)
