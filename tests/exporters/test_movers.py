# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What moves in a run of several robots: states against the drives, moving points, boxes, tracks, and what reads them.

A watcher sees a leader, which drives at up to 1 m/s, in part behind a post, and a robot that creeps at 2 cm/s.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from export_bags import without
from sense_worlds import at, box, make_world

from fieldtruth import pipeline
from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError
from fieldtruth.bag.movers import STILL, Mover, MoverState
from fieldtruth.bag.run import Run, open_run
from fieldtruth.core import transforms
from fieldtruth.datasets import RunDataset
from fieldtruth.experiment.config import Experiment
from fieldtruth.world.model import World

LIDAR: Final = {"kind": "lidar", "columns": 256, "rings": 32, "max_range": 20.0, "spinning": True}
EYE: Final = {"kind": "camera", "name": "eye", "width": 160, "height": 120, "rate_hz": 10, "instances": True,
              "mount": {"xyz": [0.3, 0.0, 0.5]}}  # fmt: skip
BASE: Final[list[dict[str, Any]]] = [{"kind": "imu"}, {"kind": "gnss"}]
LATE_NS: Final = 500_000_000
"""A stamp at which the leader drives at its full speed."""


def world() -> World:
    return make_world([(box("post", (0.05, 0.05, 0.5)), at(-1.0, 0.9, 0.5))])


def robot(speed: float, *points: tuple[float, float], sensors: list[dict[str, Any]] = BASE) -> dict[str, Any]:
    route = {"metres": {"start": points[0], "waypoints": points[1:]}}
    return {"route": route, "control": {"speed": speed}, "rig": {"sensors": sensors}}


@pytest.fixture(name="folder", scope="module")
def _folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the runs."""
    experiment = Experiment.model_validate({
        "name": "trio",
        "environment": "park",
        "seconds": 0.62,
        "robots": {
            "leader": robot(1.0, (0, 1), (8, 2)),
            "parked": robot(0.02, (1.2, -0.8), (8, -1)),
            "watcher": robot(0.3, (-2.5, 1), (8, 1.5), sensors=[*BASE, LIDAR, EYE]),
        },
    })  # fmt: skip
    return pipeline.generate(experiment, tmp_path_factory.mktemp("runs"), world=world(), workers=2)


@pytest.fixture(name="run", scope="module")
def _run(folder: Path) -> Run:
    return open_run(folder / "watcher")


def number_of(run: Run, name: str) -> int:
    return next(mover.object_id for mover in run.movers if mover.name == name)


# ---------------------------------------------------------------------------------------------------------------------
# States


def test_a_mover_is_moving_if_a_corner_is() -> None:
    mover = Mover("a", 5, 16, "robot", np.array([2.0, 1.0, 0.5]), np.array([1.0, 0.0, 0.0]))
    pose = transforms.pose((3.0, 0.0, 1.0), (0.0, 0.0, 90.0))
    turning = MoverState(pose, np.zeros(3), np.array([0.0, 0.0, 0.1]))
    assert mover.box(turning).centre == pytest.approx([3.0, 1.0, 1.0])
    assert mover.velocity(turning) == pytest.approx([-0.1, 0.0, 0.0])
    farthest = np.hypot(2.0, 0.5)  # [m] from its origin
    for rate, moves in ((1.01, True), (0.99, False)):
        state = MoverState(pose, np.zeros(3), np.array([0.0, 0.0, -rate * STILL / farthest]))
        assert mover.is_moving(state) is moves
    assert mover.is_moving(MoverState(pose, np.array([0.0, 0.0, -0.051]), np.zeros(3)))


def test_states_are_those_of_the_other_robots_drives(run: Run, folder: Path) -> None:
    """The leader's own run has the same drive as odometry, and states between two messages are between theirs."""
    leader = open_run(folder / "leader")
    number = number_of(run, "leader")
    assert [mover.name for mover in run.movers] == ["leader", "parked"]
    assert [mover.name for mover in leader.movers] == ["parked", "watcher"]
    for row in (5, 25):
        stamp = int(leader.trajectory.stamps_ns[row])
        state = run.movers.at(stamp)[number]
        assert np.array_equal(state.pose, leader.trajectory.world_from_base(stamp))
        after = run.movers.at(stamp + 1_000_000)[number]
        between = run.movers.at(stamp + 250_000)[number]
        assert between.pose[:3, 3] == pytest.approx(0.75 * state.pose[:3, 3] + 0.25 * after.pose[:3, 3], abs=1e-12)
        assert between.linear == pytest.approx(0.75 * state.linear + 0.25 * after.linear)
        assert after.pose[:3, 3] - state.pose[:3, 3] == pytest.approx(1e-3 * after.linear, abs=1e-9)
    last = run.movers.at(620_000_000)[number]
    assert np.array_equal(run.movers.at(650_000_000)[number].pose, last.pose)
    with pytest.raises(BagError, match="has no message of /gazebo/model_states near 2000000000 ns"):
        run.movers.at(2_000_000_000)


def test_points_and_pixels_of_what_moves(run: Run, folder: Path) -> None:
    leader, parked = number_of(run, "leader"), number_of(run, "parked")
    dataset = RunDataset(folder / "watcher", ["moving", "moving_mask", "instances", "instance_mask"])
    sample = next(each for each in dataset if each["stamp_ns"] == LATE_NS)
    for moving, instances in (
        (sample["moving"], sample["instances"]),
        (sample["moving_mask"], sample["instance_mask"]),
    ):
        assert moving.dtype == np.bool_
        assert np.array_equal(moving, instances == leader)
        assert np.count_nonzero(moving) > 40
        assert np.count_nonzero(instances == parked) > 20
    first = run["lidar"][0]
    assert not run.movers.moving(first.instance, 1_000_000).any()  # when all stand
    alone = without(folder / "watcher" / "trio_watcher.bag", folder / "alone" / "a.bag")
    with pytest.raises(BagError, match=r"moving: .*a\.bag has no experiment\.yaml beside it, which says what moves"):
        RunDataset(alone, ["moving"])


def test_a_run_without_the_poses_of_what_moves_is_refused(folder: Path, tmp_path: Path) -> None:
    bag = without(
        folder / "watcher" / "trio_watcher.bag", tmp_path / "trio_watcher.bag", f"/watcher{table.MODEL_STATES}"
    )
    bag.with_name("experiment.yaml").write_bytes((folder / "watcher" / "experiment.yaml").read_bytes())
    with pytest.raises(BagError, match=r"has no /gazebo/model_states"), pytest.warns(match="does not fit the bag"):
        RunDataset(bag, ["moving"])
