# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Robots that other robots see: their materials and instance ids in a world, and each as a body that moves.

A robot is a box and its wheels, as ``experiment.rig.body_parts`` has them and its own sensors see it, in the same
paint. It is one rigid body: a wheel looks the same however far it has turned.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.rig import Box, Cylinder, Rig, body_parts
from fieldtruth.kernels.robot import ALBEDO, RIM
from fieldtruth.sense.moving import MovingBody
from fieldtruth.sense.robot import METAL, PAINT, REFLECTANCE, RUBBER
from fieldtruth.world.model import Material, Mesh, World, merge_meshes
from fieldtruth.world.solids import make_box, make_lathe, placed

_MATERIALS: Final = {PAINT: "robot_paint", RUBBER: "robot_rubber", METAL: "robot_metal"}
_TEXTURE: Final = "robot"
_GLOSS: Final = 0.2
"""Of paint, dull varnish; rubber and rim are matt."""
_BEVEL: Final = 0.005
"""[m] of the edges of boxes."""
_SIDES: Final = 64
"""Of a wheel: a radius of 0.165 m is short by 0.2 mm between two corners."""


def with_robots(world: World, names: Iterable[str]) -> World:
    """Return a world that knows robots: their materials, and for each an instance id after the last object's.

    The robots themselves are bodies that move, of ``robot_body``; all else is as it was.

    Raises:
        ConfigurationError: an object of the world has the name of a robot.
    """
    names = tuple(names)
    for name in names:
        if name in world.object_names:
            raise ConfigurationError(f"robot {name}: an object of the world {world.name} has this name; choose another")
    materials = {_MATERIALS[row]: _material(row) for row in _MATERIALS}
    white = {_TEXTURE: np.full((1, 1, 3), 255, np.uint8)}
    return replace(
        world,
        materials={**world.materials, **materials},
        textures={**world.textures, **white},
        object_names=(*world.object_names, *names),
    )


def _material(row: int) -> Material:
    red, green, blue = ALBEDO[row].tolist()
    gloss = _GLOSS if row == PAINT else 0.0
    paint = Material(name=_MATERIALS[row], label=Label.ROBOT, texture=_TEXTURE, tint=(red, green, blue), gloss=gloss)
    return replace(paint, reflectance=REFLECTANCE[row])


def robot_body(world: World, name: str, rig: Rig, pose: Callable[[NDArray[np.int64]], Array]) -> MovingBody:
    """Return a robot of a world of ``with_robots``; ``pose`` gives world_from_base as ``MovingBody`` asks for it."""
    return MovingBody(name=name, object_id=world.object_names.index(name), mesh=robot_mesh(name, rig), pose=pose)


def robot_mesh(name: str, rig: Rig) -> Mesh:
    """Return the parts of a robot as triangles in base_link."""
    parts = [mesh for part in body_parts(rig) for mesh in (_box(part) if isinstance(part, Box) else _wheel(part))]
    return merge_meshes(f"robot {name}", parts, footprint=float(np.hypot(*rig.robot.outline[:2])) / 2)


def _box(box: Box) -> list[Mesh]:
    return [placed(make_box(_MATERIALS[PAINT], box.size.tolist(), bevel=_BEVEL), transforms.pose(tuple(box.centre)))]


def _wheel(wheel: Cylinder) -> list[Mesh]:
    radius, rim, half = wheel.radius, RIM * wheel.radius, wheel.width / 2
    tyre = make_lathe(_MATERIALS[RUBBER], [(rim, -half), (radius, -half), (radius, half), (rim, half)], sides=_SIDES)
    hubs = [make_lathe(_MATERIALS[METAL], [(0.0, -half), (rim, -half)], sides=_SIDES)]
    hubs.append(make_lathe(_MATERIALS[METAL], [(rim, half), (0.0, half)], sides=_SIDES))
    base_from_wheel = transforms.pose(tuple(wheel.centre), (90.0, 0.0, 0.0))  # a lathe turns about z, a wheel about y
    return [placed(part, base_from_wheel) for part in (tyre, *hubs)]
