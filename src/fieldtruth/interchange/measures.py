# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Measures of objects for an inventory, taken from their meshes: height, trunk, crown, leaf area, volume."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.world.model import Material, Mesh

BREAST_HEIGHT: Final = 1.3
"""Height above the ground [m] at which the diameter of a trunk is measured, as foresters do."""
TRUNK_WITHIN: Final = 0.8
"""Distance [m] from a tree's position within which a section of wood belongs to the trunk and not to a branch.

The middle of a crooked oak's trunk is up to 0.7 m aside at breast height."""


@dataclass(frozen=True, kw_only=True)
class Measures:
    """Measures of a mesh in its own frame, at scale 1."""

    corners: Array  # (n, 3) corners of its convex hull [m]
    length: float  # [m] along x
    width: float  # [m] along y
    classes: tuple[str, ...]  # the class of the largest area first
    wood: Array  # (t, 3, 3) triangles of trunk and branches [m]
    leaf_corners: Array | None = None  # (n, 3) corners of the convex hull of its leaves [m]
    leaf_area: float = np.nan  # [m2]
    crown_diameter: float = np.nan  # [m]
    volume: float = np.nan  # [m3]


def measure(mesh: Mesh, materials: Mapping[str, Material]) -> Measures:
    """Measure a mesh; what it lacks is NaN.

    Leaves are the surfaces that transmit light, blades and petals among them. They are single layers of triangles, so
    the sum of the triangles is the area of one side. The crown's diameter is that of the circle with the area of the
    leaves' convex hull, seen from above. The volume is that of a rock, with its part below the soil.
    """
    triangles = mesh.vertices.astype(np.float64)[mesh.faces]
    edges = np.diff(triangles, axis=1)
    area = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    used = [materials[name] for name in mesh.materials]
    label = np.array([material.label for material in used], np.intp)[mesh.material]
    leafy = np.array([material.translucency > 0 for material in used])[mesh.material]
    by_class = np.bincount(label, area, len(CLASSES))
    present = sorted(np.unique(label), key=lambda k: -by_class[k])
    length, width, _ = np.ptp(triangles.reshape(-1, 3), axis=0)
    leaf_corners = hull_corners(triangles[leafy].reshape(-1, 3)) if leafy.any() else None
    return Measures(
        corners=hull_corners(triangles.reshape(-1, 3)),
        length=float(length),
        width=float(width),
        classes=tuple(CLASSES[k].name for k in present),
        wood=triangles[label == Label.TRUNK],
        leaf_corners=leaf_corners,
        leaf_area=float(area[leafy].sum()) if leafy.any() else np.nan,
        crown_diameter=np.nan if leaf_corners is None else circle_diameter(_area_from_above(leaf_corners)),
        volume=float(np.linalg.det(triangles).sum()) / 6 if present == [Label.ROCK] else np.nan,
    )


def hull_corners(points: Array) -> Array:
    """Corners (n, 3) of the convex hull of points (m, 3); of a flat or straight set, all different points."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return np.unique(points, axis=0)


def circle_diameter(area: float) -> float:
    """Diameter [m] of the circle with this area [m2]."""
    return float(2 * np.sqrt(area / np.pi))


def _area_from_above(points: Array) -> float:
    """Area [m2] of the convex hull of points (m, 3), projected along z."""
    try:
        return float(ConvexHull(points[:, :2]).volume)
    except QhullError:
        return 0.0


def moved(world_from_object: Array, points: Array) -> Array:
    """Points (..., 3) of an object's frame in the world.

    Without a matrix product, which rounds equal points in different rows differently: seams would open.
    """
    x, y, z = np.moveaxis(points, -1, 0)[..., None]
    return np.asarray(sum(c * world_from_object[:3, k] for k, c in enumerate((x, y, z))) + world_from_object[:3, 3])


def trunk_diameter(wood: Array, height: float, xy: Array) -> float:
    """Diameter [m] of the circle with the area of a trunk's section at a height; NaN if there is no trunk.

    Args:
        wood: triangles (t, 3, 3) [m] in the world, outwards counter-clockwise.
        height: of the section in the world [m].
        xy: position [m] of the tree (2,). Of all closed sections within ``TRUNK_WITHIN`` of it, the largest counts.
    """
    count = (wood[..., 2] > height).sum(axis=1)
    cut, count = wood[(count > 0) & (count < 3)], count[(count > 0) & (count < 3)]
    if not len(cut):
        return np.nan
    # The corner that is alone on its side of the plane, then the others in the triangle's order.
    above = cut[..., 2] > height
    alone = np.argmax(above == (count == 1)[:, None], axis=1)
    rows = np.arange(len(cut))
    first, second, third = (cut[rows, (alone + k) % 3] for k in range(3))
    ends = np.stack([_crossing(first, second, height), _crossing(first, third, height)], axis=1)
    ends[count == 2] = ends[count == 2, ::-1]
    _, node = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    a, b = node.reshape(-1, 2).T
    nodes = int(node.max()) + 1
    _, part_of_node = connected_components(coo_array((np.ones(len(a)), (a, b)), shape=(nodes, nodes)), directed=False)
    part = part_of_node[a]
    (ax, ay), (bx, by) = (ends - xy).transpose(1, 2, 0)
    area = np.abs(np.bincount(part, 0.5 * (ax * by - ay * bx)))
    share = 1 / np.bincount(part)
    middle = np.hypot(np.bincount(part, ax) * share, np.bincount(part, ay) * share)
    is_open = np.bincount(part_of_node, np.bincount(node.ravel()) % 2) > 0  # the open end of a branch's tube
    near = area[(middle < TRUNK_WITHIN) & ~is_open]
    return circle_diameter(float(near.max())) if len(near) else np.nan


def _crossing(one: Array, other: Array, height: float) -> Array:
    """Points (n, 2) where edges cross a height, computed from the lower end, so that neighbours agree exactly."""
    swap = (one[:, 2] > other[:, 2])[:, None]
    low, high = np.where(swap, other, one), np.where(swap, one, other)
    share = (height - low[:, 2]) / (high[:, 2] - low[:, 2])
    return np.asarray(low[:, :2] + share[:, None] * (high[:, :2] - low[:, :2]))
