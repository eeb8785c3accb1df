# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Everything that a page shows of a run, as plain data: what the run lacks is None or empty, and ``notes`` say why."""

import base64
from dataclasses import dataclass
from typing import Any, NamedTuple

from fieldtruth.bag import topics as table
from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import Trajectory
from fieldtruth.core.classes import CLASSES
from fieldtruth.core.progress import Progress
from fieldtruth.report.drawing.style import class_colour
from fieldtruth.report.drawing.text import shortened
from fieldtruth.report.page import snippets as loading
from fieldtruth.report.page import tables as facts
from fieldtruth.report.page.aerial_view import see_place
from fieldtruth.report.page.bag_pass import FOREIGN, read_through, reason
from fieldtruth.report.page.cloud_view import Orbit, pack
from fieldtruth.report.page.curves import Curve, Tick, curve_numbers, draw_curves, time_ticks
from fieldtruth.report.page.map import Map, draw_map
from fieldtruth.report.page.samples import Samples, take_samples
from fieldtruth.report.page.scan_cloud import gather_scans


class Eye(NamedTuple):
    """One image of a pair: JPEG and PNG in base64, empty if it lacks; size [pixel] in the bag."""

    side: str
    photo: str
    tag: str
    width: int
    height: int


class Look(NamedTuple):
    """A stereo pair: its letter, when, [ms] and [s] from the start, a small picture, and the images."""

    letter: str
    at_ms: int
    seconds: str
    thumb: str
    eyes: tuple[Eye, ...]


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What the template is given."""

    run: Run
    key_figures: list[facts.Figure]
    about: list[tuple[str, str]]
    map: Map | None
    map_note: str
    looks: tuple[Look, ...]
    look_classes: tuple[tuple[str, str], ...]
    """Name and colour of the classes in the tags."""
    orbit: Orbit | None
    orbit_note: str
    classes: list[facts.ClassRow]
    class_sums: facts.ClassRow | None
    curves: tuple[Curve, ...]
    time_ticks: tuple[Tick, ...]
    numbers: dict[str, Any]
    cameras: list[facts.CameraRow]
    baseline: str
    frames: list[facts.FrameRow]
    topics: list[facts.TopicRow]
    topics_left_out: int
    checksums: list[facts.Checksum]
    checksums_source: str
    forms: list[tuple[str, str, str]]
    snippets: list[loading.Snippet]
    notes: list[tuple[str, str]]
    """Topics that are there and yet are not shown, and why."""


def gather(run: Run, workers: int, progress: Progress) -> Findings:
    """Read a run once, look into it here and there, and rebuild its place.

    Raises:
        BagError: the bag is damaged.
    """
    passage = read_through(run, workers, progress)
    with progress.stage("choose images"):
        samples = take_samples(run)
    orbit, orbit_note = _orbit(run, passage.trajectory, progress)
    place, map_note = see_place(run, progress) if passage.trajectory is not None else (None, "")
    cameras, baseline = facts.camera_rows(run)
    fov = next((camera.across_deg for camera in cameras), None)
    looks_ns = [pair.stamp_ns for pair in samples.pairs]
    classes, sums = facts.class_rows(passage)
    topics, left_out = facts.topic_rows(run)
    checksums, source = facts.checksums(run, progress)
    seen = frozenset[int]().union(*(view.classes for pair in samples.pairs for view in pair.views.values()))
    return Findings(
        run=run,
        key_figures=facts.key_figures(run, passage),
        about=facts.about(run, passage),
        map=draw_map(run, passage.trajectory, place, looks_ns, fov),
        map_note=map_note,
        looks=_looks(samples, run.start_ns),
        look_classes=tuple((row.name, class_colour(int(row.label))) for row in CLASSES if row.label in seen),
        orbit=orbit,
        orbit_note=orbit_note,
        classes=classes,
        class_sums=sums,
        curves=draw_curves(passage.lines, run.start_ns, run.end_ns),
        time_ticks=time_ticks(run.duration_s),
        numbers=curve_numbers(passage.lines, run.start_ns),
        cameras=cameras,
        baseline=baseline,
        frames=facts.frame_rows(run),
        topics=topics,
        topics_left_out=left_out,
        checksums=checksums,
        checksums_source=source,
        forms=loading.export_commands(run),
        snippets=loading.snippets(run),
        notes=[
            (shortened(topic), shortened(why))
            for topic, why in sorted({**samples.unreadable, **passage.unreadable}.items())
        ],
    )


def _orbit(run: Run, trajectory: Trajectory | None, progress: Progress) -> tuple[Orbit | None, str]:
    with progress.stage("gather scans"):
        try:
            cloud = gather_scans(run, trajectory)
        except FOREIGN as error:
            return None, f"The clouds cannot be shown: {reason(error)}."
        if cloud is None:
            return None, f"The bag has no {table.POINTS}."
        return (pack(cloud, trajectory), "") if len(cloud.xyz) else (None, "The clouds hold no point.")


def _looks(samples: Samples, start_ns: int) -> tuple[Look, ...]:
    return tuple(
        Look(
            letter, round((pair.stamp_ns - start_ns) / 1e6), f"{(pair.stamp_ns - start_ns) / 1e9:.1f}",
            base64.b64encode(pair.thumb).decode(),
            tuple(
                Eye(side, base64.b64encode(view.photo or b"").decode(), base64.b64encode(view.tag or b"").decode(),
                    view.width, view.height)
                for side, view in pair.views.items()
            ),
        )
        for letter, pair in zip("ABCDEF", samples.pairs, strict=False)
    )  # fmt: skip
