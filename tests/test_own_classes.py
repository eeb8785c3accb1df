# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Classes of a layout's own: a bale of id 32 in a small park, with its name and colour in all that reads its run."""

from pathlib import Path

import pytest

import fieldtruth as ft
from fieldtruth.bag.run import Run, open_run

NAME, COLOUR, ID = "hay_bale", (200, 180, 60), 32
OWN = {NAME: {"colour": list(COLOUR), "label_maps": {"rellis": "vehicle"}}, "crate": {"id": 77}}
VEHICLE = 8  # in RELLIS-3D
BOX = """\
v -0.5 0 -0.5
v 0.5 0 -0.5
v 0.5 0 0.5
v -0.5 0 0.5
v -0.5 1 -0.5
v 0.5 1 -0.5
v 0.5 1 0.5
v -0.5 1 0.5
f 1 2 3 4
f 8 7 6 5
f 1 5 6 2
f 2 6 7 3
f 3 7 8 4
f 4 8 5 1
"""
RIG = {
    "sensors": [
        {"kind": "lidar", "name": "lidar", "columns": 256, "rings": 16, "rate_hz": 5, "mount": {"xyz": [0, 0, 0.9]}},
        {
            "kind": "stereo", "name": "stereo", "width": 96, "height": 64, "rate_hz": 5, "baseline": 0.1,
            "depth": True, "instances": True, "mount": {"xyz": [0.3, 0, 0.6], "rpy_deg": [0, 90, 0]},
        },
    ]
}  # fmt: skip
ROUTE = {"metres": {"start": [0, 0], "waypoints": [[3, 0]]}}


def experiment(folder: Path) -> ft.Experiment:
    """A drive past a bale of 1 m and beside it a crate."""
    pytest.importorskip("trimesh")
    (folder / "bale.obj").write_text(BOX, encoding="ascii")
    (folder / "crate.obj").write_text(BOX, encoding="ascii")
    bale = {"file": str(folder / "bale.obj"), "label": "hay bale", "pose": [4.5, 1.2]}
    crate = {"file": str(folder / "crate.obj"), "label": "crate", "pose": [4.5, -1.2], "scale": 0.7}
    layout = {"size": [24, 16], "bushes": 0, "classes": OWN, "objects": [bale, crate]}
    values = {"name": "own", "environment": "park", "seconds": 0.5, "layout": layout, "route": ROUTE, "rig": RIG}
    return ft.Experiment.model_validate(values)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Of the drive; the files of the objects are gone, as on another machine."""
    folder = tmp_path_factory.mktemp("own")
    bag = ft.generate(experiment(folder), folder, workers=2)
    (folder / "bale.obj").unlink()
    return open_run(bag)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> ft.World:
    """The world of the drive."""
    made = experiment(tmp_path_factory.mktemp("world"))
    return ft.load_world(made.environment, made.seed, made.layout)
