# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""OBJ folders read back by trimesh: every triangle, class and texture of the world."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from interchange_worlds import F8, corners_of, small_world
from PIL import Image

from fieldtruth.core.classes import Label
from fieldtruth.interchange import write_scene
from fieldtruth.interchange.ground import ground_tiles
from fieldtruth.interchange.surfaces import material_image, mesh_surfaces, placed, tiles_of_swarms
from fieldtruth.world.model import World

pytestmark = pytest.mark.usefixtures("small_ground_images")


@pytest.fixture(scope="module")
def world() -> World:
    return small_world()


@pytest.fixture(scope="module")
def folder(world: World, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(world, tmp_path_factory.mktemp("obj") / "small", to="obj")


@pytest.fixture(scope="module")
def parts(folder: Path) -> list[Any]:
    """One mesh per object and material, in the order of the file, which trimesh reverses."""
    scene = trimesh.load_scene(folder / "scene.obj", split_object=True, group_material=False, process=False)
    return list(scene.geometry.values())[::-1]


def test_objects_and_classes_are_listed(folder: Path, world: World) -> None:
    table = json.loads((folder / "objects.json").read_text())
    ids = {name: row["instance_id"] for name, row in table["objects"].items()}
    swarms = dict.fromkeys((tile.name for tile in tiles_of_swarms(world, beyond=True)), 6)
    assert ids == {"terrain_0_0": 1, "backdrop": 1, "tree_1": 2, "tree_2": 3, "bench_1": 4, "pond": 5, **swarms}
    names = [line.split()[1] for line in (folder / "scene.obj").read_text().splitlines() if line.startswith("o ")]
    assert names == list(ids)
    assert {name: row["class_id"] for name, row in table["materials"].items()} == {
        "terrain_0_0_ground": Label.GROUND, "terrain_0_0_trail": Label.TRAIL, "soil": Label.GROUND,
        "bark": Label.TRUNK, "leaf": Label.TREETOP, "grass": Label.HIGH_GRASS,
        "wood": Label.BENCH, "water": Label.WATER,
    }  # fmt: skip


def expected_parts(world: World) -> list[tuple[str, F8]]:
    """Material and corners (f, 3, 3) of each object and material."""
    assert world.backdrop is not None
    parts = [surface for tile in ground_tiles(world) for surface in tile.surfaces]
    parts += mesh_surfaces(world.backdrop, world.materials)
    for instance in world.instances:
        surfaces = mesh_surfaces(world.meshes[instance.mesh], world.materials)
        parts += [placed(surface, instance.world_from_object[None]) for surface in surfaces]
    parts += [surface for tile in tiles_of_swarms(world, beyond=True) for surface in tile.surfaces(world)]
    return [(surface.material, corners_of(surface)) for surface in parts]


def test_every_triangle_stands_where_it_stands_in_the_world(world: World, parts: list[Any]) -> None:
    expected = expected_parts(world)
    assert [part.visual.material.name for part in parts] == [material for material, _ in expected]
    for part, (_, corners) in zip(parts, expected, strict=True):
        np.testing.assert_allclose(part.triangles, corners, atol=1e-5)


def test_without_the_land_beyond_the_edge(world: World, tmp_path: Path) -> None:
    table = json.loads((write_scene(world, tmp_path / "out", to="obj", beyond=False) / "objects.json").read_text())
    assert not [name for name in table["objects"] if "beyond" in name or name == "backdrop"]
    assert any(name.startswith("tufts") for name in table["objects"])


def test_textures_are_the_materials_with_their_tints(world: World, folder: Path, parts: list[Any]) -> None:
    bark = np.asarray(Image.open(folder / "textures" / "bark.jpg")).astype(int)
    assert np.abs(bark - material_image(world, "bark")).mean() < 12  # a ramp of 8 x 8 pixels as JPEG
    for part in parts:
        assert part.visual.material.image is not None, part.visual.material.name
    pond = next(part for part in parts if part.visual.material.name == "water")
    np.testing.assert_allclose(pond.visual.uv, world.meshes["pond"].uv, atol=1e-5)
