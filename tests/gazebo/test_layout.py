# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A package says from which layout its world was built, so that a bag recorded there is annotated in the same world."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml
from small_park import small_park

from fieldtruth.experiment.files import load_experiment, parse_experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.gazebo.ros import write_ros_package
from fieldtruth.world.build import load_world
from fieldtruth.world.materials import GROUND_TYPES
from fieldtruth.world.relief import with_microrelief


def test_the_layout_is_written_and_named_in_the_readme(tmp_path: Path) -> None:
    world = replace(small_park(), layout={"grid": 0.2, "benches": 3})
    write_ros_package(tmp_path, world, Rig(), "classic")
    assert yaml.safe_load((tmp_path / "config/layout.yaml").read_text()) == {"grid": 0.2, "benches": 3}
    assert "--environment park --seed 0 --layout config/layout.yaml --lidar" in (tmp_path / "README.md").read_text()
    write_ros_package(tmp_path / "default", replace(world, layout={}), Rig(), "classic")
    assert not (tmp_path / "default/config/layout.yaml").exists()


def test_the_commands_of_a_site_name_no_file_of_the_user(tmp_path: Path) -> None:
    layout = {"name": "quinta", "centre": [49.9, 8.9], "map": {"file": "/maps/a.osm"}}
    world = replace(load_world("park"), name="quinta", layout=layout)
    experiment = load_experiment("park_1").model_copy(update={"environment": "site", "layout": layout})
    write_ros_package(tmp_path / "1", world, Rig(), "classic", [experiment])
    write_ros_package(tmp_path / "2", world, Rig(), "gz", [experiment])
    assert yaml.safe_load((tmp_path / "1/config/layout.yaml").read_text()) == layout
    assert "--environment site --seed 0 --layout config/layout.yaml" in (tmp_path / "1/README.md").read_text()
    again = (tmp_path / "2/README.md").read_text().partition("`again.yaml`:\n")[2].partition("fieldtruth generate")[0]
    assert parse_experiment(again).model_dump(include={"environment", "layout"}) == {
        "environment": "site",
        "layout": layout,
    }


def test_a_coarser_ground_is_a_sample_of_the_finer() -> None:
    coarse = np.linspace(0, 8, 41), np.linspace(-3, 3, 31)
    hills = np.sin(coarse[0])[:, None] * coarse[1]
    cover = [(GROUND_TYPES["lawn"].roughness, np.ones(hills.shape)), (GROUND_TYPES["mud"].roughness, hills * 0 + 0.5)]
    made = {}
    for cells in (160, 80, 40):
        fine = np.linspace(0, 8, cells + 1), np.linspace(-3, 3, cells * 6 // 8 + 1)
        made[cells] = with_microrelief(hills, coarse, fine, cover, np.random.default_rng(5))
    np.testing.assert_allclose(made[80], made[160][::2, ::2], atol=1e-12)
    np.testing.assert_allclose(made[40], made[160][::4, ::4], atol=1e-12)
    assert np.std(made[160] - np.asarray(hills).mean()) > 1e-3
