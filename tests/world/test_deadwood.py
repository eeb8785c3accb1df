# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Dead wood: snags have the requested height and no leaves, logs lie in the ground, colliders cover them."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from mesh_checks import assert_same_bytes, assert_valid, face_normals

from fieldtruth.core.classes import Label
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Mesh
from fieldtruth.world.plants import TREES, clearance_circles, grow_log, grow_snag, grow_stump

Make = Callable[[np.random.Generator], Mesh]


def snag(rng: np.random.Generator, name: str = "spruce", height: float = 7.0) -> Mesh:
    return grow_snag(TREES[name], name="snag", height=height, rng=rng)


def log(rng: np.random.Generator, *, length: float = 6.0, radius: float = 0.22, roots: bool | None = False) -> Mesh:
    return grow_log(TREES["beech"], name="log", length=length, radius=radius, rng=rng, roots=roots)


def stump(rng: np.random.Generator) -> Mesh:
    return grow_stump(TREES["oak"], name="stump", radius=0.3, rng=rng)


MAKERS: dict[str, Make] = {
    **{f"snag_{name}": partial(snag, name=name) for name in TREES},
    "snag_low": partial(snag, height=1.0),
    "snag_high": partial(snag, height=20.0),
    "log": log,
    "log_roots": partial(log, roots=True),
    "log_short": partial(log, length=1.0, radius=0.05),
    "log_great": partial(log, length=20.0, radius=0.6),
    "stump": stump,
}
every = pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS.keys())
seeds = pytest.mark.parametrize("seed", [1, 2, 3, 4])


@every
def test_mesh_is_valid(make: Make) -> None:
    for seed in range(1, 5):
        mesh = make(np.random.default_rng(seed))
        assert_valid(mesh, least_area=5e-10)
        assert ((face_normals(mesh) * mesh.normals[mesh.faces].mean(1)).sum(1) > 0).mean() > 0.93, seed
        assert len(mesh.faces) < 20_000


@every
def test_all_materials_are_trunk(make: Make) -> None:
    mesh = make(np.random.default_rng(1))
    assert {MATERIALS[name].label for name in mesh.materials} == {Label.TRUNK}
    assert set(np.unique(mesh.material)) == set(range(len(mesh.materials)))


@every
def test_same_seed_gives_same_bytes_and_another_seed_another_piece(make: Make) -> None:
    first, again, other = (make(np.random.default_rng(seed)) for seed in (5, 5, 6))
    assert_same_bytes(first, again)
    assert first.vertices.tobytes() != other.vertices.tobytes()


@seeds
@pytest.mark.parametrize("height", [2.0, 6.0, 12.0])
def test_snag_has_the_requested_height(height: float, seed: int) -> None:
    mesh = snag(np.random.default_rng(seed), height=height)
    top = mesh.vertices[:, 2].max()
    assert 0.95 * height < top < 1.1 * height + 0.6
    assert mesh.vertices[:, 2].min() < -0.15
    (collider,) = mesh.colliders
    assert collider.size[1] == min(2.0, 0.9 * height)
    assert mesh.footprint == pytest.approx(collider.size[0] + 0.3)


@seeds
def test_snag_has_bark_and_bare_wood(seed: int) -> None:
    mesh = snag(np.random.default_rng(seed), "oak", 9.0)
    corner = mesh.vertices[mesh.faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    share = {name: area[mesh.material == row].sum() / area.sum() for row, name in enumerate(mesh.materials)}
    assert 0.1 < share["bark_dead"] < 0.9
    assert 0.1 < share["bark_oak"] < 0.9


@seeds
@pytest.mark.parametrize("roots", [False, True])
def test_log_is_sunk_into_the_ground_along_its_length(roots: bool, seed: int) -> None:
    """The underside is below z = 0 in every half metre; with roots, which lift the thick end, near the thin end."""
    mesh = log(np.random.default_rng(seed), length=8.0, radius=0.25, roots=roots)
    x, z = mesh.vertices[:, 0], mesh.vertices[:, 2]
    for start in np.arange(1.9 if roots else -3.9, 3.5, 0.5):
        lowest = z[(x >= start) & (x < start + 0.5)].min()
        assert lowest < -0.02
        assert roots or lowest > -0.6 * 0.25 - 0.1
    if roots:
        assert z[x < -3.9].min() < -0.1


@seeds
def test_log_has_the_requested_length_and_radius(seed: int) -> None:
    mesh = log(np.random.default_rng(seed), length=8.0, radius=0.25)
    x, y, z = mesh.vertices.T
    assert np.ptp(x) == pytest.approx(8.0, abs=1.0)
    thick = (x < -3.0) & (x > -3.6)
    assert z[thick].max() == pytest.approx(1.7 * 0.25, abs=0.12)
    trunk = np.abs(y) < 0.6
    assert (z[trunk] < 0.55).mean() > 0.95


@seeds
@pytest.mark.parametrize("roots", [False, True])
def test_boxes_cover_the_log_and_circles_cover_the_boxes(roots: bool, seed: int) -> None:
    mesh = log(np.random.default_rng(seed), length=6.0, radius=0.25, roots=roots)
    above = mesh.vertices[mesh.vertices[:, 2] > 0].astype(np.float64)
    inside = np.zeros(len(above), bool)
    for box in mesh.colliders:
        assert box.shape == "box"
        assert box.yaw_deg == 0
        offset = np.abs(above - box.position)
        inside |= (
            (offset[:, 0] <= box.size[0] / 2 + 0.03)
            & (offset[:, 1] <= box.size[1] / 2 + 0.03)
            & (above[:, 2] <= box.position[2] + box.size[2] + 0.03)
        )
    assert inside.mean() > 0.75  # except splinters, stubs and root tips
    low = np.abs(mesh.vertices[:, 0]) < 2.8
    assert inside[low[mesh.vertices[:, 2] > 0]].mean() > 0.75
    circles = clearance_circles(mesh)
    assert len(circles) == len(mesh.colliders)
    for (x, y, radius), box in zip(circles, mesh.colliders, strict=True):
        corner = np.array(box.size[:2]) / 2
        assert np.hypot(*(np.array(box.position[:2]) + corner - (x, y))) <= radius + 1e-9
        assert np.hypot(x, y) + radius < mesh.footprint + 0.6


@seeds
def test_moss_is_on_the_upper_side_of_a_log(seed: int) -> None:
    mesh = log(np.random.default_rng(seed), length=9.0, radius=0.3)
    row = mesh.materials.index("bark_moss")
    normals = mesh.normals[mesh.faces[mesh.material == row]].mean(1)
    assert np.quantile(normals[:, 2], 0.05) > 0.1


@seeds
def test_less_detail_means_fewer_triangles(seed: int) -> None:
    for grow in (
        partial(grow_snag, TREES["pine"], height=8.0),
        partial(grow_log, TREES["pine"], length=6.0, radius=0.2, roots=True),
        partial(grow_stump, TREES["pine"], radius=0.2),
    ):
        fine, coarse = (grow(name="x", rng=np.random.default_rng(seed), detail=d) for d in (1.0, 0.25))
        assert len(coarse.faces) < 0.6 * len(fine.faces)


def test_sizes_out_of_range_are_rejected() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match=r"height must be between 1 and 20 m, got 30\.0"):
        snag(rng, height=30.0)
    with pytest.raises(ValueError, match=r"length must be between 1 and 20 m, got 0\.5"):
        log(rng, length=0.5)
    with pytest.raises(ValueError, match=r"radius must be between 0\.05 and 0\.6 m, got nan"):
        log(rng, radius=float("nan"))
