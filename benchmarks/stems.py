# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Diameters of stems by circles at breast height, against the meshes: the tables of docs/benchmarks_truth.md.

Run: python benchmarks/stems.py [--envs NAME ...] [--signal ideal|datasheet] [--method FILE.py:FUNCTION]

A robot drives along the first route of each environment. Of each tree, the points on its stem, by instance id and part,
from 1.2 to 1.4 m above the ground are given to a method: a function of points (n, 2) [m], world x and y, that returns
x, y and radius [m] of a circle, or None. So segmentation is not a part of the error; ``--with-branches`` gives it the
points of class trunk, which branches have, too. Once they are the points of a
single scan, and once those of all scans at their true poses.

The truth is the diameter of the circle with the area of the trunk's section 1.3 m above the ground. Errors are
estimates less truth. ``seen`` is the share of the turn about the true middle that has points, gaps of up to 30 deg
counted in.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from drives import FIGURES, Drive, Scan, drive_arguments, driven, score, show
from scipy.optimize import least_squares

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label, PlantPart
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.user_code import named_function
from fieldtruth.interchange.inventory import BREAST_HEIGHT, Section, moved, named_objects, trunk_section
from fieldtruth.maps.stems import through
from fieldtruth.world.model import Mesh, World
from fieldtruth.world.plants import TREES

REACH: Final = 20.0
"""Distance [m] up to which stems are scored."""
THICK: Final = 0.07
"""Least diameter [m] of a stem."""
SLICE: Final = 0.1
"""Distance [m] of points from breast height."""
LEAST: Final = 6
"""Points of a circle, at least."""
GAP: Final = np.radians(30.0)
"""Angle [rad] between neighbouring points up to which the turn between them was seen."""
ROUGH: Final = 0.02
"""Distance [m] from a circle up to which its points lie: bark has flutes, and stems have a dozen sides."""
TRIES: Final = 300
"""Circles through three points."""
RADII: Final = 0.025, 0.8
"""Least and greatest radius [m] of a stem."""
EVERY: Final = 5
"""Scans from one of which stems are fitted to the next."""
RANGES: Final = (0.0, 5.0, 10.0, 15.0, 20.0)
COLUMNS: Final = ("stems", "seen", "points", "method", *FIGURES)
SHARES: Final = (0.0, 0.2, 0.3, 0.4, 0.5, 0.7, 1.01)

Method = Callable[[Array], Sequence[float] | None]


class Stem(NamedTuple):
    """Instance id, ground [m] and section of a stem."""

    instance: int
    ground: float
    section: Section


class Seen(NamedTuple):
    """A stem in clouds: distance [m], share of its turn, points, and errors [m] by method, NaN without a fit."""

    distance: float
    share: float
    points: int
    errors: Mapping[str, float]


def stems_of(drive: Drive) -> Iterator[Stem]:
    """Yield the stems of the trees within reach of a drive."""
    world, wood = drive.world, dict[str, Array]()
    for item in named_objects(world):
        mesh, xy = world.meshes[item.mesh], item.world_from_object[:2, 3]
        if not {*mesh.species} & {*TREES} or drive.distance(xy[None])[0] > REACH:
            continue
        if item.mesh not in wood:
            wood[item.mesh] = wood_of(world, mesh)
        ground = float(world.terrain.field.height_at(*xy))
        section = trunk_section(moved(item.world_from_object, wood[item.mesh]), ground + BREAST_HEIGHT, xy)
        if section is not None and section.diameter >= THICK:
            yield Stem(item.object_id, ground, section)


def wood_of(world: World, mesh: Mesh) -> Array:
    """Triangles (t, 3, 3) [m] of trunk and branches of a mesh, in its frame."""
    label = np.array([world.materials[name].label for name in mesh.materials])[mesh.material]
    return np.asarray(mesh.vertices[mesh.faces[label == Label.TRUNK]], np.float64)


# ---------------------------------------------------------------------------------------------------------------------
# Methods


def algebraic(points: Array) -> Sequence[float] | None:
    """Circle by linear least squares (Kåsa 1976); None if its radius is not within ``RADII``."""
    return _of_a_stem(through(points))


def geometric(points: Array) -> Sequence[float] | None:
    """Circle of the least sum of squared distances, from the algebraic one on; None as there."""
    start = through(points)
    return None if start is None else _of_a_stem(_nearest(points, start[:3]))


def consensus(points: Array) -> Sequence[float] | None:
    """Geometric circle of the points near the best of those through three points each; None as there."""
    a, b, c = points[np.random.default_rng(0).integers(len(points), size=(3, TRIES))]
    with np.errstate(divide="ignore", invalid="ignore"):
        one, two = b - a, c - a
        across = (one**2).sum(axis=1)[:, None] * two - (two**2).sum(axis=1)[:, None] * one
        offset = across[:, ::-1] * (1, -1) / (2 * (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]))[:, None]
    middles, radii = a + offset, np.hypot(*offset.T)
    near = np.abs(np.hypot(*(points - middles[:, None]).transpose(2, 0, 1)) - radii[:, None]) < ROUGH
    near &= ((radii >= RADII[0]) & (radii <= RADII[1]))[:, None]
    best = int(near.sum(axis=1).argmax())
    if near[best].sum() < LEAST:
        return None
    return _of_a_stem(_nearest(points[near[best]], (*middles[best], radii[best])))


def _nearest(points: Array, start: Sequence[float]) -> Sequence[float]:
    def off(circle: Array) -> Array:
        return np.asarray(np.hypot(*(points - circle[:2]).T) - circle[2])

    return [float(value) for value in least_squares(off, start).x]


def _of_a_stem(circle: Sequence[float] | None) -> Sequence[float] | None:
    return None if circle is None or not RADII[0] <= circle[2] <= RADII[1] else circle


METHODS: Final[Mapping[str, Method]] = {"algebraic": algebraic, "geometric": geometric, "consensus": consensus}


# ---------------------------------------------------------------------------------------------------------------------
# Scores


def seen_share(points: Array, xy: tuple[float, float]) -> float:
    """Share of the turn about a middle that has points (n, 2)."""
    angles = np.sort(np.arctan2(points[:, 1] - xy[1], points[:, 0] - xy[0]))
    gaps = np.diff(angles, append=angles[:1] + 2 * np.pi)
    return float(gaps[gaps <= GAP].sum() / (2 * np.pi))


def seen(stem: Stem, points: Array, distance: float, methods: Mapping[str, Method]) -> Seen:
    """Fit circles to the points (n, 3) [m] of a stem."""
    slice_ = points[np.abs(points[:, 2] - stem.ground - BREAST_HEIGHT) <= SLICE, :2]
    circles = {name: method(slice_) if len(slice_) >= LEAST else None for name, method in methods.items()}
    errors = {
        name: np.nan if circle is None else 2 * circle[2] - stem.section.diameter for name, circle in circles.items()
    }
    return Seen(distance, seen_share(slice_, stem.section[:2]), len(slice_), errors)


def by_stem(scan: Scan, *, branches: bool = False) -> dict[int, Array]:
    """Points (n, 3) on stems by instance id; ``branches``: all of class trunk."""
    wood = scan.label == Label.TRUNK
    if not branches:
        wood &= scan.part == PlantPart.STEM
    points, instance = scan.points[wood], scan.instance[wood]
    order = np.argsort(instance, kind="stable")
    ids, first = np.unique(instance[order], return_index=True)
    return dict(zip(ids.tolist(), np.split(points[order], first[1:]), strict=False))


def seen_in(
    stems: Sequence[Stem], scan: Scan, poses: Array, methods: Mapping[str, Method], *, branches: bool = False
) -> Iterator[Seen]:
    """Yield the stems within reach of poses, in the points of a scan, or of several in one."""
    found, none = by_stem(scan, branches=branches), np.zeros((0, 3))
    for stem in stems:
        distance = float(np.hypot(*(poses[:, :2, 3] - stem.section[:2]).T).min())
        if distance <= REACH:
            yield seen(stem, found.get(stem.instance, none), distance, methods)


def all_in_one(drive: Drive) -> Scan:
    """Points of all scans."""
    return Scan(*(np.concatenate(parts) for parts in zip(*drive.scans, strict=True)))


def rows_of(found: Sequence[Seen], what: str, edges: Sequence[float]) -> Iterator[list[object]]:
    """Yield a row of the table for each class of distance or share, and each method."""
    value = np.array([getattr(each, what) for each in found])
    for low, high in pairwise(edges):
        own = [each for each, v in zip(found, value.tolist(), strict=True) if low <= v < high]
        if what == "share":  # of those that no circle is asked of, nothing is known
            own = [each for each in own if each.points >= LEAST]
        if not own:
            continue
        middle = float(np.median([each.share for each in own])), int(np.median([each.points for each in own]))
        name = f"{low:g} to {min(high, 1.0) if what == 'share' else high:g}"
        for method in own[0].errors:
            yield [name, len(own), *middle, method, *score(np.array([each.errors[method] for each in own]))]


def picture(stem: Stem, points: Array, methods: Mapping[str, Method], file: str) -> None:
    """Draw the points of a stem, its true circle and those of all methods."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    figure = Figure((6, 6), layout="constrained")
    axes = figure.subplots()
    xy = points[np.abs(points[:, 2] - stem.ground - BREAST_HEIGHT) <= SLICE, :2]
    axes.plot(*xy.T, ".", color="black", markersize=3)
    circles = {"true": (*stem.section[:2], stem.section.diameter / 2)}
    fits = {name: method(xy) for name, method in methods.items()}
    circles |= {name: (fit[0], fit[1], fit[2]) for name, fit in fits.items() if fit is not None}
    for (name, (x, y, radius)), colour in zip(
        circles.items(), ("#2a9d3a", "#d1495b", "#e3a008", "#3266c2"), strict=False
    ):
        axes.add_patch(Circle((x, y), radius, fill=False, color=colour, label=f"{name}: {200 * radius:.1f} cm"))
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.legend()
    figure.savefig(file, dpi=100)


def main() -> None:
    """Print the tables."""
    parser = drive_arguments(__doc__ or "", ("forest", "park"))
    parser.add_argument("--with-branches", action="store_true", help="points of branches, too")
    options = parser.parse_args()
    branches = options.with_branches
    try:
        methods = {**METHODS, **{name: named_function("method", name) for name in options.method}}
        rows: dict[str, list[list[object]]] = {"distance": [], "share": []}
        for environment in options.envs:
            drive = driven(environment, options.seconds, options.signal)
            stems, whole = list(stems_of(drive)), all_in_one(drive)
            steps = range(0, len(drive.scans), EVERY)
            found = {
                "one scan": [
                    each
                    for i in steps
                    for each in seen_in(stems, drive.scans[i], drive.poses[i : i + 1], methods, branches=branches)
                ],
                "whole drive": list(seen_in(stems, whole, drive.poses, methods, branches=branches)),
            }
            for what, edges in (("distance", RANGES), ("share", SHARES)):
                for name, each in found.items():
                    rows[what] += [[environment, name, *row] for row in rows_of(each, what, edges)]
        for what, made in rows.items():
            show(["environment", "clouds", what, *COLUMNS], made)
            print()
        if options.picture and stems:
            points = by_stem(whole, branches=branches)
            nearest = max(stems, key=lambda stem: len(points.get(stem.instance, ())))
            picture(nearest, points[nearest.instance], methods, options.picture)
    except FieldtruthError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
