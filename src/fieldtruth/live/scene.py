# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The world and the robot for viewers: the ground as a grid, objects as boxes in their class's colour."""

from typing import Any, Final, NamedTuple

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
_OPAQUE: Final = 0.6
_GREY: Final = (128, 128, 128)


class ObjectBox(NamedTuple):
    """The box around an object."""

    centre: Array  # (3,) [m]
    size: Array  # (3,) [m]
    quaternion_wxyz: Array
    label: int
    rgb: tuple[int, int, int]


def scene_update(world: World, rig: Rig) -> Any:
    """Return the ``SceneUpdate`` of Foxglove."""
    from foxglove import messages as m

    def colour(rgba: tuple[float, ...]) -> Any:
        return m.Color(**dict(zip("rgba", rgba, strict=True)))

    def vector(kind: Any, xyz: Array) -> Any:
        return kind(**dict(zip("xyz", map(float, xyz), strict=True)))

    def cube(centre: Array, size: Array, quaternion_wxyz: Array, rgba: tuple[float, ...]) -> Any:
        orientation = m.Quaternion(**dict(zip("wxyz", map(float, quaternion_wxyz), strict=True)))
        pose = m.Pose(position=vector(m.Vector3, centre), orientation=orientation)
        return m.CubePrimitive(pose=pose, size=vector(m.Vector3, size), color=colour(rgba))

    hull = [cube(centre, size, np.array([1.0, 0.0, 0.0, 0.0]), _ROBOT) for centre, size in hull_boxes(rig)]
    boxes = [cube(*box[:3], (*(value / 255 for value in box.rgb), _OPAQUE)) for box in object_boxes(world)]
    points, triangles = ground_triangles(world)
    pose = m.Pose(position=m.Vector3(), orientation=m.Quaternion(w=1.0))
    corners = [vector(m.Point3, point) for point in points]
    ground = m.TriangleListPrimitive(
        pose=pose, points=corners, indices=triangles.ravel().tolist(), color=colour(_GROUND)
    )
    return m.SceneUpdate(
        entities=[
            m.SceneEntity(id="ground", frame_id=WORLD, triangles=[ground]),
            m.SceneEntity(id="objects", frame_id=WORLD, cubes=boxes),
            m.SceneEntity(id="robot", frame_id=BASE, frame_locked=True, cubes=hull),
        ]
    )


def hull_boxes(rig: Rig) -> list[tuple[Array, Array]]:
    """Return centre and size [m] of the boxes around the robot's parts, in base_link."""
    boxes = (part if isinstance(part, Box) else part.box for part in body_parts(rig))
    return [(box.centre, box.size) for box in boxes]


def object_boxes(world: World) -> list[ObjectBox]:
    """Return the box around each object."""
    found = []
    for instance in world.instances:
        mesh, pose = world.meshes[instance.mesh], instance.world_from_object
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        scale = float(np.cbrt(np.linalg.det(pose[:3, :3])))
        label = world.materials[mesh.materials[int(np.bincount(mesh.material).argmax())]].label
        centre = (pose @ np.append((low + high) / 2, 1.0))[:3]
        turn = quaternion_wxyz_from_rotation(pose[:3, :3] / scale)
        found.append(ObjectBox(centre, (high - low) * scale, turn, int(label), world.classes[label].rgb or _GREY))
    return found


def ground_triangles(world: World) -> tuple[Array, Any]:
    """Return points (n, 3) [m] of a grid on the ground, and its triangles (m, 3)."""
    spacing = max(world.size) / _CELLS
    nx, ny = (int(length / spacing) + 1 for length in world.size)
    x, y = np.meshgrid(*((np.arange(n) - (n - 1) / 2) * spacing for n in (nx, ny)), indexing="ij")
    points = np.stack([x, y, world.terrain.field.height_at(x, y)], axis=-1).reshape(-1, 3)
    corner = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    faces = np.stack([corner, corner + ny, corner + ny + 1, corner, corner + ny + 1, corner + 1], axis=-1)
    return points, faces.reshape(-1, 3)
