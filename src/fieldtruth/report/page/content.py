# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Content of a page as plain data: parts that the run lacks are empty, with the reason in a note.

It has samples of all cameras with their tag images (paper, Figures 17 to 20), compressed to bounded sizes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import Trajectory
from fieldtruth.bag.readings import Readings, image_of
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core.classes import CLASSES, PALETTE
from fieldtruth.core.png import encode_png
from fieldtruth.core.progress import Progress
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.report.drawing.images import downscaled, jpeg_below
from fieldtruth.report.drawing.style import class_colour, sensor_nouns, shortened
from fieldtruth.report.page import tables
from fieldtruth.report.page.bag_pass import UNEXPECTED, reason, summarize_bag, usable_topics
from fieldtruth.report.page.cloud import CloudView, accumulate_scans, pack_cloud
from fieldtruth.report.page.map import Map, draw_map, view_world
from fieldtruth.report.page.series import Curve, Tick, curve_values, draw_curves, time_ticks

SAMPLES: Final = 6
PARTS_SHOWN: Final = ("photo", "label")
PHOTO_BYTES: Final = 330_000
TAG_BYTES: Final = 130_000
"""Limits of two cameras; more share what these have."""
THUMBNAIL_BYTES: Final = 16_000
_WIDEST: Final = 1280  # [pixel]
_THUMBNAIL: Final = 200  # [pixel]
_SIMULTANEOUS: Final = 20_000_000  # [ns]; images farther apart are not simultaneous


@dataclass
class View:
    """Images of one view of a camera: photograph as JPEG and tag image as PNG, each empty if missing."""

    photo: bytes = b""
    tag: bytes = b""
    classes: frozenset[int] = frozenset()
    """Class ids in the tag image."""
    width: int = 0
    height: int = 0
    """Size in the bag [pixel]."""
    later_ms: int = 0
    """Time after that of the sample, if it is not simultaneous."""


@dataclass
class Sample:
    """Views of all cameras at one time, by name, and a thumbnail (JPEG) of the first."""

    stamp_ns: int
    views: dict[str, View] = field(default_factory=dict)
    thumbnail: bytes = b""


def read_samples(run: Run) -> tuple[list[Sample], dict[str, str]]:
    """Read a sample from the middle of each sixth of the images, and by topic why its images cannot be shown.

    Of a camera with stamps of its own, a sample has the image that is nearest in time.

    Raises:
        BagError: the bag is damaged.
    """
    usable, views = usable_topics(run)[0], run.of(Image, recorded=False)
    unreadable: dict[str, str] = {}
    images: dict[tuple[str, str], Readings] = {}
    for part in PARTS_SHOWN:
        for view in views:
            if view.topics[part] in usable:
                try:
                    images[view.name, part] = run.readings(view.name, [part])
                except BagError as error:
                    unreadable[view.topics[part]] = reason(error)
    samples: list[Sample] = []
    stamps = next((each.stamps_ns for each in images.values()), np.empty(0, np.int64))
    count = min(SAMPLES, len(stamps))
    share = min(1.0, 2.0 / max(len(views), 1))
    for k in range(count):
        sample = Sample(int(stamps[(2 * k + 1) * len(stamps) // (2 * count)]))
        for source in views:
            found = _view(source, images, unreadable, sample, share)
            if found.photo or found.tag:
                sample.views[source.label] = found
        if sample.views:
            samples.append(sample)
    return samples, unreadable


def _view(
    source: Source, images: Mapping[tuple[str, str], Readings], unreadable: dict[str, str], sample: Sample, share: float
) -> View:
    view, near_ns = View(), max(_SIMULTANEOUS, round(0.5e9 / source.config.rate_hz))
    for part, add, most in (("photo", _add_photo, PHOTO_BYTES), ("label", _add_tag, TAG_BYTES)):
        readings = images.get((source.name, part))
        if readings is None or not len(readings):
            continue
        row = int(np.abs(readings.stamps_ns - sample.stamp_ns).argmin())
        later_ns = int(readings.stamps_ns[row]) - sample.stamp_ns
        if abs(later_ns) > near_ns:
            continue
        message = readings.message(row)
        try:
            colours = add(view, image_of({part: message}), int(share * most))
        except UNEXPECTED as error:
            unreadable[source.topics[part]] = reason(error)
        else:
            view.height, view.width = colours.shape[:2]
            view.later_ms = round(later_ns / 1e6) if abs(later_ns) > _SIMULTANEOUS else 0
            sample.thumbnail = sample.thumbnail or jpeg_below(_narrowed(colours, _THUMBNAIL), THUMBNAIL_BYTES)
    return view


def _add_photo(view: View, image: Any, most: int) -> NDArray[np.uint8]:
    colours: NDArray[np.uint8] = image.photo
    stored = image.jpeg or b""
    fits = stored and len(stored) <= most and colours.shape[1] <= _WIDEST
    view.photo = stored if fits else jpeg_below(_narrowed(colours, _WIDEST), most)
    return colours


def _add_tag(view: View, image: Any, most: int) -> NDArray[np.uint8]:
    ids: NDArray[np.uint8] = image.label
    colours = PALETTE[ids]
    view.classes = frozenset(np.unique(ids).tolist())
    while len(png := encode_png(ids, palette=PALETTE)) > most or ids.shape[1] > _WIDEST:
        ids = np.ascontiguousarray(ids[::2, ::2])
    view.tag = png
    return colours


def _narrowed(colours: NDArray[np.uint8], widest: int) -> NDArray[np.uint8]:
    factor = -(-colours.shape[1] // widest)
    return downscaled(colours, factor) if factor > 1 and colours.shape[0] >= factor else colours


@dataclass(frozen=True, kw_only=True)
class PageContent:
    """Input of the page's template."""

    run: Run
    key_figures: list[tables.Figure]
    made_by: str
    """Version that made it, of a run with its experiment."""
    first_fixes: dict[str, tuple[float, ...]]
    map: Map | None
    map_note: str
    samples: list[Sample]
    is_pair: bool
    """Whether all images are those of one stereo pair."""
    image_classes: tuple[tuple[str, str], ...]
    """Name and colour of the classes in the tag images."""
    counted: str
    """What the class shares count."""
    cloud: CloudView | None
    cloud_note: str
    classes: list[tables.ClassRow]
    class_sums: tables.ClassRow | None
    curves: tuple[Curve, ...]
    time_ticks: tuple[Tick, ...]
    curve_values: dict[str, Any]
    views: list[tables.ViewRow]
    frames: list[tables.FrameRow]
    topics: list[tuple[str, str, int, str]]
    checksums: dict[str, str]
    checksums_source: str
    richest: tuple[str, str]
    """Topic and expression of the first example."""
    has_frames: bool
    notes: list[tuple[str, str]]
    """Topics that cannot be shown, with the reason."""


def collect_content(run: Run, workers: int, progress: Progress) -> PageContent:
    """Read a run, rebuild its world and compute everything that the page shows.

    Raises:
        BagError: the bag is damaged.
    """
    summary = summarize_bag(run, workers, progress)
    trajectory = summary.trajectory
    with progress.stage("select images"):
        samples, unreadable = read_samples(run)
    with progress.stage("accumulate scans"):
        cloud, cloud_note = _cloud(run, trajectory)
    aerial, map_note = view_world(run, progress) if trajectory is not None else (None, "")
    calibrated = tables.view_rows(run)
    classes, class_sums = tables.class_rows(summary)
    checksums, checksums_source = tables.checksums(run, progress)
    visible = frozenset[int]().union(*(view.classes for sample in samples for view in sample.views.values()))
    return PageContent(
        run=run,
        key_figures=tables.key_figures(run, summary),
        made_by="" if run.experiment is None else tables.made_by(run),
        first_fixes=summary.first_fixes,
        map=draw_map(run, trajectory, aerial, [each.stamp_ns for each in samples], next(iter(calibrated), None)),
        map_note=map_note,
        samples=samples,
        is_pair=[view.side for view in run.of(Image, recorded=False)] == ["left", "right"],
        image_classes=tuple((row.name, class_colour(row.label)) for row in CLASSES if row.label in visible),
        counted=_counted(run, len(summary.pixels)),
        cloud=cloud,
        cloud_note=cloud_note,
        classes=classes,
        class_sums=class_sums,
        curves=draw_curves(summary.lines, run.start_ns, run.end_ns),
        time_ticks=time_ticks(run.duration_s),
        curve_values=curve_values(summary.lines, run.start_ns),
        views=calibrated,
        frames=tables.frame_rows(run),
        topics=tables.topic_rows(run),
        checksums=checksums,
        checksums_source=checksums_source,
        richest=tables.richest_topic(run),
        has_frames=tables.has_frames(run),
        notes=[
            (shortened(topic), shortened(why.replace(f" of {topic} at ", " at ")))
            for topic, why in sorted({**unreadable, **summary.unreadable}.items())
        ],
    )


def _counted(run: Run, views: int) -> str:
    """Name what the shares count: pixels of the views that the bag has, and points of the clouds of the rig."""
    whose = f"all {views} cameras" if views > 2 else "the camera" if views == 1 else "both cameras"
    clouds, images = run.of(Cloud, recorded=False), run.of(Image, recorded=False)
    scans = (
        f"the scans of {' and '.join(sensor_nouns(each.config for each in clouds))}" if len(clouds) > 1 else "the scans"
    )
    pixels, points = f"every pixel in the tag images of {whose}", f"every point in {scans}"
    return " and of ".join([pixels] * bool(images) + [points] * bool(clouds))


def _cloud(run: Run, trajectory: Trajectory | None) -> tuple[CloudView | None, str]:
    try:
        cloud = accumulate_scans(run, trajectory)
    except UNEXPECTED as error:
        return None, f"The clouds cannot be shown: {reason(error)}."
    if cloud is None:
        topics = ", ".join(each.topic for each in run.of(Cloud, recorded=False))
        return None, f"The bag has no {topics}." if topics else "The rig has no sensor that gives clouds."
    return (pack_cloud(cloud, trajectory), "") if len(cloud.xyz) else (None, "The clouds have no points.")
