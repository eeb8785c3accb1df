# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export voxels ahead of the sensor of clouds, in the form of SemanticKITTI's semantic scene completion.

Files of a cloud have the number that it has in ``semantickitti``. All are x-major, and bits begin with the highest of a
byte. ``.bin``: voxels with a point of the cloud. ``.label``: class of each voxel that a surface of the world touches, 0
where it is free. ``.invalid``: free ones below the bare ground or beyond the world, where no truth is. ``.occluded``:
those without a point that ``.bin`` hides from the sensor.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.run import Run
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import Label
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import first_of_clouds
from fieldtruth.exporters.occupancy import bits_of, voxel_meshes
from fieldtruth.kernels.counting import VoxelMeshes, mark_meshes
from fieldtruth.kernels.walks import hide_voxels
from fieldtruth.local_maps import world_of_run
from fieldtruth.sense.scene import terrain_nodes
from fieldtruth.world.model import World

SHAPE: Final = (256, 256, 32)
VOXEL_M: Final = 0.2
FIRST: Final = np.array([0.0, -25.6, -2.0])
"""Lower corner [m] of the first voxel, in the sensor's frame."""
_LEAST: Final = (Label.GROUND, Label.TRAIL, Label.HIGH_GRASS, Label.TREETOP, Label.BUSH)
"""Classes that a voxel has only if it has no other, the first one least of all; trunk and branch comes before any."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write ``sequences/NN/voxels/NUMBER.bin``, ``.label``, ``.invalid`` and ``.occluded`` for each cloud.

    Raises:
        BagError: a run has no clouds, true poses or known world, or is damaged.
    """
    for number, run in enumerate(runs):
        _write_voxels(run, target / "sequences" / f"{number:02d}" / "voxels", options)


def _write_voxels(run: Run, folder: Path, options: Options) -> None:
    source = first_of_clouds(run)
    clouds, base_from_sensor = run.readings(source.name, labelled=False), run.calibration.base_from(source.name)
    with options.progress.stage("build the world"):
        volumes = Volumes(world_of_run(run))
    folder.mkdir(parents=True)

    def save(row: int) -> None:
        cloud = clouds.read(row)
        pose = run.trajectory.world_from_base(cloud.stamp_ns) @ base_from_sensor
        label, hit = volumes.labels(pose), points_in(cloud.xyz.astype(np.float64))
        hidden = np.zeros(SHAPE, np.uint8)
        hide_voxels(hit, FIRST, VOXEL_M, hidden)
        masks = {"bin": hit, "invalid": volumes.unknown(pose) & (label == 0), "occluded": hidden & (hit == 0)}
        for name, mask in masks.items():
            np.packbits(mask.reshape(-1)).tofile(folder / f"{row:06d}.{name}")
        options.labels.ids[label].astype("<u2").tofile(folder / f"{row:06d}.label")

    list(options.each(f"{run.name}: voxels", run, range(len(clouds)), save))


def points_in(xyz: Array) -> NDArray[np.uint8]:
    """Return 1 for the voxels that hold points (n, 3) [m] of the sensor's frame."""
    cells = np.floor((xyz - FIRST) / VOXEL_M).astype(np.int64)
    inside = ((cells >= 0) & (cells < SHAPE)).all(axis=1)
    found = np.zeros(SHAPE, np.uint8)
    found[tuple(cells[inside].T)] = 1
    return found


class Volumes:
    """The voxels ahead of a sensor in a world. Threads may share it."""

    def __init__(self, world: World) -> None:
        self._world, self._meshes, self._bits = world, voxel_meshes(world), bits_of(world)
        others = sorted({*self._bits} - {*_LEAST, int(Label.TRUNK)})
        self._order = [*_LEAST, *others, Label.TRUNK]

    def labels(self, world_from_sensor: Array) -> NDArray[np.uint8]:
        """Return the class ids of the voxels, 0 where no surface is."""
        marked = np.zeros(SHAPE, np.uint32)
        sensor_from_world = transforms.inverse(world_from_sensor)
        box = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * SHAPE * VOXEL_M + FIRST
        corners = transforms.transform(world_from_sensor, box)
        low, high = corners.min(axis=0), corners.max(axis=0)
        near = np.flatnonzero(((self._meshes.low <= high) & (self._meshes.high >= low)).all(axis=1))
        poses = np.ascontiguousarray(sensor_from_world @ self._meshes.pose[near])
        objects = self._meshes._replace(mesh=self._meshes.mesh[near], pose=poses)
        for meshes in (objects, self._ground(low, high, sensor_from_world)):
            mark_meshes(meshes, np.arange(len(meshes.mesh)), FIRST, VOXEL_M, marked)
        found = np.zeros(SHAPE, np.uint8)
        for label in self._order:
            found[marked & np.uint32(1 << self._bits[label]) != 0] = label
        return found

    def unknown(self, world_from_sensor: Array) -> Mask:
        """Return which voxels have their middle below the bare ground or beyond the world."""
        middles = np.stack(np.meshgrid(*(np.arange(n) + 0.5 for n in SHAPE), indexing="ij"), axis=-1) * VOXEL_M + FIRST
        x, y, z = np.moveaxis(transforms.transform(world_from_sensor, middles), -1, 0)
        length, width = self._world.size
        beyond: Mask = (np.abs(x) > length / 2) | (np.abs(y) > width / 2)
        below: Mask = z < self._world.terrain.field.height_at(x, y)
        return beyond | below

    def _ground(self, low: Array, high: Array, sensor_from_world: Array) -> VoxelMeshes:
        """Return the triangles of the ground above a rectangle, in the sensor's frame."""
        terrain = self._world.terrain
        nodes = terrain_nodes(terrain.surface)
        spacing = float(nodes[1, 0, 0] - nodes[0, 0, 0])
        i, j = (
            slice(*np.clip([(a - s) // spacing, (b - s) // spacing + 2], 0, n).astype(int))
            for a, b, s, n in zip(low[:2], high[:2], nodes[0, 0, :2], nodes.shape[:2], strict=True)
        )
        nodes = nodes[i, j] if terrain.visible else nodes[:0, :0]
        row = np.arange(nodes.shape[0] * nodes.shape[1]).reshape(nodes.shape[:2])
        a, b, c, d = (each.ravel() for each in (row[:-1, :-1], row[1:, :-1], row[:-1, 1:], row[1:, 1:]))
        faces = np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, c, d], axis=1)])
        vertices = np.ascontiguousarray(nodes.reshape(-1, 3), np.float32)
        middle = (nodes[:-1, :-1, :2] + nodes[1:, 1:, :2]) / 2
        label = terrain.label_at(middle[..., 0], middle[..., 1]).ravel().astype(np.uint32)
        bits = np.tile(np.uint32(1) << label, 2)
        poses, one = sensor_from_world[None], np.zeros(1, np.int64)
        return VoxelMeshes(vertices, faces, bits, np.array([0, len(faces)]), one, poses, low[None], high[None])
