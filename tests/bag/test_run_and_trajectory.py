# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Opening runs, true poses from either topic, and decoding of images."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Reader, Writer

from fieldtruth.bag import decode as read
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import ModelStatesReader, Trajectory, read_poses
from fieldtruth.bag.reader import decoder, open_bag
from fieldtruth.bag.run import open_run
from fieldtruth.core import transforms
from fieldtruth.core.classes import CLASSES, PALETTE, Label
from fieldtruth.experiment.config import Experiment

STATES = "/gazebo/model_states"


def copy_of(bag: Path, target: Path, without: set[str]) -> Path:
    """Write a bag again without some topics."""
    with Reader(bag) as reader, Writer(target) as writer:
        connections = {
            c.id: writer.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, md5sum=c.digest)
            for c in reader.connections
            if c.topic not in without
        }
        for connection, stamp, data in reader.messages():
            if connection.id in connections:
                writer.write(connections[connection.id], stamp, bytes(data))
    return target


def test_a_folder_and_its_bag_are_the_same_run(small_run: Path) -> None:
    run = open_run(small_run)
    assert run == open_run(small_run / "park_1.bag")
    assert (run.name, run.start_ns, run.end_ns) == ("park_1", 10**6, 1_200_000_000)
    assert run.duration_s == pytest.approx(1.199)
    assert isinstance(run.experiment, Experiment)
    assert run.counts["/os1_cloud_node/points"] == 12


def test_the_experiment_of_another_bag_in_the_folder_is_ignored(small_run: Path, tmp_path: Path) -> None:
    shutil.copy(small_run / "experiment.yaml", tmp_path)
    shutil.copy(small_run / "park_1.bag", tmp_path / "other.bag")
    assert open_run(tmp_path).experiment is None


def test_errors_of_opening_runs_are_one_line(small_run: Path, tmp_path: Path) -> None:
    with pytest.raises(BagError, match=r"nowhere does not exist; a run must be the folder of a run, or a bag"):
        open_run(tmp_path / "nowhere")
    with pytest.raises(BagError, match="has no bag; a run must be a folder with one bag"):
        open_run(tmp_path)
    for name in "ab":
        shutil.copy(small_run / "park_1.bag", tmp_path / f"{name}.bag")
    with pytest.raises(BagError, match=r"has 2 bags \(a.bag, b.bag\)"):
        open_run(tmp_path)
    empty = tmp_path / "empty.bag"
    with Writer(empty):
        pass
    with pytest.raises(BagError, match=r"empty\.bag has no messages"):
        open_run(empty)
    with pytest.raises(BagError, match="has no /lidar; available: /clock, "):
        open_run(small_run).require("/imu/data", "/lidar")


def test_model_states_read_in_place_equal_the_message(small_run: Path) -> None:
    reader = ModelStatesReader()
    with open_bag(small_run / "park_1.bag") as bag:
        decode = decoder(bag)
        for raw in list(bag.messages([STATES]))[::400]:
            message = decode(raw)
            poses, twists = reader.poses(raw.data), reader.twists(raw.data)
            assert list(reader.names) == message.name
            for k in (reader.row(raw.data), 1, len(message.name) - 1):
                p, q, twist = message.pose[k].position, message.pose[k].orientation, message.twist[k]
                assert poses[k].tolist() == [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
                linear, angular = twist.linear, twist.angular
                assert twists[k].tolist() == [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
    with pytest.raises(BagError, match="/gazebo/model_states has no model 'robot'; available: husky, "):
        reader.row(raw.data, "robot")
    for broken in (raw.data[:-1], raw.data[:3], b"", raw.data + b"x", b"\xff" * 40):
        with pytest.raises(BagError, match="damaged"):
            ModelStatesReader().poses(broken)


def test_both_topics_give_the_same_trajectory(small_run: Path, tmp_path: Path) -> None:
    from_odometry = open_run(small_run).trajectory
    bag = copy_of(small_run / "park_1.bag", tmp_path / "states.bag", {"/ground_truth/odom"})
    from_states = open_run(bag).trajectory
    rows = np.searchsorted(from_states.stamps_ns, from_odometry.stamps_ns)
    assert len(from_states) == 1200
    assert np.array_equal(from_states.stamps_ns[rows], from_odometry.stamps_ns)
    assert np.array_equal(from_states.position[rows], from_odometry.position)
    assert np.array_equal(from_states.quaternion_wxyz[rows], from_odometry.quaternion_wxyz)
    neither = copy_of(bag, tmp_path / "neither.bag", {STATES})
    with pytest.raises(BagError, match="has no /ground_truth/odom"):
        read_poses(open_run(neither))


def test_poses_are_interpolated_linearly_and_spherically() -> None:
    turn = [transforms.pose((0, 0, 0), (0, 0, yaw)) for yaw in (0.0, 90.0)]
    way = Trajectory(
        np.array([1000, 2000]),
        np.array([[0.0, 0.0, 0.0], [2.0, 4.0, 0.0]]),
        # the same attitude has two signs
        np.stack([1, -1])[:, None] * np.stack([transforms.quaternion_wxyz_from_rotation(t[:3, :3]) for t in turn]),
    )
    assert np.allclose(way.world_from_base(1250), transforms.pose((0.5, 1.0, 0.0), (0, 0, 22.5)), atol=1e-12)
    assert np.allclose(way.world_from_base(2000), transforms.pose((2.0, 4.0, 0.0), (0, 0, 90.0)), atol=1e-12)
    assert np.allclose(way.world_from_base(500), turn[0])
    assert way.length_m == pytest.approx(20**0.5)
    with pytest.raises(BagError, match="no true pose at 3001 ns; poses range from 1000 to 2000 ns"):
        way.world_from_base(3001)


def test_colours_are_decoded_to_their_classes() -> None:
    label = np.arange(1, 16, dtype=np.uint8).reshape(3, 5)
    assert np.array_equal(read.labels(PALETTE[label]), label)
    for c in CLASSES:
        if c.label is Label.VOID:
            continue
        for channel in range(3):
            wrong = PALETTE[np.full((2, 3), c.label)].copy()
            wrong[1, 2, channel] ^= 1
            colour = " ".join(map(str, wrong[1, 2]))
            with pytest.raises(BagError, match=f"row 1, column 2 has the colour {colour}, which no class has"):
                read.labels(wrong)


def test_images_with_other_channel_orders_and_strides_are_read(small_run: Path) -> None:
    topic = "/stereo/camera/left/tag/img_raw"
    message = next(read.read_bag(small_run / "park_1.bag", [topic])).message
    rgb = read.image(message)
    for encoding in ("bgr8", "8UC3"):
        padded = np.zeros((message.height, message.width * 3 + 8), np.uint8)
        padded[:, :-8] = rgb[..., ::-1].reshape(message.height, -1)
        other = type(message)(
            message.header, message.height, message.width, encoding, 0, padded.shape[1], padded.reshape(-1)
        )
        assert np.array_equal(read.image(other), rgb)
    for changes in ({"encoding": "yuv422"}, {"width": message.width - 1, "step": 12}, {"height": message.height + 1}):
        values = {name: getattr(message, name) for name in ("header", "height", "width", "encoding", "is_bigendian",
                                                             "step", "data")} | changes  # fmt: skip
        with pytest.raises(BagError, match="image"):
            read.image(type(message)(**values))


def test_depth_and_instance_images_are_decoded(small_run: Path) -> None:
    bag = small_run / "park_1.bag"
    names = ("depth", "instances", "tag/img_raw")
    depth, instance, tag = (next(read.read_bag(bag, [f"/stereo/camera/left/{n}"])).message for n in names)
    metres, ids, label = read.depth(depth), read.instances(instance), read.labels(read.image(tag))
    sky = label == Label.SKY
    assert sky.any()
    assert np.array_equal(np.isinf(metres), sky)
    assert np.array_equal(ids == 0, sky)
    assert (metres > 0).all()
    assert (depth.encoding, instance.encoding, depth.step, instance.step) == ("32FC1", "16UC1", 640, 320)
    with pytest.raises(BagError, match="must be 32FC1"):
        read.depth(tag)
    with pytest.raises(BagError, match="must be 16UC1"):
        read.instances(depth)


def test_a_zero_quaternion_is_an_error(small_run: Path) -> None:
    message = next(read.read_bag(small_run / "park_1.bag", ["/ground_truth/odom"])).message
    pose = message.pose.pose
    assert read.pose_matrix(pose).shape == (4, 4)
    nowhere = type(pose)(pose.position, type(pose.orientation)(0.0, 0.0, 0.0, 0.0))
    with pytest.raises(BagError, match=r"must be finite, with a quaternion of length 1, got .* 0, 0, 0, 0"):
        read.pose_matrix(nowhere)
