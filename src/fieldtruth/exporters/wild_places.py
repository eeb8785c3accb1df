# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs for place recognition and loop closures, in the layout of Wild-Places, with lists of true matches.

Each run is a folder with ``Clouds/STAMP.pcd`` and ``poses_aligned.csv``, as Wild-Places (Knights and others 2023,
arXiv:2211.12732) has them, whose scripts make queries and databases of these. ``pairs.csv`` lists the places that are
seen again, within a run and between runs of one world: what those scripts, and users of SLAM, compare theirs with.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fieldtruth.bag.run import Run
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.yaml_io import package_data
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import Member, first_of_clouds
from fieldtruth.exporters.pcd import pcd_bytes

NEAR: Final = 3.0
"""Distance [m] up to which two frames are of one place, as in Wild-Places."""
AGAIN_NS: Final = 30_000_000_000
"""Time [ns] from which on a place of the same run is seen again, and not still."""
_STEP: Final = 0.5
"""Way [m] between frames: a robot that stands sees nothing new."""
_SEASON: Final = ("season", "drought", "snow_depth")
"""Keys of a layout that change what a world looks like, and nothing's place."""
_TEXTS: Final = package_data("fieldtruth.exporters", "wild_places.yaml")


class Frames(NamedTuple):
    """Frames of a run: rows of its clouds, their stamps (n,) [ns] and poses world_from_lidar (n, 4, 4)."""

    member: Member
    rows: NDArray[np.intp]
    stamps_ns: NDArray[np.int64]
    poses: Array


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: a folder for each run, runs.csv, pairs.csv and a README.

    Raises:
        BagError: a bag has no clouds, true poses or /tf_static, clouds have no labels, or a bag is damaged.
    """
    every = [_frames(member) for member in options.members]
    target.mkdir()
    (target / "README.md").write_text(str(_TEXTS["readme"]).format(near=NEAR, step=_STEP, again=AGAIN_NS // 10**9))
    _write_rows(target / "runs.csv", "run,split,environment,seed,season,frames,world", _rows_of(every))
    _write_rows(
        target / "pairs.csv",
        "query_run,query_timestamp,database_run,database_timestamp,distance_m,turn_deg",
        (row for query in every for database in every for row in pairs(query, database)),
    )
    for frames in every:
        _write_run(frames, target / frames.member.name, options)


def seconds_of(stamp_ns: int) -> str:
    """Return a stamp [ns] as the timestamps in file names and lists: seconds with nine decimals."""
    return f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}"


def _frames(member: Member) -> Frames:
    run = member.run
    sensor = first_of_clouds(run)
    stamps = run[sensor.name].stamps_ns
    if run.is_frames:
        rows = np.arange(len(stamps))
    else:
        positions = np.array([run.trajectory.world_from_base(stamp)[:3, 3] for stamp in stamps.tolist()])
        way = np.cumsum(np.linalg.norm(np.diff(positions, axis=0, prepend=positions[:1]), axis=1))
        rows = np.unique((way // _STEP).astype(np.int64), return_index=True)[1]
    mount = run.calibration.base_from(sensor.name)
    poses = [run.trajectory.world_from_base(stamp) @ mount for stamp in stamps[rows].tolist()]
    return Frames(member, rows, stamps[rows], np.array(poses))


def _world_of(run: Run) -> tuple[str, int, str] | None:
    """Environment, seed and layout (JSON), which all seasons of a world share; None of a bag from elsewhere."""
    if run.experiment is None:
        return None
    layout = {name: value for name, value in run.experiment.layout.items() if name not in _SEASON}
    return run.experiment.world_name, run.experiment.seed, json.dumps(layout, sort_keys=True, default=str)


def _rows_of(every: Sequence[Frames]) -> Iterator[list[object]]:
    """Yield the rows of runs.csv, where worlds have numbers from 0 on."""
    numbers: dict[tuple[str, int, str], int] = {}
    for member, rows, *_ in every:
        world, made_by = _world_of(member.run), member.run.experiment
        environment, seed, _ = world or ("", "", "")
        season = "" if made_by is None else made_by.layout.get("season", "summer")
        number = "" if world is None else numbers.setdefault(world, len(numbers))
        yield [member.name, member.split, environment, seed, season, len(rows), number]


def pairs(query: Frames, database: Frames) -> Iterator[list[object]]:
    """Yield the frames of a database that are of the place of a query; none if the runs are of two worlds.

    In a drive, a frame of the same run counts from ``AGAIN_NS`` on; separate frames are no drive.
    """
    same = query is database
    worlds = [_world_of(frames.member.run) for frames in (query, database)]
    if not same and (None in worlds or worlds[0] != worlds[1]):
        return
    again = 1 if query.member.run.is_frames else AGAIN_NS
    tree = cKDTree(database.poses[:, :3, 3])
    for row, position in enumerate(query.poses[:, :3, 3]):
        for other in sorted(tree.query_ball_point(position, NEAR)):
            if same and abs(int(query.stamps_ns[row] - database.stamps_ns[other])) < again:
                continue
            between = transforms.inverse(query.poses[row]) @ database.poses[other]
            turn = np.degrees(np.arctan2(between[1, 0], between[0, 0]))
            yield [
                query.member.name, seconds_of(int(query.stamps_ns[row])), database.member.name,
                seconds_of(int(database.stamps_ns[other])), f"{np.linalg.norm(between[:3, 3]):.4f}", f"{turn:.2f}",
            ]  # fmt: skip


def _write_run(frames: Frames, folder: Path, options: Options) -> None:
    """Write the clouds of a run, and poses_aligned.csv."""
    run, name = frames.member.run, first_of_clouds(frames.member.run).name
    (folder / "Clouds").mkdir(parents=True)
    quaternions = np.roll(transforms.quaternion_wxyz_from_rotation(frames.poses[:, :3, :3]), -1, axis=1)
    numbers = np.column_stack([frames.poses[:, :3, 3], quaternions])
    stamps = [seconds_of(stamp) for stamp in frames.stamps_ns.tolist()]
    rows = ([stamp, *(f"{x:.9f}" for x in row)] for stamp, row in zip(stamps, numbers.tolist(), strict=True))
    _write_rows(folder / "poses_aligned.csv", "timestamp,x,y,z,qx,qy,qz,qw", rows)
    clouds = run[name]

    def save(k: int) -> None:
        cloud = clouds.read(int(frames.rows[k]))
        (folder / "Clouds" / f"{stamps[k]}.pcd").write_bytes(pcd_bytes(cloud, options.labels, frames.poses[k]))

    for _ in options.each(f"{frames.member.name}: clouds", run, range(len(stamps)), save):
        pass


def _write_rows(path: Path, header: str, rows: Iterable[Sequence[object]]) -> None:
    with path.open("w", encoding="utf-8") as file:
        file.write(header + "\n")
        file.writelines(",".join(map(str, row)) + "\n" for row in rows)
