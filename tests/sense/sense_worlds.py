# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds so small that every range and every pixel in them is known in closed form."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar
from fieldtruth.world import assembly
from fieldtruth.world.model import (
    Collider,
    Heightfield,
    Instance,
    Material,
    Mesh,
    Raster,
    Terrain,
    World,
    merge_meshes,
)

F8 = NDArray[np.float64]
Placed = tuple[Mesh, F8]
"""A mesh and its pose (4, 4)."""

MATERIALS = {
    "soil": Label.GROUND,
    "gravel": Label.TRAIL,
    "stone": Label.ROCK,
    "bark": Label.TRUNK,
    "leaf": Label.TREETOP,
    "wood": Label.BENCH,
    "water": Label.WATER,
}
BOX_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
BOX_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip
"""Two triangles for each side: -x, +x, -y, +y, -z, +z."""


def make_mesh(
    name: str, vertices: ArrayLike, faces: ArrayLike, material: str | Sequence[str] = "stone", *, footprint: float = 0.5
) -> Mesh:
    """Flat-shaded triangles; ``material`` is one name, or a name for each face."""
    corners = np.asarray(vertices, np.float64)[np.asarray(faces)]
    count = len(corners)
    names = [material] * count if isinstance(material, str) else list(material)
    unique = tuple(dict.fromkeys(names))
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return Mesh(
        name=name,
        vertices=corners.reshape(-1, 3).astype(np.float32),
        normals=np.repeat(across, 3, axis=0).astype(np.float32),
        uv=corners.reshape(-1, 3)[:, :2].astype(np.float32),
        faces=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        material=np.array([unique.index(n) for n in names], np.int32),
        materials=unique,
        footprint=footprint,
    )


def box(name: str, half: Sequence[float], material: str | Sequence[str] = "stone") -> Mesh:
    """A box about its origin with half edge lengths ``half`` [m]."""
    return make_mesh(name, BOX_CORNERS * half, BOX_FACES, material)


def quad(name: str, corners: ArrayLike, material: str = "stone") -> Mesh:
    """A planar quadrilateral through corners (4, 3) in order."""
    return make_mesh(name, corners, [[0, 1, 2], [0, 2, 3]], material)


def at(x: float, y: float, z: float) -> F8:
    """A pose without rotation."""
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def make_world(
    objects: Sequence[Placed] = (),
    *,
    height: float | Callable[[F8, F8], F8] = 0.0,
    side: float = 40.0,
    spacing: float = 0.5,
    trail: Raster | None = None,
) -> World:
    """A square of ground about the origin, with objects, and with a trail if a raster of its distances is given."""
    count = round(side / spacing) + 1
    x, y = np.meshgrid(*2 * [-side / 2 + spacing * np.arange(count)], indexing="ij")
    heights = height(x, y) if callable(height) else np.full_like(x, height)
    texture = np.full((4, 4, 3), 120, np.uint8)
    return World(
        name="tiny",
        seed=0,
        size=(side, side),
        terrain=Terrain(
            field=Heightfield(heights=heights.astype(np.float32), spacing=spacing, x0=-side / 2, y0=-side / 2),
            trail_distance=trail
            or Raster(values=np.ones((2, 2), np.float32), spacing=side, x0=-side / 2, y0=-side / 2),
            cover=Raster(values=np.ones((2, 2, 1), np.float32), spacing=side, x0=-side / 2, y0=-side / 2),
            ground_materials=("soil",),
            trail_material="gravel",
            border_material="gravel",
        ),
        meshes={mesh.name: mesh for mesh, _ in objects},
        instances=tuple(
            Instance(name=f"object_{k}", kind="object", mesh=mesh.name, object_id=k + 2, world_from_object=pose)
            for k, (mesh, pose) in enumerate(objects)
        ),
        materials={
            name: Material(name=name, label=label, texture="grey", translucency=0.4 * (name == "leaf"))
            for name, label in MATERIALS.items()
        },
        textures={"grey": texture},
        object_names=("husky", "ground", *(f"object_{k}" for k in range(len(objects)))),
    )


def floating(*objects: Placed) -> Scene:
    """Objects alone: the ground is below a LiDAR's range."""
    return Scene(make_world(objects, height=-900.0))


class Rays(NamedTuple):
    """Hits of single rays: range [m] (0 for none), class and instance id."""

    range_m: F8
    label: NDArray[np.uint8]
    instance: NDArray[np.uint32]


def trace_rays(scene: Scene, origins: F8, directions: F8, *, max_range: float = 200.0) -> Rays:
    """Trace rays (n, 3) with a LiDAR of one ring, by giving each column the pose that aims it."""
    out = Rays(np.zeros(len(origins)), np.zeros(len(origins), np.uint8), np.zeros(len(origins), np.uint32))
    for first in range(0, len(origins), 4096):
        rows = slice(first, first + 4096)
        count = max(8, len(origins[rows]))
        config = LidarConfig(columns=count, rings=1, min_range=0.0, max_range=max_range)
        azimuth = -2.0 * np.pi * np.arange(len(origins[rows])) / count
        ahead = directions[rows] / np.linalg.norm(directions[rows], axis=1, keepdims=True)
        side = np.cross(ahead, np.where(np.abs(ahead[:, 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        frame = np.stack([ahead, side, np.cross(ahead, side)], axis=-1)
        turn = np.zeros_like(frame)
        turn[:, 0, 0], turn[:, 1, 1], turn[:, 2, 2] = np.cos(azimuth), np.cos(azimuth), 1.0
        turn[:, 0, 1], turn[:, 1, 0] = -np.sin(azimuth), np.sin(azimuth)
        poses = np.tile(np.eye(4), (count + 1, 1, 1))
        poses[len(ahead) :, 2, 3] = 1e6  # surplus columns hit nothing
        poses[: len(ahead), :3, :3] = frame @ np.swapaxes(turn, 1, 2)
        poses[: len(ahead), :3, 3] = origins[rows]
        scan = IdealLidar(config, scene).scan(poses)
        found = first + scan.column.astype(np.int64)
        out.range_m[found], out.label[found], out.instance[found] = scan.range_m, scan.label, scan.instance
    return out


@contextmanager
def without_textures() -> Iterator[None]:
    """Build worlds quickly, without textures, which change neither layout nor labels."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(assembly, "make_textures", lambda *_: {})
        yield


def built_scene(environment: str) -> Scene:
    """An environment of seed 0, made once in a process."""
    from kept_worlds import KEPT

    return KEPT.scene(KEPT.load_world(environment))


def driven(columns: int) -> F8:
    """Poses of a LiDAR that drives and turns during its scan."""
    share = np.linspace(0.0, 1.0, columns + 1)
    return np.stack([transforms.pose((0.2 * s, -0.1 * s, 1.1), (2, -3, 10 * s)) for s in share])


def scan_bytes(config: LidarConfig, scene: Scene, poses: F8, stamps: list[int]) -> list[bytes]:
    """Bytes of the scans of a new LiDAR from the same poses at stamps [ns], in their order."""
    lidar = IdealLidar(config, scene)
    return [b"".join(values.tobytes() for values in lidar.scan(poses, stamp)) for stamp in stamps]


def limbed_tree() -> Mesh:
    """A trunk 4 m high, with a plate of leaves on either side of it: limbs 0 (+y, 3 m up) and 1 (-y, 2 m up)."""
    trunk = box("tree", (0.1, 0.1, 2.2), "bark")
    vertices = [trunk.vertices + np.array([0, 0, 1.8], np.float32)]
    for y, z in ((1.3, 3.0), (-1.3, 2.0)):
        vertices.append(box("plate", (0.05, 1.3, 0.6)).vertices + np.array([0, y, z], np.float32))
    return replace(
        merge_meshes("tree", [trunk, box("a", (1, 1, 1), "leaf"), box("b", (1, 1, 1), "leaf")], footprint=1.0),
        vertices=np.concatenate(vertices),
        colliders=(Collider(shape="cylinder", size=(0.1, 2.0)),),
        species=("oak",),
        limb=np.array([-1, 0, 1], np.int16).repeat(12),
        joints=np.array([[0, 0, 3.0], [0, 0, 2.0]], np.float32),
    )
