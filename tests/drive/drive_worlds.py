# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Small worlds to drive in: a heightfield from a function of x and y, with boxes and cylinders as obstacles."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.core.geodesy import geodetic_from_world
from fieldtruth.drive.controller import DriveMonitor, WaypointFollower
from fieldtruth.drive.simulate import SimulatedRobot
from fieldtruth.drive.surroundings import WheelSoil
from fieldtruth.experiment.config import Experiment, RouteConfig, geodetic_route
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Collider, Heightfield, Instance, Material, Mesh, Raster, Swarm, Terrain, World

F8 = NDArray[np.float64]
HeightFunction = Callable[[F8, F8], F8]


def flat(x: F8, y: F8) -> F8:
    return np.zeros_like(x + y)


def make_field(
    height: HeightFunction = flat, size: tuple[float, float] = (40.0, 20.0), spacing: float = 0.2
) -> Heightfield:
    nx, ny = (round(s / spacing) + 1 for s in size)
    x0, y0 = -size[0] / 2, -size[1] / 2
    x, y = np.meshgrid(x0 + spacing * np.arange(nx), y0 + spacing * np.arange(ny), indexing="ij")
    return Heightfield(heights=height(x, y).astype(np.float32), spacing=spacing, x0=x0, y0=y0)


def make_world(
    height: HeightFunction = flat,
    *,
    size: tuple[float, float] = (40.0, 20.0),
    spacing: float = 0.2,
    obstacles: Sequence[tuple[str, Collider, F8]] = (),
    water_level: float | None = None,
    ground_type: str = "",
) -> World:
    """``obstacles`` are name, collider and world_from_object; all ground is of ``ground_type``."""
    field = make_field(height, size, spacing)
    grid = Raster(values=np.ones((2, 2), np.float32), spacing=100.0, x0=-50.0, y0=-50.0)
    empty = np.zeros((0, 3), np.float32)
    meshes = {
        name: Mesh(
            name=name,
            vertices=empty,
            normals=empty,
            uv=empty[:, :2],
            faces=np.zeros((0, 3), np.int32),
            material=np.zeros(0, np.int32),
            materials=(),
            colliders=(collider,),
        )
        for name, collider, _ in obstacles
    }
    instances = tuple(
        Instance(name=name, kind="obstacle", mesh=name, object_id=k + 2, world_from_object=world_from_object)
        for k, (name, _, world_from_object) in enumerate(obstacles)
    )
    return World(
        name="test",
        seed=0,
        size=size,
        terrain=Terrain(
            field=field,
            trail_distance=grid,
            cover=Raster(values=np.ones((2, 2, 1), np.float32), spacing=100.0, x0=-50.0, y0=-50.0),
            ground_materials=("soil",),
            trail_material="soil",
            border_material="soil",
        ),
        meshes=meshes,
        instances=instances,
        materials={"soil": Material(name="soil", label=Label.GROUND, texture="soil", ground_type=ground_type)},
        textures={},
        water_level=water_level,
    )


def with_stones(world: World, stones: Sequence[Mesh], rows: Sequence[int], poses: F8) -> World:
    """``world`` with a swarm "stones" of ``stones[rows[k]]`` at ``poses`` (n, 4, 4)."""
    swarm = Swarm(
        name="stones",
        kind="rock",
        object_id=len(world.instances) + 2,
        meshes=tuple(stone.name for stone in stones),
        mesh=np.array(rows, np.int32),
        world_from_object=np.asarray(poses, np.float64),
        tint=np.ones((len(poses), 3), np.float32),
    )
    names = {name for stone in stones for name in stone.materials}
    return dataclasses.replace(
        world,
        meshes={**world.meshes, **{stone.name: stone for stone in stones}},
        materials={**world.materials, **{name: MATERIALS[name] for name in names}},
        swarms=(*world.swarms, swarm),
    )


def make_experiment(
    waypoints: Sequence[tuple[float, float]],
    *,
    start: tuple[float, float] = (0.0, 0.0),
    seconds: float | None = None,
    **changes: object,
) -> Experiment:
    """``start`` and ``waypoints`` are world x, y [m]."""
    points = np.array([start, *waypoints], float)
    geodetic = geodetic_from_world(np.column_stack([points, np.zeros(len(points))]))
    (latitude, longitude), *rest = [(float(p[0]), float(p[1])) for p in geodetic]
    route = RouteConfig(start=(latitude, longitude), waypoints=tuple(rest))
    values = {"name": "test", "environment": "test", "route": route, "seconds": seconds, **changes}
    return Experiment.model_validate(values)


def obstacle(
    name: str, shape: str, size: tuple[float, ...], x: float, y: float, **pose: float
) -> tuple[str, Collider, F8]:
    """A collider at x, y; ``pose``: height z [m] of its base, yaw [deg] and scale of the object."""
    world_from_object = transforms.pose((x, y, pose.get("z", 0.0)), (0.0, 0.0, pose.get("yaw", 0.0)))
    world_from_object[:3, :3] *= pose.get("scale", 1.0)
    return name, Collider(shape=shape, size=size), world_from_object  # type: ignore[arg-type]


def make_robot(
    world: World,
    start: tuple[float, float] = (0.0, 0.0),
    *,
    yaw_deg: float = 0.0,
    soil: WheelSoil | None = None,
    rig: Rig | None = None,
) -> SimulatedRobot:
    """A settled robot without a route, by default the paper's."""
    ahead = np.array(start) + 100 * np.array([np.cos(np.deg2rad(yaw_deg)), np.sin(np.deg2rad(yaw_deg))])
    experiment = make_experiment([(float(ahead[0]), float(ahead[1]))])
    waypoints = geodetic_route(experiment.route).waypoints
    monitor = DriveMonitor(world, WaypointFollower(waypoints, experiment.control), experiment.control)
    robot = SimulatedRobot(world, rig or Rig(), monitor, soil)
    robot.spawn(np.array(start), ahead)
    return robot


def tilted(along_deg: float, across_deg: float) -> HeightFunction:
    """A plane that rises along x and along y."""
    slope_x, slope_y = np.tan(np.deg2rad([along_deg, across_deg]))
    return lambda x, y: slope_x * x + slope_y * y


def hills(x: F8, y: F8) -> F8:
    """Sum of waves: 0.1 m high, 5 to 30 m long."""
    waves = [(5.0, 0.3, 1.0), (8.0, 2.0, 4.0), (13.0, 4.0, 2.0), (21.0, 5.5, 0.5), (30.0, 1.2, 3.0)]
    return np.asarray(
        sum(0.02 * np.sqrt(w / 5) * np.sin(2 * np.pi / w * (x * np.cos(a) + y * np.sin(a)) + p) for w, a, p in waves)
    )
