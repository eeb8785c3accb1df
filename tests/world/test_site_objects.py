# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a map shows is in the world of a site: in its place by degrees, with its class, and solid where it is."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.geodesy import Origin, geodetic_from_world
from fieldtruth.drive.traversability import Blockage, Traversability, obstacle_outlines
from fieldtruth.sense.scene import Scene
from fieldtruth.world.build import build_world
from fieldtruth.world.environments.site.build import land_beyond
from fieldtruth.world.environments.site.config import Config
from fieldtruth.world.model import Instance, Raster, World
from fieldtruth.world.plants import TREES
from fieldtruth.world.water import DRY

rasterio = pytest.importorskip("rasterio")
pyproj = pytest.importorskip("pyproj")
pytest.importorskip("osmium")

pytestmark = pytest.mark.usefixtures("untextured")

PLACE = Origin(47.6, 11.3, 0.0)
EAST_NORTH = pyproj.Transformer.from_crs(4326, 32632, always_xy=True).transform(PLACE.longitude, PLACE.latitude)
SIZE = (64.0, 48.0)
Corner = tuple[float, float]
HOUSE = ((14.0, 8.0), (22.0, 8.0), (22.0, 14.0), (14.0, 14.0))
SHED = ((-24.0, 12.0), (-18.0, 12.0), (-18.0, 15.0), (-21.0, 15.0), (-21.0, 18.0), (-24.0, 18.0))
POND = ((-22.0, -18.0), (-10.0, -18.0), (-10.0, -10.0), (-22.0, -10.0))
STREAM = ((8.0, -23.0), (8.0, -12.0), (10.0, -6.0))
DITCH = ((26.0, -23.0), (26.0, -6.0))
ROAD, FOOTWAY, TRACK = ((-31.0, 0.0), (31.0, 0.0)), ((2.0, 2.0), (2.0, 22.0)), ((-31.0, -4.0), (4.0, -4.0))
WALL, FENCE, HEDGE = (
    ((-14.0, 6.0), (-4.0, 6.0), (-4.0, 12.0)),
    ((12.0, 20.0), (28.0, 20.0)),
    ((-30.0, 3.0), (-16.0, 3.0)),
)
GATE = (20.0, 20.0)
FIELD, SCRUB = (
    ((-10.0, 14.0), (-1.0, 14.0), (-1.0, 22.0), (-10.0, 22.0)),
    ((13.0, -20.0), (23.0, -20.0), (23.0, -8.0), (13.0, -8.0)),
)
ORCHARD = ((5.0, 5.0), (12.0, 5.0), (12.0, 18.0), (5.0, 18.0))
POINTS = {
    "bench": (-8.0, 3.2),
    "lamp_post": (4.0, 3.0),
    "trash_bin": (-10.0, 3.2),
    "table": (-26.0, 8.0),
    "bollard": (0.0, 2.6),
}
TAGS = {
    "bench": {"amenity": "bench"}, "lamp_post": {"highway": "street_lamp"}, "trash_bin": {"amenity": "waste_basket"},
    "table": {"leisure": "picnic_table"}, "bollard": {"barrier": "bollard"},
}  # fmt: skip
CLASSES = {
    "bench": Label.BENCH, "lamp_post": Label.LAMP_POST, "trash_bin": Label.TRASH_BIN, "table": Label.TABLE,
    "bollard": Label.POST,
}  # fmt: skip
AREAS: Sequence[tuple[Sequence[Corner], dict[str, str]]] = (
    (HOUSE, {"building": "house", "height": "7"}), (SHED, {"building": "yes"}), (POND, {"natural": "water"}),
    (FIELD, {"landuse": "farmland"}), (SCRUB, {"natural": "scrub"}), (ORCHARD, {"landuse": "orchard"}),
)  # fmt: skip
LINES: Sequence[tuple[Sequence[Corner], dict[str, str]]] = (
    (STREAM, {"waterway": "stream", "width": "1.6"}), (DITCH, {"waterway": "ditch"}),
    (ROAD, {"highway": "residential", "width": "4"}), (FOOTWAY, {"highway": "footway", "surface": "gravel"}),
    (TRACK, {"highway": "track", "tracktype": "grade4"}), (WALL, {"barrier": "wall", "height": "1.4"}),
    (FENCE, {"barrier": "fence"}), (HEDGE, {"barrier": "hedge"}),
)  # fmt: skip


def street_map(path: Path) -> Path:
    """Every line and area, then the points; nodes in degrees with nine digits."""
    nodes, ways = list[str](), list[str]()

    def node(corner: Corner, tags: str = "") -> int:
        latitude, longitude, _ = geodetic_from_world((*corner, 0.0), PLACE)
        nodes.append(
            f'<node id="{len(nodes) + 1}" version="1" lat="{latitude:.9f}" lon="{longitude:.9f}">{tags}</node>'
        )
        return len(nodes)

    def text(tags: dict[str, str]) -> str:
        return "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())

    for name, corner in POINTS.items():
        node(corner, text(TAGS[name]))
    node(GATE, text({"barrier": "gate"}))
    for closed, features in ((True, AREAS), (False, LINES)):
        for corners, tags in features:
            ids = [node(corner) for corner in corners]
            refs = "".join(f'<nd ref="{each}"/>' for each in (ids + ids[:1] if closed else ids))
            ways.append(f'<way id="{len(ways) + 1}" version="1">{refs}{text(tags)}</way>')
    path.write_text(f'<osm version="0.6">{"".join(nodes)}{"".join(ways)}</osm>')
    return path


def layout(folder: Path) -> dict[str, Any]:
    return {
        "centre": [PLACE.latitude, PLACE.longitude],
        "size": list(SIZE),
        "map": {"file": str(street_map(folder / "area.osm"))},
        "individuals": 1,
        "litter": 0,
        "grass_per_m2": 0,
        "beyond": False,
    }


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    return build_world("site", 0, layout(tmp_path_factory.mktemp("maps")))


@pytest.fixture(scope="module")
def scene(world: World) -> Scene:
    return Scene(world)


def of_kind(world: World, kind: str) -> list[Instance]:
    return [each for each in world.instances if each.kind == kind]


def corners_of(world: World, instance: Instance) -> Any:
    pose = instance.world_from_object
    return world.meshes[instance.mesh].vertices.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]


def distance_m(world: World, xy: Any, corner: Corner) -> float:
    """Along the ellipsoid between a position in the world and the node that the map has, by pyproj."""
    latitude, longitude, _ = geodetic_from_world((*xy, 0.0), world.origin)
    at = geodetic_from_world((*corner, 0.0), PLACE)
    return float(pyproj.Geod(ellps="WGS84").inv(longitude, latitude, at[1], at[0])[2])


@pytest.mark.parametrize("kind", POINTS)
def test_furniture_stands_at_its_node_has_its_class_and_stops_the_robot(world: World, scene: Scene, kind: str) -> None:
    (piece,) = of_kind(world, kind)
    assert distance_m(world, piece.world_from_object[:2, 3], POINTS[kind]) < 0.01
    middle = corners_of(world, piece).mean(axis=0)
    hit = scene.cast([[POINTS[kind][0], POINTS[kind][1], middle[2] + 9.0]], [[0.0, 0.0, -1.0]])
    assert hit.label[0] in (CLASSES[kind], Label.GROUND)  # a basket may be open
    across = scene.cast((middle + np.array([6.0, 0.05, 0.0]))[None], [[-1.0, 0.0, 0.0]])
    assert CLASSES[kind] in (hit.label[0], across.label[0])
    assert piece.name in {outline.name for outline in obstacle_outlines(world)}


def test_a_building_has_the_outline_height_and_class_of_the_map(world: World, scene: Scene) -> None:
    house, shed = of_kind(world, "building")
    for building, corners in ((house, HOUSE), (shed, SHED)):
        walls = corners_of(world, building)
        for corner in corners:
            nearest = walls[np.argmin(np.hypot(*(walls[:, :2] - corner).T))]
            assert distance_m(world, nearest[:2], corner) < 0.01
    ground = world.terrain.field.height_at(*np.array(HOUSE).T)
    z = float(ground.max()) + 0.5
    hit = scene.cast([[10.0, 10.0, z], [18.0, 30.0, z]], [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    assert hit.label.tolist() == [Label.BUILDING, Label.BUILDING]
    assert hit.range_m == pytest.approx([4.0, 16.0], abs=0.03)  # windows lie 1.5 cm before the wall
    # A gabled roof: half of its height is above the height of the map, as that of its ridge is not a wall's.
    rise = 3.0 * np.tan(np.radians(38.0))
    top = corners_of(world, house)[:, 2].max() - ground.min()
    assert top == pytest.approx(7.0 + rise / 2 + np.ptp(ground) / 2, abs=0.1)


def test_walls_fences_and_buildings_block_the_planner_and_gates_and_trails_open_them(world: World) -> None:
    traversability = Traversability(world)
    solid = [(14.0, 11.0), (-21.0, 16.5), (-9.0, 6.0), (-4.0, 9.0), (14.0, 20.0), (26.0, 20.0)]
    assert traversability.blockage_at(solid).tolist() == [Blockage.OBSTACLE] * len(solid)
    assert traversability.blockage_at([GATE, (0.5, -0.5), (2.0, 12.0)]).tolist() == [Blockage.NONE] * 3


def test_a_wall_and_a_fence_have_their_height_and_class(world: World, scene: Scene) -> None:
    for kind, label, at, height in (
        ("wall", Label.BUILDING, (-9.0, 6.0), 1.4),
        ("fence", Label.FENCE, (14.0, 20.0), 1.1),
    ):
        (barrier,) = of_kind(world, kind)
        ground = float(world.terrain.field.height_at(*at))
        hit = scene.cast([[at[0], at[1] + 3.0, ground + 0.25 * height]], [[0.0, -1.0, 0.0]])
        assert hit.label[0] == label
        above = corners_of(world, barrier)
        near = above[np.abs(above[:, 0] - at[0]) < 1.5]
        assert near[:, 2].max() - ground == pytest.approx(height, abs=0.2)


def test_a_pond_is_level_water_over_a_bed_within_dry_banks(world: World, scene: Scene) -> None:
    (x0, y0), (x1, y1) = POND[0], POND[2]
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(x0 + 1, x1 - 1, 9), np.linspace(y0 + 1, y1 - 1, 7)))
    rays = np.stack([x, y, np.full(len(x), 20.0)], axis=-1)
    hits = scene.cast(rays, np.tile([0.0, 0.0, -1.0], (len(x), 1)))
    own = hits.label == Label.WATER
    assert own.mean() > 0.7  # reeds stand in the shallows
    levels = hits.position[own, 2]
    assert np.ptp(levels) < 1e-4
    assert (world.terrain.field.height_at(x, y) < levels[0] - 0.1).all()
    assert world.water_at(x, y) == pytest.approx(float(levels[0]), abs=1e-4)
    bank = np.array([(x0 - 0.7, -14.0), (x1 + 0.7, -14.0), (-16.0, y0 - 0.7), (-16.0, y1 + 0.7)])
    assert (world.terrain.field.height_at(*bank.T) > levels[0]).all()
    assert Traversability(world).blockage_at([(-16.0, -14.0)]).tolist() == [Blockage.WATER]


def test_a_stream_never_rises_and_a_ditch_is_a_dry_drop(world: World) -> None:
    assert isinstance(world.water_level, Raster)
    y = np.linspace(-22.0, -13.0, 40)
    level = world.water_at(np.full(40, 8.0), y)
    assert (level > DRY / 2).all()
    assert (np.diff(level) < 1e-3).all()
    field = world.terrain.field
    assert (field.height_at(np.full(40, 8.0), y) < level).all()
    for side in (-2.2, 2.2):
        assert (field.height_at(np.full(40, 8.0 + side), y) > level).all()
    y = np.linspace(-20.0, -8.0, 30)
    assert (world.water_at(np.full(30, 26.0), y) < DRY / 2).all()
    banks = np.min([field.height_at(np.full(30, 26.0 + side), y) for side in (-2.0, 2.0)], axis=0)
    assert (banks - field.height_at(np.full(30, 26.0), y) > 0.35).all()


def test_trails_have_the_material_of_their_tags_and_one_class(world: World, scene: Scene) -> None:
    places = {"asphalt": (10.0, 0.2), "gravel": (2.0, 14.0), "path": (-12.0, -4.9)}
    names = list(world.materials)
    for name, (x, y) in places.items():
        hit = scene.cast([[x, y, float(world.terrain.surface.height_at(x, y)) + 0.05]], [[0.0, 0.0, -1.0]])
        assert hit.label[0] == Label.TRAIL
        assert names[hit.material[0]] == name
        assert world.terrain.label_at(x, y) == Label.TRAIL
    assert world.terrain.trail_materials == ()


def test_scrub_orchard_and_hedge_grow_where_the_map_has_them(world: World) -> None:
    bushes = np.array([each.world_from_object[:2, 3] for each in of_kind(world, "bush")])
    (x0, y0), (x1, y1) = SCRUB[0], SCRUB[2]
    in_scrub = ((bushes >= (x0 - 0.1, y0 - 0.1)) & (bushes <= (x1 + 0.1, y1 + 0.1))).all(axis=1)
    in_hedge = (np.abs(bushes[:, 1] - 3.0) < 0.01) & (bushes[:, 0] > -30.1) & (bushes[:, 0] < -15.9)
    assert in_scrub.sum() >= 5
    assert in_hedge.sum() == 19  # 14 m, one each 0.75 m from half of that on
    assert (in_scrub | in_hedge).all()
    trees = np.array([i.world_from_object[:2, 3] for i in world.instances if i.kind in ("apple", "oak")])
    rows = np.unique(trees[:, 0].round(2))
    assert len(trees) == len(rows) * len(np.unique(trees[:, 1].round(2)))
    assert np.diff(rows) == pytest.approx(4.5, abs=0.02)


def test_soil_lies_on_the_field(world: World) -> None:
    cover = world.terrain.cover.at(-5.5, 18.0)
    assert world.terrain.ground_materials[int(np.argmax(cover))] == "soil"


def raster(path: Path, values: Any, dtype: str, margin: float, crs: str = "EPSG:32632") -> Path:
    """Write bands (count, n, n) over a square of 60 m and a margin around the place."""
    east, north = EAST_NORTH
    side = 60.0 + margin
    transform = rasterio.transform.from_origin(
        east - side, north + side, 2 * side / values.shape[2], 2 * side / values.shape[1]
    )
    profile = {
        "driver": "GTiff",
        "dtype": dtype,
        "count": len(values),
        "height": values.shape[1],
        "width": values.shape[2],
    }
    with rasterio.open(path, "w", crs=crs, transform=transform, **profile) as dataset:
        dataset.write(values)
    return path


def test_only_a_raster_that_ends_is_left_out_of_the_land_beyond(tmp_path: Path) -> None:
    path = raster(tmp_path / "dem.tif", np.full((1, 300, 300), 500.0), "float64", 60.0)
    given = {"centre": PLACE[:2], "size": (32.0, 24.0), "elevation": {"file": str(path), "reference": "ellipsoid"}}
    config = Config.model_validate(given)
    land_beyond(config, PLACE, np.random.default_rng(0))
    with rasterio.open(path, "r+") as dataset:
        dataset.units = ["degC"]
    with pytest.raises(ConfigurationError, match="an unknown unit"):
        land_beyond(config, PLACE, np.random.default_rng(0))


def test_land_cover_and_photograph_and_the_land_beyond_are_those_of_the_rasters(tmp_path: Path) -> None:
    steps = np.arange(160)
    east_half = np.where(steps[None, :] < 80, 7, 9) + 0 * steps[:, None]  # 7 west, 9 east of the place
    cover = raster(tmp_path / "cover.tif", east_half[None].astype(np.uint8), "uint8", 20.0)
    colours = np.stack([np.where(steps[None, :] < 80, 200, 60) + 0 * steps[:, None], *2 * [100 + 0 * east_half]])
    photo = raster(tmp_path / "photo.tif", colours.astype(np.uint8), "uint8", 20.0)
    plane = 500.0 + 0.05 * np.broadcast_to(np.arange(600)[::-1, None] + 0.5, (600, 600))  # rises 5 % to the north
    elevation = raster(tmp_path / "dem.tif", plane[None].astype(np.float64), "float64", 240.0)
    world = build_world("site", 0, {
        "centre": [PLACE.latitude, PLACE.longitude], "size": [32, 24], "litter": 0, "grass_per_m2": 0,
        "land_cover": {"file": str(cover), "classes": {7: "soil", 9: "heath"}}, "photo": {"file": str(photo)},
        "elevation": {"file": str(elevation), "reference": "ellipsoid"}, "surface": "lawn", "individuals": 1,
    })  # fmt: skip
    names, y = world.terrain.ground_materials, np.array([9.0, -9.0])  # west, east
    weights = world.terrain.cover.at(np.zeros(2), y)
    assert [names[int(k)] for k in weights.argmax(axis=1)] == ["soil", "dry_grass"]
    colour = Raster(values=world.terrain.colour, spacing=world.terrain.cover.spacing, x0=-16.0, y0=-12.0)  # type: ignore[arg-type]
    west, east = colour.at(np.zeros(2), y)
    linear = [((v / 255 + 0.055) / 1.055) ** 2.4 for v in (200, 60, 100)]
    assert west[0] / east[0] == pytest.approx(linear[0] / linear[1], rel=0.02)
    assert west[0] / west[1] == pytest.approx(linear[0] / linear[2], rel=0.02)
    assert world.backdrop is not None
    corners = world.backdrop.vertices.astype(np.float64)
    away = np.maximum(np.abs(corners[:, 0]) - 16.0, np.abs(corners[:, 1]) - 12.0)
    ring = corners[(away > 45.0) & (np.hypot(*corners[:, :2].T) < 180.0)]
    # Cells of 1 m with 5 cm each; the meridian's convergence turns north by 0.01 rad.
    slope = np.linalg.lstsq(np.column_stack([ring[:, :2], np.ones(len(ring))]), ring[:, 2], rcond=None)[0]
    assert slope[0] == pytest.approx(0.05, rel=0.03)
    assert np.abs(ring @ np.array([slope[0], slope[1], -1.0]) + slope[2]).max() < 0.05


def test_woods_of_land_cover_without_trees_get_random_ones(tmp_path: Path) -> None:
    """Of two woods, 12 m wide strips beside a meadow, the one in which a file has a tree keeps just that one."""
    steps = np.arange(160) - 79.5  # [m] from the place, to the east
    classes = np.where(np.abs(np.abs(steps) - 15) < 6, 10, 30)[None, :] + 0 * steps[:, None]
    cover = raster(tmp_path / "cover.tif", classes[None].astype(np.uint8), "uint8", 20.0)
    where = pyproj.Transformer.from_crs(32632, 4326).transform(EAST_NORTH[0] - 15, EAST_NORTH[1])
    (tmp_path / "trees.csv").write_text("lat,lon,height\n{},{},9\n".format(*where))
    layout = {
        "centre": [PLACE.latitude, PLACE.longitude], "size": [60, 60], "litter": 0, "grass_per_m2": 0, "grid": 0.2,
        "land_cover": {"file": str(cover), "classes": {10: "wood", 30: "meadow"}}, "individuals": 1,
        "trees": {"file": str(tmp_path / "trees.csv")}, "trees_per_m2": 0.06, "beyond": False,
    }  # fmt: skip
    world = build_world("site", 0, layout)
    y = np.array([each.world_from_object[1, 3] for each in world.instances if each.kind in TREES])
    assert (y > 0).sum() == 1  # west
    assert y[y > 0] == pytest.approx(15.0, abs=0.5)
    assert (y < 0).sum() == pytest.approx(0.06 * 12 * 60, rel=0.25)
    assert (np.abs(-y[y < 0] - 15) < 7.5).all()  # cells of 1 m, turned by the meridian's convergence
