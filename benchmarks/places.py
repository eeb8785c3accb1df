# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Places that are seen again, with true distances: lists of frames, and recall@1 (docs/benchmarks_truth.md).

Run: python benchmarks/places.py [--envs NAME ...] [--signal ideal|datasheet] [--method FILE.py:FUNCTION] [--out FOLDER]
     python benchmarks/places.py --runs FOLDER [--method FILE.py:FUNCTION]

A robot stands at random places of the trails of an environment, with its view along them in either direction, and a
LiDAR scans: once for the database, and at other places for the queries. With ``--aside M`` the database is along the
environment's first route, and queries are up to M metres beside it, at any heading. As in Wild-Places (Knights and
others 2023, arXiv:2211.12732) a match is right if its frame is at most 3 m away, and queries without such a frame do
not count. The table has a row for each distance of the nearest frame.

With ``--runs``, FOLDER is an export ``--to wild-places`` of runs of one world, as those of the campaign revisit: each
run is a database for all others, and the table has a row for each change of season and direction.

A method is a function ``(queries, database) -> dissimilarities`` of lists of clouds (n, 3) [m] in the LiDAR's frame;
it returns an array (queries, database), of which the least in a row is the match. FOLDER gets, for each environment,
the poses of both sets (timestamp, x, y, z, qx, qy, qz, qw) and the true distances between them [m].
"""

import csv
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from drives import Drive, arguments, scanned, show, with_lidar
from numpy.typing import NDArray
from pypcd4.pypcd4 import PointCloud
from scipy.spatial.distance import cdist

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, FieldtruthError
from fieldtruth.core.user_code import named_function
from fieldtruth.experiment.config import FramesConfig

NEAR: Final = 3.0
"""Distance [m] up to which a match is right."""
EDGES: Final = (0.0, 1.0, 2.0, NEAR)
"""Distances [m] of the nearest frame, from row to row of the table."""
SEEDS: Final = {"database": 1, "queries": 2}
"""Of the places."""
ON_ROUTE: Final = 0.2
"""Distance [m] of the database from the route."""
RINGS, SECTORS, REACH = 20, 60, 40.0
"""Cells of a descriptor, and its radius [m]."""
LIFT: Final = 2.0
"""Height [m] that is added, so that ground is above 0."""

Method = Callable[[Sequence[Array], Sequence[Array]], Array]


class Recall(NamedTuple):
    """Queries with a frame of the database near them, and the share [%] whose match is one; and that by chance."""

    queries: int
    recall: float
    chance: float


def scan_context(queries: Sequence[Array], database: Sequence[Array]) -> Array:
    """Dissimilarities (queries, database) of Scan Context (Kim and Kim 2018): least mean cosine distance of sectors.

    A descriptor has the greatest height of each ring and sector. Turning the LiDAR shifts its sectors, all shifts of
    which are compared.
    """
    spectra, seen = zip(
        *(_spectra(np.array([_context(cloud) for cloud in each])) for each in (queries, database)), strict=True
    )
    cosine = np.fft.irfft(np.einsum("qrf,drf->qdf", spectra[0].conj(), spectra[1]), SECTORS)
    both = np.fft.irfft(np.einsum("qf,df->qdf", seen[0].conj(), seen[1]), SECTORS)
    return np.asarray((1.0 - cosine / np.maximum(both, 1.0)).min(axis=-1))


def _context(cloud: Array) -> Array:
    """Greatest heights (rings, sectors) [m] above ``LIFT`` below the LiDAR, 0 in empty cells."""
    distance = np.hypot(cloud[:, 0], cloud[:, 1])
    inside = distance < REACH
    ring = (distance[inside] / REACH * RINGS).astype(int)
    turn = np.arctan2(cloud[inside, 1], cloud[inside, 0]) / (2 * np.pi) % 1.0
    heights = np.zeros((RINGS, SECTORS))
    np.maximum.at(heights, (ring, (turn * SECTORS).astype(int) % SECTORS), cloud[inside, 2] + LIFT)
    return heights


def _spectra(contexts: Array) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Spectra along the sectors of contexts (k, rings, sectors) with columns of length 1, and of what is not empty."""
    length = np.linalg.norm(contexts, axis=1, keepdims=True)
    columns = np.divide(contexts, length, out=np.zeros_like(contexts), where=length > 0)
    return np.fft.rfft(columns), np.fft.rfft((length[:, 0] > 0).astype(np.float64))


def recall(dissimilarity: Array, distance: Array) -> Recall:
    """Score dissimilarities (queries, database) against true distances [m] of the same shape."""
    near = distance <= NEAR
    kept = near.any(axis=1)
    if not kept.any():
        return Recall(0, np.nan, np.nan)
    right = near[kept, dissimilarity[kept].argmin(axis=1)]
    return Recall(int(kept.sum()), 100 * float(right.mean()), 100 * float(near[kept].mean()))


def by_nearest(dissimilarity: Array, distance: Array) -> dict[str, Recall]:
    """Score by the distance of the nearest frame, and all; arguments as of ``recall``."""
    nearest = distance.min(axis=1)
    rows = {f"{low:g} to {high:g}": (nearest > low) & (nearest <= high) for low, high in pairwise(EDGES)}
    rows["all"] = np.ones(len(distance), bool)
    return {name: recall(dissimilarity[own], distance[own]) for name, own in rows.items()}


def sets_of(environment: str, signal: str, count: int, aside: float | None) -> dict[str, Drive]:
    """Scan the frames of the database and the queries.

    Raises:
        UnknownNameError, RouteError: as ``driven``, and as frames of an experiment.
    """
    experiment = with_lidar(environment, signal)
    level = FramesConfig(count=count, along="trail", pitch_deg=0, roll_deg=0, raised_m=0)
    found = {}
    for name, near in {"database": ON_ROUTE, "queries": aside}.items():
        changes = {"seed": SEEDS[name]} | ({} if aside is None else {"along": None, "aside_m": near})
        route = None if aside is None else experiment.route
        found[name] = scanned(
            experiment.model_copy(update={"frames": level.model_copy(update=changes), "route": route})
        )
    return found


def clouds_of(drive: Drive) -> list[Array]:
    """Points (n, 3) [m] of each scan in the LiDAR's frame."""
    inverse = transforms.inverse(drive.poses)
    return [transforms.transform(pose, scan.points) for pose, scan in zip(inverse, drive.scans, strict=True)]


def write_lists(folder: Path, sets: dict[str, Drive], distance: Array) -> None:
    """Write the poses of both sets, and the distances between them [m], a row for each query."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, drive in sets.items():
        quaternion = np.roll(transforms.quaternion_wxyz_from_rotation(drive.poses[:, :3, :3]), -1, axis=1)
        rows = np.column_stack([np.arange(len(quaternion)), drive.poses[:, :3, 3], quaternion])
        header = "timestamp,x,y,z,qx,qy,qz,qw"
        np.savetxt(folder / f"{name}.csv", rows, ["%d", *7 * ["%.6f"]], ",", header=header, comments="")
    np.savetxt(folder / "distances.csv", distance, "%.4f", ",")


class Place(NamedTuple):
    """A run of an export: its season, the poses (k, 4, 4) of its frames in the world, and their clouds."""

    season: str
    poses: Array
    clouds: list[Array]


def places_of(folder: Path) -> list[Place]:
    """Read the runs of an export ``--to wild-places``.

    Raises:
        ConfigurationError: the folder is not one of two runs at least.
    """
    try:
        with (folder / "runs.csv").open(encoding="utf-8") as file:
            rows = [*csv.DictReader(file)]
    except OSError as error:
        raise ConfigurationError(f"{folder} must be an export --to wild-places: {error.strerror}") from error
    if len(rows) < 2:
        raise ConfigurationError(f"{folder} must be an export of two runs at least, got {len(rows)}")
    return [_place(folder / row["run"], row["season"]) for row in rows]


def _place(folder: Path, season: str) -> Place:
    with (folder / "poses_aligned.csv").open(encoding="utf-8") as file:
        rows = [*csv.DictReader(file)]
    poses = [
        transforms.pose_from_quaternion_wxyz(
            [float(row[axis]) for axis in "xyz"], [float(row[f"q{axis}"]) for axis in "wxyz"]
        )
        for row in rows
    ]
    files = [folder / "Clouds" / f"{row['timestamp']}.pcd" for row in rows]
    return Place(season, np.array(poses), [PointCloud.from_path(file).numpy(("x", "y", "z")) for file in files])


def between_runs(places: Sequence[Place], method: Method) -> dict[tuple[str, str], Recall]:
    """Recall by seasons and directions: each run is the database of every other, and the shares are of all queries."""
    sums: dict[tuple[str, str], list[Recall]] = {}
    for database in places:
        for query in places:
            if query is database:
                continue
            distance = cdist(query.poses[:, :3, 3], database.poses[:, :3, 3])
            seasons = "same season" if query.season == database.season else "other season"
            turned = float(_ahead(query) @ _ahead(database)) < 0
            key = (seasons, "back" if turned else "there")
            sums.setdefault(key, []).append(recall(method(query.clouds, database.clouds), distance))
    return {key: _joined(found) for key, found in sorted(sums.items())}


def _ahead(place: Place) -> Array:
    """Way (2,) [m] from the first frame to the last."""
    return np.asarray(place.poses[-1, :2, 3] - place.poses[0, :2, 3])


def _joined(found: Sequence[Recall]) -> Recall:
    """Recall over the queries of several pairs of runs."""
    kept = [each for each in found if each.queries]
    total = sum(each.queries for each in kept)
    if not total:
        return Recall(0, np.nan, np.nan)
    shares = [sum(each.queries * getattr(each, name) for each in kept) / total for name in ("recall", "chance")]
    return Recall(total, *shares)


def main() -> None:
    """Print the table."""
    parser = arguments(__doc__ or "", ("park", "forest", "forest_road"))
    parser.add_argument("--count", type=int, default=60, help="frames of each set (default: 60)")
    parser.add_argument("--out", type=Path, metavar="FOLDER")
    parser.add_argument("--runs", type=Path, metavar="FOLDER", help="an export --to wild-places in place of frames")
    parser.add_argument("--aside", type=float, metavar="M", help="queries up to M beside the route [m]")
    options = parser.parse_args()
    if options.aside is not None and not 0.1 <= options.aside <= 1000:
        parser.error(f"argument --aside: must be 0.1 to 1000, got {options.aside:g}")
    if not 1 <= options.count <= 10_000:
        parser.error(f"argument --count: must be 1 to 10000, got {options.count}")
    try:
        methods: dict[str, Method] = {"Scan Context": scan_context} | {
            name: named_function("method", name) for name in options.method
        }
        if options.runs:
            places = places_of(options.runs)
            rows = [
                [*key, name, *found]
                for name, method in methods.items()
                for key, found in between_runs(places, method).items()
            ]
            show(["queries of", "direction", "method", "queries", "recall@1 %", "by chance %"], rows)
            return
        for k, environment in enumerate(options.envs):
            sets = sets_of(environment, options.signal, options.count, options.aside)
            distance = cdist(sets["queries"].poses[:, :3, 3], sets["database"].poses[:, :3, 3])
            if options.out:
                write_lists(options.out / environment, sets, distance)
            queries, database = (clouds_of(sets[name]) for name in ("queries", "database"))
            rows = [
                [environment, nearest, name, *found]
                for name, method in methods.items()
                for nearest, found in by_nearest(method(queries, database), distance).items()
            ]
            show(["environment", "nearest", "method", "queries", "recall@1 %", "by chance %"], rows, header=k == 0)
    except FieldtruthError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
