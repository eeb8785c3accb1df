# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Files of meshes that trimesh writes, and a plain of 40 m x 20 m in which they stand."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from fieldtruth.core.classes import CLASSES
from fieldtruth.core.geodesy import PAPER_ORIGIN, Origin
from fieldtruth.world.assembly import assemble
from fieldtruth.world.grids import Line, Trail
from fieldtruth.world.model import Heightfield, Raster, Terrain, World, make_mesh
from fieldtruth.world.objects.config import ObjectConfig
from fieldtruth.world.objects.place import stand_objects
from fieldtruth.world.placement import SwarmSpec, WorldBuilder

trimesh: Any = pytest.importorskip("trimesh")
RADIUS, HEIGHT, SIDES = 0.3, 0.9, 32
Y_UP = np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
"""A pose that takes our axes, x forward and z up, to those of glTF, z forward and y up."""


def barrel(path: Path, *, texture: bool = True) -> Path:
    """A barrel in glTF's axes, with blue and white rings as a texture and its base 5 m from the file's origin."""
    body = trimesh.creation.cylinder(radius=RADIUS, height=HEIGHT, sections=SIDES)
    body.apply_translation((5.0, 2.0, 1.0))
    body.apply_transform(Y_UP)
    if texture:
        rings = np.zeros((64, 48, 3), np.uint8)
        rings[:], rings[::8] = (30, 80, 160), (220, 220, 220)
        uv = np.column_stack([np.zeros(len(body.vertices)), body.vertices[:, 1]])
        paint = trimesh.visual.material.PBRMaterial(
            name="blue paint", baseColorTexture=Image.fromarray(rings), roughnessFactor=0.3
        )
        body.visual = trimesh.visual.TextureVisuals(uv=uv, material=paint)
    trimesh.Scene({"barrel": body}).export(path)
    return path


def bales(path: Path) -> Path:
    """A wall of six bales of 1.2 m x 0.5 m x 0.5 m along x, z up: 3.6 m long, 1 m high."""
    boxes = [trimesh.creation.box((1.2, 0.5, 0.5)) for _ in range(6)]
    for k, box in enumerate(boxes):
        box.apply_translation((1.2 * (k % 3), 0.0, 0.5 * (k // 3)))
    trimesh.util.concatenate(boxes).export(path)
    return path


def gate(path: Path) -> Path:
    """Two posts of 0.2 m, 3 m apart along y, and a beam at 2 m to 2.2 m: concave, z up."""
    parts = []
    for size, at in (((0.2, 0.2, 2.0), (0, -1.5, 1)), ((0.2, 0.2, 2.0), (0, 1.5, 1)), ((0.2, 3.2, 0.2), (0, 0, 2.1))):
        box = trimesh.creation.box(size)
        box.apply_translation(at)
        parts.append(box)
    trimesh.util.concatenate(parts).export(path)
    return path


def entry(path: Path, **values: Any) -> ObjectConfig:
    return ObjectConfig.model_validate({"file": str(path), "label": "trash bin", "pose": [0, 0]} | values)


def plain(
    objects: Sequence[ObjectConfig],
    *,
    slope: float = 0.0,
    trails: Sequence[Trail] = (),
    corridors: Sequence[Line] = (),
    swarm: SwarmSpec | None = None,
    seed: int = 0,
    origin: Origin = PAPER_ORIGIN,
) -> World:
    """Soil that rises by ``slope`` along x for x > 0 and is flat elsewhere, without litter."""
    x = -20 + 0.25 * np.arange(161)
    grid: dict[str, float] = {"spacing": 0.25, "x0": -20.0, "y0": -10.0}
    heights = np.repeat(slope * np.maximum(x, 0.0)[:, None], 81, axis=1).astype(np.float32)
    builder = WorldBuilder(Heightfield(heights=heights, **grid), (40.0, 20.0), trails, corridors)
    stand_objects(builder, objects, CLASSES, origin)
    if swarm is not None:
        builder.scatter_swarm(swarm, np.random.default_rng(3))
    nodes = np.stack(np.meshgrid(x, -10 + 0.25 * np.arange(81), indexing="ij"), axis=-1).reshape(-1, 2)
    far = np.minimum(builder.trail_distance(nodes), 100.0).reshape(heights.shape).astype(np.float32)
    terrain = Terrain(
        field=builder.field,
        trail_distance=Raster(values=far, **grid),
        cover=Raster(values=np.ones((161, 81, 1), np.float32), **grid),
        ground_materials=("soil",),
        trail_material="soil",
        border_material="soil",
    )
    corner = np.array([[0, 0, -50], [1, 0, -50], [0, 1, -50]])
    below = make_mesh("backdrop", corner, np.tile((0.0, 0.0, 1.0), (3, 1)), corner[:, :2], [[0, 1, 2]], ("soil",))
    seeds = np.random.SeedSequence(seed)
    return assemble(
        builder, terrain, name="plain", seed=seed, textures=seeds, backdrop=below, objects=objects, origin=origin
    )
