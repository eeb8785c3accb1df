# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Voxels of worlds against closed forms, and against the clouds of a run."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from sense_worlds import at, box, make_mesh, make_world

from fieldtruth.bag.decode import points, read_bag, stamp_ns
from fieldtruth.bag.run import open_run
from fieldtruth.core import transforms
from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.core.errors import OutputError
from fieldtruth.exporters import export
from fieldtruth.exporters.occupancy import Lattice, lattice_of, voxels_of
from fieldtruth.world.model import Raster, World

Rows = set[tuple[int, ...]]


def rows_of(world: World, voxel_m: float = 0.1) -> tuple[Lattice, Rows]:
    """Rows x, y, z, class of a world."""
    lattice = lattice_of(world, voxel_m)
    parts = [part for _, part in voxels_of(world, lattice)]
    rows = np.concatenate([np.column_stack([part.coords.astype(int), part.label]) for part in parts])
    assert [tuple(row) for row in rows.tolist()] == sorted(tuple(row) for row in rows.tolist())
    found = {tuple(row) for row in rows.tolist()}
    assert len(found) == len(rows)
    return lattice, found


def test_level_ground_is_one_layer_and_a_block_is_its_shell() -> None:
    lattice, found = rows_of(make_world([(box("block", (0.45, 0.45, 0.45)), at(0.0, 0.0, 1.0))], height=0.05, side=4.0))
    assert lattice.origin.tolist() == [-2.0, -2.0, 0.0]
    assert lattice.shape == (40, 40, 15)
    ground = {(i, j, 0, int(Label.GROUND)) for i in range(40) for j in range(40)}
    cells = range(10)
    shell = {
        (15 + i, 15 + j, 5 + k, int(Label.ROCK))
        for i in cells for j in cells for k in cells if {0, 9} & {i, j, k}
    }  # fmt: skip
    assert len(shell) == 10**3 - 8**3
    assert found == ground | shell


def test_a_slope_passes_through_the_voxels_of_its_heights() -> None:
    lattice, found = rows_of(make_world(height=lambda x, y: 0.5 * x + 0.013, side=4.0, spacing=0.25))
    for i in range(40):
        low, high = (0.5 * (-2.0 + 0.1 * (i + step)) + 0.013 - lattice.origin[2] for step in (0, 1))
        layers = range(int(np.floor(low / 0.1 + 1e-6)), int(np.floor(high / 0.1 - 1e-6)) + 1)
        assert {row[2] for row in found if row[0] == i and row[1] == 7} == set(layers)


def test_a_triangle_marks_the_voxels_that_it_passes_through_and_no_other() -> None:
    rng = np.random.default_rng(3)
    for _ in range(4):
        corners = rng.uniform([-0.8, -0.8, 1.0], [0.8, 0.8, 2.0], (3, 3))
        lattice, found = rows_of(
            make_world([(make_mesh("t", corners, [[0, 1, 2]]), np.eye(4))], height=-0.95, side=2.0)
        )
        marked = np.array([row[:3] for row in found if row[3] == Label.ROCK])
        a, b = np.meshgrid(np.linspace(0, 1, 500), np.linspace(0, 1, 500))
        inner = (a + b <= 1.0).ravel()
        weights = np.stack([1 - a - b, a, b], axis=-1).reshape(-1, 3)[inner]
        cells = (weights @ corners - lattice.origin) / 0.1
        assert {tuple(row) for row in np.floor(cells).astype(int).tolist()} <= {tuple(row) for row in marked.tolist()}
        away, _ = cKDTree(cells).query(marked + 0.5, p=np.inf)  # along the axis where it is farthest
        assert np.max(away) < 0.56  # a sample is in each, or nearer to it than samples are apart


def test_ground_has_the_classes_of_trail_and_soil_on_either_side_of_the_edge() -> None:
    edge = Raster(
        values=np.array([[-2.03, -2.03], [1.97, 1.97]], np.float32), spacing=4.0, x0=-2.0, y0=-2.0
    )  # x < 0.03
    _, found = rows_of(make_world(height=0.05, side=4.0, trail=edge))
    assert {row[0] for row in found if row[3] == Label.TRAIL} == set(range(21))
    assert {row[0] for row in found if row[3] == Label.GROUND} == set(range(20, 40))


@pytest.mark.usefixtures("in_park")
def test_every_point_of_a_lidar_is_in_a_voxel_of_its_class(small_run: Path, tmp_path: Path) -> None:
    made = export(small_run, "occupancy", out=tmp_path / "park.npz")
    with np.load(made, allow_pickle=False) as file:
        grid = dict(file)
    assert (grid["coords"].dtype, grid["label"].dtype) == (np.uint16, np.uint8)
    assert grid["names"].tolist() == [row.name for row in CLASSES[:18]]
    assert (grid["coords"].max(axis=0) < grid["shape"]).all()
    size = np.array([*grid["shape"], len(CLASSES)])
    known = np.sort(np.ravel_multi_index((*grid["coords"].T.astype(np.int64), grid["label"]), size))
    run = open_run(small_run)
    trajectory, lidar = run.trajectory, run.rig.lidar
    total = 0
    for reading in read_bag(run.bag, [lidar.topic]):
        cloud = points(reading.message)
        pose = trajectory.world_from_base(stamp_ns(reading.message.header)) @ lidar.mount.base_from_sensor
        xyz = transforms.transform(pose, np.stack([cloud[axis] for axis in "xyz"], axis=1).astype(float))
        cells = (xyz - grid["origin"]) / grid["voxel_m"]
        inside = ((cells > 0.1) & (cells < grid["shape"] - 0.1)).all(axis=1)
        total += int(inside.sum())
        met = np.zeros(inside.sum(), np.bool_)
        for shift in [np.zeros(3), *(0.01 * np.array([a, b, c]) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1))]:
            met |= is_known(known, np.floor(cells[inside] + shift).astype(np.int64), cloud["label"][inside], size)
        assert met.all()
        others = np.where(cloud["label"][inside] == Label.ROCK, Label.BENCH, Label.ROCK)
        assert is_known(known, np.floor(cells[inside]).astype(np.int64), others, size).mean() < 0.05
    assert total > 10_000


def is_known(
    known: NDArray[np.int64], cells: NDArray[np.int64], label: NDArray[np.uint8], size: NDArray[np.int64]
) -> NDArray[np.bool_]:
    rows = np.ravel_multi_index((*cells.T, label.astype(np.int64)), size.tolist())
    at_row = np.minimum(np.searchsorted(known, rows), len(known) - 1)
    return np.asarray(known[at_row] == rows)


@pytest.mark.parametrize("voxel", [0.0, -1.0, 1e-9, 20.0, float("nan"), float("inf")])
def test_voxels_have_a_size_between_limits(voxel: float, small_run: Path, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"voxel must be between 0\.01 and 10\.0 m"):
        export(small_run, "occupancy", out=tmp_path / "a.npz", voxel_m=voxel)
    assert not list(tmp_path.iterdir())
