# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The world and the robot as a scene of Foxglove: the ground as a grid, objects as boxes in their class's colour."""

from typing import Any, Final

import numpy as np

from fieldtruth.bag.messages import WORLD
from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import quaternion_wxyz_from_rotation
from fieldtruth.experiment.rig import Box, Rig, body_parts
from fieldtruth.experiment.sensor_config import BASE
from fieldtruth.world.model import World

_CELLS: Final = 150
"""Cells of the ground along the longer side of the world."""
_GROUND: Final = (0.45, 0.42, 0.36, 1.0)
_ROBOT: Final = (0.95, 0.75, 0.1, 1.0)


def scene_update(world: World, rig: Rig) -> Any:
    """Return the ``SceneUpdate``."""
    from foxglove import messages as m

    def colour(rgba: tuple[float, ...]) -> Any:
        return m.Color(**dict(zip("rgba", rgba, strict=True)))

    def vector(kind: Any, xyz: Array) -> Any:
        return kind(**dict(zip("xyz", map(float, xyz), strict=True)))

    def cube(centre: Array, size: Array, rotation: Array, rgba: tuple[float, ...]) -> Any:
        orientation = m.Quaternion(**dict(zip("wxyz", quaternion_wxyz_from_rotation(rotation).tolist(), strict=True)))
        pose = m.Pose(position=vector(m.Vector3, centre), orientation=orientation)
        return m.CubePrimitive(pose=pose, size=vector(m.Vector3, size), color=colour(rgba))

    hull = []
    for part in body_parts(rig):
        size = part.size if isinstance(part, Box) else np.array([2 * part.radius, part.width, 2 * part.radius])
        hull.append(cube(part.centre, size, np.eye(3), _ROBOT))
    points, faces = _ground(world)
    pose = m.Pose(position=m.Vector3(), orientation=m.Quaternion(w=1.0))
    corners = [vector(m.Point3, point) for point in points]
    ground = m.TriangleListPrimitive(pose=pose, points=corners, indices=faces.tolist(), color=colour(_GROUND))
    return m.SceneUpdate(
        entities=[
            m.SceneEntity(id="ground", frame_id=WORLD, triangles=[ground]),
            m.SceneEntity(id="objects", frame_id=WORLD, cubes=[cube(*box) for box in _boxes(world)]),
            m.SceneEntity(id="robot", frame_id=BASE, frame_locked=True, cubes=hull),
        ]
    )


def _boxes(world: World) -> list[tuple[Array, Array, Array, tuple[float, ...]]]:
    """Return centre, size, rotation and colour of the box around each object."""
    found = []
    for instance in world.instances:
        mesh, pose = world.meshes[instance.mesh], instance.world_from_object
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        scale = float(np.cbrt(np.linalg.det(pose[:3, :3])))
        label = world.materials[mesh.materials[int(np.bincount(mesh.material).argmax())]].label
        colour = (*(value / 255 for value in world.classes[label].rgb or (128, 128, 128)), 0.6)
        centre = (pose @ np.append((low + high) / 2, 1.0))[:3]
        found.append((centre, (high - low) * scale, pose[:3, :3] / scale, colour))
    return found


def _ground(world: World) -> tuple[Array, Any]:
    """Return points (n, 3) [m] of a grid on the ground, and the indices (3 m,) of its triangles."""
    spacing = max(world.size) / _CELLS
    nx, ny = (int(length / spacing) + 1 for length in world.size)
    x, y = np.meshgrid(*((np.arange(n) - (n - 1) / 2) * spacing for n in (nx, ny)), indexing="ij")
    points = np.stack([x, y, world.terrain.field.height_at(x, y)], axis=-1).reshape(-1, 3)
    corner = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    faces = np.stack([corner, corner + ny, corner + ny + 1, corner, corner + ny + 1, corner + 1], axis=-1)
    return points, faces.ravel()
