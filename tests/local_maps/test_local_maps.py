# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Maps around the robot in closed form on tiny worlds, and against the clouds and the path of a run."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sense_worlds import at, box, make_world
from tiny_runs import TinyRun, cloud, straight

from fieldtruth import cli, local_maps
from fieldtruth.bag.run import open_run
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError, FieldtruthError
from fieldtruth.exporters import MapOptions, export
from fieldtruth.local_maps import LocalMaps, world_rays
from fieldtruth.world.model import World
from fieldtruth.world_maps import write_map
from fieldtruth.world_maps.files import identity

SECOND = 1_000_000_000
ABOVE = at(0.0, 0.0, 1.0)
"""A LiDAR 1 m above base_link."""


@pytest.fixture(scope="module")
def world() -> World:
    """A slope with a post of 0.18 m x 0.18 m at x = 5, y = 0, which touches the four cells around it."""
    post = box("post", (0.09, 0.09, 1.0), "wood"), at(5.0, 0.0, 1.0)
    return make_world([post], height=lambda x, y: 0.05 * y, side=40.0)


@pytest.fixture(autouse=True)
def in_tiny_world(world: World, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if "brief_run" not in request.fixturenames:
        monkeypatch.setattr(local_maps, "world_of_run", lambda run: world)


def maps_of(path: Any = None, clouds: Any = (), **options: Any) -> LocalMaps:
    clouds = clouds or [cloud(0, [[1.0, 0.0, 0.0]]), cloud(SECOND, [[1.0, 0.0, 0.0]])]
    return LocalMaps(TinyRun(path or straight(1.0, 2.0), {"scan": clouds}, {"scan": ABOVE}), workers=1, **options)


def cell_of(grid: Any, x: float, y: float) -> tuple[int, int]:
    return int((x - grid.x0) / grid.resolution), int((y - grid.y0) / grid.resolution)


@pytest.mark.parametrize(("side", "resolution", "count"), [(20.0, 0.1, 200), (40.0, 0.2, 200), (8.0, 0.25, 32)])
def test_a_map_moves_with_the_robot_in_whole_cells(side: float, resolution: float, count: int) -> None:
    maps = maps_of(side=side, resolution=resolution)
    for stamp, x in ((0, 0.0), (SECOND, 1.0), (SECOND * 3 // 2, 1.5)):
        made = maps.at(stamp)
        assert made.layers["ground"].shape == (count, count)
        middle = made.grid.x0 + side / 2, made.grid.y0 + side / 2
        assert np.abs(np.subtract(middle, (x, 0.0))).max() <= resolution / 2 + 1e-9
        whole = (np.array(made.grid[:2]) + 20.0) / resolution
        np.testing.assert_allclose(whole, np.rint(whole), atol=1e-6)
        y = made.grid.y0 + (np.arange(count) + 0.5) * resolution
        inside = np.isfinite(made.layers["ground"])
        expected = np.broadcast_to(0.05 * y, (count, count))
        np.testing.assert_allclose(made.layers["ground"][inside], expected[inside], atol=1e-6)
        np.testing.assert_allclose(made.layers["slope"][inside], np.arctan(0.05), atol=1e-3)


def test_cells_are_those_of_the_map_of_the_world(world: World, tmp_path: Path) -> None:
    with np.load(write_map(world, tmp_path / "a.npz", to="npz", resolution=0.1, workers=1)) as file:
        whole = dict(file)
    made = maps_of()[1]
    i, j = (round((a - b) / 0.1) for a, b in ((made.grid.x0, whole["x0"]), (made.grid.y0, whole["y0"])))
    for name in ("ground", "hard_ground", "overhang", "obstacle", "step_height", "overhang_class"):
        np.testing.assert_array_equal(made.layers[name], whole[name][i : i + 200, j : j + 200], name)
    assert made.layers["overhang_class"][cell_of(made.grid, 5.0 + 0.01, 0.01)] == Label.BENCH


def test_beyond_the_world_a_map_is_empty_and_nothing_is_free() -> None:
    made = maps_of(straight(1.0, 1.0, start=(18.0, 0.0)))[0]
    beyond = made.grid.x0 + (np.arange(200) + 0.5) * 0.1 > 20.0
    assert beyond.sum() == 80
    assert np.isnan(made.layers["ground"][beyond]).all()
    assert not made.layers["free"][beyond].any()
    assert made.layers["free"][~beyond].all()
    assert made.free_distance[0] == pytest.approx(2.0)
    assert made.free_distance[60] == pytest.approx(4.0)


@pytest.mark.parametrize("heading", [0.0, 30.0, -135.0])
def test_free_distance_is_that_to_the_side_of_a_post(heading: float) -> None:
    made = maps_of(straight(1.0, 1.0, heading=np.radians(heading)))[0]
    angle = np.radians(np.arange(360) + heading)
    facing = np.abs(np.arctan2(np.sin(angle), np.cos(angle))) < np.arctan2(0.099, 4.9)
    assert facing.sum() in (2, 3)
    np.testing.assert_allclose(made.free_distance[facing], 4.9 / np.cos(angle[facing]))
    assert (made.free_distance[np.cos(angle) < 0.99] == 10.0).all()
    x, y = made.free_polygon[np.flatnonzero(facing)[0]]
    turned = np.cos(np.radians(heading)) * x - np.sin(np.radians(heading)) * y
    assert turned == pytest.approx(4.9)


def test_seen_is_what_rays_passed_and_hit_until_then() -> None:
    clouds = [
        cloud(0, [[3.05, 0.0, -1.0], [0.0, -4.0, 2.0]]),
        cloud(SECOND, [[0.0, 2.05, -0.8]]),  # from x = 1
    ]
    maps = maps_of(clouds=clouds)
    first, second = (maps[k].layers["seen"] for k in (0, 1))
    a, b = (maps[k].grid for k in (0, 1))
    assert first[cell_of(a, 3.05, 0.01)] == 2
    assert [first[cell_of(a, x, 0.01)] for x in (0.05, 1.55, 2.95, 3.15)] == [1, 1, 1, 0]
    # The second ray rises from 1 m by 0.5 m per metre; 2 m above the falling ground it is at y = -1 / 0.55.
    assert [first[cell_of(a, 0.01, y)] for y in (-0.55, -1.75, -1.95, -3.95)] == [1, 1, 0, 2]
    assert first[cell_of(a, 1.01, 2.05)] == 0
    assert second[cell_of(b, 1.01, 2.05)] == 2
    assert second[cell_of(b, 3.05, 0.01)] == 2
    assert (second > 0).sum() == (first > 0).sum() + 20


def test_rays_of_a_spinning_lidar_start_where_it_is_at_their_own_time() -> None:
    swept = cloud(SECOND, [[3.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 0.0, 0.0]], [0, SECOND // 2, 2 * SECOND])
    origins, ends = world_rays(swept, straight(2.0, 2.0), ABOVE)
    np.testing.assert_allclose(origins, [[2.0, 0.0, 1.0], [3.0, 0.0, 1.0], [4.0, 0.0, 1.0]])
    np.testing.assert_allclose(ends, [[5.0, 0.0, 1.0], [3.0, 2.0, 1.0], [5.0, 0.0, 1.0]])  # the last pose is at 4 m


def cost_file(path: Path, world: World, **layers: Any) -> Path:
    np.savez(path, x0=-2.0, y0=-1.0, resolution=0.5, world=np.array(identity(world)), **layers)
    return path


def test_costs_are_those_of_the_cell_below_and_block_what_no_heading_passes(world: World, tmp_path: Path) -> None:
    passes, slip = np.full((8, 4), 8, np.uint8), np.arange(32.0, dtype=np.float32).reshape(8, 4)
    passes[6] = 0  # x from 1 to 1.5
    costs = {"passes_v1": passes, "slip_v1": slip, "slip_v1_h000": slip + 1}
    made = maps_of(cost=cost_file(tmp_path / "c.npz", world, **costs))[0]
    assert "slip_v1_h000" not in made.layers
    for x, y, value in ((-1.95, -0.95, 0.0), (-1.55, -0.55, 0.0), (-1.45, -0.45, 5.0), (1.95, 0.95, 31.0)):
        assert made.layers["slip_v1"][cell_of(made.grid, x, y)] == value
    assert np.isnan(made.layers["slip_v1"][cell_of(made.grid, 2.05, 0.0)])
    assert [made.layers["free"][cell_of(made.grid, x, 0.05)] for x in (0.95, 1.05, 1.45, 1.55, 2.05)] == [1, 0, 0, 1, 1]
    assert made.free_distance[0] == pytest.approx(1.0)


def test_what_is_not_allowed_is_said(world: World, tmp_path: Path) -> None:
    no_costs, text = tmp_path / "d.npz", tmp_path / "e.npz"
    np.savez(no_costs, ground=np.zeros((2, 2)))
    text.write_text("x", encoding="ascii")
    other = cost_file(tmp_path / "f.npz", make_world(side=30.0), passes_v1=np.ones((2, 2)))
    for options, message in (
        ({"layers": ["grond"]}, "unknown layer 'grond'; did you mean 'ground'?"),
        ({"resolution": 0.0}, "resolution must be 0.001 to 100 m, got 0"),
        ({"layers": []}, "layers must name one of ground, "),
        ({"side": 0.0}, "side must be 1 to 4000 cells of 0.1 m, got 0 m"),
        ({"layers": ["roughness_20_50cm"]}, "needs a resolution of at most 0.05 m, got 0.1"),
        ({"cost": tmp_path / "none.npz"}, "none.npz does not exist; `fieldtruth cost EXPERIMENT --to npz` makes it"),
        ({"cost": text}, "e.npz is no NPZ file"),
        ({"cost": no_costs}, "d.npz is no map of costs that names its world"),
        ({"cost": other}, "f.npz is of another world: tiny with seed 0, 30 m x 30 m, 0 objects, and the run is in"),
    ):
        with pytest.raises(FieldtruthError) as error:
            maps_of(**options)
        assert message in str(error.value)
        assert "\n" not in str(error.value)


@pytest.mark.usefixtures("in_park")
def test_maps_of_a_run_agree_with_its_clouds_and_path(brief_run: Path, tmp_path: Path) -> None:
    made = export(brief_run, "local-maps", out=tmp_path / "maps", workers=1, maps=MapOptions(resolution=0.2))
    run = open_run(brief_run)
    stamps = run.readings(run.rig.lidar.name).stamps_ns.tolist()
    assert {*made.glob("*.npz")} == {made / f"{stamp}.npz" for stamp in stamps}
    assert (made / "map.yaml").is_file()
    with np.load(made / f"{stamps[-1]}.npz") as file:
        last = dict(file)
    np.testing.assert_allclose(last["world_from_base"], run.trajectory.world_from_base(stamps[-1]))
    assert last["ground"].shape == (100, 100)
    xyz = run["lidar"].read(len(stamps) - 1)
    _, ends = world_rays(xyz, run.trajectory, run.calibration.base_from("lidar"))
    trail = ends[xyz.label == Label.TRAIL]
    i, j = np.floor((trail[:, :2] - [last["x0"], last["y0"]]) / 0.2).astype(int).T
    near = (i >= 0) & (i < 100) & (j >= 0) & (j < 100)
    assert near.sum() > 50
    assert np.abs(np.median(trail[near, 2] - last["ground"][i[near], j[near]])) < 0.01
    assert (last["seen"][i[near], j[near]] == 2).all()
    path = np.floor((run.trajectory.position[:, :2] - [last["x0"], last["y0"]]) / 0.2).astype(int)
    assert last["free"][tuple(path.T)].all()


def test_options_of_maps_are_refused_in_one_line(
    brief_run: Path, in_park: None, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["export", str(brief_run), "--to", "local-maps", "--layers", "grond"]) == 2
    assert "unknown layer 'grond'" in capsys.readouterr().err.splitlines()[-1]
    assert cli.main(["export", str(brief_run), "--to", "pcd", "--side", "3"]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == (
        "error: format 'pcd' has no side; formats that have: webdataset, huggingface, local-maps, local-maps-bag"
    )
    with pytest.raises(ConfigurationError, match="side must be"):
        export(brief_run, "local-maps", maps=MapOptions(side=-1.0))
