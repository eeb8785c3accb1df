# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Heights of a map against vertical rays of the second tracer, which knows nothing of columns of cells."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.core.classes import GROUND_ID, Label
from fieldtruth.validation.tracer import TERRAIN, ReferenceTracer
from fieldtruth.world.model import LOOSE, Material, Mesh, World
from fieldtruth.world_maps.bodies import GROUNDS, PLANTS
from fieldtruth.world_maps.layers import Grid

HEIGHTS: Final = ("ground", "hard_ground", "plant_top", "overhang")
"""Layers that rays find; each needs its class, all but the ground their instance ids."""
TOLERANCE: Final = 1e-3
"""Difference [m] between a height and that of a ray that counts as wrong."""
_SURE: Final = 1e-4  # [m] from an edge at which a ray cannot miss a triangle
_ABOVE: Final = 100.0  # [m] above the ground from which rays go down
_FAR: Final = 1000.0  # [m]
Keep = Callable[[Material, Mesh], bool]


def _is_stone(material: Material, mesh: Mesh) -> bool:
    return material.label in GROUNDS and not material.translucency and not mesh.passable


def _is_plant(material: Material, mesh: Mesh) -> bool:
    return material.label in PLANTS


def _is_body(material: Material, mesh: Mesh) -> bool:
    foliage = material.translucency > 0 or material.label in (Label.TREETOP, Label.HIGH_GRASS, Label.WATER)
    return not foliage and not mesh.passable


def _only(world: World, keep: Keep, low: Array, high: Array, *, ground: bool) -> World:
    """The faces of some materials near a rectangle, and the bare ground or none."""
    meshes, reach = {}, {}
    for name, mesh in world.meshes.items():
        own = np.array([keep(world.materials[m], mesh) for m in mesh.materials], np.bool_)[mesh.material]
        bare = replace(mesh, part=None, limb=None, joints=None)
        meshes[name] = replace(bare, faces=mesh.faces[own], material=mesh.material[own])
        reach[name] = float(np.linalg.norm(mesh.vertices, axis=1).max(initial=0.0)) if own.any() else -np.inf

    def is_near(name: str, pose: Array) -> bool:
        far = reach[name] * float(np.cbrt(np.linalg.det(pose[:3, :3])))
        return bool(((pose[:2, 3] >= low - far) & (pose[:2, 3] <= high + far)).all())

    swarms = []
    for swarm in (each for each in world.swarms if each.kind not in LOOSE):
        poses = swarm.world_from_object
        scale = np.linalg.norm(poses[:, :3, 0], axis=1)
        far = (np.array([reach[name] for name in swarm.meshes])[swarm.mesh] * scale)[:, None]
        kept = ((poses[:, :2, 3] >= low - far) & (poses[:, :2, 3] <= high + far)).all(axis=1)
        swarms.append(replace(swarm, mesh=swarm.mesh[kept], world_from_object=poses[kept], tint=swarm.tint[kept]))
    return replace(
        world,
        meshes=meshes,
        instances=tuple(each for each in world.instances if is_near(each.mesh, each.world_from_object)),
        swarms=tuple(swarms),
        terrain=replace(world.terrain, layer=None, visible=ground),
        backdrop=None,
    )


class VerticalRays:
    """Vertical rays from points (n, 3) [m]: heights of what they meet.

    A ray that passes within 0.1 mm of an edge may hit the triangle or miss it: it goes on to the next one that it hits
    for sure. ``height`` (n,) is that of the first hit, NaN without.
    """

    def __init__(self, world: World, keep: Keep, start: Array, *, up: bool = False, ground: bool = True) -> None:
        part = _only(world, keep, start[:, :2].min(axis=0), start[:, :2].max(axis=0), ground=ground)
        sign, self._count = (1.0 if up else -1.0), len(start)
        ahead, far = np.tile([0.0, 0.0, sign], (len(start), 1)), np.full(len(start), _FAR)
        hits = ReferenceTracer(part).hits(start, ahead, far)
        end = np.full(len(start), np.inf)
        sure = hits.margin > _SURE
        np.minimum.at(end, hits.ray[sure], hits.range_m[sure])
        self._may_miss = np.isinf(end)
        near = hits.range_m <= end[hits.ray]
        self._ray, self._z = hits.ray[near], start[hits.ray[near], 2] + sign * hits.range_m[near]
        self._label, self._instance = hits.label[near], hits.instance[near]
        self.height = np.full(len(start), np.nan)
        rays, first = np.unique(self._ray, return_index=True)
        self.height[rays] = self._z[first]
        self.lowest = np.full(len(start), np.inf)
        np.minimum.at(self.lowest, self._ray, self._z)

    def differ(self, heights: NDArray[Any], label: NDArray[np.uint8], instance: NDArray[np.uint32]) -> Mask:
        """Rays (n,) that meet nothing of a class and instance within 1 mm of a height; if NaN, nothing for sure."""
        near = np.abs(heights[self._ray].astype(np.float64) - self._z) <= TOLERANCE
        near &= instance[self._ray] == self._instance
        near &= (self._label == label[self._ray]) | (self._label == TERRAIN)
        met = np.bincount(self._ray[near], minlength=self._count) > 0
        return np.where(np.isnan(heights), ~self._may_miss, ~met)


def wrong_heights(
    world: World, grid: Grid, made: Mapping[str, NDArray[Any]], cells: Index
) -> dict[str, tuple[VerticalRays, Mask]]:
    """Return the rays through the middles of cells (n, 2), and which of these are wrong, by each of ``HEIGHTS``."""
    cells = cells[np.lexsort(tuple((cells // 16).T[::-1]))]  # 32 neighbours at once are faster
    i, j = cells.T
    x, y = grid.middles(*(slice(0, n) for n in grid.shape))
    own = {name: values[i, j] for name, values in made.items()}
    top = np.column_stack([x[i], y[j], np.full(len(i), float(own["ground"].max()) + _ABOVE)])
    level = np.column_stack([top[:, :2], own["hard_ground"].astype(np.float64) + TOLERANCE])
    rays = {
        "ground": VerticalRays(world, lambda *_: False, top),
        "hard_ground": VerticalRays(world, _is_stone, top),
        "plant_top": VerticalRays(world, _is_plant, top, ground=False),
        "overhang": VerticalRays(world, _is_body, level, up=True, ground=False),
    }
    own["ground_instance"] = np.full(len(i), GROUND_ID, np.uint32)
    wrong = {name: each.differ(*(own[name + k] for k in ("", "_class", "_instance"))) for name, each in rays.items()}
    wrong["hard_ground"] &= own["hard_ground_class"] != Label.TRUNK  # roots
    wrong["plant_top"] &= ~(np.isnan(own["plant_top"]) & (rays["plant_top"].lowest <= own["ground"]))  # roots of herbs
    wrong["overhang"] &= own["overhang"] != own["hard_ground"]  # inside a body
    return {name: (each, wrong[name]) for name, each in rays.items()}
