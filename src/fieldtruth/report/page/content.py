# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Content of a page as plain data: parts that the run lacks are empty, with the reason in a note."""

from dataclasses import dataclass
from typing import Any

from fieldtruth.bag.geometry import Trajectory
from fieldtruth.bag.run import Run
from fieldtruth.core.classes import CLASSES
from fieldtruth.core.progress import Progress
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.report.drawing.style import class_colour
from fieldtruth.report.drawing.text import shortened
from fieldtruth.report.page import snippets, tables
from fieldtruth.report.page.bag_pass import UNEXPECTED, reason, summarize_bag
from fieldtruth.report.page.cloud_view import CloudView, pack_cloud
from fieldtruth.report.page.curves import Curve, Tick, curve_values, draw_curves, time_ticks
from fieldtruth.report.page.map import Map, draw_map
from fieldtruth.report.page.samples import Sample, read_samples
from fieldtruth.report.page.scan_cloud import accumulate_scans
from fieldtruth.report.page.world_view import view_world


@dataclass(frozen=True, kw_only=True)
class PageContent:
    """Input of the page's template."""

    run: Run
    key_figures: list[tables.Figure]
    about: dict[str, str]
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
    cameras: list[tables.CameraRow]
    frames: list[tables.FrameRow]
    topics: list[tuple[str, str, int, str]]
    checksums: dict[str, str]
    checksums_source: str
    exports: list[tuple[str, str]]
    snippets: list[snippets.Snippet]
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
    cameras = tables.camera_rows(run)
    classes, class_sums = tables.class_rows(summary)
    checksums, checksums_source = tables.checksums(run, progress)
    visible = frozenset[int]().union(*(view.classes for sample in samples for view in sample.views.values()))
    return PageContent(
        run=run,
        key_figures=tables.key_figures(run, summary),
        about=tables.about(run, summary),
        map=draw_map(run, trajectory, aerial, [each.stamp_ns for each in samples], next(iter(cameras), None)),
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
        cameras=cameras,
        frames=tables.frame_rows(run),
        topics=tables.topic_rows(run),
        checksums=checksums,
        checksums_source=checksums_source,
        exports=snippets.export_commands(run),
        snippets=snippets.snippets(run),
        notes=[
            (shortened(topic), shortened(why.replace(f" of {topic} at ", " at ")))
            for topic, why in sorted({**unreadable, **summary.unreadable}.items())
        ],
    )


def _counted(run: Run, cameras: int) -> str:
    """Name what the shares count: pixels of the cameras that the bag has, and points of the LiDARs of the rig."""
    whose = f"all {cameras} cameras" if cameras > 2 else "the camera" if cameras == 1 else "both cameras"
    lidars, views = run.of(Cloud, recorded=False), run.of(Image, recorded=False)
    scans = f"the scans of {len(lidars)} LiDARs" if len(lidars) > 1 else "the scans"
    pixels, points = f"every pixel in the tag images of {whose}", f"every point in {scans}"
    return " and of ".join([pixels] * bool(views) + [points] * bool(lidars))


def _cloud(run: Run, trajectory: Trajectory | None) -> tuple[CloudView | None, str]:
    try:
        cloud = accumulate_scans(run, trajectory)
    except UNEXPECTED as error:
        return None, f"The clouds cannot be shown: {reason(error)}."
    if cloud is None:
        topics = ", ".join(lidar.topic for lidar in run.of(Cloud, recorded=False))
        return None, f"The bag has no {topics}." if topics else "The rig has no LiDAR."
    return (pack_cloud(cloud, trajectory), "") if len(cloud.xyz) else (None, "The clouds have no points.")
