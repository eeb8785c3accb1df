# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of plants: of each side of a box as it was given, of plants by their geometry, and they change nothing else."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import at, box, floating, quad

from fieldtruth.core.classes import Label, PlantPart
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.files import dump_experiment, load_experiment, with_overrides
from fieldtruth.kernels.lidar import EchoBuffers
from fieldtruth.sense import scene as scenes
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.lidar.config import LidarConfig, LidarSignal
from fieldtruth.sensors.lidar.sensing import Lidar
from fieldtruth.world.assembly import cut_at_edge
from fieldtruth.world.model import Mesh
from fieldtruth.world.plants import BUSHES, GRASSES, TREES
from fieldtruth.world.plants.deadwood import grow_log, grow_snag
from fieldtruth.world.plants.grasses import grow_clump, grow_tuft
from fieldtruth.world.plants.growth import grow_skeleton
from fieldtruth.world.plants.trees import grow_bush, grow_tree
from fieldtruth.world.seasons import changes
from fieldtruth.world.seasons.leaves import in_season

HALF = np.array([1.0, 2.0, 3.0])
SIDES = np.array([1, 2, 3, 4, 5, 0], np.uint8)
"""Part of the sides -x, +x, -y, +y, -z, +z."""
MATERIALS = ["bark"] * 2 + ["leaf"] * 4 + ["bark"] * 4 + ["leaf"] * 2
LOOKING = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""World from an optical frame at the origin that looks along x."""


def box_of_parts() -> Scene:
    """A box about the origin of which each side is a part."""
    mesh = replace(box("box", HALF.tolist(), MATERIALS), part=SIDES.repeat(2))
    return floating((mesh, at(0, 0, 0)))


def side_of(points: NDArray[Any]) -> NDArray[np.intp]:
    """Side of the box about the origin (n,) that points (n, 3) are on."""
    axis = (np.abs(points) / HALF).argmax(axis=1)
    return np.asarray(2 * axis + (points[np.arange(len(points)), axis] > 0))


def test_points_and_pixels_have_the_part_of_the_side_that_they_are_on() -> None:
    scene = box_of_parts()  # seen from inside
    config = LidarConfig(columns=256, rings=64, vertical_fov_deg=170.0, min_range=0.1, parts=True)
    found = Lidar(config, scene).scan(at(0, 0, 0))
    side = side_of(found.xyz.astype(float))
    clear = np.sort(np.abs(found.xyz) / HALF, axis=1)[:, 1] < 0.999  # no rays to edges
    assert set(side[clear]) == set(range(6))
    assert np.array_equal(found.part[clear], SIDES[side[clear]])
    labels = np.array([Label.TRUNK, Label.TREETOP, Label.TREETOP, Label.TRUNK, Label.TRUNK, Label.TREETOP])
    assert np.array_equal(found.label[clear], labels[side[clear]])
    camera = LabelCamera(
        CameraConfig(width=96, height=96, horizontal_fov_deg=140, mount=Mount(xyz=(0, 0, 0)), parts=True), scene
    )
    images = camera.label(LOOKING)
    v, u = np.mgrid[:96, :96]
    lens = camera.config.projection
    rays = np.stack([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, np.ones((96, 96))], -1) * images.depth[..., None]
    points = rays.reshape(-1, 3) @ LOOKING[:3, :3].T
    clear = np.sort(np.abs(points) / HALF, axis=1)[:, 1] < 0.999
    assert np.array_equal(images.part.ravel()[clear], SIDES[side_of(points)[clear]])
    assert np.array_equal(images.label.ravel()[clear], labels[side_of(points)[clear]])
    assert len(set(images.part.ravel())) == 3  # ahead and aside


def all_but_part(values: tuple[Any, ...]) -> list[Any]:
    return list(values[:-1])


def stem_and_branch() -> Scene:
    """Two walls of one object, one behind the other: a stem before a branch."""
    made = []
    for name, x, left, right, part in (("front", 5.0, 3.0, 0.0, 1), ("back", 5.4, 3.0, -3.0, 2)):
        wall = quad(name, [[x, right, -9], [x, left, -9], [x, left, 9], [x, right, 9]], "bark")
        made.append((replace(wall, part=np.full(2, part, np.uint8)), at(0, 0, 0)))
    world = floating(*made).world
    return Scene(replace(world, instances=tuple(replace(each, object_id=2) for each in world.instances)))


SIGNALS = [None, {}, {"sub_rays": 7, "divergence_deg": 0.4, "pulse_length": 1.0}]


@pytest.mark.parametrize("signal", SIGNALS)
def test_parts_change_nothing_else_of_a_scan(signal: dict[str, Any] | None) -> None:
    """A stem before a branch of the same tree: a wide beam that meets both makes one echo of one class."""
    scene = stem_and_branch()
    own = None if signal is None else LidarSignal.model_validate({"returns": "two", **signal})
    config = LidarConfig(columns=4096, rings=16, vertical_fov_deg=1.0, signal=own, min_range=0.1)
    plain, parts = (Lidar(config.model_copy(update={"parts": on}), scene).scan(at(0, 0, 0)) for on in (False, True))
    for mine, theirs in zip(all_but_part(plain), all_but_part(parts), strict=True):
        assert np.array_equal(mine, theirs)
    assert len(plain.part) == len(plain.label)
    assert not plain.part.any()
    assert set(parts.part) == {1, 2}
    aside = parts.xyz[:, 1] > 0.1
    assert (parts.part[aside] == 1).all()
    assert (parts.part[parts.xyz[:, 1] < -0.1] == 2).all()


@pytest.mark.parametrize("signal", SIGNALS)
def test_rows_of_meshes_change_nothing_else_of_a_scan(signal: dict[str, Any] | None) -> None:
    """Copies of a swarm, which have one instance id and merge in an echo, are told apart."""
    own = None if signal is None else LidarSignal.model_validate({"returns": "two", **signal})
    config = LidarConfig(columns=4096, rings=16, vertical_fov_deg=1.0, signal=own, min_range=0.1)
    scene = stem_and_branch()
    plain, rows = (
        Lidar(config.model_copy(update={"passability": on}), scene).scan(at(0, 0, 0)) for on in (False, True)
    )
    for name in plain._fields:
        assert name == "top" or np.array_equal(getattr(plain, name), getattr(rows, name))
    assert not plain.top.any()
    first = 2 + (scene.world.backdrop is not None)
    assert set(rows.top[rows.xyz[:, 1] > 0.1]) == {first}
    assert set(rows.top[rows.xyz[:, 1] < -0.1]) == {first + 1}


def test_a_particle_in_the_air_has_no_part() -> None:
    def in_air(echoes: EchoBuffers, key: np.uint64, _poses: Any, _directions: Any) -> None:
        echoes.label[0, ::2], echoes.depth[0, ::2], echoes.apparent[0, ::2] = int(Label.PARTICLE), 0.5, 0.1

    config = LidarConfig(columns=64, rings=8, signal=LidarSignal(), min_range=0.1, parts=True)
    found = Lidar(config, box_of_parts(), in_air=in_air).scan(at(0, 0, 0))
    floats = found.label == Label.PARTICLE
    assert floats.any()
    assert not found.part[floats].any()
    assert found.part[~floats].any()


def test_codes_are_ids_that_no_class_has(monkeypatch: pytest.MonkeyPatch) -> None:
    world = box_of_parts().world
    many = {"classes": {f"own {k}": {"id": k} for k in range(32, 256)}}
    codes = Scene(replace(world, layout=many)).part_codes
    assert np.flatnonzero(codes.part).min() >= len(Label)
    assert np.flatnonzero(codes.part).max() < 32
    monkeypatch.setattr(scenes, "Label", range(31))
    with pytest.raises(ConfigurationError, match="parts need 5 ids that no class has, and 1 are free"):
        _ = Scene(replace(world, layout=many)).part_codes


def test_a_plant_that_is_cut_at_the_edge_keeps_its_parts() -> None:
    scene = box_of_parts()
    cut = cut_at_edge(replace(scene.world, size=(1.0, 3.0)))
    (mesh,) = cut.meshes.values()
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    assert (np.abs(middle[:, :2]).max(axis=0) < [0.5, 1.5]).all()
    assert set(mesh.face_parts) == {5, 0}  # the sides in x and y are beyond the edge
    assert np.array_equal(mesh.face_parts, SIDES[side_of(middle * [0.0, 0.0, 1.0])])


def test_experiments_without_parts_are_written_as_before() -> None:
    plain = load_experiment("park_1")
    assert "parts" not in dump_experiment(plain)
    assert dump_experiment(with_overrides(plain, extras=["parts"])).count("parts: true") == 2


def centre(mesh: Mesh, part: PlantPart) -> NDArray[Any]:
    """Middles (n, 3) [m] of the faces of a part."""
    assert mesh.part is not None
    return np.asarray(mesh.vertices[mesh.faces[mesh.part == part]].mean(axis=1), np.float64)


@pytest.mark.parametrize("name", ["oak", "spruce", "birch"])
def test_the_stem_of_a_tree_is_what_lies_about_its_axis(name: str) -> None:
    mesh = grow_tree(TREES[name], name="tree", height=11.0, rng=np.random.default_rng(3))
    habit = TREES[name].habit(11.0)
    assert mesh.part is not None
    wood = np.array([not material.startswith("leaf") for material in mesh.materials])[mesh.material]
    assert np.array_equal(np.isin(mesh.part, (PlantPart.STEM, PlantPart.BRANCH)), wood)
    assert np.array_equal(mesh.part == PlantPart.LEAF, ~wood)
    stem, branch = centre(mesh, PlantPart.STEM), centre(mesh, PlantPart.BRANCH)
    low = stem[:, 2] < 0.25 * 11.0
    assert np.hypot(*stem[low, :2].T).max() < 3.0 * habit.trunk_radius * 11.0 + 0.5
    assert np.quantile(np.hypot(*branch[:, :2].T), 0.5) > np.quantile(np.hypot(*stem[:, :2].T), 0.9)
    assert len(grow_skeleton(habit, 11.0, np.random.default_rng(3))[0].length) == 1  # one stem, as here


def test_flowers_blades_and_dead_wood_have_their_parts() -> None:
    rng = np.random.default_rng
    gorse = grow_bush(BUSHES["gorse"], name="gorse", height=1.2, rng=rng(1))
    assert gorse.part is not None
    assert np.array_equal(gorse.part == PlantPart.FLOWER, gorse.material == gorse.materials.index("petal_gorse"))
    reed = grow_tuft(GRASSES["reed"], name="reed", height=2.0, rng=rng(1))
    assert reed.part is not None
    assert np.array_equal(reed.part == PlantPart.FLOWER, reed.material == reed.materials.index("blade_plume"))
    assert centre(reed, PlantPart.FLOWER)[:, 2].min() > 0.6 * 2.0
    meadow = grow_tuft(GRASSES["meadow"], name="meadow", height=0.6, rng=rng(1))
    assert set(meadow.face_parts) == {PlantPart.STEM, PlantPart.FLOWER, PlantPart.BLADE}
    fern = grow_tuft(GRASSES["fern"], name="fern", height=0.7, rng=rng(1))
    assert set(fern.face_parts) == {PlantPart.STEM, PlantPart.LEAF}
    snag = grow_snag(TREES["oak"], name="snag", height=5.0, rng=rng(1))
    assert set(snag.face_parts) == {PlantPart.STEM, PlantPart.BRANCH}
    log = grow_log(TREES["oak"], name="log", length=4.0, radius=0.2, rng=rng(1), roots=True)
    soil = log.material == log.materials.index("bark_soil")
    assert np.array_equal(log.face_parts == PlantPart.NONE, soil)
    both = {GRASSES["meadow"]: 0.5, GRASSES["reed"]: 0.5}
    clump = grow_clump(both, name="clump", radius=0.3, per_m2=30.0, rng=rng(1))
    assert len(clump.face_parts) == len(clump.faces)
    assert set(clump.face_parts) > {PlantPart.STEM, PlantPart.FLOWER}


def test_a_bare_tree_in_winter_has_stem_and_branches_alone() -> None:
    mesh = grow_tree(TREES["oak"], name="tree", height=10.0, rng=np.random.default_rng(2), detail=0.1)
    bare = in_season(mesh, changes("winter"), 0)
    assert len(bare.face_parts) == len(bare.faces)
    leaves = np.array([name.startswith("leaf") for name in bare.materials])[bare.material]
    assert np.array_equal(bare.face_parts == PlantPart.LEAF, leaves)
    twigs = bare.material == bare.materials.index("bark_oak_twigs")
    assert twigs.any()
    assert (bare.face_parts[twigs] == PlantPart.BRANCH).all()
    assert (mesh.face_parts == PlantPart.STEM).sum() == (bare.face_parts == PlantPart.STEM).sum()
