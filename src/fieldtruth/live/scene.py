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
_MOST_BOXES: Final = 3000
_GROUND: Final = (0.45, 0.42, 0.36, 1.0)
_ROBOT: Final = (0.95, 0.75, 0.1, 1.0)


def scene_update(world: World, rig: Rig) -> Any:
    """Return the ``SceneUpdate``."""
    from foxglove import messages as m

    def cube(centre: Array, size: Array, colour: tuple[float, ...], rotation: Array | None = None) -> Any:
        w, x, y, z = (1.0, 0.0, 0.0, 0.0) if rotation is None else quaternion_wxyz_from_rotation(rotation).tolist()
        at = m.Vector3(**dict(zip("xyz", map(float, centre), strict=True)))
        pose = m.Pose(position=at, orientation=m.Quaternion(x=x, y=y, z=z, w=w))
        edges = m.Vector3(**dict(zip("xyz", map(float, size), strict=True)))
        return m.CubePrimitive(pose=pose, size=edges, color=_colour(colour))

    boxes = [cube(*box) for box in _boxes(world)]
    sizes = [
        part.size if isinstance(part, Box) else np.array([2 * part.radius, part.width, 2 * part.radius])
        for part in body_parts(rig)
    ]
    hull = [cube(part.centre, size, _ROBOT) for part, size in zip(body_parts(rig), sizes, strict=True)]
    points, indices = _ground(world)
    ground = m.TriangleListPrimitive(
        pose=m.Pose(position=m.Vector3(), orientation=m.Quaternion(w=1.0)),
        points=[m.Point3(x=x, y=y, z=z) for x, y, z in points.tolist()],
        indices=indices.tolist(),
        color=_colour(_GROUND),
    )
    return m.SceneUpdate(
        entities=[
            m.SceneEntity(id="ground", frame_id=WORLD, triangles=[ground]),
            m.SceneEntity(id="objects", frame_id=WORLD, cubes=boxes),
            m.SceneEntity(id="robot", frame_id=BASE, frame_locked=True, cubes=hull),
        ]
    )


def _colour(rgba: tuple[float, ...]) -> Any:
    from foxglove.messages import Color

    return Color(**dict(zip("rgba", rgba, strict=True)))


def _boxes(world: World) -> list[tuple[Array, Array, tuple[float, ...], Array]]:
    """Return centre, size, colour and rotation of the box around each object, of the largest if there are many."""
    found = []
    for instance in world.instances:
        mesh = world.meshes[instance.mesh]
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        scale = float(np.cbrt(np.linalg.det(instance.world_from_object[:3, :3])))
        centre = instance.world_from_object @ np.append((low + high) / 2, 1.0)
        label = world.materials[mesh.materials[int(np.bincount(mesh.material).argmax())]].label
        rgb = world.classes[label].rgb or (128, 128, 128)
        colour = (*(value / 255 for value in rgb), 0.6)
        found.append((centre[:3], (high - low) * scale, colour, instance.world_from_object[:3, :3] / scale))
    return sorted(found, key=lambda box: -float(np.prod(box[1])))[:_MOST_BOXES]


def _ground(world: World) -> tuple[Array, Any]:
    """Return points (n, 3) [m] of a grid on the ground, and the indices (3 m,) of its triangles."""
    spacing = max(world.size) / _CELLS
    nx, ny = (int(length / spacing) + 1 for length in world.size)
    x, y = np.meshgrid(*((np.arange(n) - (n - 1) / 2) * spacing for n in (nx, ny)), indexing="ij")
    points = np.stack([x, y, world.terrain.field.height_at(x, y)], axis=-1).reshape(-1, 3)
    corner = (np.arange(nx - 1)[:, None] * ny + np.arange(ny - 1)).ravel()
    faces = np.stack([corner, corner + ny, corner + ny + 1, corner, corner + ny + 1, corner + 1], axis=-1)
    return points, faces.ravel()
