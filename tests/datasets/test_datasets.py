# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A run as a data set: each frame holds what rosbags reads from the bag."""

import io
from collections import defaultdict
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pytest
from dataset_bags import equal, rewrite
from numpy.typing import NDArray
from PIL import Image
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation, Slerp

from fieldtruth.core.classes import CLASSES
from fieldtruth.datasets import RunDataset
from fieldtruth.datasets.items import GEOMETRY, ITEMS, Sample

LACKING = ("normals", "flow", "parts", "part_mask", "passability", "passability_mask")
"""Items that the small run does not have."""
ALL = tuple(name for name in (*ITEMS, *GEOMETRY) if name not in LACKING)
POINTS, ODOMETRY = "/os1_cloud_node/points", "/ground_truth/odom"
Truth = dict[str, dict[int, Any]]


@pytest.fixture(scope="module")
def truth(small_run: Path) -> Truth:
    """Messages by topic and stamp in the header, as rosbags' own reader finds them."""
    store = get_typestore(Stores.ROS1_NOETIC)
    found: Truth = defaultdict(dict)
    with Reader(small_run / f"{small_run.name}.bag") as reader:
        for connection, stamp, data in reader.messages():
            if connection.msgtype in ("gazebo_msgs/msg/ModelStates", "rosgraph_msgs/msg/Clock"):
                continue
            if connection.msgtype not in store.types:
                store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
            message = store.deserialize_ros1(data, connection.msgtype)
            if hasattr(message, "header"):
                stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            found[connection.topic][stamp] = message
    return found


def matrix(xyz: Any, q: Any) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix(), [xyz.x, xyz.y, xyz.z]
    return pose


def mounts(truth: Truth) -> dict[str, NDArray[np.float64]]:
    """base_from_child of all fixed frames; parents come before children."""
    known = {"base_link": np.eye(4)}
    [message] = truth["/tf_static"].values()
    for each in message.transforms:
        transform = matrix(each.transform.translation, each.transform.rotation)
        known[each.child_frame_id] = known[each.header.frame_id] @ transform
    return known


def world_from_base(truth: Truth, stamp_ns: int) -> NDArray[np.float64]:
    """Pose at a stamp, from odometry, by SciPy's interpolation."""
    stamps = sorted(truth[ODOMETRY])
    poses = [truth[ODOMETRY][stamp].pose.pose for stamp in stamps]
    turns = Rotation.from_quat([[p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w] for p in poses])
    places = np.array([[p.position.x, p.position.y, p.position.z] for p in poses])
    pose = np.eye(4)
    pose[:3, :3] = Slerp(np.array(stamps) / 1e9, turns)(stamp_ns / 1e9).as_matrix()
    pose[:3, 3] = [np.interp(stamp_ns, stamps, column) for column in places.T]
    return pose


def cloud_fields(message: Any) -> NDArray[Any]:
    kinds = {2: "u1", 4: "<u2", 6: "<u4", 7: "<f4"}
    dtype = np.dtype(
        {
            "names": [f.name for f in message.fields],
            "formats": [kinds[f.datatype] for f in message.fields],
            "offsets": [f.offset for f in message.fields],
            "itemsize": message.point_step,
        }
    )
    return np.frombuffer(message.data.tobytes(), dtype)


@pytest.mark.parametrize("camera", ["left", "right"])
def test_every_item_of_every_frame_equals_the_bag_as_rosbags_reads_it(
    small_run: Path, truth: Truth, camera: Any
) -> None:
    base_from = mounts(truth)
    label_of = {rgb: int(label) for label, _, rgb in CLASSES if rgb is not None}
    dataset = RunDataset(small_run, ALL, camera=camera)
    assert dataset.stamps_ns.tolist() == [200_000_000 * k for k in range(1, 7)]
    for sample in dataset:
        stamp, prefix = sample["stamp_ns"], f"/stereo/camera/{camera}"
        assert (sample["camera_stamp_ns"], sample["lidar_stamp_ns"], sample["run"]) == (stamp, stamp, "park_1")
        photo = np.asarray(Image.open(io.BytesIO(truth[f"{prefix}/real/compressed"][stamp].data.tobytes())))
        assert np.array_equal(sample["image"], np.moveaxis(photo, 2, 0))
        tag = truth[f"{prefix}/tag/img_raw"][stamp].data.reshape(-1, 3)
        assert sample["mask"].ravel().tolist() == [label_of[tuple(pixel)] for pixel in tag.tolist()]
        depth = np.frombuffer(truth[f"{prefix}/depth"][stamp].data.tobytes(), "<f4").reshape(92, 160)
        ids = np.frombuffer(truth[f"{prefix}/instances"][stamp].data.tobytes(), "<u2").reshape(92, 160)
        assert np.array_equal(sample["depth"], depth)
        assert np.array_equal(sample["instance_mask"], ids)
        points = cloud_fields(truth[POINTS][stamp])
        assert np.array_equal(sample["cloud"], np.stack([points["x"], points["y"], points["z"]], axis=1))
        assert np.array_equal(sample["labels"], points["intensity"])
        assert np.array_equal(sample["instances"], points["instance"])
        assert np.array_equal(
            sample["rays"], np.stack([points["ring"], points["column"], np.zeros(len(points))], axis=1)
        )
        pose = truth[ODOMETRY][stamp].pose.pose
        in_world = matrix(pose.position, pose.orientation)
        optical = base_from[f"{camera}_camera_optical"]
        assert np.array_equal(sample["K"].ravel(), truth[f"{prefix}/camera_info"][stamp].K)
        assert sample["distortion_model"] == "plumb_bob"
        assert not sample["D"].any()
        for key, expected in {
            "world_from_base": in_world,
            "world_from_camera": in_world @ optical,
            "world_from_lidar": in_world @ base_from["os1_lidar"],
            "base_from_camera": optical,
            "base_from_lidar": base_from["os1_lidar"],
        }.items():
            assert sample[key] == pytest.approx(expected, abs=1e-12), key


def test_types_and_shapes_are_the_documented_ones(small_run: Path) -> None:
    sample = RunDataset(small_run, ALL)[0]
    assert sample.keys() == get_type_hints(Sample).keys() - {*LACKING}
    wide, points = (92, 160), len(sample["cloud"])
    kinds = {
        "image": ("u1", (3, *wide)),
        "mask": ("i8", wide),
        "depth": ("f4", wide),
        "instance_mask": ("i4", wide),
        "moving_mask": ("b1", wide),
        "cloud": ("f4", (points, 3)),
        "labels": ("i8", (points,)),
        "instances": ("i4", (points,)),
        "moving": ("b1", (points,)),
        "reflectivity": ("f4", (points,)),
        "rays": ("i8", (points, 3)),
        "K": ("f8", (3, 3)),
        "D": ("f8", (5,)),
    }
    for key, value in sample.items():
        if isinstance(value, np.ndarray):
            kind, shape = kinds.get(key, ("f8", (4, 4)))
            assert (value.dtype, value.shape) == (np.dtype(kind), shape), key
            assert value.flags.writeable, key
            assert value.flags.c_contiguous, key


@pytest.mark.parametrize("camera", ["left", "right"])
def test_the_cloud_falls_on_pixels_of_the_same_class_and_object(fine_run: Path, camera: Any) -> None:
    asked = ("mask", "depth", "instance_mask", "cloud", "labels", "instances", "pose", "calibration")
    seen = right = same_object = 0
    errors = []
    for sample in RunDataset(fine_run, asked, camera=camera):
        camera_from_lidar = np.linalg.inv(sample["world_from_camera"]) @ sample["world_from_lidar"]
        points = sample["cloud"] @ camera_from_lidar[:3, :3].T + camera_from_lidar[:3, 3]
        near = points[:, 2] > 0.2
        pixels = points[near] @ sample["K"].T
        u, v = np.rint(pixels[:, :2] / pixels[:, 2:]).astype(int).T
        inside = (u >= 1) & (v >= 1) & (u < 319) & (v < 183)
        u, v, z = u[inside], v[inside], points[near, 2][inside]
        label, instance = sample["labels"][near][inside], sample["instances"][near][inside]
        around = [(v + down, u + aside) for down in (-1, 0, 1) for aside in (-1, 0, 1)]
        mask, ids, depth = (
            np.stack([sample[k][place] for place in around]) for k in ("mask", "instance_mask", "depth")
        )
        calm = (mask == mask[4]).all(0) & (np.abs(depth - z) < 0.1 * z).all(0)  # seen, and no silhouette
        seen += calm.sum()
        right += (mask[4] == label)[calm].sum()
        same_object += (ids == instance).any(0)[calm].sum()
        errors.append(np.abs(depth[4] / z - 1.0)[calm])
    assert seen > 10_000
    assert right > 0.992 * seen  # a twig, or a blade on the lawn, between two pixels' centres can still be hit
    assert same_object > 0.992 * seen
    assert np.median(np.concatenate(errors)) < 0.005


# ---------------------------------------------------------------------------------------------------------------------
# Association of messages to frames


def test_a_single_sensor_gives_all_its_frames(small_run: Path) -> None:
    assert RunDataset(small_run).stamps_ns.tolist() == [40_000_000 * k for k in range(1, 31)]
    assert RunDataset(small_run, ["labels"]).stamps_ns.tolist() == [100_000_000 * k for k in range(1, 13)]
    assert RunDataset(small_run, ["pose"]).items == ("pose",)
    assert RunDataset(small_run, ["pose"], anchor="lidar")[2]["world_from_lidar"].shape == (4, 4)


@pytest.mark.parametrize(("anchor", "tolerance_s"), [("camera", 0.02), ("lidar", 0.019), ("lidar", 0.02)])
def test_within_the_tolerance_the_nearest_reading_is_used_with_its_own_pose(
    small_run: Path, truth: Truth, anchor: Any, tolerance_s: float
) -> None:
    own, other = ("camera", "lidar") if anchor == "camera" else ("lidar", "camera")
    stamps = {"camera": [40_000_000 * k for k in range(1, 31)], "lidar": [100_000_000 * k for k in range(1, 13)]}
    nearest = {own_ns: min((abs(own_ns - ns), ns) for ns in stamps[other]) for own_ns in stamps[own]}
    expected = {own_ns: ns for own_ns, (apart, ns) in nearest.items() if apart <= tolerance_s * 1e9}
    dataset = RunDataset(small_run, ["image", "labels", "pose"], anchor=anchor, tolerance_s=tolerance_s)
    found = list(dataset)
    assert {s[f"{own}_stamp_ns"]: s[f"{other}_stamp_ns"] for s in found} == expected
    assert [s["stamp_ns"] for s in found] == list(expected)
    assert len(found) >= 6
    base_from = mounts(truth)
    for sample in found:
        for sensor, frame in (("camera", "left_camera_optical"), ("lidar", "os1_lidar")):
            pose = world_from_base(truth, sample[f"{sensor}_stamp_ns"]) @ base_from[frame]
            assert sample[f"world_from_{sensor}"] == pytest.approx(pose, abs=1e-9)
        assert np.array_equal(
            sample["labels"], cloud_fields(truth[POINTS][sample["lidar_stamp_ns"]])["label"].astype(int)
        )
        assert sample["world_from_base"] == pytest.approx(world_from_base(truth, sample["stamp_ns"]), abs=1e-9)


def test_a_pose_between_two_messages_lies_between_them(small_run: Path, tmp_path: Path, truth: Truth) -> None:
    """Every second pose is removed; interpolation between the others must find it."""
    bag = rewrite(small_run, tmp_path / "half.bag", keep=lambda topic, k: topic != ODOMETRY or k % 2 == 0)
    dataset = RunDataset(bag, ["pose"])  # poses at 0.02, 0.06, ... and images at 0.04, 0.08, ...
    assert len(dataset) == 29  # nothing after the last pose
    for sample in dataset:
        pose = truth[ODOMETRY][sample["stamp_ns"]].pose.pose
        exact = matrix(pose.position, pose.orientation)
        assert sample["world_from_base"][:3, 3] == pytest.approx(exact[:3, 3], abs=1e-3)  # the nearest pose is 6 mm off
        assert sample["world_from_base"][:3, :3] == pytest.approx(exact[:3, :3], abs=2e-3)
        assert not np.array_equal(sample["world_from_base"], exact)


def test_without_odometry_the_poses_are_those_of_the_model_states(small_run: Path, tmp_path: Path) -> None:
    bag = rewrite(small_run, tmp_path / "park_1.bag", keep=lambda topic, k: topic != ODOMETRY)
    for sample, expected in zip(RunDataset(bag, ["pose"]), RunDataset(small_run, ["pose"]), strict=True):
        assert sample["world_from_base"] == pytest.approx(expected["world_from_base"], abs=1e-9)


def test_stamps_are_those_of_the_headers_where_the_bag_has_others(small_run: Path, tmp_path: Path) -> None:
    delays = np.random.default_rng(0).integers(10**6, 3 * 10**8, 10**5).tolist()
    bag = rewrite(small_run, tmp_path / "park_1.bag", delay=lambda k: delays[k])
    items = [item for item in ALL if not item.startswith("moving")]  # which needs the experiment
    frames, expected = RunDataset(bag, items), RunDataset(small_run, items)
    assert len(frames) == len(expected) == 6
    for k in range(6):
        equal(frames[k], expected[k])
