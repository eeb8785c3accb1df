# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Limbs of trees that move on their own: which faces are one group, and where a group is attached to the trunk.

Limbs that leave the trunk at about one height and on one side are a group; what grows on them, leaves included, is
rigid with them. A group's foot is the mean of its joints on the trunk's axis. A joint above or below the foot slides in
the wood, by the angle times that distance at most: groups are flat, so this is seldom more than the trunk's radius.
"""

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.sense.leaning import WHOLE, Plants, bunches_of
from fieldtruth.world.model import Mesh, World

STEM: Final = -2
"""Number of what remains of a tree without the limbs that move on their own."""
LEVELS: Final = 4
"""Parts of a crown's height, each with two groups of limbs, one on either side."""
LEAST: Final = 2.5
"""Height [m] from which on limbs of a tree move on their own."""


class Limbs(NamedTuple):
    """Groups (g,) of a mesh's limbs, in its frame."""

    group: Index
    """(f,) Of each face; STEM of the trunk's."""
    foot: Array
    """(g, 3) [m]"""
    reach: Array
    """(g,) [m] from the foot to the farthest corner."""
    middle: Array
    """(g, 3) [m] Mean of the corners, from the foot."""


def limbs_of(mesh: Mesh) -> Limbs | None:
    """Return the groups of limbs of a mesh; None if it has none, or nothing beside them."""
    if mesh.limb is None or mesh.joints is None or mesh.limb.max(initial=-1) < 0 or mesh.limb.min() >= 0:
        return None
    wood = mesh.limb < 0
    number, limb = np.unique(mesh.limb[~wood], return_inverse=True)
    joint, corners = mesh.joints[number].astype(np.float64), mesh.vertices.astype(np.float64)[mesh.faces[~wood]]
    away = _means(corners.mean(axis=1), limb) - joint
    low, high = joint[:, 2].min(), joint[:, 2].max()
    level = np.minimum(LEVELS * (joint[:, 2] - low) / max(high - low, 1e-9), LEVELS - 1).astype(np.intp)
    # Neighbours above each other are not split in one plane.
    side = np.floor((np.arctan2(away[:, 1], away[:, 0]) / np.pi + 0.5 * level) % 2.0)
    _, group = np.unique(2 * level + side, return_inverse=True)
    foot, own = _means(joint, group), group[limb]
    reach = np.zeros(len(foot))
    np.maximum.at(reach, own, np.linalg.norm(corners - foot[own][:, None], axis=-1).max(axis=1))
    faces = np.full(len(mesh.faces), STEM, np.intp)
    faces[~wood] = own
    return Limbs(faces, foot, reach, _means(corners.mean(axis=1), own) - foot)


def _means(points: Array, group: Index) -> Array:
    """Mean (g, 3) of the points (n, 3) of each group."""
    count = np.maximum(np.bincount(group), 1)
    return np.stack([np.bincount(group, points[:, k]) / count for k in range(3)], axis=-1)


@lru_cache(maxsize=8)  # the pieces of a plant are asked for one after another
def pieces_of(mesh: Mesh) -> Index:
    """Return the group of limbs, or the bunch, of each face (f,) of a mesh, as ``Plants.bunch`` counts them."""
    limbs = limbs_of(mesh)
    return bunches_of(mesh) if limbs is None else limbs.group


def faces_of_piece(mesh: Mesh, piece: int) -> Mask:
    """Return which faces (f,) of a mesh are those of a number in ``Plants.bunch``."""
    return np.full(len(mesh.faces), True) if piece == WHOLE else pieces_of(mesh) == piece


def with_limbs(world: World, plants: Plants) -> Plants:
    """Return plants with further rows, at the end, for the limbs of trees inside the world."""
    known = {name: limbs_of(world.meshes[name]) for name in np.unique(plants.mesh).tolist()}
    near = (np.abs(plants.world_from_object[:, :2, 3]) <= np.array(world.size) / 2.0).all(axis=1)
    high = np.flatnonzero(near & (plants.height >= LEAST))
    found = [(row, limbs) for row in high.tolist() if (limbs := known[str(plants.mesh[row])]) is not None]
    if not found:
        return plants
    tree = np.array([row for row, _ in found])
    row = tree.repeat([len(limbs.foot) for _, limbs in found])
    foot, reach, middle = (np.concatenate([limbs[k] for _, limbs in found]) for k in (1, 2, 3))
    number = np.concatenate([np.arange(len(limbs.foot)) for _, limbs in found])
    pose, bunch = plants.world_from_object[row], plants.bunch.copy()
    bunch[tree] = STEM
    ahead = np.einsum("nij,nj->ni", pose[:, :3, :3], middle)
    further = plants._replace(
        **{key: value[row] for key, value in plants._asdict().items()}  # what a limb has in common with its tree
    )._replace(
        bunch=number,
        foot=np.einsum("nij,nj->ni", pose[:, :3, :3], foot) + pose[:, :3, 3],
        height=reach * np.linalg.norm(pose[:, :3, 2], axis=1),
        parent=row,
        ahead=ahead / np.linalg.norm(ahead, axis=1, keepdims=True),
    )
    own = plants._replace(bunch=bunch)
    return Plants._make(np.concatenate(both) for both in zip(own, further, strict=True))
