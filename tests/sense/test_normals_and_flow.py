# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Normals and optical flow of a camera, against closed forms and against the labels and depths of the next image."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import at, box, floating, make_mesh, make_world, quad

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.core.lenses import FLAT, directions, project
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.robot import robot_views
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera, LabelImages

F8 = NDArray[np.float64]
WIDTH, HEIGHT = 96, 64
LENSES: dict[str, dict[str, Any]] = {
    "pinhole": {},
    "plumb_bob": {"lens": {"model": "plumb_bob", "coefficients": [-0.2, 0.05, 0.001, -0.002, 0.0]}},
    "rational": {
        "lens": {
            "model": "rational_polynomial",
            "coefficients": [0.3, 0.02, 0.001, -0.001, 0.001, 0.5, 0.05, 0.002],
        }
    },
    "fisheye": {
        "lens": {"model": "equidistant", "coefficients": [0.02, -0.01, 0.002, 0.0], "image_circle_deg": 180},
        "horizontal_fov_deg": 190.0,
        "vertical_fov_deg": 130.0,
    },
    "panorama": {"lens": {"model": "equirectangular"}},
    "cut": {"lens": {"model": "pinhole", "image_circle_deg": 60}},
}


def camera_of(scene: Scene, lens: str = "pinhole", **values: Any) -> LabelCamera:
    given = {"name": "eye", "mount": {"xyz": (0.0, 0.0, 0.0)}, "width": WIDTH, "height": HEIGHT, "far": 100.0}
    wanted = {"normals": True, "flow": True}
    return LabelCamera(CameraConfig.model_validate(given | wanted | LENSES[lens] | values), scene)


def rays_of(camera: LabelCamera) -> F8:
    """Unit directions (h, w, 3) in the optical frame."""
    return directions(camera.config.projection, np.arange(WIDTH), np.arange(HEIGHT)[:, None])


def points_of(camera: LabelCamera, images: LabelImages) -> F8:
    """Points (h, w, 3) [m] in the optical frame, NaN without a surface."""
    rays = rays_of(camera)
    range_m = images.depth / (rays[..., 2] if camera.config.projection.model in FLAT else 1.0)
    return np.where((images.depth > 0)[..., None], rays * range_m[..., None], np.nan)


def sphere(radius: float, count: int = 160) -> Any:
    """A sphere about its origin, of triangles whose vertices are on it."""
    polar, azimuth = np.linspace(0.0, np.pi, count + 1), np.linspace(0.0, 2 * np.pi, 2 * count + 1)
    p, a = np.meshgrid(polar, azimuth, indexing="ij")
    vertices = radius * np.stack([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(1, count - 1), np.arange(2 * count), indexing="ij")
    first = (i * (2 * count + 1) + j).ravel()
    below = first + 2 * count + 1
    faces = np.concatenate([np.stack([first, below, below + 1], 1), np.stack([first, below + 1, first + 1], 1)])
    return make_mesh("sphere", vertices, faces)


CLUTTER = make_world(
    [
        (box("near", (0.4, 0.3, 0.8)), transforms.pose((4.0, 0.8, 0.5), (10.0, 20.0, 30.0))),
        (box("far", (1.0, 1.0, 1.5)), transforms.pose((9.0, -1.5, 1.0), (0.0, 0.0, 50.0))),
        (quad("fence", np.array([[0, -2, 0], [0, 2, 0], [0, 2, 1.2], [0, -2, 1.2]])), transforms.pose((6.5, 1.5, 0.0))),
    ],
    height=lambda x, y: 0.1 * x,
)
EYE = transforms.pose((0.0, 0.0, 1.2), (0.0, 4.0, 3.0)) @ OPTICAL


@pytest.fixture(scope="module")
def clutter() -> Scene:
    return Scene(CLUTTER)


# ---------------------------------------------------------------------------------------------------------------------
# Normals


def test_normals_of_a_turned_and_scaled_box_are_those_of_its_faces() -> None:
    pose = transforms.pose((4.0, 0.3, -0.4), (0.0, -35.0, 40.0))
    scaled = pose.copy()
    scaled[:3, :3] *= 1.7
    camera = camera_of(floating((box("block", (0.5, 0.7, 0.9)), scaled)))
    images = camera.label(EYE)
    seen = images.depth > 0
    assert seen.sum() > 500
    in_box = images.normal[seen] @ (EYE[:3, :3].T @ pose[:3, :3])
    axis = np.abs(in_box).argmax(axis=1)
    assert np.abs(np.abs(in_box) - np.eye(3)[axis]).max() < 1e-5
    inside = transforms.transform(transforms.inverse(pose) @ EYE, points_of(camera, images)[seen]) / 1.7
    face = np.abs(inside) / [0.5, 0.7, 0.9]
    flat = np.sort(face, axis=1)[:, 1] < 0.99  # not at an edge
    rows = np.arange(len(axis))[flat]
    assert (face.argmax(axis=1) == axis)[flat].all()
    assert (np.sign(in_box[rows, axis[flat]]) == np.sign(inside[rows, axis[flat]])).all()  # outwards
    assert len(np.unique(axis)) == 3
    assert not images.normal[~seen].any()


def test_normals_of_a_slope_and_of_a_sphere() -> None:
    camera = camera_of(Scene(make_world(height=lambda x, y: 0.2 * x - 0.1 * y)))
    images = camera.label(EYE)
    up = np.array([-0.2, 0.1, 1.0]) / np.linalg.norm([-0.2, 0.1, 1.0])
    assert (images.depth > 0).sum() > 1000
    assert np.abs(images.normal[images.depth > 0] - up @ EYE[:3, :3]).max() < 1e-5
    centre, radius = np.array([5.0, 0.0, 1.0]), 1.5
    camera = camera_of(floating((sphere(radius), at(*centre))))
    images = camera.label(EYE)
    seen = images.depth > 0
    outwards = (transforms.transform(EYE, points_of(camera, images)[seen]) - centre) / radius @ EYE[:3, :3]
    assert seen.sum() > 1000
    turned = np.degrees(np.arccos(np.clip((images.normal[seen] * outwards).sum(axis=1), -1.0, 1.0)))
    assert turned.max() < 1.0  # half a facet's angle


@pytest.mark.parametrize("lens", LENSES)
def test_normals_have_length_one_face_the_camera_and_are_those_of_the_depth(clutter: Scene, lens: str) -> None:
    camera = camera_of(clutter, lens)
    images = camera.label(EYE)
    seen, rays = images.depth > 0, rays_of(camera)
    assert seen.sum() > 1000
    assert np.abs(np.linalg.norm(images.normal[seen], axis=1) - 1.0).max() < 1e-6
    assert not images.normal[~seen].any()
    assert ((images.normal * rays).sum(axis=-1)[seen] < 0.0).all()
    points = points_of(camera, images)
    across = np.cross(points[1:-1, 2:] - points[1:-1, :-2], points[2:, 1:-1] - points[:-2, 1:-1])
    across /= -np.linalg.norm(across, axis=-1, keepdims=True)
    around = [images.normal[1 + i : HEIGHT - 1 + i, 1 + j : WIDTH - 1 + j] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    around_id = [images.instance[1 + i : HEIGHT - 1 + i, 1 + j : WIDTH - 1 + j] for i in (-1, 1) for j in (-1, 0, 1)]
    flat = np.all([np.abs(each - around[4]).max(axis=-1) < 1e-6 for each in around], axis=0)
    flat &= np.all([each == images.instance[1:-1, 1:-1] for each in around_id], axis=0) & seen[1:-1, 1:-1]
    assert flat.sum() > 300
    assert np.abs(across - around[4])[flat].max() < 1e-3


def test_labels_do_not_depend_on_the_extras(clutter: Scene) -> None:
    with_all, without = camera_of(clutter).label(EYE), camera_of(clutter, normals=False, flow=False).label(EYE)
    for name in ("label", "instance", "depth"):
        assert getattr(with_all, name).tobytes() == getattr(without, name).tobytes()
    assert without.normal.size == 0


# ---------------------------------------------------------------------------------------------------------------------
# Flow in closed form


def wall(distance: float) -> Scene:
    return floating((quad("wall", [[0, -60, -60], [0, 60, -60], [0, 60, 60], [0, -60, 60]]), at(distance, 0.0, 0.0)))


def flow_of(camera: LabelCamera, now: F8, later: F8) -> NDArray[np.float32]:
    return camera.flow(camera.label(now), now, later)


def grid() -> tuple[F8, F8]:
    u, v = np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float))
    return u, v


def test_flow_towards_a_wall_expands_and_beside_it_shifts() -> None:
    camera = camera_of(wall(8.0))
    (u, v), lens = grid(), camera.config.projection
    ahead = flow_of(camera, OPTICAL, transforms.pose((2.0, 0.0, 0.0)) @ OPTICAL)
    grown = 8.0 / 6.0 - 1.0
    expected = np.stack([(u - lens.cx) * grown, (v - lens.cy) * grown], axis=-1)
    inside = (np.abs(u + expected[..., 0] - lens.cx) < WIDTH / 2) & (
        np.abs(v + expected[..., 1] - lens.cy) < HEIGHT / 2
    )
    assert np.abs(ahead - expected)[inside].max() < 1e-4
    assert np.isnan(ahead[~inside]).all()
    assert inside.sum() in range(3000, WIDTH * HEIGHT)
    left = flow_of(
        camera, OPTICAL, transforms.pose((0.0, 0.5, 0.25)) @ OPTICAL
    )  # what stands still moves right and down
    shift = np.array([0.5 * lens.fx / 8.0, 0.25 * lens.fy / 8.0])
    assert np.abs(left[~np.isnan(left[..., 0])] - shift).max() < 1e-4


def test_a_turn_about_the_axis_turns_the_image_and_sky_moves_by_rotation_alone() -> None:
    camera = camera_of(wall(8.0), horizontal_fov_deg=60.0, vertical_fov_deg=42.1)
    (u, v), lens, angle = grid(), camera.config.projection, np.radians(5.0)
    turned = flow_of(camera, OPTICAL, OPTICAL @ transforms.pose((0.0, 0.0, 0.0), (0.0, 0.0, 5.0)))
    x, y = (u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy
    to_u = lens.cx + lens.fx * (np.cos(angle) * x + np.sin(angle) * y)
    to_v = lens.cy + lens.fy * (-np.sin(angle) * x + np.cos(angle) * y)
    known = ~np.isnan(turned[..., 0])
    assert known.mean() > 0.9
    assert np.abs(turned - np.stack([to_u - u, to_v - v], axis=-1))[known].max() < 1e-4
    sky = camera_of(floating((box("behind", (0.1, 0.1, 0.1)), at(-5.0, 0.0, 0.0))))
    moved = flow_of(sky, OPTICAL, transforms.pose((3.0, 2.0, -1.0), (0.0, 0.0, 2.0)) @ OPTICAL)
    still = flow_of(sky, OPTICAL, transforms.pose((0.0, 0.0, 0.0), (0.0, 0.0, 2.0)) @ OPTICAL)
    assert np.array_equal(moved, still, equal_nan=True)
    middle = moved[HEIGHT // 2, WIDTH // 2, 0]  # a turn to the left moves the image to the right
    assert middle == pytest.approx(sky.config.projection.fx * np.tan(np.radians(2.0)), rel=0.01)


def test_flow_of_a_panorama_turns_across_its_seam() -> None:
    camera = camera_of(wall(8.0), "panorama")
    turned = flow_of(camera, OPTICAL, transforms.pose((0.0, 0.0, 0.0), (0.0, 0.0, 30.0)) @ OPTICAL)
    assert np.abs(turned - [WIDTH * 30.0 / 360.0, 0.0]).max() < 1e-3
    assert not np.isnan(turned).any()


def test_what_a_post_hides_in_the_next_image_has_no_flow() -> None:
    post = quad("post", [[0, -0.1, -9], [0, 0.1, -9], [0, 0.1, 9], [0, -0.1, 9]])
    scene = floating(
        (quad("wall", [[0, -60, -60], [0, 60, -60], [0, 60, 60], [0, -60, 60]]), at(8, 0, 0)), (post, at(2, 0, 0))
    )
    camera = camera_of(scene)
    later = transforms.pose((0.0, 0.3, 0.0)) @ OPTICAL  # to the left
    images = camera.label(OPTICAL)
    row = camera.flow(images, OPTICAL, later)[HEIGHT // 2]
    y = (
        -(np.arange(WIDTH) - camera.config.projection.cx) / camera.config.projection.fx * 8.0
    )  # on the wall, to the left
    through = 0.3 + (y - 0.3) * 2.0 / 8.0  # where the ray from the next position passes the post
    hidden = (np.abs(through) < 0.1) & (images.instance[HEIGHT // 2] == 2)
    outside = np.arange(WIDTH) + 0.3 * camera.config.projection.fx / 8.0 > WIDTH - 0.5
    assert hidden.sum() > 3
    wall_seen = images.instance[HEIGHT // 2] == 2
    assert (np.isnan(row[:, 0]) == (hidden | outside))[wall_seen].all()
    of_post = images.instance[HEIGHT // 2] == 3
    assert np.abs(row[of_post, 0] - 0.3 * camera.config.projection.fx / 2.0).max() < 1e-4


# ---------------------------------------------------------------------------------------------------------------------
# Flow and the next image


@pytest.mark.parametrize("lens", LENSES)
def test_flow_leads_to_the_same_object_at_its_depth(clutter: Scene, lens: str) -> None:
    camera = camera_of(clutter, lens)
    later = transforms.pose((0.25, 0.1, 1.25), (2.0, 3.0, 6.0)) @ OPTICAL
    now, after = camera.label(EYE), camera.label(later)
    flow = camera.flow(now, EYE, later)
    known = ~np.isnan(flow[..., 0])
    assert known.mean() > 0.5
    target = np.stack(grid(), axis=-1) + flow
    points = transforms.transform(transforms.inverse(later) @ EYE, points_of(camera, now).reshape(-1, 3)).reshape(
        now.normal.shape
    )
    seen = known & (now.depth > 0)
    apart = target[seen] - project(camera.config.projection, points[seen])
    apart[:, 0] -= WIDTH * np.rint(apart[:, 0] / WIDTH) * (lens == "panorama")
    assert np.abs(apart).max() < 2e-3

    def at_target(sign: float) -> float:
        """Share of pixels whose target has the same object at the depth of the point."""
        column, row = np.rint(np.stack(grid(), axis=-1) + sign * flow)[seen].astype(int).T
        column, row = column % WIDTH, np.clip(row, 0, HEIGHT - 1)
        depth = points[seen][:, 2] if camera.config.projection.model in FLAT else np.linalg.norm(points[seen], axis=1)
        same = after.instance[row, column] == now.instance[seen]
        return float((same & (np.abs(after.depth[row, column] / depth - 1.0) < 0.1)).mean())

    assert at_target(1.0) > 0.93
    assert at_target(-1.0) < at_target(1.0) - 0.05
    sky = known & (now.depth == 0) & (now.label == Label.SKY)
    column, row = np.rint(target[sky]).astype(int).T
    if sky.any():
        assert (after.depth[np.clip(row, 0, HEIGHT - 1), column % WIDTH] == 0).mean() > 0.97


def test_no_motion_is_no_flow(clutter: Scene) -> None:
    for lens in LENSES:
        camera = camera_of(clutter, lens)
        flow = flow_of(camera, EYE, EYE)
        has_ray = ~np.isnan(rays_of(camera)[..., 0])
        assert np.isnan(flow[~has_ray]).all()
        known = ~np.isnan(flow[..., 0])
        assert np.abs(flow[known]).max() < 2e-3
        assert known[has_ray].mean() > 0.97  # directions in single precision cross the outermost borders


def test_the_robot_moves_with_its_camera_and_hides_the_world() -> None:
    values = {"kind": "camera", "mount": {"xyz": (-0.6, 0.0, 0.9), "rpy_deg": (0.0, 35.0, 0.0)}, "width": WIDTH}
    rig = Rig.model_validate({"visible": True, "sensors": [values | {"height": HEIGHT, "normals": True, "flow": True}]})
    imager, (view,) = rig.imagers[0], robot_views(rig).values()
    camera = LabelCamera(imager.config, Scene(make_world()))
    foot = -rig.robot.footprint.xyz[2]
    bases = [transforms.pose((x, 0.0, foot)) for x in (0.0, 0.2)]
    now, later = (base @ imager.base_from_optical for base in bases)
    images = camera.label(now, view)
    robot = images.label == Label.ROBOT
    flow = camera.flow(images, now, later, view)
    assert 100 < robot.sum() < 0.8 * robot.size
    assert not flow[robot].any()
    deck = images.normal[robot] @ imager.base_from_optical[:3, :3].T
    assert (np.abs(deck - [0.0, 0.0, 1.0]).max(axis=1) < 1e-5).mean() > 0.5
    assert np.abs(np.linalg.norm(deck, axis=1) - 1.0).max() < 1e-6
    target = np.stack(grid(), axis=-1) + flow
    known = ~np.isnan(flow[..., 0]) & ~robot
    column, row = np.rint(target[known]).astype(int).T
    lost = robot[np.clip(row, 0, HEIGHT - 1), np.clip(column, 0, WIDTH - 1)].mean()
    blind = camera.flow(camera.label(now), now, later)
    column, row = np.rint((np.stack(grid(), axis=-1) + blind)[~np.isnan(blind[..., 0]) & ~robot]).astype(int).T
    unseen = robot[np.clip(row, 0, HEIGHT - 1), np.clip(column, 0, WIDTH - 1)].mean()
    assert lost < 0.25 * unseen  # what is left are borders within half a pixel
