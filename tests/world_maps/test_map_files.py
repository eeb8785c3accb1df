# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Maps as files, read back by GDAL, rosbags, Pillow, PyYAML and NumPy; and what is refused."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rasterio
import yaml
from numpy.typing import NDArray
from PIL import Image
from pyproj import Transformer
from rosbags.highlevel import AnyReader
from rosbags.interfaces import ConnectionExtRosbag1
from sense_worlds import at, box, make_world

from fieldtruth import cli, world_maps
from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.core.errors import ConfigurationError, FieldtruthError, OutputError
from fieldtruth.core.geodesy import Origin, geodetic_from_world
from fieldtruth.world import build
from fieldtruth.world.model import World
from fieldtruth.world_maps import check_layers, write_map
from fieldtruth.world_maps.files import local_crs
from fieldtruth.world_maps.layers import LAYERS


@pytest.fixture(scope="module")
def world() -> World:
    """A slope with a post, 8 m by 6 m, on a hill in the Alps; the post is at x = 2, y = 1."""
    post = box("post", (0.1, 0.1, 1.0), "wood"), at(2.0, 1.0, 1.0)
    made = make_world([post], height=lambda x, y: 0.1 * x + 0.02 * y, side=10.0)
    return replace(made, size=(8.0, 6.0), origin=Origin(47.1, 11.3, 1200.0))


@pytest.fixture(scope="module")
def layers(world: World, tmp_path_factory: pytest.TempPathFactory) -> dict[str, NDArray[Any]]:
    path = write_map(world, tmp_path_factory.mktemp("npz") / "a.npz", to="npz", workers=1)
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


def test_numpy_has_all_layers_over_x_and_y(layers: dict[str, NDArray[Any]]) -> None:
    assert {*LAYERS} <= {*layers}
    for name, row in LAYERS.items():
        assert (layers[name].dtype, layers[name].shape) == (np.dtype(row.dtype), (160, 120)), name
    x = layers["x0"] + (np.arange(160) + 0.5) * layers["resolution"]
    y = layers["y0"] + (np.arange(120) + 0.5) * layers["resolution"]
    np.testing.assert_allclose(layers["ground"], 0.1 * x[:, None] + 0.02 * y, atol=1e-6)
    assert layers["classes"][layers["overhang_class"][120, 80]] == "bench"
    assert layers["surfaces"][layers["surface"][0, 0]] == "soil"
    assert layers["solid_distance"][120, 80] == 0.0
    assert layers["solid_distance"][120, 100] == pytest.approx(18 * 0.05)
    assert layers["origin"].tolist() == [47.1, 11.3, 1200.0]


def test_geotiffs_have_north_up_a_crs_units_and_colours(
    world: World, layers: dict[str, NDArray[Any]], tmp_path: Path
) -> None:
    out = write_map(world, tmp_path / "map", to="geotiff", workers=1)
    assert {path.name for path in out.iterdir()} == {*(f"{name}.tif" for name in LAYERS), "map.yaml"}
    for name, row in LAYERS.items():
        with rasterio.open(out / f"{name}.tif") as file:
            np.testing.assert_array_equal(file.read(1)[::-1, ::-1], layers[name])
            assert (file.descriptions[0], file.units[0] or "") == (row.description, row.unit)
            assert file.crs.is_projected
    with rasterio.open(out / "ground.tif") as file:
        east, north = -1.0, 2.0  # y = 1, x = 2
        [value] = next(file.sample([(east, north)]))
        assert value == pytest.approx(0.1 * 2.0 + 0.02 * 1.0, abs=0.0031)
        longitude, latitude = Transformer.from_crs(file.crs.to_wkt(), 4326, always_xy=True).transform(east, north)
        expected = geodetic_from_world([2.0, 1.0, 0.2], world.origin)
        np.testing.assert_allclose([latitude, longitude], expected[:2], atol=1e-9)  # 0.1 mm
    with rasterio.open(out / "overhang_class.tif") as file:
        assert file.colormap(1)[Label.BENCH] == (*(CLASSES[Label.BENCH].rgb or ()), 255)
        assert file.tags(1)[str(int(Label.BENCH))] == "bench"
        assert file.nodata == 0
    about = yaml.safe_load((out / "map.yaml").read_text(encoding="utf-8"))
    assert about["classes"][int(Label.TRAIL)] == "trail"
    assert about["layers"]["slope"]["unit"] == "rad"


@pytest.mark.parametrize("origin", [Origin(49.9, 8.9, 0.0), Origin(-33.0, 151.0, 900.0), Origin(67.0, -20.0, 2500.0)])
def test_the_map_projection_is_the_plane_of_the_world(origin: Origin) -> None:
    x, y, z = (a.ravel() for a in np.meshgrid([-500.0, 0.0, 500.0], [-500.0, 0.0, 500.0], [-50.0, 50.0]))
    latitude, longitude, _ = geodetic_from_world(np.stack([x, y, z], axis=-1), origin).T
    east, north = Transformer.from_crs(4326, local_crs(origin), always_xy=True).transform(longitude, latitude)
    assert np.abs([east + y, north - x]).max() < 5e-3


def test_a_grid_map_is_latched_and_its_matrices_begin_at_the_greatest_x_and_y(
    world: World, layers: dict[str, NDArray[Any]], tmp_path: Path
) -> None:
    out = write_map(world, tmp_path / "map.bag", to="grid_map", layers=["ground", "overhang_instance"], workers=1)
    with AnyReader([out]) as bag:
        found: dict[str, tuple[Any, Any]] = {
            c.topic: (c, bag.deserialize(data, c.msgtype)) for c, _, data in bag.messages()
        }
    connection, message = found["/grid_map"]
    assert connection.digest == "95681e052b1f73bf87b7eb984382b401"  # of ANYbotics' grid_map_msgs/GridMap
    assert isinstance(connection.ext, ConnectionExtRosbag1)
    assert connection.ext.latching == 1
    assert message.layers == ["ground", "overhang_instance"]
    assert message.info.header.frame_id == "world"
    assert (message.info.length_x, message.info.length_y) == pytest.approx((8.0, 6.0))
    assert (message.info.pose.position.x, message.info.pose.position.y) == pytest.approx((0.0, 0.0))
    for name, data in zip(message.layers, message.data, strict=True):
        outer, inner = data.layout.dim
        assert (outer.label, outer.size, outer.stride) == ("column_index", 120, 160 * 120)
        assert (inner.label, inner.size, inner.stride) == ("row_index", 160, 160)
        matrix = data.data.reshape(160, 120, order="F")  # as Eigen maps it
        i, j = 159 - 120, 119 - 80  # grid_map: x = length_x / 2 - (i + 0.5) resolution
        assert matrix[i, j] == layers[name][120, 80]
        np.testing.assert_array_equal(matrix, layers[name][::-1, ::-1])
    assert yaml.safe_load(found["/grid_map/names"][1].data)["classes"][1] == "ground"


def test_an_image_for_nav2_has_x_to_the_right_and_obstacles_in_black(world: World, tmp_path: Path) -> None:
    out = write_map(world, tmp_path / "nav2", to="pgm", workers=1)
    about = yaml.safe_load((out / "map.yaml").read_text(encoding="utf-8"))
    image = np.asarray(Image.open(out / about["image"]))
    assert image.shape == (120, 160)
    assert about["origin"] == [-4.0, -3.0, 0.0]
    assert {int(v) for v in np.unique(image)} == {0, 254}
    rows, columns = np.nonzero(image == 0)
    x = about["origin"][0] + (columns + 0.5) * about["resolution"]
    y = about["origin"][1] + (image.shape[0] - rows - 0.5) * about["resolution"]
    assert np.abs(x - 2.0).max() < 0.16
    assert np.abs(y - 1.0).max() < 0.16
    occupied, free = (255 - 0) / 255, (255 - 254) / 255
    assert occupied > about["occupied_thresh"] > about["free_thresh"] > free


def test_blocks_and_workers_make_no_difference(
    world: World, layers: dict[str, NDArray[Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(world_maps, "_TILE", 37)
    monkeypatch.setattr(world_maps, "_BLOCK", 50)
    with np.load(write_map(world, tmp_path / "b.npz", to="npz", workers=2)) as file:
        for name in LAYERS:
            np.testing.assert_allclose(file[name], layers[name], atol=1e-6, err_msg=name)


def test_an_area_is_a_part_of_the_map(world: World, layers: dict[str, NDArray[Any]], tmp_path: Path) -> None:
    path = write_map(world, tmp_path / "c.npz", to="npz", layers=["ground"], area=[1.0, 0.0, 3.0, 99.0], workers=1)
    with np.load(path) as file:
        assert "overhang" not in file.files
        np.testing.assert_allclose(file["ground"], layers["ground"][100:140, 60:], atol=1e-6)


def test_a_coarse_map_leaves_out_the_waves_that_its_cells_cannot_hold() -> None:
    left_out = [name for name in LAYERS if name not in check_layers(None, 0.2, "npz")]
    assert left_out == ["roughness_20_50cm", "roughness_50_150cm"]
    assert check_layers(None, 0.05, "npz") == list(LAYERS)
    assert check_layers(["slope", "ground", "slope"], 1.0, "npz") == ["slope", "ground"]


REFUSED = [
    ({"to": "tiff"}, "unknown format 'tiff'; did you mean 'geotiff'? Available: geotiff, grid_map, npz, pgm"),
    ({"layers": ["slpoe"]}, "unknown layer 'slpoe'; did you mean 'slope'? Available: ground, "),
    ({"layers": []}, "layers must name one of ground, "),
    ({"resolution": 0.0}, "resolution must be 0.001 to 100 m, got 0"),
    ({"resolution": float("nan")}, "resolution must be 0.001 to 100 m, got nan"),
    (
        {"layers": ["roughness_20_50cm"], "resolution": 0.1},
        "layer roughness_20_50cm needs a resolution of at most 0.05 m, got 0.1",
    ),
    ({"area": [1.0, 0.0, 0.0, 1.0]}, "area must hold a cell of 0.05 m of the world, which is 8 m x 6 m about 0, 0"),
    ({"area": [50.0, 0.0, 60.0, 1.0]}, "area must hold a cell of 0.05 m of the world, which is 8 m x 6 m about 0, 0"),
    ({"resolution": 50.0}, "area must hold a cell of 50 m of the world, which is 8 m x 6 m about 0, 0"),
    ({"to": "pgm", "layers": ["slope"]}, "layers must be left out for pgm, which has its own"),
]


@pytest.mark.parametrize(("options", "line"), REFUSED)
def test_what_cannot_be_mapped_is_refused_in_a_line(
    world: World, options: dict[str, Any], line: str, tmp_path: Path
) -> None:
    with pytest.raises(FieldtruthError) as error:
        write_map(world, tmp_path / "map", **{"to": "npz", **options})
    assert str(error.value).startswith(line)
    assert not any(tmp_path.iterdir())


def test_a_world_without_ground_a_full_disk_and_a_message_that_is_too_long_are_refused(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bare = replace(world, terrain=replace(world.terrain, visible=False))
    with pytest.raises(ConfigurationError, match="tiny: a map needs a world with ground, this one has objects only"):
        write_map(bare, tmp_path / "map", to="geotiff")
    monkeypatch.setattr(world_maps, "disk_usage", lambda path: SimpleNamespace(free=4e9))
    with pytest.raises(OutputError, match=r"needs \d\.\d GB of disk, but 4.0 GB are free, for a map of 8000 x 6000"):
        write_map(world, tmp_path / "new/map.npz", to="npz", resolution=0.001)
    monkeypatch.setattr(world_maps, "disk_usage", lambda path: SimpleNamespace(free=1e15))
    with pytest.raises(
        OutputError, match=r"grid_map holds at most 1 GB, got \d\.\d GB for a map of 8000 x 6000 cells; take "
    ):
        write_map(world, tmp_path / "map.bag", to="grid_map", resolution=0.001)
    assert not any(tmp_path.iterdir())


def test_a_map_is_replaced_if_asked_and_no_other_folder_is(world: World, tmp_path: Path) -> None:
    options: dict[str, Any] = {"to": "geotiff", "layers": ["ground"], "resolution": 0.5, "workers": 1}
    out = write_map(world, tmp_path / "map", **options)
    with pytest.raises(OutputError, match="already exists"):
        write_map(world, out, **options)
    write_map(world, out, **{**options, "layers": ["slope"]}, overwrite=True)
    assert {path.name for path in out.iterdir()} == {"slope.tif", "map.yaml"}
    for name in ("notes.txt", "map.yaml"):
        mine = tmp_path / "mine"
        mine.mkdir(exist_ok=True)
        (mine / name).touch()
        with pytest.raises(OutputError, match="is a folder that holds no map, or more than a map"):
            write_map(world, mine, **options, overwrite=True)
    assert sorted(path.name for path in tmp_path.rglob("*")) == [
        "map", "map.yaml", "map.yaml", "mine", "notes.txt", "slope.tif",
    ]  # fmt: skip


@pytest.fixture
def loaded(world: World, monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """The worlds that a command asked for."""
    asked: list[tuple[Any, ...]] = []

    def load(environment: str, seed: int = 0, layout: dict[str, Any] | None = None, **_: Any) -> World:
        asked.append((environment, seed, layout))
        return world

    monkeypatch.setattr(build, "load_world", load)
    return asked


def test_the_command_maps_an_environment_or_the_world_of_an_experiment(
    loaded: list[tuple[Any, ...]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = "map park --to npz --layers ground,slope --resolution 0.5 --area=-1,-1,1,1 --seed 3 --out a.npz --workers 1"
    assert cli.main(words.split()) == 0
    assert capsys.readouterr().out.startswith("a.npz: ")
    with np.load("a.npz") as file:
        assert file["ground"].shape == (4, 4)
    route = "{start: [49.9, 8.9], waypoints: [[49.9001, 8.9]]}"
    text = f"{{name: a, environment: park, seed: 5, layout: {{bushes: 3}}, route: {route}}}"
    (tmp_path / "mine.yaml").write_text(text, encoding="utf-8")
    words = "map mine.yaml --to pgm --resolution 0.2"
    assert cli.main(words.split()) == 0
    words = "map forest_1 --to pgm --resolution 0.2 --out b --seed 9"
    assert cli.main(words.split()) == 0
    assert [each[:2] for each in loaded] == [("park", 3), ("park", 5), ("forest", 9)]
    assert loaded[1][2] == {"bushes": 3}


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("map prak --to npz", "unknown environment or experiment 'prak'; did you mean 'park'? Available: "),
        ("map park --to tiff", "unknown format 'tiff'; did you mean 'geotiff'? "),
        ("map park --to npz --resolution 0", "resolution must be 0.001 to 100 m, got 0"),
        ("map park --to npz --layers heigth", "unknown layer 'heigth'; "),
        ("map park --to npz --area 1,2,3", "--area must be x0,y0,x1,y1 [m] with x0 < x1 and y0 < y1, got '1,2,3'"),
        ("map park --to npz --area 1,2,3,x", "--area must be x0,y0,x1,y1 [m] with x0 < x1 and y0 < y1, got '1,2,3,x'"),
        ("map none.yaml --to npz", "cannot read none.yaml: No such file or directory"),
        ("map park", "the following arguments are required: --to"),
    ],
)
def test_a_wrong_command_is_one_line(
    words: str, line: str, loaded: list[tuple[Any, ...]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert cli.main(words.split()) == 2
    text = capsys.readouterr().err
    assert text.startswith(f"error: {line}")
    assert text.count("\n") == 1
    assert not loaded
    assert not any(tmp_path.iterdir())
