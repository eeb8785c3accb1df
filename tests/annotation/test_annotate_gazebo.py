# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Two seconds of a drive in Gazebo 11, recorded by ``rosbag record``: annotated, it agrees with Gazebo's own clouds.

``tests/gazebo/test_drives.py`` makes such bags; ``tests/gazebo/excerpt.py`` cut this one. Its clouds, at 10, 11 and
12 s, were cast by Gazebo against the exported triangles; their intensity is the class id. A change of the park needs a
new excerpt.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from annotate_bags import stored, write
from sense_worlds import without_textures

from fieldtruth.annotation import annotate
from fieldtruth.bag.decode import image, points, read_bag, stamp_ns, static_transforms
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import PALETTE
from fieldtruth.experiment.rig import paper_rig
from fieldtruth.gazebo import DEFAULT_LAYOUT
from fieldtruth.render.bake import BakedScene
from fieldtruth.render.surfaces import shading_of
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CAMERA_FROM_OPTICAL, StereoConfig
from fieldtruth.sensors.camera.sensor import camera_matrix
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.world.build import build_world

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:the bag's own messages")]

EXCERPT: Final = Path(__file__).parent / "data" / "gazebo_park.bag"
RIG: Final = paper_rig(lidar=LidarConfig(rate_hz=1.0), cameras=StereoConfig(rate_hz=1.0, width=320, height=184))
OURS = "/os1_cloud_node/points"
GAZEBO = f"/recorded{OURS}"
STAMPS: Final = [10 * 10**9, 11 * 10**9, 12 * 10**9]


@pytest.fixture(scope="module")
def scene() -> Scene:
    with without_textures():
        return Scene(build_world("park", 0, DEFAULT_LAYOUT))


@pytest.fixture(scope="module")
def annotated(scene: Scene, park: SensorWorld, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With the light of the park on its finer ground, as photographs are not looked at and light takes long."""
    out, light = tmp_path_factory.mktemp("gazebo") / "annotated.bag", park.baked.shading
    lit = BakedScene(scene=scene, shading=shading_of(scene, light.light, light.materials, light.air))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fieldtruth.sensors.kind.bake", lambda *_: lit)
        return annotate(EXCERPT, "park", rig=RIG, out=out, scene=scene)


def beams(message: Any) -> tuple[Array, Array]:
    """Range [m] and class id of each beam, (columns, rings); 0 without a return."""
    cloud = points(message)
    range_m, label = np.zeros((2, RIG.lidar.columns, RIG.lidar.rings))
    xyz = np.stack([cloud[axis].astype(np.float64) for axis in "xyz"], axis=1)
    range_m[cloud["column"], cloud["ring"]] = np.linalg.norm(xyz, axis=1)
    label[cloud["column"], cloud["ring"]] = cloud["intensity"]
    return range_m, label


def clouds(bag: Path, topic: str) -> list[tuple[Array, Array]]:
    messages = [reading.message for reading in read_bag(bag, [topic])]
    assert [stamp_ns(message.header) for message in messages] == STAMPS
    assert {message.header.frame_id for message in messages} == {"os1_lidar"}
    return [beams(message) for message in messages]


def differing(bag: Path) -> float:
    """Share of the beams of our clouds that differ from Gazebo's by more than 5 mm or in class."""
    pairs = zip(clouds(bag, OURS), clouds(bag, GAZEBO), strict=True)
    return float(np.mean([(np.abs(a[0] - b[0]) > 0.005) | (a[1] != b[1]) for a, b in pairs]))


def test_our_clouds_are_gazebos_except_at_edges(annotated: Path) -> None:
    assert differing(annotated) < 0.001, "has the park changed? Then make a new excerpt"
    range_m, label = clouds(annotated, OURS)[0]
    assert (range_m > 0).sum() > 20_000
    assert len(np.unique(label)) > 6


def test_tag_images_show_the_classes_of_gazebos_points(annotated: Path) -> None:
    """The camera is beside the LiDAR, so that some points are hidden from it; nearly all of them are not."""
    optical = RIG.stereo.left.base_from_sensor @ CAMERA_FROM_OPTICAL
    optical_from_lidar = transforms.inverse(optical) @ RIG.lidar.mount.base_from_sensor
    tags = [image(reading.message) for reading in read_bag(annotated, ["/stereo/camera/left/tag/img_raw"])]
    same = []
    for tag, reading in zip(tags, read_bag(annotated, [GAZEBO]), strict=True):
        cloud = points(reading.message)
        seen = transforms.transform(optical_from_lidar, np.stack([cloud[axis] for axis in "xyz"], axis=1))
        seen, label = seen[seen[:, 2] > 0.5], cloud["intensity"][seen[:, 2] > 0.5].astype(int)
        column, row = np.rint((seen @ camera_matrix(RIG.stereo).T)[:, :2] / seen[:, 2:]).astype(int).T
        inside = (column >= 0) & (column < RIG.stereo.width) & (row >= 0) & (row < RIG.stereo.height)
        assert inside.sum() > 1000
        same.append((tag[row[inside], column[inside]] == PALETTE[label[inside]]).all(axis=1).mean())
    assert min(same) > 0.9


def test_images_frames_and_the_recorded_messages_are_in_the_bag(annotated: Path) -> None:
    messages = stored(annotated)
    added = [message for message in messages if message.kind.topic.startswith(("/stereo/", OURS, "/tf"))]
    assert len(added) == 1 + 3 * (1 + 2 * 3)  # frames; a cloud, and of either camera image, tag image and calibration
    carried = [message for message in messages if message not in added]
    same_name = [m._replace(kind=m.kind._replace(topic=m.kind.topic.removeprefix("/recorded"))) for m in carried]
    assert same_name == stored(EXCERPT)
    assert {child for _, child in static_transforms(annotated)} >= {"os1_lidar", "left_camera_optical"}


def test_without_odometry_the_robots_row_of_model_states_is_used(scene: Scene, tmp_path: Path) -> None:
    """It has no stamps but those of ``rosbag record``, which are some milliseconds late."""
    left = [message for message in stored(EXCERPT) if message.kind.topic != "/ground_truth/odom"]
    clouds_only = paper_rig(lidar=RIG.lidar, cameras=StereoConfig(enabled=False))
    bag = annotate(write(tmp_path / "x.bag", left), "park", rig=clouds_only, scene=scene)
    pairs = zip(clouds(bag, OURS), clouds(bag, GAZEBO), strict=True)
    assert all(np.median(np.abs(a[0] - b[0])) < 0.002 for a, b in pairs)
