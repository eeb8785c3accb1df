# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""LiDAR and cameras of one robot in the park agree on class, object and distance."""

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter
from sense_worlds import F8, built_scene, trace_rays

from fieldtruth.core import transforms
from fieldtruth.core.classes import GROUND_ID, PALETTE, Label
from fieldtruth.experiment.config import metres_from_route
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.kernels.lidar import Scan
from fieldtruth.sense.lens import intrinsics_of
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CAMERA_FROM_OPTICAL
from fieldtruth.sensors.camera.labels import LabelCamera, LabelImages, tag_image
from fieldtruth.sensors.lidar.sensing import IdealLidar

pytestmark = pytest.mark.slow  # by default, the check "lidar and cameras" of ``validate`` looks at a run

RIG = Rig()
LENS = intrinsics_of(RIG.stereo)
BASE_HEIGHT = 0.13228  # [m] of base_link above the ground (paper, Table 2)
ATTITUDES = ((0.0, 0.0), (8.0, 0.0), (0.0, -7.0), (0.0, 7.0), (-6.0, 4.0), (1.0, 1.0))  # roll and pitch [deg]


class View(NamedTuple):
    """Scan and label images from one pose of the robot."""

    world_from_base: F8
    scan: Scan
    left: LabelImages
    right: LabelImages
    even_left: "Smooth"
    even_right: "Smooth"


def optical(side: str) -> F8:
    """base_from_optical of a camera."""
    mount = RIG.stereo.left if side == "left" else RIG.stereo.right
    return mount.base_from_sensor @ CAMERA_FROM_OPTICAL


@pytest.fixture(scope="module")
def scene() -> Scene:
    return built_scene("park")


@pytest.fixture(scope="module")
def views(scene: Scene) -> list[View]:
    """Six poses along the route of park_1, with different roll and pitch."""
    lidar, camera = IdealLidar(RIG.lidar, scene), LabelCamera(RIG.stereo, scene)
    corners = metres_from_route(load_experiment("park_1").route)
    found = []
    for (roll, pitch), start, end in zip(ATTITUDES, corners[:-1], corners[1:], strict=False):
        yaw = np.degrees(np.arctan2(*(end - start)[::-1]))
        z = float(scene.world.terrain.field.height_at(*start)) + BASE_HEIGHT
        base = transforms.pose((*start, z), (roll, pitch, yaw))
        left, right = (camera.label(base @ optical(side)) for side in ("left", "right"))
        scan = lidar.scan(base @ RIG.lidar.mount.base_from_sensor)
        found.append(View(base, scan, left, right, smooth(left), smooth(right)))
    return found


class Projected(NamedTuple):
    """LiDAR points inside one camera's image: image point [pixel], depth [m], class, object, point in the world."""

    u: F8
    v: F8
    depth: F8
    label: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    world: F8


def project(view: View, side: str) -> Projected:
    """LiDAR points in an image, at least 4 pixels from its border, projected by the static transforms and K."""
    optical_from_lidar = transforms.inverse(optical(side)) @ RIG.lidar.mount.base_from_sensor
    x, y, z = transforms.transform(optical_from_lidar, view.scan.xyz).T
    ahead = z > 0.1
    u, v = (np.full(len(z), -1.0) for _ in range(2))
    u[ahead], v[ahead] = LENS.cx + LENS.fx * (x / z)[ahead], LENS.cy + LENS.fy * (y / z)[ahead]
    rows = np.flatnonzero((u > 4) & (u < RIG.stereo.width - 5) & (v > 4) & (v < RIG.stereo.height - 5))
    world = transforms.transform(view.world_from_base @ RIG.lidar.mount.base_from_sensor, view.scan.xyz[rows])
    return Projected(u[rows], v[rows], z[rows], view.scan.label[rows], view.scan.instance[rows], world)


class Smooth(NamedTuple):
    """Pixels whose 5 x 5 neighbourhood is one class, one object and one plane; inverse depth and its slopes."""

    here: NDArray[np.bool_]
    inverse: F8
    du: F8
    dv: F8


def smooth(image: LabelImages) -> Smooth:
    """Inverse depth of a plane is affine in the image; deviations above 0.3 % are silhouettes or corners."""
    with np.errstate(divide="ignore"):
        inverse = np.where(image.depth > 0, 1.0 / image.depth.astype(np.float64), 0.0)
    dv, du = np.gradient(inverse)
    here = image.depth > 0
    for part in (image.label, image.instance):
        here &= maximum_filter(part, 5) == minimum_filter(part, 5)
    for step_v in (-2, 0, 2):
        for step_u in (-2, 0, 2):
            moved = np.roll(inverse, (-step_v, -step_u), (0, 1))
            here &= np.abs(moved - inverse - step_v * dv - step_u * du) < 0.003 * inverse
    here[:3], here[-3:], here[:, :3], here[:, -3:] = False, False, False, False
    return Smooth(here, inverse, du, dv)


def depth_at(image: Smooth, u: F8, v: F8) -> F8:
    """Depth [m] at image points, extrapolated along the plane from the nearest pixel's centre."""
    row, column = np.rint(v).astype(int), np.rint(u).astype(int)
    sloped = (u - column) * image.du[row, column] + (v - row) * image.dv[row, column]
    return np.asarray(1.0 / np.maximum(image.inverse[row, column] + sloped, 1e-9))


@pytest.mark.parametrize("side", ["left", "right"])
def test_ray_from_the_camera_to_a_lidar_point_hits_the_same_object(scene: Scene, views: list[View], side: str) -> None:
    """A ray from the camera's centre to each LiDAR point ends there, on the same object, or is occluded."""
    points = compared = 0
    for view in views:
        seen = project(view, side)
        eye = (view.world_from_base @ optical(side))[:3, 3]
        offset = seen.world - eye
        distance = np.linalg.norm(offset, axis=1)
        rays = trace_rays(scene, np.tile(eye, (len(offset), 1)), offset)
        same = (rays.label == seen.label) & (rays.instance == seen.instance)
        margin = np.where(rays.instance == seen.instance, 0.01, 1e-4)  # a leaf may lie on the ground
        hidden = (rays.range_m > 0) & (rays.range_m < distance - margin)
        reached = np.abs(rays.range_m - distance) < 0.01
        # A ray may miss a point within single precision of the border of a leaf, twig or stone: one of 4,000 in a view.
        missed = ~hidden & ~(same & reached)
        assert missed.sum() <= 1, f"{missed.sum()} of {len(missed)}"
        assert not np.any(missed & (seen.instance == GROUND_ID))
        points, compared = points + len(offset), compared + int(np.sum(~hidden))
    assert points > 20_000
    assert compared > 0.9 * points, f"{compared} of {points} were compared"


@pytest.mark.parametrize("side", ["left", "right"])
def test_projected_points_land_on_pixels_of_their_class(scene: Scene, views: list[View], side: str) -> None:
    """Away from silhouettes, every point that is not occluded; and the depth image has its depth."""
    points = compared = 0
    for view in views:
        image, even = (view.left, view.even_left) if side == "left" else (view.right, view.even_right)
        seen = project(view, side)
        row, column = np.rint(seen.v).astype(int), np.rint(seen.u).astype(int)
        depth = depth_at(even, seen.u, seen.v)
        near = even.here[row, column]
        allowed = 0.01 + 0.003 * seen.depth  # the curvature that ``smooth`` allows
        hidden = depth < seen.depth - allowed
        agrees = (
            (image.label[row, column] == seen.label)
            & (image.instance[row, column] == seen.instance)
            & (np.abs(depth - seen.depth) < allowed)
        )
        odd = np.flatnonzero(near & ~hidden & ~agrees)
        # The rest are twigs and leaf tips narrower than a pixel, in front of the surface in the image.
        assert len(odd) < 2e-3 * np.count_nonzero(near), [PALETTE[seen.label[k]].tolist() for k in odd]
        assert np.all(seen.depth[odd] < depth[odd])
        eye = (view.world_from_base @ optical(side))[:3, 3]
        rays = trace_rays(scene, np.tile(eye, (len(odd), 1)), seen.world[odd] - eye)
        assert np.array_equal(rays.label, seen.label[odd])
        assert np.array_equal(rays.instance, seen.instance[odd])
        points, compared = points + int(np.sum(near)), compared + int(np.sum(near & ~hidden))
    assert points > 8_500  # one in eight fewer than on smooth ground: pixels on steps of the relief are left out
    assert compared > 0.97 * points, f"{compared} of {points} were compared"


def test_depth_agrees_to_1_cm_where_the_ground_is_near(views: list[View]) -> None:
    """Within 3 m the pixels are finer than the ground's relief, so that 1 cm suffices on every slope.

    That is the ground itself: stalks and leaves that lie on it may be narrower than a pixel.
    """
    count = 0
    for view in views:
        for side, even in (("left", view.even_left), ("right", view.even_right)):
            seen = project(view, side)
            row, column = np.rint(seen.v).astype(int), np.rint(seen.u).astype(int)
            ground = (seen.instance == GROUND_ID) & even.here[row, column] & (seen.depth < 3.0)
            difference = (depth_at(even, seen.u, seen.v) - seen.depth)[ground]
            assert difference[difference > -0.05].max() < 0.01
            assert np.abs(difference[difference > -0.05]).max() < 0.01
            assert (difference < -0.05).mean() < 0.01  # hidden from the camera
            count += int(np.sum(ground))
    assert count > 5000


def test_stereo_pixels_show_the_same_object(views: list[View]) -> None:
    """A left pixel, shifted by fx * baseline / depth, shows the same object in the right image or is occluded."""
    shift = LENS.fx * RIG.stereo.baseline
    pixels = compared = 0
    for view in views:
        left, right = view.even_left, view.even_right
        v, u = np.nonzero(left.here)
        moved = u - shift * left.inverse[v, u]
        inside = moved > 4
        v, u, moved = v[inside], u[inside], moved[inside]
        column = np.rint(moved).astype(int)
        near = right.here[v, column]
        v, u, moved, column = v[near], u[near], moved[near], column[near]
        depth = 1.0 / left.inverse[v, u]
        other = depth_at(right, moved, v.astype(np.float64))
        allowed = 0.01 + 0.003 * depth
        hidden = other < depth - allowed
        odd = ~hidden & ~(
            (view.left.label[v, u] == view.right.label[v, column])
            & (view.left.instance[v, u] == view.right.instance[v, column])
            & (np.abs(other - depth) < allowed)
        )
        assert np.count_nonzero(odd) == 0, [(int(a), int(b)) for a, b in zip(v[odd][:9], u[odd][:9], strict=True)]
        pixels, compared = pixels + len(v), compared + int(np.sum(~hidden))
    assert pixels > 1_000_000
    assert compared > 0.99 * pixels


def test_views_cover_the_classes_of_the_park(views: list[View]) -> None:
    """Preconditions of the tests above: nearly all classes appear, robot and void never do, sky has instance id 0."""
    images = [image for view in views for image in (view.left, view.right)]
    classes = set(np.unique(np.concatenate([np.unique(i.label) for i in images])).tolist())
    in_scans = set(np.unique(np.concatenate([view.scan.label for view in views])).tolist())
    park = {Label.GROUND, Label.TRUNK, Label.TREETOP, Label.BUSH, Label.TRAIL, Label.LAMP_POST, Label.BENCH}
    assert {int(label) for label in park | {Label.SKY}} <= classes
    assert {int(label) for label in park} <= in_scans
    assert Label.VOID not in classes | in_scans
    assert Label.SKY not in in_scans
    for image in images:
        sky = image.label == Label.SKY
        assert np.array_equal(sky, image.instance == 0)
        assert np.array_equal(sky, image.depth == 0)
        colours = set(map(tuple, np.unique(tag_image(image.label).reshape(-1, 3)[::7], axis=0).tolist()))
        assert colours <= {tuple(c) for c in PALETTE[1:].tolist()}
    assert all(view.scan.instance.min() > 0 for view in views)


def test_ids_and_classes_are_those_of_the_worlds_objects(scene: Scene, views: list[View]) -> None:
    world = scene.world
    labels = {name: {int(world.materials[m].label) for m in mesh.materials} for name, mesh in world.meshes.items()}
    allowed = {i.object_id: labels[i.mesh] for i in world.instances}
    allowed |= {s.object_id: {label for name in s.meshes for label in labels[name]} for s in world.swarms}
    assert world.backdrop is not None
    land = {int(world.materials[name].label) for name in world.backdrop.materials}  # distant woods are treetop
    allowed |= {0: {int(Label.SKY)}, 1: {int(Label.GROUND), int(Label.TRAIL)} | land}
    for view in views:
        for image in (view.left, view.right):
            pairs = [divmod(int(p), 256) for p in np.unique(image.instance.astype(np.int64) * 256 + image.label)]
            assert all(label in allowed[object_id] for object_id, label in pairs)
            assert all(object_id < len(world.object_names) for object_id, _ in pairs)
