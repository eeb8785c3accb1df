# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Class shares: known on a plain, independent of threads, formatted as tables."""

import numpy as np
import pytest
from report_worlds import EXPERIMENT, plain
from small_park import LAYOUT, RIG, small_park

from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.drive.plan import pose_on_ground
from fieldtruth.experiment.config import Experiment
from fieldtruth.report import shares as shares_module
from fieldtruth.report.shares import ClassShares, class_shares, count_classes, shares_of, shares_table
from fieldtruth.sense.scene import Scene


def test_shares_on_a_plain_match_closed_form() -> None:
    world = plain()
    poses = [pose_on_ground(world.terrain.field, np.array([x, 3.0, 0.4]), RIG) for x in (0.0, 10.0, 20.0)]
    shares = count_classes(Scene(world), RIG, poses, workers=2)
    assert shares.pixels.shape == shares.points.shape == (3, 18)
    assert (shares.pixels[:, Label.GROUND] == 64 * 24).all()
    assert (shares.pixels[:, Label.SKY] == 64 * 24).all()
    assert (shares.points[:, Label.GROUND] == 64 * 8).all()
    assert shares.pixel_share[Label.SKY] == shares.pixel_share[Label.GROUND] == 0.5
    assert shares.point_share[Label.GROUND] == 1.0
    assert shares.as_dict() == {"poses": 3, "pixels": {"ground": 4608, "sky": 4608}, "points": {"ground": 1536}}


def test_shares_separate_trail_and_ground_along_the_route() -> None:
    shares = class_shares(EXPERIMENT, spacing=2.0, scene=Scene(plain(trail_north_of_0=True)))
    assert len(shares.pixels) == 7  # the path ends 2 m before the last waypoint, 16 m away
    assert shares.points[:, [Label.GROUND, Label.TRAIL]].sum() == shares.points.sum() == 7 * 64 * 8
    assert (np.diff(shares.points[:, Label.TRAIL]) > 0).all()
    assert shares.pixels[-1, Label.GROUND] == 0


def test_counts_do_not_depend_on_the_number_of_threads() -> None:
    scene = Scene(small_park())
    one, three = (class_shares(EXPERIMENT, spacing=3.0, scene=scene, workers=workers) for workers in (1, 3))
    np.testing.assert_array_equal(one.pixels, three.pixels)
    np.testing.assert_array_equal(one.points, three.points)
    assert (one.pixels.sum(axis=1) == 64 * 48).all()
    assert len({tuple(row) for row in one.pixels.tolist()}) > 1


def test_experiments_in_one_world_load_it_once(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = []

    def load(experiment: Experiment) -> object:
        loaded.append((experiment.environment, experiment.seed, experiment.layout))
        return plain()

    monkeypatch.setattr(shares_module, "world_of", load)
    changes = ({"name": "small_2"}, {"name": "other", "seed": 5}, {"name": "bare", "seed": 5, "layout": {"bushes": 0}})
    found = shares_of([EXPERIMENT, *(EXPERIMENT.model_copy(update=values) for values in changes)])
    assert list(found) == ["small_1", "small_2", "other", "bare"]
    assert loaded == [("park", 0, LAYOUT), ("park", 5, LAYOUT), ("park", 5, {"bushes": 0})]
    np.testing.assert_array_equal(found["small_1"].pixels, found["other"].pixels)


def test_table_has_a_row_per_class_and_a_column_per_experiment() -> None:
    def counted(**counts: int) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
        rows = np.zeros((2, len(CLASSES)), np.int64)
        for name, count in counts.items():
            rows[1, Label[name]] = count
        return rows

    shares = {
        "a_1": ClassShares(pixels=counted(GROUND=3, SKY=1), points=counted(GROUND=8)),
        "b_1": ClassShares(pixels=counted(GROUND=1, TRUNK=99_999), points=counted()),
    }
    assert [line.split() for line in shares_table(shares).splitlines()] == [
        ["pixels", "[%]", "a_1", "b_1"],
        ["ground", "75.00", "0.00"],
        ["trunk", "and", "branch", "-", "100.00"],
        ["sky", "25.00", "-"],
        ["counted", "4", "100000"],
        [],
        ["points", "[%]", "a_1", "b_1"],
        ["ground", "100.00", "-"],
        ["counted", "8", "0"],
    ]
    assert not shares["b_1"].point_share.any()
