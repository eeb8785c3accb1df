# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies of actors: poses of parts from joints, meshes, materials, sizes and random numbers."""

import copy
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from walks import F8, body_at, placements

from fieldtruth.actors.cast import figures_of
from fieldtruth.actors.figure import Figure, Joint
from fieldtruth.actors.kinds import IN_WINTER_COAT, KINDS
from fieldtruth.actors.shapes import make_textures
from fieldtruth.core.classes import Label
from fieldtruth.experiment.actor_config import KINDS as NAMES
from fieldtruth.experiment.config import Experiment
from fieldtruth.world.model import Mesh

LABELS = {
    "person": Label.PERSON,
    "dog": Label.ANIMAL,
    "deer": Label.ANIMAL,
    "cow": Label.ANIMAL,
    "cyclist": Label.VEHICLE,
    "car": Label.VEHICLE,
    "tractor": Label.VEHICLE,
    "robot": Label.ROBOT,
    "multirotor": Label.AERIAL_VEHICLE,
}


@cache
def figure_of(kind: str, seed: int = 3) -> Figure:
    return KINDS[kind].figure("it", np.random.default_rng(seed))


def cielab(tint: tuple[float, float, float]) -> F8:
    """L*, a*, b* of linear shares of red, green and blue under D65 (CIE 15)."""
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ tint
    x, y, z = np.cbrt(xyz / [0.9505, 1.0, 1.0890])
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def volume(mesh: Mesh) -> float:
    """Volume [m3] inside of triangles that face outwards."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6


def composed(figure: Figure, root: F8, angles: F8) -> list[F8]:
    """Pose of each part, joint by joint, from the parent's."""
    found = [root.copy() for _ in figure.parts]
    for part in range(len(figure.parts)):
        rows = [row for row, joint in enumerate(figure.joints) if joint.part == part]
        if not rows:
            continue
        first = figure.joints[rows[0]]
        pose = (found[first.parent] if first.parent >= 0 else root).copy()
        step = np.eye(4)
        step[:3, 3] = first.origin
        pose = pose @ step
        for row in rows:
            step = np.eye(4)
            if figure.joints[row].axis == "lift":
                step[2, 3] = angles[row]
            else:
                step[:3, :3] = Rotation.from_euler(figure.joints[row].axis, angles[row]).as_matrix()
            pose = pose @ step
        found[part] = pose
    return found


@pytest.mark.parametrize("kind", ["person", "cow", "cyclist"])
def test_poses_of_parts_are_those_of_the_joints_one_after_the_other(kind: str) -> None:
    figure, rng = figure_of(kind), np.random.default_rng(5)
    angles = rng.uniform(-1, 1, (3, len(figure.joints)))
    roots = np.tile(np.eye(4), (3, 1, 1))
    roots[:, :3, :3] = Rotation.random(3, random_state=1).as_matrix()
    roots[:, :3, 3] = rng.normal(size=(3, 3))
    poses = figure.poses(roots, angles)
    assert poses.shape == (3, len(figure.parts), 4, 4)
    for k in range(3):
        assert poses[k] == pytest.approx(np.array(composed(figure, roots[k], angles[k])), abs=1e-12)
    for row in range(len(figure.joints)):
        other = angles.copy()
        other[:, row] *= -1
        assert np.abs(figure.poses(roots, other) - poses).max() > 1e-2, figure.joints[row].name


def test_a_part_without_joints_is_fixed_in_the_root() -> None:
    figure = figure_of("car")
    root = body_at(1.0, 2.0, 0.5)
    poses = figure.poses(root[None], np.zeros((1, len(figure.joints))))
    assert poses[0, 0] == pytest.approx(root)
    assert poses[0, 1, :3, 3] == pytest.approx((root @ [*figure.joints[0].origin, 1])[:3])


def test_all_kinds_of_experiments_are_made() -> None:
    assert tuple(KINDS) == NAMES
    assert set(LABELS) == set(NAMES)


@pytest.mark.parametrize("kind", NAMES)
def test_meshes_and_materials_are_those_of_bodies_that_move(kind: str) -> None:
    figure = figure_of(kind)
    assert figure.kind == kind
    assert figure.label == LABELS[kind]
    names = [mesh.name for mesh in figure.parts]
    assert len(set(names)) == len(names)
    for mesh in figure.parts:
        assert mesh.name.startswith("it ")
        assert mesh.faces.min() >= 0
        assert mesh.faces.max() < len(mesh.vertices)
        assert np.isfinite(mesh.vertices).all()
        lengths = np.linalg.norm(mesh.normals[np.unique(mesh.faces)], axis=1)
        assert lengths == pytest.approx(1.0, abs=1e-4)
        assert volume(mesh) > 0
        assert set(mesh.materials) <= set(figure.materials)
    assert sum(len(mesh.faces) for mesh in figure.parts) < (4000 if kind == "person" else 12_000)
    for name, material in figure.materials.items():
        assert name == material.name
        assert name.startswith("it ")
        assert material.texture in make_textures()
        assert material.translucency == material.mirror == 0
        assert material.reflectance is not None
        assert 0 < material.reflectance < 1
        assert 0 <= min(material.tint) <= max(material.tint) < 0.8


@pytest.mark.parametrize("kind", NAMES)
def test_normals_are_those_of_the_outer_sides(kind: str) -> None:
    for mesh in figure_of(kind).parts:
        a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(np.float64) for k in range(3))
        across = np.cross(b - a, c - a)
        facing = np.einsum("ij,ij->i", across, mesh.normals[mesh.faces].mean(axis=1))
        area = np.linalg.norm(across, axis=1)
        assert area[facing < 0].sum() < 0.01 * area.sum(), mesh.name


def test_a_cyclist_is_a_person_on_a_vehicle() -> None:
    figure = figure_of("cyclist")
    labels = {name: figure.materials[f"it {name}"].label for name in ("coat", "helmet", "frame", "rubber")}
    assert labels == {
        "coat": Label.PERSON,
        "helmet": Label.PERSON,
        "frame": Label.VEHICLE,
        "rubber": Label.VEHICLE,
    }


@pytest.mark.parametrize("kind", NAMES)
def test_random_numbers_make_the_figure(kind: str) -> None:
    one, same = figure_of(kind), KINDS[kind].figure("it", np.random.default_rng(3))
    others = [figure_of(kind, seed) for seed in range(5, 8)]
    assert one.materials == same.materials
    for a, b in zip(one.parts, same.parts, strict=True):
        assert np.array_equal(a.vertices, b.vertices)
    assert any(other.materials != one.materials for other in others)
    assert one.joints == same.joints


@pytest.mark.parametrize("kind", NAMES)
def test_a_figure_that_stands_is_in_its_box(kind: str) -> None:
    figure = figure_of(kind)
    start = placements(lambda t: 0.0, seconds=0.3, height=5.0)
    gait = KINDS[kind].gait(figure, start[0], lambda x, y: 0.0, np.random.default_rng(1))
    root, angles = [gait.step(each) for each in start][-1]
    poses = figure.poses(root[None], angles[None])[0]
    points = np.concatenate(
        [mesh.vertices @ m[:3, :3].T + m[:3, 3] for mesh, m in zip(figure.parts, poses, strict=True)]
    )
    low, high = points.min(axis=0), points.max(axis=0)
    length, width, height = figure.size
    base = 5.0 - height / 2 if figure.flies else 0.0
    assert max(-low[0], high[0]) == pytest.approx(length / 2, abs=0.05)
    assert max(-low[1], high[1]) == pytest.approx(width / 2, abs=0.12)  # it may look aside
    assert low[2] > base - 0.01
    assert figure.flies or high[2] == pytest.approx(height, abs=0.05)
    assert min(-low[0], high[0]) > 0.35 * length
    assert max(-low[1], high[1]) < figure.radius + 0.05
    assert 0 < figure.speed < figure.top_speed


@pytest.mark.parametrize("kind", NAMES)
def test_a_copy_of_a_gait_goes_on_from_where_it_was(kind: str) -> None:
    figure = figure_of(kind)
    way = placements(lambda t: 0.8, lambda t: 0.3, seconds=1.5, height=4.0)
    gait = KINDS[kind].gait(figure, way[0], lambda x, y: 0.1 * x, np.random.default_rng(1))
    for each in way[:90]:
        gait.step(each)
    kept = copy.deepcopy(gait)
    first = [gait.step(each) for each in way[90:]]
    again = [kept.step(each) for each in way[90:]]
    for (root, angles), (other, values) in zip(first, again, strict=True):
        assert np.array_equal(root, other)
        assert np.array_equal(angles, values)


def test_joints_are_named_once() -> None:
    for kind in NAMES:
        joints: tuple[Joint, ...] = figure_of(kind).joints
        names = [joint.name for joint in joints]
        assert len(set(names)) == len(names)
        assert all(joint.parent < joint.part for joint in joints)


@pytest.mark.parametrize("kind", ["dog", "deer", "cow"])
def test_no_fur_is_more_colourful_than_melanin_makes_it(kind: str) -> None:
    for each in [KINDS[kind], *([IN_WINTER_COAT[kind]] if kind in IN_WINTER_COAT else [])]:
        for seed in range(30):
            materials = each.figure("it", np.random.default_rng(seed)).materials
            for part in ("fur", "patch"):
                red, green, blue = materials[f"it {part}"].tint
                assert red >= green >= blue
                assert np.hypot(*cielab((red, green, blue))[1:]) < 25.0


def test_deer_are_reddish_in_summer_and_greyish_in_the_other_seasons() -> None:
    experiment = Experiment.model_validate(
        {"name": "it", "environment": "forest", "route": {"metres": {"start": [0, 0], "waypoints": [[5, 0]]}}}
        | {"actors": {"deer": {"kind": "deer"}}}
    )
    chroma = {}
    for season in ("spring", "summer", "autumn", "winter"):
        figure = figures_of(experiment.model_copy(update={"layout": {"season": season}}))["deer"]
        chroma[season] = np.hypot(*cielab(figure.materials["deer fur"].tint)[1:])
        rump = np.hypot(*cielab(figure.materials["deer patch"].tint)[1:])
        assert (rump > 12.0) == (season == "summer")
    assert all(chroma[season] < 0.7 * chroma["summer"] for season in ("spring", "autumn", "winter"))


@pytest.mark.parametrize("seed", range(40))
def test_no_clothes_are_more_colourful_than_washed_cotton(seed: int) -> None:
    for name, material in KINDS["person"].figure("it", np.random.default_rng(seed)).materials.items():
        assert np.hypot(*cielab(material.tint)[1:]) < 42.0, name
