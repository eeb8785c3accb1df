# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""``validate`` of maps: they pass as they were written, and one flipped cell of each kind of layer is found."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import yaml
from numpy.typing import NDArray
from sense_worlds import at, box, make_world

from fieldtruth import cli, world_maps
from fieldtruth.bag.run import open_run
from fieldtruth.core.errors import ConfigurationError, OutputError
from fieldtruth.cost import tiles, write_cost_map
from fieldtruth.cost.check import validate_cost_map
from fieldtruth.exporters import MapOptions, export
from fieldtruth.local_maps import LocalMaps, check, world_of_run
from fieldtruth.local_maps.check import validate_map
from fieldtruth.local_maps.costs import read_costs
from fieldtruth.validation import Check, runner
from fieldtruth.world import build
from fieldtruth.world.model import World
from fieldtruth.world_maps import map_layers, write_map
from fieldtruth.world_maps.files import FORMATS, MadeMap
from fieldtruth.world_maps.layers import LAYERS, Grid, Layers, names_of

KINDS = (
    *("ground", "ground_class", "overhang", "overhang_instance", "plant_top_class", "surface", "soil", "water_depth"),
    *("solid_volume", "obstacle", "slope", "step_height", "drop_height", "solid_distance"),
)


@pytest.fixture(scope="module")
def world() -> World:
    """A slope of 4 m by 3 m with a tree of two boxes."""
    trunk, crown = box("trunk", (0.1, 0.1, 0.8), "bark"), box("crown", (0.5, 0.5, 0.3), "leaf")
    placed = [(trunk, at(0.52, 0.33, 0.8)), (crown, at(0.52, 0.33, 1.7))]
    made = make_world(placed, height=lambda x, y: 0.1 * x + 0.02 * y, side=6.0)
    return replace(made, size=(4.0, 3.0), layout={"size": [4.0, 3.0]})


@pytest.fixture(autouse=True)
def built(world: World, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    def load_world(name: str, seed: int, layout: Any) -> World:
        assert (name, seed, layout) == ("tiny", 0, {"size": [4.0, 3.0]})
        return world

    if "brief_run" not in request.fixturenames:
        monkeypatch.setattr(build, "load_world", load_world)


@pytest.fixture(scope="module")
def written(world: World, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("maps")
    outs = {"npz": "a.npz", "geotiff": "map", "grid_map": "a.bag"}
    return {to: write_map(world, folder / out, to=to, resolution=0.1, workers=1) for to, out in outs.items()}


def flipped(values: NDArray[Any], i: int, j: int) -> NDArray[Any]:
    """Return a layer with another number in one cell; a height differs by 3 mm, and one that is not is there."""
    changed = values.copy()
    if values.dtype.kind == "f":
        changed[i, j] = 0.5 if np.isnan(values[i, j]) else values[i, j] + 0.003
    else:
        changed[i, j] = values[i, j] ^ 1
    return changed


def result(path: Path, name: str = "map") -> Check:
    return next(each for each in validate_map(path, workers=1) if each.name == name)


@pytest.mark.parametrize("to", ["npz", "geotiff", "grid_map"])
def test_maps_pass_as_they_were_written(written: dict[str, Path], to: str) -> None:
    checks = validate_map(written[to], workers=1)
    assert [(each.name, each.passed) for each in checks] == [("map", True), ("heights by rays", True)]
    assert checks[0].text == f"{40 * 30 * len(LAYERS) - 40 * 30 * 1:,} cells"  # no roughness from 5 cm on
    assert checks[1].text == "1,600 rays"


@pytest.mark.parametrize("layer", KINDS)
def test_a_flipped_cell_of_each_kind_is_found(written: dict[str, Path], tmp_path: Path, layer: str) -> None:
    with np.load(written["npz"]) as file:
        found = dict(file)
    found[layer] = flipped(found[layer], 31, 7)
    np.savez(tmp_path / "a.npz", allow_pickle=False, **found)
    wrong = result(tmp_path / "a.npz")
    assert wrong.passed is False
    assert "cells are those of the rebuilt world: 1 of " in wrong.text
    assert f"first {layer}, cell (31, 7)" in wrong.text.replace("np.int64(31)", "31").replace("np.int64(7)", "7")


@pytest.mark.parametrize("layer", [KINDS[-1], "ground"])
def test_a_layer_without_its_last_row_is_found(written: dict[str, Path], tmp_path: Path, layer: str) -> None:
    with np.load(written["npz"]) as file:
        found = dict(file)
    np.savez(tmp_path / "a.npz", allow_pickle=False, **found | {layer: found[layer][:-1]})
    assert result(tmp_path / "a.npz").passed is False


def test_a_flipped_cell_of_a_geotiff_and_of_a_grid_map_is_found(
    world: World, written: dict[str, Path], tmp_path: Path
) -> None:
    folder = tmp_path / "map"
    shutil.copytree(written["geotiff"], folder)
    with rasterio.open(folder / "ground.tif", "r+") as file:
        values = file.read(1)
        values[4, 5] += 0.003
        file.write(values, 1)
    assert "first ground, cell" in result(folder).text
    with np.load(written["npz"]) as stored:
        layers: Layers = {name: stored[name] for name in ("ground", "obstacle")}
        grid = Grid(float(stored["x0"]), float(stored["y0"]), float(stored["resolution"]), (40, 30))
    layers["obstacle"] = flipped(layers["obstacle"], 3, 3)
    FORMATS["grid_map"].write(MadeMap(world, grid, layers, names_of(world)), tmp_path / "b.bag")
    assert "first obstacle, cell" in result(tmp_path / "b.bag").text


def test_rays_find_what_the_columns_of_cells_have_wrong(
    written: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both the file and the map that is made again are off by 2 mm."""

    def wrong_layers(world: World, grid: Grid, layers: Any, workers: int) -> Layers:
        made = map_layers(world, grid, layers, workers)
        return made | {"overhang": made["overhang"] + np.float32(0.002)}

    with np.load(written["npz"]) as file:
        found = dict(file)
    found["overhang"] = found["overhang"] + np.float32(0.002)
    np.savez(tmp_path / "a.npz", allow_pickle=False, **found)
    monkeypatch.setattr(check, "map_layers", wrong_layers)
    same, rays = validate_map(tmp_path / "a.npz", workers=1)
    assert same.passed
    assert rays.passed is False
    assert "layer overhang near cell" in rays.text


@pytest.mark.usefixtures("in_park")
def test_maps_around_the_robot_are_checked_with_their_run(
    brief_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / brief_run.name
    shutil.copytree(brief_run, run)
    maps = export(run, "local-maps", workers=1, maps=MapOptions(side=6.0, resolution=0.2))
    assert maps.parent == run
    assert cli.main(["validate", str(maps)]) == 0
    assert capsys.readouterr().out.splitlines()[0].startswith("pass     local maps       ")
    made = LocalMaps(run, side=6.0, resolution=0.2, workers=1)
    monkeypatch.setattr(check, "LocalMaps", lambda *_, **__: made)  # once is enough for what follows
    monkeypatch.setattr(check, "_trace", lambda *_: None)
    path = sorted(maps.glob("*.npz"))[-1]
    with np.load(path) as file:
        good = dict(file)
    for name in ("ground", "overhang_class", "seen", "free", "free_distance", "free_polygon", "world_from_base"):
        bad = good[name].copy()
        bad.flat[17 % bad.size] = bad.flat[17 % bad.size] + 1
        np.savez(path, allow_pickle=False, **{**good, name: bad})
        wrong = result(maps, "local maps")
        assert wrong.passed is False, name
        assert f"first {path.name}, {name}, cell" in wrong.text
    (maps / "notes.npz").write_bytes(b"a note")  # of no stamp, and so not looked at
    np.savez(path, allow_pickle=False, **{**good, "ground": np.array(["a", "b"])})
    assert f"first {path.name}, ground, which is <U1 (2,), expected float32 (30, 30)" in result(maps, "local maps").text
    whole = path.read_bytes()
    for damaged in (b"", b"no archive", whole[: len(whole) // 2]):
        path.write_bytes(damaged)
        assert f"first {path.name}, which is damaged" in result(maps, "local maps").text
    path.rename(maps / "5.npz")
    assert "first 5.npz, at whose stamp there is no frame" in result(maps, "local maps").text
    (maps / "5.npz").unlink()
    assert f"first {path.name}, which is missing" in result(maps, "local maps").text
    for each in maps.glob("*.npz"):
        each.unlink()
    assert result(maps, "local maps").passed is False
    capsys.readouterr()
    (maps / "map.yaml").write_text("side: wide")
    assert cli.main(["validate", str(maps)]) == 2
    monkeypatch.setattr(runner, "validate", lambda *_, **__: [Check("bag", True, "whole")])
    assert cli.main(["validate", str(run)]) == 1  # with the checks of the run
    lines = capsys.readouterr().out.splitlines()
    assert re.match("pass +bag +whole$", lines[0])
    assert re.match(r"FAIL +local maps +.*map\.yaml does not describe maps around a robot$", lines[-2])


@pytest.mark.usefixtures("in_park")
def test_costs_in_maps_around_the_robot_are_those_of_the_map_of_costs_and_driven_again(
    brief_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One changed cost is found in a map around the robot, and one in the map of costs that is beside them."""
    run = tmp_path / brief_run.name
    shutil.copytree(brief_run, run)
    opened = open_run(run)
    x, y = opened.trajectory.position[0, :2].tolist()
    asked: dict[str, Any] = {
        "headings": 2,
        "resolution": 0.5,
        "area": [x - 0.5, y - 0.5, x + 0.5, y + 0.5],
        "workers": 1,
    }
    monkeypatch.setattr(tiles, "cache_folder", lambda: tmp_path / "cache")
    cost = write_cost_map(world_of_run(opened), tmp_path / "c.npz", to="npz", rig=opened.rig, **asked)
    chosen = MapOptions(side=3.0, resolution=0.25, layers=["ground", "energy_v1", "passes_v1", "free"], cost=cost)
    maps = export(run, "local-maps", workers=1, maps=chosen)
    assert (maps / "costs.npz").read_bytes() == cost.read_bytes()

    assert cli.main(["validate", "--json", str(maps)]) == 0
    names = [each["name"] for each in json.loads(capsys.readouterr().out)["checks"] if each["passed"]]
    assert names == ["local maps", "costs", "costs by drives"]
    made = LocalMaps(run, **chosen.given(), workers=1)
    monkeypatch.setattr(check, "LocalMaps", lambda *_, **__: made)  # once is enough for what follows

    def changed(path: Path, name: str, cell: tuple[int, int]) -> None:
        with np.load(path) as file:
            layers = dict(file)
        assert np.isfinite(layers[name][cell])
        layers[name][cell] += 0.5
        np.savez(path, allow_pickle=False, **layers)

    path = min(maps.glob("[0-9]*.npz"))
    good = path.read_bytes()
    changed(path, "energy_v1", (6, 6))
    wrong = result(maps, "local maps")
    assert wrong.passed is False
    assert ": 1 of " in wrong.text
    assert f"first {path.name}, energy_v1, cell" in wrong.text
    for name in ("energy_v1", "energy_v1_h000", "energy_v1_h180"):  # so that the mean fits
        changed(maps / "costs.npz", name, (0, 0))
    assert [each.passed for each in validate_cost_map(maps / "costs.npz")] == [True, False]
    path.write_bytes(good)
    assert result(maps, "local maps").passed
    with np.load(maps / "costs.npz") as file:
        layers = dict(file)
    for rig in (json.dumps({"robot": "jackal"}), "{}"):
        np.savez(maps / "costs.npz", allow_pickle=False, **layers | {"rig": np.array(rig)})
        assert result(maps, "local maps").text.endswith(
            f"costs.npz, which is of {'another' if 'j' in rig else 'no'} robot"
        )
    (maps / "costs.npz").unlink()
    assert result(maps, "local maps").text.endswith("costs.npz, which is missing")
    about = yaml.safe_load((maps / "map.yaml").read_text(encoding="utf-8"))
    (maps / "map.yaml").write_text(yaml.safe_dump({key: about[key] for key in about if key != "cost"}))
    assert result(maps, "local maps").passed
    assert "not costs and what follows from them, without costs.npz" in result(maps, "local maps").text


@pytest.mark.parametrize("damage", ["empty", "other", "byte", "x0", "flat", "resolution"])
def test_a_damaged_map_of_costs_is_refused_in_one_line(damage: str, tmp_path: Path) -> None:
    path = tmp_path / "c.npz"
    layers: dict[str, Any] = {"x0": 0.0, "y0": 0.0, "resolution": 0.5, "world": "park with seed 0, "}
    layers |= {"passes_v1": np.ones((40, 40), np.uint8), "energy_v1": np.random.default_rng(0).random((40, 40))}
    np.savez_compressed(path, allow_pickle=False, **layers)
    assert read_costs(path).grid.shape == (40, 40)
    whole = path.read_bytes()
    half = len(whole) // 2
    if damage in ("x0", "flat", "resolution"):
        changes: dict[str, Any] = {"passes_v1": np.ones(9)} if damage == "flat" else {"resolution": 0.0}
        changed = {} if damage == "x0" else changes
        kept = {key: layers[key] for key in layers if key != damage}
        np.savez(path, allow_pickle=False, **kept | changed)
    elif damage == "other":
        with path.open("wb") as file:
            np.save(file, np.ones(3))
    else:
        path.write_bytes(b"" if damage == "empty" else whole[:half] + bytes([whole[half] ^ 8]) + whole[half + 1 :])
    with pytest.raises(ConfigurationError, match=r"^\S+c\.npz is no "):
        read_costs(path)


def test_map_of_a_site_is_made_in_its_world(world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its name is that of the file, which may be gone: the layout has all that the file said."""
    layout = {"name": "campus", "centre": [50.0, 8.0]}
    campus, asked = replace(world, name="campus", layout=layout), list[Any]()

    def load_world(*given: Any) -> World:
        asked.append(given)
        return campus

    monkeypatch.setattr(build, "load_world", load_world)
    for to, out in (("npz", "a.npz"), ("geotiff", "a")):
        path = write_map(campus, tmp_path / out, to=to, resolution=0.1, layers=["ground"], workers=1)
        assert result(path).passed
    assert asked == [("site", 0, layout)] * 2


def test_geotiffs_without_their_library_are_refused_in_one_line(
    written: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(world_maps, "find_spec", lambda name: None)
    with pytest.raises(OutputError, match=r"^geotiff needs a library .* run: pip install 'fieldtruth\[maps\]'$"):
        validate_map(written["geotiff"])


def test_what_is_no_map_is_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.savez(tmp_path / "a.npz", ground=np.zeros((3, 3)))
    (tmp_path / "b.npz").write_bytes(b"no archive")
    (tmp_path / "c.npz").write_bytes(b"")
    (tmp_path / "nav2").mkdir()
    (tmp_path / "nav2" / "map.yaml").write_text("image: map.pgm")
    for name in ("a.npz", "b.npz", "c.npz", "nav2"):
        assert cli.main(["validate", str(tmp_path / name)]) == 2
        text = capsys.readouterr().err.splitlines()[-1]
        assert "is no map that says what its world is; `fieldtruth map` writes them as geotiff, grid_map and" in text
