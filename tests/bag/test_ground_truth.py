# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Consistency of a finished bag: labels, depth, motion and positions agree through its own frames and cameras."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fieldtruth.bag.decode import image, points, pose_matrix, read_bag, stamp_ns, static_transforms
from fieldtruth.core import geodesy, transforms
from fieldtruth.core.classes import CLASSES, PALETTE, Label
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.experiment.rig import Rig
from fieldtruth.pipeline import generate
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.world.build import load_world

pytestmark = pytest.mark.slow  # full-size images


@pytest.fixture(scope="module")
def park_bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the beginning of park_1, with every sensor at full resolution."""
    experiment = with_overrides(load_experiment("park_1"), seconds=0.6)
    return generate(experiment, tmp_path_factory.mktemp("park_bag"))


def messages(bag: Path, topic: str) -> dict[int, Any]:
    """Messages of a topic by the stamp in their header."""
    return {stamp_ns(r.message.header): r.message for r in read_bag(bag, [topic])}


def labels_of(tag: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Class ids (h, w) of a tag image; fails on a colour that is not in the table."""
    code = tag.astype(np.uint32) @ np.array([1, 256, 65536], np.uint32)
    table = {int(np.array(c.rgb, np.uint32) @ [1, 256, 65536]): int(c.label) for c in CLASSES if c.rgb is not None}
    found = np.unique(code)
    assert set(found.tolist()) <= set(table), "a tag image holds a colour outside the table"
    lookup = np.array([table[int(c)] for c in found], np.uint8)
    return np.asarray(lookup[np.searchsorted(found, code)])


@pytest.mark.parametrize("side", ["left", "right"])
def test_lidar_points_land_on_pixels_of_their_class_and_depth(park_bag: Path, side: str) -> None:
    static = static_transforms(park_bag)
    base_from_lidar = static["base_link", "os1_lidar"]
    base_from_optical = static["base_link", f"{side}_camera"] @ static[f"{side}_camera", f"{side}_camera_optical"]
    clouds = messages(park_bag, "/os1_cloud_node/points")
    tags = messages(park_bag, f"/stereo/camera/{side}/tag/img_raw")
    infos = messages(park_bag, f"/stereo/camera/{side}/camera_info")
    odometry = messages(park_bag, "/ground_truth/odom")
    rig = Rig()
    camera = LabelCamera(rig.stereo, Scene(load_world("park", 0)))
    common = sorted(set(clouds) & set(tags))
    assert len(common) == 3
    compared = 0
    for stamp in common:
        info, cloud = infos[stamp], points(clouds[stamp])
        fx, _, cx, _, fy, cy, *_ = info.K
        xyz = np.stack([cloud["x"], cloud["y"], cloud["z"]], axis=-1)
        seen = transforms.transform(transforms.inverse(base_from_optical) @ base_from_lidar, xyz)
        depth_image = camera.label(pose_matrix(odometry[stamp].pose.pose) @ base_from_optical).depth
        label_image = labels_of(image(tags[stamp]))
        front = seen[:, 2] > 0.3
        u, v = np.full(len(seen), -9.0), np.full(len(seen), -9.0)
        u[front], v[front] = (seen[front, :2] / seen[front, 2:] * [fx, fy] + [cx, cy]).T
        inside = (u > 2) & (u < info.width - 3) & (v > 2) & (v < info.height - 3)
        for k in np.flatnonzero(inside):
            i, j = int(v[k]), int(u[k])
            around_depth = depth_image[i - 1 : i + 3, j - 1 : j + 3].astype(np.float64)
            around_label = label_image[i - 1 : i + 3, j - 1 : j + 3]
            if around_depth.min() <= 0 or not (around_label == around_label[0, 0]).all():
                continue  # a silhouette
            inverse = 1.0 / around_depth
            bend = np.abs(np.diff(inverse, 2, axis=0)).max() + np.abs(np.diff(inverse, 2, axis=1)).max()
            if bend > 2e-4 * inverse.mean():
                continue  # not one plane: an edge within the class
            fu, fv = u[k] - j, v[k] - i
            at = inverse[1:3, 1:3]  # 1 / depth is linear over the image of a plane
            expected = 1.0 / (
                (at[0, 0] * (1 - fu) + at[0, 1] * fu) * (1 - fv) + (at[1, 0] * (1 - fu) + at[1, 1] * fu) * fv
            )
            if seen[k, 2] > expected + 0.05:
                continue  # hidden from the camera by something nearer
            compared += 1
            assert around_label[1, 1] == cloud["label"][k] == cloud["intensity"][k]
            assert abs(expected - seen[k, 2]) < 0.01
    assert compared > 1000


def test_cloud_and_tags_hold_only_known_classes(park_bag: Path) -> None:
    for reading in read_bag(park_bag, ["/os1_cloud_node/points"]):
        cloud = points(reading.message)
        assert (cloud["label"] == cloud["intensity"]).all()
        assert not set(np.unique(cloud["label"]).tolist()) & {Label.VOID, Label.WATER, Label.SKY}
        assert cloud["instance"].min() >= 1
    for side in ("left", "right"):
        for reading in read_bag(park_bag, [f"/stereo/camera/{side}/tag/img_raw"]):
            seen = set(np.unique(labels_of(image(reading.message))).tolist())
            assert {Label.GROUND, Label.TRAIL, Label.TREETOP, Label.SKY} <= seen


def test_photograph_and_tag_show_the_same_view(park_bag: Path) -> None:
    """Sky is brighter and bluer than treetops in every photograph, by the tag's own mask."""
    photos = messages(park_bag, "/stereo/camera/left/real/compressed")
    tags = messages(park_bag, "/stereo/camera/left/tag/img_raw")
    assert photos.keys() == tags.keys()
    stamp = min(photos)
    photo, label = image(photos[stamp]).astype(float), labels_of(image(tags[stamp]))
    assert photo.shape[:2] == label.shape
    sky, crown = photo[label == Label.SKY].mean(axis=0), photo[label == Label.TREETOP].mean(axis=0)
    assert sky.mean() > 2 * crown.mean()
    assert sky[2] > sky[0]


def test_instances_are_rows_of_model_states(park_bag: Path) -> None:
    first = next(iter(read_bag(park_bag, ["/gazebo/model_states"]))).message
    kinds = {"lamp_post": Label.LAMP_POST, "bench": Label.BENCH, "table": Label.TABLE, "trash_bin": Label.TRASH_BIN}
    cloud = np.concatenate([points(r.message) for r in read_bag(park_bag, ["/os1_cloud_node/points"])])
    assert first.name[0] == "husky"
    checked = 0
    for row in np.unique(cloud["instance"]):
        kind = first.name[row].rsplit("_", 1)[0]
        if kind in kinds:
            checked += 1
            assert set(cloud["label"][cloud["instance"] == row].tolist()) == {kinds[kind]}
    assert checked >= 5


def test_gnss_and_imu_agree_with_the_true_pose(park_bag: Path) -> None:
    static = static_transforms(park_bag)
    odometry = messages(park_bag, "/ground_truth/odom")
    fixes, readings = messages(park_bag, "/navsat/fix"), messages(park_bag, "/imu/data")
    assert (len(fixes), len(readings)) == (1, 30)
    for stamp, fix in fixes.items():
        world_from_base = pose_matrix(odometry[stamp].pose.pose)
        antenna = (world_from_base @ static["base_link", "GNSS_link"])[:3, 3]
        told = geodesy.world_from_geodetic([fix.latitude, fix.longitude, fix.altitude])
        assert np.linalg.norm(told - antenna) < 1e-3
    for stamp, reading in readings.items():
        q = reading.orientation
        world_from_imu = transforms.rotation_from_quaternion_wxyz([q.w, q.x, q.y, q.z])
        world_from_base = world_from_imu @ static["base_link", "imu_link"][:3, :3].T
        assert np.allclose(world_from_base, pose_matrix(odometry[stamp].pose.pose)[:3, :3], atol=1e-9)


def test_palette_has_a_colour_for_every_class_that_is_seen() -> None:
    assert len({tuple(row) for row in PALETTE[1:]}) == len(PALETTE) - 1
