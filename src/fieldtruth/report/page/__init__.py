# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""An HTML page about a run: one file that needs no network, no server and no other file.

Parts that the run lacks are empty, with the reason in a note. It has samples of all cameras with tag images (paper,
Figures 17 to 20), compressed to bounded sizes.
"""

import base64
import hashlib
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any, Final

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

import fieldtruth
from fieldtruth.bag.file import TRACK, BagError
from fieldtruth.bag.geometry import Trajectory
from fieldtruth.bag.readings import Readings, image_of
from fieldtruth.bag.run import Run, open_run
from fieldtruth.bag.topics import Source
from fieldtruth.core.classes import ClassTable
from fieldtruth.core.files import output_errors, output_path, write_atomically
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.png import encode_png
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.core.templates import templates
from fieldtruth.report.drawing.images import downscaled, jpeg_below
from fieldtruth.report.drawing.style import class_colour, fixed, sensor_nouns, shortened
from fieldtruth.report.page import tables
from fieldtruth.report.page.bag_pass import (
    UNEXPECTED,
    Curve,
    Tick,
    curve_values,
    draw_curves,
    reason,
    summarize_bag,
    time_ticks,
    usable_topics,
)
from fieldtruth.report.page.cloud import CloudView, accumulate_scans, pack_cloud
from fieldtruth.report.page.map import Map, draw_map, view_world

SAMPLES: Final = 6
PARTS_SHOWN: Final = ("photo", "label")
PHOTO_BYTES: Final = 330_000
TAG_BYTES: Final = 130_000
"""Limits of two cameras; more share what these have."""
THUMBNAIL_BYTES: Final = 16_000
_WIDEST: Final = 1280  # [pixel]
_THUMBNAIL: Final = 200  # [pixel]
_SIMULTANEOUS: Final = 20_000_000  # [ns]; images farther apart are not simultaneous
_SCRIPTS: Final = ("page.js", "cloud.js")
LARGEST_PAGE: Final = 15_000_000
"""Limit [byte] of a page, however long the run: number and size of all parts are bounded."""


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
            image = image_of({part: message}, classes=readings.classes)
            colours = add(view, image, int(share * most), readings.classes)
        except UNEXPECTED as error:
            unreadable[source.topics[part]] = reason(error)
        else:
            view.height, view.width = colours.shape[:2]
            view.later_ms = round(later_ns / 1e6) if abs(later_ns) > _SIMULTANEOUS else 0
            sample.thumbnail = sample.thumbnail or jpeg_below(_narrowed(colours, _THUMBNAIL), THUMBNAIL_BYTES)
    return view


def _add_photo(view: View, image: Any, most: int, _: ClassTable) -> NDArray[np.uint8]:
    colours: NDArray[np.uint8] = image.photo
    stored = image.jpeg or b""
    fits = stored and len(stored) <= most and colours.shape[1] <= _WIDEST
    view.photo = stored if fits else jpeg_below(_narrowed(colours, _WIDEST), most)
    return colours


def _add_tag(view: View, image: Any, most: int, classes: ClassTable) -> NDArray[np.uint8]:
    ids: NDArray[np.uint8] = image.label
    colours = classes.palette[ids]
    view.classes = frozenset(np.unique(ids).tolist())
    while len(png := encode_png(ids, palette=classes.palette)) > most or ids.shape[1] > _WIDEST:
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
    """True if all images are those of one stereo pair."""
    image_classes: tuple[tuple[str, str], ...]
    """Name and colour of the classes in the tag images."""
    counted: str
    """Names the pixels and points of the class shares."""
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
    classes, class_sums = tables.class_rows(summary, run.classes)
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
        image_classes=tuple((row.name, class_colour(row)) for row in run.classes if row.label in visible),
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


def render_page(content: PageContent) -> str:
    """Return the page as HTML."""
    scripts = [_source(name) for name in _SCRIPTS]
    hashes = " ".join(f"'sha256-{_base64(hashlib.sha256(script.encode()).digest())}'" for script in scripts)
    policy = f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {hashes}; base-uri 'none'"
    environment = templates("fieldtruth.report.page", autoescape=True, keep_trailing_newline=False)
    environment.filters |= {
        "base64": _base64,
        "fixed": fixed,
        "shortened": shortened,
        "quote": shlex.quote,
        "ascii": ascii,
    }
    return environment.get_template("page.html.jinja").render(
        content=content,
        run=content.run,
        version=fieldtruth.__version__,
        policy=policy,
        max_rows=tables.ROWS,
        track_file=TRACK,
        style=Markup(_source("style.css")),
        scripts=[Markup(script) for script in scripts],
        numbers={
            "duration": content.run.duration_s * 1e3,
            "curves": content.curve_values,
            "path": content.map.positions if content.map else [],
            "classes": {colour: name for name, colour in content.image_classes},
        },
    )


def _source(name: str) -> str:
    return resources.files("fieldtruth.report.page").joinpath(name).read_text(encoding="utf-8")


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode()


def write_report(
    path: Path | str, *, out: Path | str | None = None, overwrite: bool = False, progress: Progress | None = None
) -> Path:
    """Write an HTML page about a run; by default ``NAME_report.html`` beside the bag.

    It shows the path on an aerial view, stereo pairs with their tag images, an interactive labelled cloud, class
    shares, time series of the other sensors, calibration, topics, checksums and how to load the run (paper, Figures 12
    and 17 to 21). The page states what the bag lacks.

    Args:
        path: folder of a run, or a bag.
        out: an .html file.
        overwrite: replace an existing file.
        progress: receives the stages of the work.

    Returns:
        Path of the page.

    Raises:
        BagError: the bag does not exist or is damaged.
        ConfigurationError: its experiment.yaml cannot be read.
        OutputError: the page already exists, or cannot be written.
    """
    check = partial(output_path, endings=(".html", ".htm"), parents=False, overwrite=overwrite)
    target = None if out is None else check(out)
    run = open_run(path)
    if target is None:
        target = check(run.folder / f"{run.name}_report.html")
    progress = Silent() if progress is None else progress
    content = collect_content(run, cpu_count(), progress)
    with progress.stage("write the page"), output_errors(target):
        write_atomically(target, render_page(content).encode(errors="replace"))
    return target


__all__ = ["LARGEST_PAGE", "write_report"]
