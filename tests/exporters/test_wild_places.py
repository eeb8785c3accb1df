# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wild-Places' layout as its scripts read it, and pairs of places against distances and turns that are known."""

import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pandas
from numpy.typing import ArrayLike
from pypcd4.pypcd4 import PointCloud

from fieldtruth.bag.run import open_run
from fieldtruth.core.transforms import pose, transform
from fieldtruth.experiment.files import dump_experiment, load_experiment
from fieldtruth.exporters import export
from fieldtruth.exporters.frames import Member
from fieldtruth.exporters.wild_places import Frames, _rows_of, pairs, seconds_of

SECOND = 10**9


def frames(
    name: str, xy_yaw: ArrayLike, seconds: ArrayLike, world: str = "forest", is_frames: bool = False, **layout: object
) -> Frames:
    poses = np.array([pose((x, y, 0.5), (0.0, 0.0, np.degrees(yaw))) for x, y, yaw in np.asarray(xy_yaw, float)])
    made_by = SimpleNamespace(world_name=world, seed=3, layout=layout)
    run = cast(Any, SimpleNamespace(is_frames=is_frames, experiment=made_by))
    stamps = (np.asarray(seconds) * SECOND).astype(np.int64)
    return Frames(Member(run, "train", name), np.arange(len(poses)), stamps, poses)


def test_pairs_of_two_runs_have_their_distance_and_the_turn_between_them() -> None:
    there = frames("there", [(0, 0, 0), (10, 0, 0)], [1, 2])
    back = frames("back", [(10, 1.5, np.pi / 2), (0, 2.99, -3.0), (5, 0, 0), (0, 3.01, 0)], [1, 2, 3, 4])
    found = [*pairs(there, back)]
    assert found == [
        ["there", "1.000000000", "back", "2.000000000", "2.9900", f"{np.degrees(-3.0):.2f}"],
        ["there", "2.000000000", "back", "1.000000000", "1.5000", "90.00"],
    ]


def test_a_run_meets_its_own_places_after_half_a_minute() -> None:
    run = frames("loop", [(0, 0, 0), (1, 0, 0), (0, 0.5, np.pi), (9, 9, 0)], [0, 20, 40, 60])
    assert [(row[1], row[3]) for row in pairs(run, run)] == [
        ("0.000000000", "40.000000000"),
        ("40.000000000", "0.000000000"),
    ]


def test_separate_frames_need_no_time_between_them() -> None:
    run = frames("looks", [(0, 0, 0), (1, 0, 0), (9, 9, 0)], [1, 2, 3], is_frames=True)
    assert [(row[1], row[3]) for row in pairs(run, run)] == [
        ("1.000000000", "2.000000000"),
        ("2.000000000", "1.000000000"),
    ]


def test_worlds_of_two_layouts_differ_but_not_those_of_two_seasons() -> None:
    summer = frames("a", [(0, 0, 0)], [1], old_trees=3, size=(90, 90))
    snow = frames("b", [(0, 0, 0)], [1], size=[90, 90], season="winter", drought=0.2, snow_depth=0.1, old_trees=3)
    other = frames("c", [(0, 0, 0)], [1], size=[90, 90], old_trees=4)
    assert len([*pairs(summer, snow)]) == 1
    assert [*pairs(summer, other)] == []
    assert [row[-1] for row in _rows_of([summer, other, snow])] == [0, 1, 0]


def test_places_of_two_worlds_are_no_pairs() -> None:
    one, other = frames("a", [(0, 0, 0)], [1]), frames("b", [(0, 0, 0)], [1], world="park")
    assert [*pairs(one, other)] == []
    other.member.run.experiment = None  # type: ignore[misc]  # a bag from elsewhere
    assert [*pairs(one, other)] == []


def test_stamps_keep_their_nanoseconds() -> None:
    assert seconds_of(1_753_000_000_000_000_001) == "1753000000.000000001"
    assert seconds_of(100_000_000) == "0.100000000"


def test_files_are_read_as_those_of_wild_places(small_run: Path, tmp_path: Path) -> None:
    folders = [shutil.copytree(small_run, tmp_path / name) for name in ("summer", "autumn")]
    told = folders[1] / "experiment.yaml"  # that it was made in autumn
    told.write_text(dump_experiment(load_experiment(told).model_copy(update={"layout": {"season": "autumn"}})))
    made = export(folders, "wild-places", out=tmp_path / "places")
    runs = pandas.read_csv(made / "runs.csv")
    assert sorted(runs[["environment", "seed", "season", "frames"]].to_numpy().tolist()) == [
        ["park", 0, "autumn", 1],
        ["park", 0, "summer", 1],
    ]
    pairs = pandas.read_csv(made / "pairs.csv")
    assert len(pairs) == 2
    assert (pairs["query_run"] != pairs["database_run"]).all()
    assert np.abs(pairs[["distance_m", "turn_deg"]].to_numpy()).max() == 0
    run = open_run(small_run)
    cloud = run["lidar"].read(0)
    mount = run.calibration.base_from("lidar")
    for name in runs["run"]:
        poses = pandas.read_csv(made / name / "poses_aligned.csv", dtype={"timestamp": str})  # as its scripts do
        row: Any = poses.iloc[0]
        points = PointCloud.from_path(made / name / "Clouds" / f"{row.timestamp}.pcd").numpy(("x", "y", "z"))
        assert float(row.timestamp) == cloud.stamp_ns / SECOND
        assert (points == cloud.xyz).all()
        x, y, z, w = row.qx, row.qy, row.qz, row.qw
        ahead = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)]
        world = transform(run.trajectory.world_from_base(cloud.stamp_ns) @ mount, np.array([[0, 0, 0], [1, 0, 0]]))
        assert np.abs([row.x, row.y, row.z] - world[0]).max() < 1e-8
        assert np.abs(ahead - (world[1] - world[0])).max() < 1e-8
