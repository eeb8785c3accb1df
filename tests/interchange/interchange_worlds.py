# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A small world with all that an export carries: a bent trail, slopes, objects, a swarm, land beyond the edge."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from sense_worlds import BOX_CORNERS, BOX_FACES, make_mesh, make_world, quad

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.interchange.surfaces import Surface
from fieldtruth.world.model import Instance, Material, Mesh, Raster, Swarm, World

F8 = NDArray[np.float64]
RADIUS, WIDTH, SIDE = 6.0, 1.5, 20.0
"""The trail is a ring about the origin: its centre line's radius and its width [m]; side [m] of the world."""


def hills(x: F8, y: F8) -> F8:
    return np.asarray(0.3 * np.sin(0.4 * x) + 0.2 * np.cos(0.5 * y) + 0.05 * x)


def ring_trail(spacing: float, corner: float = -SIDE / 2) -> Raster:
    """Signed distance to the ring's edge."""
    count = int(np.ceil((SIDE / 2 - corner) / spacing)) + 1
    x, y = np.meshgrid(*2 * [corner + spacing * np.arange(count)], indexing="ij")
    distance = np.abs(np.hypot(x, y) - RADIUS) - WIDTH / 2
    return Raster(values=distance.astype(np.float32), spacing=spacing, x0=corner, y0=corner)


def pose(x: float, y: float, z: float, *, yaw_deg: float = 0.0, tilt_deg: float = 0.0, scale: float = 1.0) -> F8:
    matrix = transforms.pose((x, y, z), (0.0, tilt_deg, yaw_deg))
    matrix[:3, :3] *= scale
    return matrix


def small_world(trail_spacing: float = 0.1) -> World:
    """20 m square, cells of 0.2 m: two trees that share a mesh, a bench, a pond, 40 tufts (10 of them beyond)."""
    tree = make_mesh("tree", BOX_CORNERS * (0.2, 0.3, 1.5), BOX_FACES, ["bark"] * 8 + ["leaf"] * 4)
    bench, pond = make_mesh("bench", BOX_CORNERS * 0.4, BOX_FACES, "wood"), quad("pond", _square(1.0), "water")
    tufts = [_blade(f"tuft_{k}", height) for k, height in enumerate((0.3, 0.5))]
    world = make_world(height=hills, side=SIDE, spacing=0.2, trail=ring_trail(trail_spacing))
    instances = (
        Instance(name="tree_1", kind="tree", mesh="tree", object_id=2, world_from_object=pose(3, 1, 0.2, yaw_deg=30)),
        Instance(
            name="tree_2", kind="tree", mesh="tree", object_id=3, tint=(0.8, 1.2, 0.9),
            world_from_object=pose(-7, 8, 0.1, yaw_deg=200, tilt_deg=15, scale=1.3),
        ),
        Instance(name="bench_1", kind="bench", mesh="bench", object_id=4, world_from_object=pose(0, -4, 0, yaw_deg=75)),
        Instance(name="pond", kind="water", mesh="pond", object_id=5, world_from_object=pose(8, 8, -0.1)),
    )  # fmt: skip
    meshes = {mesh.name: mesh for mesh in (tree, bench, pond, *tufts)}
    textures = {"grey": np.full((4, 4, 3), 120, np.uint8), "ramp": _ramp()}
    return replace(
        world,
        meshes=meshes,
        instances=instances,
        swarms=(_tufts(tufts),),
        textures=textures,
        materials=_materials(world),
        water_level=-0.1,
        backdrop=_frame(),
        object_names=("husky", "ground", "tree_1", "tree_2", "bench_1", "pond", "tufts"),
    )


def _materials(world: World) -> dict[str, Material]:
    """The bark has a tint above 1, which a colour factor may not have."""
    looks = dict(world.materials)
    looks["grass"] = Material(name="grass", label=Label.HIGH_GRASS, texture="grey", translucency=0.4)
    looks["bark"] = replace(looks["bark"], texture="ramp", tint=(1.4, 0.5, 0.5))
    looks["water"] = replace(looks["water"], mirror=0.02)
    return looks


def _ramp() -> NDArray[np.uint8]:
    """Red grows to the right, green downwards."""
    image = np.zeros((8, 8, 3), np.uint8)
    image[..., 0], image[..., 1] = np.arange(8) * 30, np.arange(8)[:, None] * 30
    return image


def _blade(name: str, height: float) -> Mesh:
    return quad(name, [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.0, height], [0.0, 0.0, height]], "grass")


def _square(half: float) -> list[list[float]]:
    return [[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]]


def _tufts(meshes: Sequence[Mesh]) -> Swarm:
    rng = np.random.default_rng(3)
    far = rng.uniform(11.0, 15.0, (10, 2)) * np.where(np.arange(10) < 5, 1, -1)[:, None]
    xy = np.concatenate([rng.uniform(-9.5, 9.5, (30, 2)), far])
    poses = np.array([pose(x, y, 0.0, yaw_deg=90 * (k % 4), scale=0.8 + 0.01 * k) for k, (x, y) in enumerate(xy)])
    tint = rng.uniform(0.7, 1.4, (40, 3)).astype(np.float32)
    rows = (np.arange(40) % 3 == 0).astype(np.int32)
    names = tuple(mesh.name for mesh in meshes)
    return Swarm(
        name="tufts", kind="high_grass", object_id=6, meshes=names, mesh=rows, world_from_object=poses, tint=tint
    )


def _frame() -> Mesh:
    """A square ring of land around the world, 10 m wide, level."""
    inner, outer = SIDE / 2, SIDE / 2 + 10
    corners = [[s * inner, t * inner, 0.0] for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    corners += [[s * outer, t * outer, 0.0] for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    faces = [f for k in range(4) for f in ([k, 4 + k, 4 + (k + 1) % 4], [k, 4 + (k + 1) % 4, (k + 1) % 4])]
    return make_mesh("backdrop", corners, faces, "soil")


# ---------------------------------------------------------------------------------------------------------------------
# What tests measure


def corners_of(surface: Surface) -> F8:
    """Corners (f, 3, 3) of a surface's triangles."""
    return surface.vertices[surface.faces].astype(np.float64)


def areas(corners: F8) -> F8:
    """Areas (f,) of triangles (f, 3, 3)."""
    return np.asarray(np.linalg.norm(across(corners), axis=1) / 2)


def across(corners: F8) -> F8:
    """Normals (f, 3) of triangles (f, 3, 3), as long as twice their areas."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def mesh_areas(mesh: Mesh) -> dict[str, float]:
    """Area of each material of a mesh."""
    found = areas(mesh.vertices[mesh.faces].astype(np.float64))
    return {name: float(found[mesh.material == row].sum()) for row, name in enumerate(mesh.materials)}
