# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The inventory: measures of objects with known answers, positions by another library, files read by GDAL."""

import csv
import re
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pymap3d
import pyogrio
import pytest
import trimesh
from sense_worlds import box, make_mesh, make_world

from fieldtruth.core.arrays import Array
from fieldtruth.interchange import inventory
from fieldtruth.interchange.inventory import COLUMNS, named_objects
from fieldtruth.world.build import load_world
from fieldtruth.world.model import Mesh, Swarm, World, merge_meshes
from fieldtruth.world.placement import upright_pose
from fieldtruth.world.plants import BUSHES, GRASSES, TREES, grow_bush, grow_clump, grow_stump, grow_tree
from fieldtruth.world.rocks import ROCK_TYPES, make_rock

SIDES = 24


def cone(name: str, foot: tuple[float, float, float], radius: float, tip: tuple[float, float, float]) -> Mesh:
    """A cone of bark with ``SIDES`` sides from a circle of ``radius`` [m] to its tip, open below, outwards facing."""
    turn = 2 * np.pi * np.arange(SIDES) / SIDES
    rim = np.stack([np.cos(turn), np.sin(turn), np.zeros(SIDES)], axis=1) * radius + foot
    k = np.arange(SIDES)
    faces = np.stack([k, (k + 1) % SIDES, np.full(SIDES, SIDES)], axis=1)
    return make_mesh(name, np.concatenate([rim, [tip]]), faces, "bark")


def leaf(name: str, side: float, height: float) -> Mesh:
    """A horizontal square leaf about the z axis."""
    corners = 0.5 * side * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) + [0, 0, height]
    return make_mesh(name, corners, [[0, 1, 2], [0, 2, 3]], "leaf")


def tree() -> Mesh:
    """A trunk of 0.3 m radius and 13 m height, a branch below breast height, a dead stem 2 m away, one square leaf."""
    parts = [
        cone("trunk", (0, 0, 0), 0.3, (0, 0, 13.0)),
        cone("branch", (0, 0, 0.9), 0.2, (3.0, 0, 1.4)),
        cone("other", (2.0, 0, 0), 0.8, (2.0, 0, 6.0)),
        leaf("leaf", 4.0, 10.0),
    ]
    return replace(merge_meshes("tree", parts, footprint=0.5), species=("oak",))


def rows_of(world: World) -> list[dict[str, Any]]:
    return [dict(zip(COLUMNS, row, strict=True)) for row in inventory.inventory(world)]


def pose(x: float, y: float, z: float, *, yaw: float = 0.0, scale: float = 1.0) -> Array:
    matrix = upright_pose(x, y, yaw, scale)
    matrix[2, 3] = z
    return matrix


def test_tree_of_known_dimensions() -> None:
    """Scale 1.3, on a slope of 10 %, with its origin 0.4 m below the ground at its position."""
    scale, x, y = 1.3, 5.0, -3.0
    ground = 0.1 * x
    world = make_world([(tree(), pose(x, y, ground - 0.4, yaw=0.7, scale=scale))], height=lambda x, y: 0.1 * x)
    (row,) = rows_of(world)
    assert (row["instance_id"], row["name"], row["kind"]) == (2, "object_0", "object")
    assert (row["species"], row["scientific_name"]) == ("oak", "Quercus robur")
    assert row["classes"] == "trunk and branch; treetop"
    assert (row["x_m"], row["y_m"]) == (x, y)
    assert row["ground_height_m"] == pytest.approx(ground, abs=1e-4)
    assert row["height_m"] == pytest.approx(13 * scale - 0.4, abs=1e-3)
    radius = 0.3 * (1 - (1.3 + 0.4) / scale / 13.0) * scale  # of the cone at 1.3 m above the ground
    polygon = SIDES / 2 * np.sin(2 * np.pi / SIDES) * radius**2
    assert row["trunk_diameter_m"] == pytest.approx(2 * np.sqrt(polygon / np.pi), abs=1e-4)
    assert row["crown_base_m"] == pytest.approx(10 * scale - 0.4, abs=1e-3)
    assert row["leaf_area_m2"] == pytest.approx((4 * scale) ** 2, abs=1e-3)
    assert row["crown_diameter_m"] == pytest.approx(2 * 4 * scale / np.sqrt(np.pi), abs=1e-3)
    assert row["length_m"] == pytest.approx((2.0 + 3.0) * scale, abs=1e-3)
    assert row["width_m"] == pytest.approx(4.0 * scale, abs=1e-3)
    assert row["volume_m3"] is None


def test_leaning_trunk_is_cut_horizontally() -> None:
    """The section of an inclined trunk is longer by 1 / cos of its inclination."""
    lean = np.radians(20.0)
    upright = cone("trunk", (0, 0, 0), 0.2, (0, 0, 4000.0))
    matrix = pose(0, 0, 0)
    matrix[:3, :3] = [[np.cos(lean), 0, np.sin(lean)], [0, 1, 0], [-np.sin(lean), 0, np.cos(lean)]]
    foot = np.array([-1.3 * np.tan(lean), 0.0, 0.0])  # at 1.3 m its axis is above the position
    moved = replace(upright, vertices=(upright.vertices + foot @ matrix[:3, :3]).astype(np.float32))
    (row,) = rows_of(make_world([(moved, matrix)]))
    area = SIDES / 2 * np.sin(2 * np.pi / SIDES) * 0.2**2 / np.cos(lean)
    assert row["trunk_diameter_m"] == pytest.approx(2 * np.sqrt(area / np.pi), rel=2e-3)


def test_rock_and_furniture() -> None:
    world = make_world(
        [
            (box("rock", (0.5, 0.4, 0.3)), pose(1, 2, 0.1, scale=2.0)),
            (box("seat", (0.9, 0.2, 0.4), "wood"), pose(3, 2, 0.4, yaw=1.0)),
            (cone("stump", (0, 0, 0), 0.3, (0, 0, 1.29)), pose(6, 2, 0)),
        ]
    )
    rock, seat, stump = rows_of(world)
    assert rock["volume_m3"] == pytest.approx(8 * 0.5 * 0.4 * 0.3 * 2**3, rel=1e-6)
    assert rock["height_m"] == pytest.approx(0.1 + 2 * 0.3, abs=1e-4)
    assert (seat["length_m"], seat["width_m"], seat["height_m"]) == pytest.approx((1.8, 0.4, 0.8), abs=1e-4)
    assert seat["classes"] == "bench"
    parts = ("trunk_diameter_m", "crown_base_m", "crown_diameter_m", "leaf_area_m2", "species", "scientific_name")
    assert [row[part] for row in (rock, seat, stump) for part in parts] == 3 * 6 * [None]
    assert seat["volume_m3"] is None


@pytest.mark.parametrize("name", ["beech", "oak", "pine", "birch", "lime"])
def test_trunk_of_a_grown_tree_is_as_thick_as_its_taper(name: str) -> None:
    """The collider has 1.1 times the radius of the skeleton at 1.3 m; bark is fluted, and a polygon is inside it."""
    mesh = grow_tree(TREES[name], name="tree", height=14.0, rng=np.random.default_rng(5), grown_in="stand")
    (row,) = rows_of(grown_world(mesh))
    assert row["trunk_diameter_m"] == pytest.approx(2 * mesh.colliders[0].size[0] / 1.1, rel=0.03)
    assert row["height_m"] == pytest.approx(14.0, abs=0.3)
    assert row["scientific_name"] == TREES[name].latin


def test_bush_has_leaves_from_the_ground_on_and_no_trunk() -> None:
    mesh = grow_bush(BUSHES["box"], name="bush", height=1.0, rng=np.random.default_rng(1))
    (row,) = rows_of(grown_world(mesh))
    assert row["classes"] == "bush"
    assert row["scientific_name"] == "Buxus sempervirens"
    assert row["trunk_diameter_m"] is None
    assert 0 <= row["crown_base_m"] < 0.1
    leaves = mesh.faces[mesh.material == mesh.materials.index("leaf_box")]
    a, b, c = mesh.vertices[leaves].astype(np.float64).transpose(1, 0, 2)
    assert row["leaf_area_m2"] == pytest.approx(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum(), abs=1e-3)


def test_species_of_clumps_dead_wood_and_rocks() -> None:
    rng = np.random.default_rng(3)
    clump = grow_clump(
        {GRASSES["meadow"]: 0.5, GRASSES["daisy"]: 0.5}, name="clump", radius=0.5, per_m2=20.0, rng=rng, detail=0.5
    )
    stump = grow_stump(TREES["pine"], name="stump", radius=0.2, rng=rng)
    rock = make_rock(ROCK_TYPES["granite"], name="rock", size=1.0, rng=rng)
    found = [rows_of(grown_world(mesh))[0] for mesh in (clump, stump, rock)]
    assert {*found[0]["species"].split("; ")} == {"meadow", "daisy"}
    assert [row["species"] for row in found[1:]] == ["pine", "granite"]
    assert GRASSES["daisy"].latin in found[0]["scientific_name"]
    assert [row["scientific_name"] for row in found[1:]] == ["Pinus sylvestris", None]
    assert found[2]["volume_m3"] > 0


def grown_world(mesh: Mesh) -> World:
    from fieldtruth.world.materials import MATERIALS

    world = make_world([(mesh, pose(0, 0, 0))])
    return replace(world, materials={**world.materials, **{name: MATERIALS[name] for name in mesh.materials}})


def test_positions_agree_with_pymap3d() -> None:
    """A point north, west and above the origin; another east and south."""
    rng = np.random.default_rng(2)
    positions = rng.uniform(-19, 19, (20, 2))
    rock = box("rock", (0.5, 0.5, 0.5))
    world = make_world([(rock, pose(x, y, 7.0)) for x, y in positions], height=7.0)
    for row, (x, y) in zip(rows_of(world), positions, strict=True):
        north, east, down = pymap3d.geodetic2ned(row["latitude_deg"], row["longitude_deg"], 7.0, 49.9, 8.9, 0.0)
        assert (north, -east) == pytest.approx((x, y), abs=2e-4)
        assert row["latitude_deg"] > 49.9 or x < 0
        assert row["longitude_deg"] < 8.9 or y < 0
        assert down == pytest.approx(-7.0, abs=1e-3)


@pytest.fixture
def mixed() -> World:
    """A tree, a rock, and a swarm of five pebbles of which two are outside the edge."""
    pebble = replace(box("pebble", (0.03, 0.02, 0.01)), species=("scree",))
    world = make_world([(tree(), pose(1, 2, 0, scale=1.1)), (box("rock", (0.5, 0.4, 0.3)), pose(-4, 2, 0.1))])
    poses = np.array([pose(x, -3, 0.5 if abs(x) > 20 else 0.0, scale=1 + 0.1 * x) for x in (1, 2, 3, 20.1, 25)])
    swarm = Swarm(
        name="pebbles",
        kind="stone",
        object_id=4,
        meshes=("pebble",),
        mesh=np.zeros(5, np.int32),
        world_from_object=poses,
        tint=np.ones((5, 3), np.float32),
    )
    return replace(world, meshes={**world.meshes, "pebble": pebble}, swarms=(swarm,))


@pytest.mark.parametrize(("beyond", "members"), [(False, 3), (True, 5)])
def test_gdal_reads_the_values_of_the_csv_files(mixed: World, tmp_path: Path, beyond: bool, members: int) -> None:
    inventory.write(mixed, tmp_path / "out", beyond=beyond)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "inventory.csv",
        "inventory.gpkg",
        "swarm_members.csv",
    }
    package = tmp_path / "out" / "inventory.gpkg"
    assert [tuple(row) for row in pyogrio.list_layers(package)] == [("inventory", "Point"), ("swarm_members", "Point")]
    for layer, count in (("inventory", 2), ("swarm_members", members)):
        with (tmp_path / "out" / f"{layer}.csv").open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        assert len(rows) == count
        info, _, geometry, values = pyogrio.raw.read(package, layer=layer)
        assert info["crs"] == "EPSG:4326"
        assert list(info["fields"]) == list(COLUMNS) == list(rows[0])
        for name, column in zip(COLUMNS, values, strict=True):
            expected = [_parsed(name, row[name]) for row in rows]
            found = [None if value is None or value != value else value for value in column.tolist()]
            assert found == expected, name
        points = [struct.unpack("<bIdd", shape) for shape in geometry]
        assert [(x, y) for _, _, x, y in points] == [
            (float(row["longitude_deg"]), float(row["latitude_deg"])) for row in rows
        ]
        west, south, east, north = pyogrio.read_info(package, layer=layer)["total_bounds"]
        assert west <= min(x for *_, x, _ in points) <= max(x for *_, x, _ in points) <= east
        assert south <= min(y for *_, y in points) <= max(y for *_, y in points) <= north


def _parsed(name: str, text: str) -> int | float | str | None:
    if not text:
        return None
    return text if COLUMNS[name] == "TEXT" else int(text) if COLUMNS[name] == "INTEGER" else float(text)


def test_swarm_members_share_an_id_and_have_their_own_measures(mixed: World) -> None:
    items = list(inventory.swarm_members(mixed))
    assert [item.beyond for item in items] == [False, False, False, True, True]
    rows = [dict(zip(COLUMNS, row, strict=True)) for row in inventory.inventory_rows(mixed, items)]
    assert {(row["instance_id"], row["name"], row["kind"], row["species"]) for row in rows} == {
        (4, "pebbles", "stone", "scree")
    }
    for row, x in zip(rows, (1, 2, 3, 20.1, 25), strict=True):
        assert row["volume_m3"] == pytest.approx(8 * 0.03 * 0.02 * 0.01 * (1 + 0.1 * x) ** 3, rel=1e-4)
    assert [row["ground_height_m"] for row in rows] == [0, 0, 0, 0.5, 0.5]


def test_same_world_gives_the_same_bytes(mixed: World, tmp_path: Path) -> None:
    for name in ("first", "second"):
        inventory.write(mixed, tmp_path / name, beyond=True)
    for path in (tmp_path / "first").iterdir():
        assert path.read_bytes() == (tmp_path / "second" / path.name).read_bytes()


def test_world_without_objects_gives_empty_layers(tmp_path: Path) -> None:
    inventory.write(make_world(), tmp_path / "out", beyond=True)
    for layer in ("inventory", "swarm_members"):
        assert (tmp_path / "out" / f"{layer}.csv").read_text() == ",".join(COLUMNS) + "\n"
        assert pyogrio.read_info(tmp_path / "out" / "inventory.gpkg", layer=layer)["features"] == 0
    assert list(named_objects(make_world())) == []


@pytest.mark.slow
def test_trunk_diameters_and_volumes_of_the_forest_agree_with_trimesh() -> None:
    pytest.importorskip("networkx", reason="trimesh needs networkx for closed sections")
    world = load_world("forest")
    rows = {row["instance_id"]: row for row in rows_of(world)}
    compared = 0
    for instance in world.instances:
        row, mesh, pose = rows[instance.object_id], world.meshes[instance.mesh], instance.world_from_object
        labels = np.array([world.materials[name].label for name in mesh.materials])[mesh.material]
        solid = trimesh.Trimesh(mesh.vertices.astype(np.float64), mesh.faces[(labels == 2) | (labels == 5)])
        solid.merge_vertices(merge_tex=True, merge_norm=True)
        solid.apply_transform(pose)
        if row["volume_m3"] is not None:
            assert row["volume_m3"] == pytest.approx(solid.volume, rel=1e-5)
        if row["trunk_diameter_m"] is not None:
            section = solid.section(plane_origin=[0, 0, row["ground_height_m"] + 1.3], plane_normal=[0, 0, 1])
            assert section is not None
            loops = [loop[:, :2] - pose[:2, 3] for loop in section.discrete]
            areas = [
                0.5 * abs((p[:-1, 0] * p[1:, 1] - p[1:, 0] * p[:-1, 1]).sum())
                for p in loops
                if np.hypot(*p.mean(0)) < 1.0  # trunks lean
            ]
            assert row["trunk_diameter_m"] == pytest.approx(2 * np.sqrt(max(areas) / np.pi), abs=1e-4), row["name"]
            compared += 1
    assert compared > 350


@pytest.mark.slow
def test_forest_is_like_a_real_one() -> None:
    """Figures of temperate mixed forests.

    - Leaf area index: 5.1 to 6.7 in evergreen ones (Asner, Scurlock and Hicke 2003), about 5.5 in deciduous ones
      (Koerner 2013); ours has clearings along two trails.
    - Stems of at least 7 cm: hundreds per hectare.
    - Basal area: 30 to 45 m2/ha.
    - Height over diameter: 80 is the limit of stability (Wonn and O'Hara 2001), which dense stands come near.
    """
    world = load_world("forest")
    trees = [row for row in rows_of(world) if row["crown_base_m"] is not None and "trunk" in row["classes"]]
    assert len(trees) == 367
    hectares = world.size[0] * world.size[1] / 1e4
    assert 4.0 < sum(row["leaf_area_m2"] for row in trees) / (1e4 * hectares) < 7.5
    stems = [row for row in trees if (row["trunk_diameter_m"] or 0) >= 0.07]
    assert 400 < len(stems) / hectares < 700
    assert 30 < sum(np.pi / 4 * row["trunk_diameter_m"] ** 2 for row in stems) / hectares < 45
    slender = [row["height_m"] / row["trunk_diameter_m"] for row in trees if row["height_m"] > 8]
    assert 65 < np.median(slender) < 90
    assert all(40 < ratio < 120 for ratio in slender)
    assert all(row["crown_base_m"] < 0.75 * row["height_m"] for row in trees)


def test_the_documents_explain_every_column() -> None:
    page = (Path(__file__).parents[2] / "docs" / "scene.md").read_text(encoding="utf-8")
    table = page.partition("## Inventory")[2].partition("## ")[0]
    rows = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    assert re.findall(r"`(\w+)`", " ".join(rows)) == list(COLUMNS)
