# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Classes that only the lake has: cables and poles are hit; water is seen by cameras and returns no pulse."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import built_scene, make_world, trace_rays

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.experiment.config import metres_from_route
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.names import EXPERIMENTS
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.lidar.sensing import IdealLidar
from fieldtruth.world.furniture import make_furniture
from fieldtruth.world.grids import Line
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.power_lines import hang, make_cable


def test_rays_at_a_cable_and_a_pole() -> None:
    wire = hang((-20.0, 6.0, 8.0), (20.0, 9.0, 8.6), sag=0.7)
    mesh, pose = make_cable("wire", wire)
    pole = make_furniture("power_pole_0")
    standing = np.eye(4)
    standing[:3, 3] = 5.0, -8.0, 0.0
    world = make_world([(mesh, pose), (pole, standing)])
    world = replace(
        world,
        materials={
            **world.materials,
            **{n: replace(MATERIALS[n], texture="grey") for n in (*mesh.materials, *pole.materials)},
        },
    )
    scene = Scene(world)
    eye = np.array([0.0, 0.0, 0.9])
    targets = wire.points(np.linspace(2.0, wire.span - 2.0, 40))
    seen = trace_rays(scene, np.tile(eye, (40, 1)), targets - eye)
    assert set(seen.label) == {Label.CABLE}
    assert set(seen.instance) == {2}
    assert seen.range_m == pytest.approx(np.linalg.norm(targets - eye, axis=1), abs=0.02)
    beside = trace_rays(scene, np.tile(eye, (40, 1)), targets + np.array([0.0, 0.0, 0.05]) - eye)
    assert set(beside.label) == {0}
    up = np.array([[5.0, -8.0, z] for z in (0.5, 2.0, 5.0, 8.0)])
    posts = trace_rays(scene, np.tile(eye, (4, 1)), up - eye)
    assert set(posts.label) == {Label.POST}


@pytest.fixture(scope="module")
def lake() -> Scene:
    return built_scene("lake")


def lines() -> list[Line]:
    experiments = [load_experiment(name) for name in EXPERIMENTS]
    routes = [metres_from_route(e.route) for e in experiments if e.environment == "lake"]
    return [Line.through([(float(x), float(y)) for x, y in route], smooth=False) for route in routes]


def robot_pose(scene: Scene, line: Line, at: float) -> NDArray[np.float64]:
    """The robot's pose (4, 4) at a fraction of a line, level, facing along it."""
    row = int(at * (len(line.points) - 1))
    (x, y), (u, v) = line.points[row], line.tangents[row]
    ground = float(scene.world.terrain.field.height_at(x, y))
    return transforms.pose((x, y, ground + 0.13), (0.0, 0.0, float(np.degrees(np.arctan2(v, u)))))


@pytest.mark.slow  # needs the whole lake
def test_every_class_is_seen_from_the_route(lake: Scene) -> None:
    """By the camera all of them, by the LiDAR all but water and sky."""
    rig, hit, seen = paper_rig(cameras=StereoConfig(width=432, height=240)), set[int](), set[int]()
    lidar, camera = IdealLidar(rig.lidar, lake), LabelCamera(rig.stereo, lake)
    for line in lines():
        for at in np.linspace(0.02, 0.98, 6):
            base = robot_pose(lake, line, at)
            hit |= set(np.unique(lidar.scan(base @ rig.lidar.mount.base_from_sensor).label).tolist())
            images = camera.label(base @ transforms.pose(rig.stereo.left.xyz) @ OPTICAL)
            seen |= set(np.unique(images.label).tolist())
    solid = {Label.GROUND, Label.TRUNK, Label.TREETOP, Label.BUSH, Label.HIGH_GRASS, Label.POST, Label.CABLE}
    assert hit == solid
    assert seen == solid | {Label.WATER, Label.SKY}


@pytest.mark.slow
def test_lidar_gets_no_return_where_the_camera_sees_water(lake: Scene) -> None:
    base = transforms.pose((0.0, -6.5, float(lake.world.terrain.field.height_at(0.0, -6.5)) + 2.5), (0.0, 0.0, -90.0))
    rig = Rig()
    eye = base @ transforms.pose(rig.stereo.left.xyz) @ OPTICAL
    camera = LabelCamera(rig.stereo, lake)
    images = camera.label(eye)
    assert (images.label == Label.WATER).mean() > 0.1
    rows, columns = (n[::97] for n in np.nonzero(images.label == Label.WATER))
    lens = camera.intrinsics
    rays = np.column_stack([(columns - lens.cx) / lens.fx, (rows - lens.cy) / lens.fy, np.ones(len(rows))])
    directions = rays @ eye[:3, :3].T
    back = trace_rays(lake, np.tile(eye[:3, 3], (len(rays), 1)), directions, max_range=2000.0)
    assert not back.range_m.any()
    # The depth image is that of the plane.
    assert lake.world.water_level is not None
    depth = (lake.world.water_level - eye[2, 3]) / directions[:, 2]
    assert images.depth[rows, columns] == pytest.approx(depth, rel=1e-4)
    lake_id = next(i.object_id for i in lake.world.instances if i.kind == "water")
    assert set(images.instance[rows, columns]) == {lake_id}
