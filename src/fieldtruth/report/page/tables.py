# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a page says in words and tables: key figures, classes, calibration, topics, checksums."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.calibration import first_message, read_static_frames
from fieldtruth.bag.checksums import read_checksums, sha256_of
from fieldtruth.bag.reader import BagError
from fieldtruth.bag.run import EXPERIMENT, Run
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import CLASSES
from fieldtruth.core.progress import Progress
from fieldtruth.experiment.files import VERSION_KEY
from fieldtruth.experiment.yaml_io import parse_mapping
from fieldtruth.report.drawing.style import class_colour
from fieldtruth.report.drawing.text import TIMES, count_text, fixed, shortened, size_text, trimmed
from fieldtruth.report.page.bag_pass import FOREIGN, Passage, usable

ROWS: Final = 200
"""At most so many rows of a table; a bag can have any number of topics and frames."""


class Figure(NamedTuple):
    """A key figure."""

    value: str
    unit: str
    label: str


class Share(NamedTuple):
    """What belongs to a class: how many, percent of all, and percent of the longest bar."""

    number: str
    percent: str
    bar: float


class ClassRow(NamedTuple):
    """A class with its pixels and points; None where the run has none at all."""

    name: str
    colour: str
    pixels: Share | None
    points: Share | None


class CameraRow(NamedTuple):
    """A camera's calibration, as CameraInfo has it."""

    side: str
    frame: str
    size: str
    fov: str
    across_deg: float
    """Horizontal field of view."""
    distortion: str
    k: tuple[tuple[str, ...], ...]
    p: tuple[tuple[str, ...], ...]


class FrameRow(NamedTuple):
    """A frame: how deep it hangs in the tree, its name and parent, x, y, z [m] and roll, pitch, yaw [deg] in it."""

    depth: int
    name: str
    parent: str
    xyz: tuple[str, ...]
    rpy: tuple[str, ...]


class TopicRow(NamedTuple):
    """A topic."""

    name: str
    msgtype: str
    number: str
    rate: str


class Checksum(NamedTuple):
    """A file's SHA-256."""

    name: str
    digest: str


def key_figures(run: Run, passage: Passage) -> list[Figure]:
    """What one wants to know first."""
    found, way = [], passage.trajectory
    if way is not None:
        found.append(Figure(f"{way.length_m:.2f}", "m", "driven"))
    found.append(Figure(f"{run.duration_s:.1f}", "s", "recorded"))
    if way is not None and run.duration_s > 0:
        found.append(Figure(f"{way.length_m / run.duration_s:.2f}", "m/s", "mean speed"))
    counted = (
        (run.counts.get(table.photograph("left"), 0), "", "stereo pairs"),
        (run.counts.get(table.POINTS, 0), "", "LiDAR scans"),
        (sum(int(c[1:].sum()) for c in passage.pixels.values()), "", "labelled pixels"),
        (0 if passage.points is None else int(passage.points[1:].sum()), "", "labelled points"),
    )
    found += [Figure(count_text(count), unit, label) for count, unit, label in counted if count]
    found.append(Figure(*size_text(run.bag.stat().st_size), "bag"))
    return found


def about(run: Run, passage: Passage) -> list[tuple[str, str]]:
    """What was driven, as pairs of a term and its text."""
    found: list[tuple[str, str]] = []
    experiment = run.experiment
    if experiment is not None:
        layout = ", ".join(f"{key}: {value}" for key, value in experiment.layout.items())
        light = experiment.light
        found += [
            ("Experiment", experiment.name),
            ("Environment", experiment.environment + (f" ({shortened(layout)})" if layout else "")),
            ("Seed", str(experiment.seed)),
            ("Made by", f"fieldtruth {shortened(str(_version(run)))}"),
            ("Commanded speed", f"{experiment.control.speed:g} m/s"),
            ("Sun", f"azimuth {light.sun_azimuth_deg:g}°, elevation {light.sun_elevation_deg:g}°"),
        ]
        if experiment.seconds is not None:
            found.append(("Ended after", f"{experiment.seconds:g} s, as asked"))
    found.append(("Stamps", f"{run.start_ns / 1e9:.3f} s to {run.end_ns / 1e9:.3f} s"))
    if passage.first_fix is not None:
        latitude, longitude, height = passage.first_fix
        found.append(("First fix", f"{fixed(latitude, 7)}°, {fixed(longitude, 7)}°, {fixed(height, 2)} m"))
    found.append(("Messages", f"{sum(run.counts.values()):,} in {len(run.counts)} topics"))
    return found


def class_rows(passage: Passage) -> tuple[list[ClassRow], ClassRow | None]:
    """Classes of which a pixel or a point was counted, and the sums; no sums where nothing was counted."""
    pixels = sum(passage.pixels.values(), np.zeros(len(CLASSES), np.int64)) if passage.pixels else None
    points = passage.points
    counts = [c for c in (pixels, points) if c is not None and c.sum()]
    if not counts:
        return [], None
    longest = max(float((c / c.sum()).max()) for c in counts)
    rows = []
    for row in CLASSES:
        if any(c[row.label] for c in counts):
            name = row.name if row.label else "no class"
            shares = [_share(c, int(row.label), longest) for c in (pixels, points)]
            rows.append(ClassRow(name, class_colour(int(row.label)), *shares))
    sums = [None if c is None or not c.sum() else Share(count_text(int(c.sum())), "", 0.0) for c in (pixels, points)]
    return rows, ClassRow("all", "", *sums)


def camera_rows(run: Run) -> tuple[list[CameraRow], str]:
    """Calibration of each camera that publishes it, and the baseline [m] in words; empty if it is not known."""
    rows, baseline = [], ""
    for side in table.SIDES:
        if (topic := table.camera_info(side)) not in usable(run)[0]:
            continue
        try:
            info = first_message(run, topic)
            k, p = np.asarray(info.K, np.float64).reshape(3, 3), np.asarray(info.P, np.float64).reshape(3, 4)
        except FOREIGN:
            continue
        size = int(info.width), int(info.height)
        with np.errstate(divide="ignore", invalid="ignore"):
            angles = np.degrees(2.0 * np.arctan(np.array(size) / (2.0 * np.array([k[0, 0], k[1, 1]]))))
            tx = -p[0, 3] / p[0, 0]
        coefficients = " ".join(f"{d:g}" for d in info.D[:12])
        rows.append(
            CameraRow(
                side=side,
                frame=shortened(info.header.frame_id),
                size=f"{size[0]} {TIMES} {size[1]}",
                fov=f"{angles[0]:.2f}° {TIMES} {angles[1]:.2f}°",
                across_deg=float(angles[0]),
                distortion=shortened(f"{info.distortion_model}, D = {coefficients}"),
                k=_matrix(k),
                p=_matrix(p),
            )
        )
        if side == "right" and math.isfinite(tx) and tx:
            baseline = f"{tx:.4f} m"
    return rows, baseline


def frame_rows(run: Run) -> list[FrameRow]:
    """Fixed frames of the bag as a tree, parents before children; none if it does not tell them."""
    if table.TF_STATIC not in usable(run)[0]:
        return []
    try:
        parents = read_static_frames(run).parents
    except FOREIGN:  # a quaternion of nought, say
        return []
    children: dict[str, list[str]] = {}
    for child, (parent, _) in parents.items():
        children.setdefault(parent, []).append(child)
    waiting = [(name, 0) for name in reversed([parent for parent in children if parent not in parents])]
    rows: list[FrameRow] = []
    while waiting and len(rows) < ROWS:
        name, depth = waiting.pop()
        parent, parent_from_child = parents.get(name, ("", None))
        pose = ((), ()) if parent_from_child is None else _pose(parent_from_child)
        rows.append(FrameRow(depth, shortened(name), shortened(parent), *pose))
        waiting += [(child, depth + 1) for child in reversed(children.get(name, []))]
    return rows


def topic_rows(run: Run) -> tuple[list[TopicRow], int]:
    """Topics with counts and rates, and how many were left out; those that the package knows stand first."""
    order = {topic.name: k for k, topic in enumerate(table.TOPICS)}
    names = sorted(run.counts, key=lambda name: (order.get(name, len(order)), name))
    rows = [
        TopicRow(
            shortened(name), shortened(run.msgtypes[name].replace("/msg/", "/")), count_text(run.counts[name]),
            _rate(run.counts[name], run.duration_s),
        )
        for name in names[:ROWS]
    ]  # fmt: skip
    return rows, len(names) - len(rows)


def checksums(run: Run, progress: Progress) -> tuple[list[Checksum], str]:
    """SHA-256 of the files of the run, and where they come from: what the folder states, or else the bag's own."""
    try:
        stated = read_checksums(run.folder)
    except BagError as error:
        stated, problem = {}, f"{error}. "
    else:
        problem = ""
    if run.bag.name in stated:
        return [
            Checksum(*item) for item in list(stated.items())[:ROWS]
        ], "as SHA256SUMS in the run's folder states them"
    with progress.stage("checksum", 1.0) as advance:
        digest = sha256_of(run.bag, advance)
    return [Checksum(run.bag.name, digest)], f"{problem}The folder states none for this bag; this is what it has now"


def rpy_deg(rotation: Array) -> tuple[float, float, float]:
    """Roll, pitch, yaw [deg] about fixed axes of a rotation (3, 3); where pitch is 90 deg up or down, roll is 0."""
    pitch = math.asin(float(np.clip(-rotation[2, 0], -1.0, 1.0)))
    if abs(abs(pitch) - math.pi / 2) < 1e-6:
        roll, yaw = 0.0, math.atan2(-rotation[0, 1], rotation[1, 1])
    else:
        roll, yaw = math.atan2(rotation[2, 1], rotation[2, 2]), math.atan2(rotation[1, 0], rotation[0, 0])
    return math.degrees(roll), math.degrees(pitch), math.degrees(yaw)


def _version(run: Run) -> object:
    text = (run.folder / EXPERIMENT).read_text(encoding="utf-8")
    values: Mapping[str, Any] = parse_mapping(text, EXPERIMENT)
    return values.get(VERSION_KEY, "of an unknown version")


def _share(counts: np.ndarray[Any, np.dtype[np.int64]] | None, label: int, longest: float) -> Share | None:
    if counts is None or not counts.sum():
        return None
    count, share = int(counts[label]), float(counts[label]) / float(counts.sum())
    percent = "none" if not count else "< 0.01 %" if share < 5e-5 else f"{100 * share:.2f} %"
    return Share(count_text(count), percent, round(100 * share / longest, 2))


def _rate(count: int, duration_s: float) -> str:
    return "once" if count == 1 or duration_s <= 0.0 else f"{float(f'{count / duration_s:.3g}'):g}"


def _matrix(values: Array) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(trimmed(v, 4) for v in row) for row in values)


def _pose(parent_from_child: Array) -> tuple[tuple[str, ...], tuple[str, ...]]:
    xyz: Sequence[float] = parent_from_child[:3, 3].tolist()
    return tuple(trimmed(v, 5) for v in xyz), tuple(trimmed(v, 3) for v in rpy_deg(parent_from_child[:3, :3]))
