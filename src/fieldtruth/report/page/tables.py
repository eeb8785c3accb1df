# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tables of a page: key figures, class shares, calibration, topics, checksums, and programs that load the run."""

import math
from collections.abc import Iterable
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.file import EXPERIMENT, BagError, bag_files
from fieldtruth.bag.geometry import first_message
from fieldtruth.bag.provenance import read_checksums, sha256_of
from fieldtruth.bag.run import Run
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.classes import ClassTable
from fieldtruth.core.lenses import COEFFICIENTS, Lens, fields_of_view
from fieldtruth.core.progress import Progress
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.core.yaml_io import parse_mapping
from fieldtruth.experiment.files import VERSION_KEY
from fieldtruth.report.drawing.maps import heading_of
from fieldtruth.report.drawing.style import TIMES, class_colour, file_size, percent, shortened, trimmed
from fieldtruth.report.page.bag_pass import UNEXPECTED, BagSummary, published, usable_topics

ROWS: Final = 200
"""Maximum number of rows of a table; a bag can have any number of topics and frames."""


class Figure(NamedTuple):
    """A key figure."""

    value: str
    unit: str
    label: str


class Share(NamedTuple):
    """Total of a class, percent of all, and length of its bar in percent of the longest."""

    total: int
    percent: str
    bar: float


class ClassRow(NamedTuple):
    """A class with its pixels and points; None if the run has no pixels or points at all."""

    name: str
    colour: str
    pixels: Share | None
    points: Share | None


class ViewRow(NamedTuple):
    """Calibration of a view from its CameraInfo."""

    name: str
    frame: str
    size: str
    fov: str
    horizontal_fov_deg: float
    heading_deg: float
    """Direction in which it looks, about z from the robot's x axis."""
    is_pinhole: bool
    distortion: str
    k: tuple[tuple[str, ...], ...]
    p: tuple[tuple[str, ...], ...]
    baseline: str
    """Distance [m] from the left view of a pair; empty for a left or a single one."""


class FrameRow(NamedTuple):
    """A static frame, its depth in the tree, and x, y, z [m], roll, pitch, yaw [deg] in its parent; () for a root."""

    depth: int
    name: str
    pose: tuple[str, ...]


def key_figures(run: Run, summary: BagSummary) -> list[Figure]:
    """The most important figures of a run."""
    figures, trajectory = [Figure(f"{run.duration_s:.1f}", "s", "recorded")], summary.trajectory
    clouds = run.of(Cloud)
    if trajectory is not None:
        figures.insert(0, Figure(f"{trajectory.length_m:.2f}", "m", "driven"))
        if run.duration_s > 0:
            figures.append(Figure(f"{trajectory.length_m / run.duration_s:.2f}", "m/s", "mean speed"))
    counted = {
        "stereo pairs": _count(run, [view.topic for view in run.of(Image, recorded=False) if view.side == "left"]),
        "single images": _count(run, [view.topic for view in run.of(Image, recorded=False) if not view.side]),
        **{
            f"{noun} scans": _count(run, [each.topic for each in clouds if each.config.noun == noun])
            for noun in dict.fromkeys(each.config.noun for each in clouds)
        },
        "labelled pixels": sum(int(counts[1:].sum()) for counts in summary.pixels.values()),
        "labelled points": sum(int(counts[1:].sum()) for counts in summary.points.values()),
    }
    figures += [Figure(f"{count:,}", "", label) for label, count in counted.items() if count]
    return [*figures, Figure(*file_size(sum(file.stat().st_size for file in bag_files(run.bag))), "bag")]


def _count(run: Run, topics: Iterable[str]) -> int:
    return sum(run.counts.get(topic, 0) for topic in topics)


def class_rows(summary: BagSummary, classes: ClassTable) -> tuple[list[ClassRow], ClassRow | None]:
    """Rows of the classes with at least one pixel or point, and the sums; None if nothing was counted."""
    pixels, points = (
        sum(counts.values(), np.zeros(len(classes), np.int64)) for counts in (summary.pixels, summary.points)
    )
    counted = [counts for counts in (pixels, points) if counts.any()]
    if not counted:
        return [], None
    longest = max(float(counts.max() / counts.sum()) for counts in counted)
    rows = [
        ClassRow(
            row.name if row.label else "no class", class_colour(row),
            _share(pixels, row.label, longest), _share(points, row.label, longest),
        )
        for row in classes
        if pixels[row.label] or points[row.label]
    ]  # fmt: skip
    return rows, ClassRow("all", "", *(Share(int(c.sum()), "", 0.0) if c.any() else None for c in (pixels, points)))


def _share(counts: Counts, label: int, longest: float) -> Share | None:
    if not counts.any():
        return None
    share = float(counts[label]) / float(counts.sum())
    return Share(int(counts[label]), percent(share, 2), round(100 * share / longest, 2))


def view_rows(run: Run) -> list[ViewRow]:
    """Calibration of each view that publishes it."""
    rows, usable = [], usable_topics(run)[0]
    for view in run.of(Image, recorded=False):
        if view.info not in usable:
            continue
        try:
            info = first_message(run, view.info)
            k, p = np.asarray(info.K, np.float64).reshape(3, 3), np.asarray(info.P, np.float64).reshape(3, 4)
        except UNEXPECTED:
            continue
        size = int(info.width), int(info.height)
        angles = _fields_of_view(info, k, size)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = -p[0, 3] / p[0, 0]
        known = view.side == "right" and math.isfinite(distance) and distance
        coefficients = " ".join(f"{d:g}" for d in info.D[:12])
        rows.append(
            ViewRow(
                name=view.label,
                frame=shortened(info.header.frame_id),
                size=f"{size[0]} {TIMES} {size[1]}",
                fov=f"{angles[0]:.2f}° {TIMES} {angles[1]:.2f}°",
                horizontal_fov_deg=float(angles[0]),
                heading_deg=float(np.degrees(heading_of(view.config.base_from_frames()[view.frame]))),
                is_pinhole=not np.any(info.D) and info.distortion_model == "plumb_bob",
                distortion=shortened(f"{info.distortion_model}, D = {coefficients}"),
                k=_matrix(k),
                p=_matrix(p),
                baseline=f"{distance:.4f} m" if known else "",
            )
        )
    return rows


def _fields_of_view(info: Any, k: Array, size: tuple[int, int]) -> tuple[float, float]:
    """Angles [deg] across the middle row and column; a panorama is taken for a whole one, as it has no K."""
    if info.distortion_model == "equirectangular":
        return 360.0, 180.0
    with np.errstate(divide="ignore", invalid="ignore"):
        plain = np.degrees(2.0 * np.arctan(np.array(size) / (2.0 * np.array([k[0, 0], k[1, 1]]))))
    if not np.any(info.D) and info.distortion_model != "equidistant":
        return float(plain[0]), float(plain[1])
    if len(info.D) != len(COEFFICIENTS.get(info.distortion_model, "").split()) or not (k[0, 0] > 0 and k[1, 1] > 0):
        return math.nan, math.nan
    lens = Lens(info.distortion_model, k[0, 0], k[1, 1], k[0, 2], k[1, 2], tuple(float(d) for d in info.D))
    return fields_of_view(lens, *size)


def _matrix(values: Array) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(trimmed(v, 4) for v in row) for row in values)


def frame_rows(run: Run) -> list[FrameRow]:
    """Static frames of the bag as a tree, parents before children; empty if it has none."""
    if table.TF_STATIC not in usable_topics(run)[0]:
        return []
    try:
        parents = run.calibration.static.parents
    except UNEXPECTED:  # an invalid quaternion, for example
        return []
    children: dict[str, list[str]] = {}
    for child, (parent, _) in parents.items():
        children.setdefault(parent, []).append(child)
    waiting = [(name, 0) for name in reversed([parent for parent in children if parent not in parents])]
    rows: list[FrameRow] = []
    while waiting and len(rows) < ROWS:
        name, depth = waiting.pop()
        pose = _pose(parents[name][1]) if name in parents else ()
        rows.append(FrameRow(depth, shortened(name), pose))
        waiting += [(child, depth + 1) for child in reversed(children.get(name, []))]
    return rows


def _pose(parent_from_child: Array) -> tuple[str, ...]:
    xyz, rpy = parent_from_child[:3, 3], rpy_deg(parent_from_child[:3, :3])
    return (*(trimmed(v, 5) for v in xyz.tolist()), *(trimmed(v, 3) for v in rpy))


def rpy_deg(rotation: Array) -> tuple[float, float, float]:
    """Roll, pitch, yaw [deg] about fixed axes of a rotation (3, 3); at pitch 90 or -90 deg, roll is 0."""
    pitch = math.asin(float(np.clip(-rotation[2, 0], -1.0, 1.0)))
    if abs(abs(pitch) - math.pi / 2) < 1e-6:
        roll, yaw = 0.0, math.atan2(-rotation[0, 1], rotation[1, 1])
    else:
        roll, yaw = math.atan2(rotation[2, 1], rotation[2, 2]), math.atan2(rotation[1, 0], rotation[0, 0])
    return math.degrees(roll), math.degrees(pitch), math.degrees(yaw)


def topic_rows(run: Run) -> list[tuple[str, str, int, str]]:
    """Name, type, count and rate of each topic; those that fieldtruth publishes come first."""
    order = {topic.name: k for k, topic in enumerate(published(run))}
    return [
        (shortened(name), shortened(run.msgtypes[name].replace("/msg/", "/")), count, _rate(count, run.duration_s))
        for name, count in sorted(run.counts.items(), key=lambda item: (order.get(item[0], len(order)), item[0]))
    ]


def _rate(count: int, duration_s: float) -> str:
    return "once" if count == 1 or duration_s <= 0.0 else f"{float(f'{count / duration_s:.3g}'):g}"


def checksums(run: Run, progress: Progress) -> tuple[dict[str, str], str]:
    """SHA-256 of the files of a run by name, and its source: the folder's SHA256SUMS, or else the bag's own files."""
    problem = ""
    try:
        stated = read_checksums(run.folder)
    except BagError as error:
        stated, problem = {}, f"{error}. "
    if run.bag.name in stated:
        return dict(list(stated.items())[:ROWS]), "as stated in the run's SHA256SUMS"
    files = bag_files(run.bag)
    with progress.stage("checksum", float(len(files))) as advance:
        digests = {file.name: sha256_of(file, advance) for file in files}
    return digests, f"{problem}No SHA256SUMS lists this bag; computed from the file{'s' * run.bag.is_dir()}"


def made_by(run: Run) -> str:
    """Version of fieldtruth that made a run with its experiment."""
    text = (run.folder / EXPERIMENT).read_text(encoding="utf-8")
    return shortened(str(parse_mapping(text, EXPERIMENT).get(VERSION_KEY, "(unknown version)")))


def richest_topic(run: Run) -> tuple[str, str]:
    """Return the topic with the richest content, and an expression for what a reading of it says."""
    decoders = dict.fromkeys([source.topic for source in run.of(Cloud)], "ft.bag.points(reading.message)")
    labels = [view.topics["label"] for view in run.of(Image, "label")]
    decoders |= dict.fromkeys(labels, "ft.bag.image(reading.message)")
    topic = next((topic for topic in decoders if topic in run.counts), min(run.counts))
    return topic, decoders.get(topic, "reading.message")


def has_frames(run: Run) -> bool:
    """Return True if the bag has the first cloud and the first image of its rig."""
    clouds, images = run.of(Cloud, recorded=False)[:1], run.of(Image, recorded=False)[:1]
    return bool(clouds and images) and all(each.has(run.counts) for each in (*clouds, *images))
