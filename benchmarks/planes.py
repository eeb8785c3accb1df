# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bare planes to drive on, with or without trunks, and experiments on them."""

import dataclasses

import numpy as np

from fieldtruth import route_from_metres
from fieldtruth.experiment.config import Experiment
from fieldtruth.world.model import Collider, Heightfield, Instance, Mesh, Raster, Terrain, World


def plane(*, slope_deg: float = 0.0, spacing: float = 0.2, size: tuple[float, float] = (24.0, 16.0)) -> World:
    """A plane that rises along x."""
    nx, ny = (round(length / spacing) + 1 for length in size)
    x0, y0 = -size[0] / 2, -size[1] / 2
    heights = np.tan(np.radians(slope_deg)) * (x0 + spacing * np.arange(nx))
    raster = {"spacing": 100.0, "x0": -50.0, "y0": -50.0}
    field = Heightfield(heights=np.repeat(heights[:, None], ny, 1).astype(np.float32), spacing=spacing, x0=x0, y0=y0)
    terrain = Terrain(
        field=field,
        trail_distance=Raster(values=np.ones((2, 2), np.float32), **raster),
        cover=Raster(values=np.ones((2, 2, 1), np.float32), **raster),
        ground_materials=("plane",),
        trail_material="plane",
        border_material="plane",
    )
    return World(
        name="plane", seed=0, size=size, terrain=terrain, meshes={}, instances=(), materials={}, textures={},
        object_names=("husky", "ground"),
    )  # fmt: skip


def among_trunks(world: World, count: int) -> World:
    """``world`` with cylinders of 30 cm that leave a strip of 4 m along y = 0 free."""
    none = np.zeros((0, 3), np.float32)
    trunk = Mesh(
        name="trunk", vertices=none, normals=none, uv=none[:, :2], faces=np.zeros((0, 3), np.int32),
        material=np.zeros(0, np.int32), materials=(), colliders=(Collider(shape="cylinder", size=(0.15, 3.0)),),
    )  # fmt: skip
    rng, half = np.random.default_rng(0), np.array(world.size) / 2 - 1.0
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, 0, 3] = rng.uniform(-half[0], half[0], count)
    poses[:, 1, 3] = rng.uniform(2.0, half[1], count) * rng.choice([-1, 1], count)
    trunks = tuple(
        Instance(name=f"trunk_{k}", kind="tree", mesh="trunk", object_id=k + 2, world_from_object=pose)
        for k, pose in enumerate(poses)
    )
    return dataclasses.replace(world, meshes={"trunk": trunk}, instances=trunks)


def experiment_on_plane(start: tuple[float, float], *waypoints: tuple[float, float], **values: object) -> Experiment:
    """An experiment along waypoints x, y [m]."""
    route = route_from_metres(start, waypoints)
    return Experiment.model_validate({"name": "plane", "environment": "plane", "route": route, **values})
