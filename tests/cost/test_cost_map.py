# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Maps of costs: lines over cells, equal bits, going on after a stop, files and their check, bad input."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drive_worlds import make_world, obstacle, tilted
from numpy.typing import NDArray

from fieldtruth import cli
from fieldtruth.core.errors import ConfigurationError, FieldtruthError, OutputError, UnknownNameError
from fieldtruth.cost import cost_layers, write_cost_map
from fieldtruth.cost import tiles as tiles_module
from fieldtruth.cost.check import has_costs, validate_cost_map
from fieldtruth.cost.stretch import Cause
from fieldtruth.cost.tiles import Order, TileDrives, made_tiles
from fieldtruth.experiment.rig import Rig
from fieldtruth.world import build
from fieldtruth.world.model import World
from fieldtruth.world_maps.layers import Grid

AREA = [-2.0, -0.5, 0.0, 0.5]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Cache folder of its own."""
    monkeypatch.setattr(tiles_module, "cache_folder", lambda: tmp_path / "cache")
    return tmp_path / "cache"


@pytest.fixture(scope="module")
def world() -> World:
    """A slope of 5 deg along x with a post."""
    return make_world(tilted(5.0, 0.0), obstacles=[obstacle("post", "box", (0.1, 0.1, 1.0), 0.6, 0.0, z=0.05)])


def layers(path: Path) -> dict[str, NDArray[Any]]:
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


@pytest.mark.parametrize("headings", [8, 24])
def test_lines_go_through_each_cell_once_and_near_its_middle(headings: int) -> None:
    order = Order(Rig(), Grid(-10.0, -5.0, 0.25, (30, 21)), headings)
    x, y = order.middles((0, 0))
    for k, angle in enumerate(order.angles()):
        count, ahead = np.zeros((30, 21), int), np.array([math.cos(angle), math.sin(angle)])
        for line in order.lines((0, 0), float(angle)):
            count[line.cells] += 1
            from_line = np.stack([x[line.cells[0]], y[line.cells[1]]], axis=-1) - line.xy
            np.testing.assert_allclose(from_line @ ahead, line.spots, atol=1e-9)
            assert (np.diff(line.spots) > 0.2).all()
            beside = np.abs(from_line @ [-ahead[1], ahead[0]])
            assert beside.max() < (1e-9 if k * 360 // headings % 45 == 0 else 0.125)
        assert (count == 1).all()


def test_a_map_is_that_of_its_drives(world: World, tmp_path: Path) -> None:
    found = layers(
        write_cost_map(world, tmp_path / "a.npz", to="npz", area=AREA, headings=2, resolution=0.5, workers=1)
    )
    assert {*cost_layers([1.0], 2)} <= {*found}
    assert found["passes_v1"].shape == (4, 2)
    np.testing.assert_array_equal(found["passes_v1"], sum(found[f"cause_v1_h{k:03d}"] == 0 for k in (0, 180)))
    assert found["cause_v1_h000"].T.tolist() == 2 * [[0, 0, 0, Cause.HULL]]
    assert list(found["causes"])[Cause.HULL] == "touches an object with hull or mast"
    assert np.isnan(found["energy_v1_h000"][3, 1])
    free = found["passes_v1"] == 2
    assert (found["energy_v1_h000"][free] > found["energy_v1_h180"][free] + 30.0).all()  # m g tan(5 deg) is 43 J/m
    np.testing.assert_allclose(found["tilt_v1"][free], math.radians(5.0), atol=0.02)


@pytest.mark.slow
def test_processes_and_a_stop_change_no_bit(world: World, tmp_path: Path, folder: Path) -> None:
    order = Order(Rig(), Grid(-18.0, -1.0, 0.5, (66, 3)), 2)  # three tiles
    one = {str(cells): costs for cells, costs in made_tiles(world, order, 1.0, 1)}
    files = sorted(folder.glob("passage-*.npz"))
    assert len(files) == 3
    kept = files[0].stat().st_mtime_ns, files[0].read_bytes()
    for path in files[1:]:  # as if it had been stopped after the first
        path.unlink()
    two = {str(cells): costs for cells, costs in made_tiles(world, order, 1.0, 2)}
    assert files[0].read_bytes() == kept[1]
    assert one.keys() == two.keys()
    for cells, costs in one.items():
        for first, second in zip(costs, two[cells], strict=True):
            np.testing.assert_array_equal(first, second)


def test_tiles_that_are_done_are_not_driven_again(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = {"to": "npz", "area": [-3.0, 0.0, -2.5, 0.5], "headings": 1, "resolution": 0.5, "workers": 1}
    first = write_cost_map(world, tmp_path / "a.npz", **asked)  # type: ignore[arg-type]
    monkeypatch.setattr(TileDrives, "costs", lambda *_: pytest.fail("driven again"))
    second = write_cost_map(world, tmp_path / "b.npz", **asked)  # type: ignore[arg-type]
    assert first.read_bytes() == second.read_bytes()


def test_tiles_meet_without_gaps() -> None:
    order = Order(Rig(), Grid(-10.0, -5.0, 0.25, (81, 37)), 8)
    covered = np.zeros((81, 37), int)
    for tile in order.tiles():
        cells = order.cells(tile)
        covered[cells] += 1
        x, y = order.middles(tile)
        assert (len(x), len(y)) == covered[cells].shape
        np.testing.assert_allclose(x[0], -10.0 + (cells[0].start + 0.5) * 0.25)
    assert (covered == 1).all()


@pytest.fixture
def small(world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Path]:
    """Writes a map of two cells, of which one does not pass at heading 0, in a format."""
    monkeypatch.setattr(build, "load_world", lambda *_: world)
    asked: dict[str, Any] = {"area": [-1.0, -0.5, 0.0, 0.0], "headings": 2, "resolution": 0.5, "workers": 1}
    return lambda to: write_cost_map(world, tmp_path / f"a.{to}", to=to, **asked)


def passed(path: Path) -> list[bool | None]:
    assert has_costs(path)
    return [check.passed for check in validate_cost_map(path)]


@pytest.mark.parametrize("to", ["npz", "grid_map", "geotiff"])
def test_validate_passes(small: Callable[[str], Path], to: str) -> None:
    made = small(to)
    if to == "grid_map":
        made = made.rename(made.with_suffix(".bag"))
    assert passed(made) == [True, True]


@pytest.mark.parametrize(
    ("name", "value", "found"),
    [
        ("slip_v1_h180", 0.01, [False, False]),
        ("cause_v1_h000", Cause.STUCK, [True, False]),  # no mean follows from why it does not pass
        ("passes_v1", 2, [False, True]),
        ("rig", None, [True, None]),
        ("tilt_v1_h180", None, [False, None]),
    ],
)
def test_validate_finds_a_value_that_was_changed(
    small: Callable[[str], Path], tmp_path: Path, name: str, value: Any, found: list[bool | None]
) -> None:
    changed: dict[str, Any] = layers(small("npz"))
    assert changed["cause_v1_h000"].tolist() == [[Cause.PASSES], [Cause.HULL]]
    if value is None:
        del changed[name]
    else:
        changed[name][1, 0] = value
    np.savez(tmp_path / "b.npz", **changed)
    assert passed(tmp_path / "b.npz") == found


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"speeds": [1.5]}, ConfigurationError, "speed must be 0.05 to 1 m/s, the limit of the robot husky, got 1.5"),
        ({"speeds": []}, ConfigurationError, "speed must be"),
        ({"resolution": 0.0}, ConfigurationError, "resolution must be 0.05 to 10 m, got 0"),
        ({"headings": 7}, ConfigurationError, "headings must divide 360"),
        ({"to": "pgm"}, UnknownNameError, "unknown format 'pgm'"),
        ({"area": [90.0, 0.0, 99.0, 1.0]}, ConfigurationError, "area must hold a cell"),
    ],
)
def test_what_is_not_allowed(
    world: World, tmp_path: Path, changes: dict[str, Any], error: type[FieldtruthError], words: str
) -> None:
    with pytest.raises(error, match=words):
        write_cost_map(world, tmp_path / "a.npz", **{"to": "npz", **changes})
    assert not (tmp_path / "a.npz").exists()


def test_a_world_without_free_ground_and_a_map_too_large(world: World, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="test: no free ground for the robot husky"):
        write_cost_map(make_world(tilted(30.0, 0.0)), tmp_path / "a.npz", to="npz")
    vast = make_world(size=(40.0, 20.0))
    object.__setattr__(vast, "size", (4e6, 4e6))
    with pytest.raises(OutputError, match="GB of disk"):
        write_cost_map(vast, tmp_path / "a.npz", to="npz")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--robot", "huski", "--to", "npz"], "unknown robot 'huski'"),
        (["--speed", "0.3,2", "--to", "npz"], "speed must be 0.05 to 1 m/s, the limit of the robot husky, got 2"),
        (["--speed", "fast", "--to", "npz"], "--speed must be a number, got 'fast'"),
        (["--resolution", "0", "--to", "npz"], "resolution must be 0.05 to 10 m, got 0"),
        (["--to", "pdf"], "unknown format 'pdf'"),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["cost", "park", *arguments]) == 2
    text = capsys.readouterr().err
    assert words in text
    assert text.count("\n") == 1
