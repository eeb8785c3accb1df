# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Poses that annotation uses, and the one-line error for each kind of bag that cannot be annotated."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from annotate_bags import Kind, Message, drive, odometry, standard, states, static, true_pose, write

from fieldtruth import annotation, cli
from fieldtruth.annotation import annotate, check_frames, read_poses
from fieldtruth.bag.geometry import RecordedPoses
from fieldtruth.bag.run import open_run
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, FieldtruthError, FieldtruthWarning
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.sensors.camera.config import CAMERA_FROM_OPTICAL, StereoConfig
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.world.model import World

RIG = Rig()
FOOTPRINT = transforms.pose((0.0, 0.0, -0.13228))


def poses_of(folder: Path, messages: list[Message], rig: Rig = RIG, robot: str = "husky") -> RecordedPoses:
    reported: list[float] = []
    folder.mkdir(exist_ok=True)
    run = open_run(write(folder / "x.bag", messages))
    poses = read_poses(run, rig, robot, reported.append)
    assert sum(reported) <= run.duration_s
    return poses


def assert_on_the_path(poses: RecordedPoses, stamps: list[int], within: float = 1e-9) -> None:
    for stamp in stamps:
        assert poses.trajectory.world_from_base(stamp) == pytest.approx(true_pose(stamp / 1e9), abs=within)


def test_stamps_are_the_multiples_of_the_period_among_the_poses(tmp_path: Path) -> None:
    poses = poses_of(tmp_path, drive(first=1, last=30))  # from 0.02 s to 0.6 s
    assert poses.stamps("camera", 25.0).tolist() == [k * 40_000_000 for k in range(1, 16)]
    assert poses.stamps("lidar", 10.0).tolist() == [k * 100_000_000 for k in range(1, 7)]
    assert poses.stamps("lidar", 10.0, 10**8).tolist() == [k * 100_000_000 for k in range(1, 6)]
    assert poses.stamps("camera", 30.0)[:3].tolist() == [33_333_333, 66_666_667, 100_000_000]


def test_stamps_of_a_wall_clock_lose_no_nanosecond(tmp_path: Path) -> None:
    start = 1_600_000_000 * 10**9 + 333_333_333
    poses = poses_of(tmp_path, [odometry(start + k * 20_000_000, true_pose(k / 50)) for k in range(30)])
    assert poses.stamps("camera", 30.0)[:3].tolist() == [start, start + 33_333_334, start + 66_666_667]
    assert poses.stamps("camera", 25.0)[0] == 1_600_000_000_360_000_000


def test_poses_are_interpolated_linearly_and_spherically(tmp_path: Path) -> None:
    # true_pose is such a motion, so a pose 7 ms off the grid gives the exact one on the grid
    messages = [odometry(k * 20_000_000 + 7_000_000, true_pose(k / 50 + 0.007)) for k in range(30)]
    poses = poses_of(tmp_path, messages)
    assert_on_the_path(poses, poses.stamps("camera", 25.0).tolist())


def test_readings_are_recorded_with_the_next_pose(tmp_path: Path) -> None:
    late = [
        odometry(k * 30_000_000, true_pose(k * 0.03), recorded=5 * 10**9 + k * 30_000_000 + k) for k in range(1, 10)
    ]
    poses = poses_of(tmp_path, late)
    assert [poses.recorded_at(t) - 5 * 10**9 for t in (40_000_000, 60_000_000, 270_000_000)] == [
        60_000_002,
        60_000_002,
        270_000_009,
    ]


def test_messages_before_the_clock_starts_or_the_robot_is_spawned_are_skipped(tmp_path: Path) -> None:
    early = odometry(0, transforms.pose((9.0, 9.0, 9.0)), recorded=1)
    assert_on_the_path(poses_of(tmp_path, [early, *drive()]), [20_000_000, 40_000_000])
    moving = [states(k * 20_000_000, {"tree": np.eye(4), "robot": true_pose(k / 50)}) for k in range(3, 20)]
    first = states(20_000_000, {"tree": np.eye(4)})
    poses = poses_of(tmp_path / "more", [first, *moving], robot="robot")
    assert poses.trajectory.stamps_ns[0] == 60_000_000
    assert_on_the_path(poses, [80_000_000, 120_000_000])


def test_poses_without_stamps_have_those_of_the_bag(tmp_path: Path) -> None:
    messages = [odometry(0, true_pose(k / 50), recorded=k * 20_000_000) for k in range(1, 20)]
    with pytest.warns(FieldtruthWarning, match="headers of /ground_truth/odom have no stamp"):
        poses = poses_of(tmp_path, messages)
    assert_on_the_path(poses, [40_000_000, 80_000_000])


def test_first_of_several_poses_with_one_stamp_is_used(tmp_path: Path) -> None:
    # a clock that ticks every 7 ms, a simulation that publishes every millisecond
    bunches = [states(k // 7 * 7_000_000, {"husky": true_pose(k * 0.001)}) for k in range(7, 300)]
    assert_on_the_path(poses_of(tmp_path, bunches), [40_000_000, 100_000_000, 200_000_000, 280_000_000], 1e-6)


@pytest.mark.parametrize(
    ("frame", "tree", "base_from_frame"),
    [
        ("/base_link", {}, np.eye(4)),
        ("", {}, np.eye(4)),
        ("base_footprint", {}, FOOTPRINT),
        (
            "base_footprint",
            {("base_footprint", "base_link"): transforms.pose((0.0, 0.0, 0.2))},
            transforms.pose((0, 0, -0.2)),
        ),
        (
            "mast",
            {("base_link", "arm"): true_pose(1.0), ("arm", "mast"): true_pose(2.0)},
            true_pose(1.0) @ true_pose(2.0),
        ),
    ],
)
def test_poses_of_another_frame_are_converted_to_base_link(
    tmp_path: Path, frame: str, tree: dict[tuple[str, str], Array], base_from_frame: Array
) -> None:
    there = [odometry(k * 20_000_000, true_pose(k / 50) @ base_from_frame, frame) for k in range(1, 20)]
    poses = poses_of(tmp_path, [*([static(tree)] if tree else []), *there])
    assert_on_the_path(poses, [40_000_000, 80_000_000])


def test_frames_that_the_bag_has_are_not_added_twice(tmp_path: Path) -> None:
    left = RIG.stereo.left.base_from_sensor
    over_the_mast = {
        ("base_link", "mast"): true_pose(1.0),
        ("mast", "left_camera"): transforms.inverse(true_pose(1.0)) @ left,
    }
    optical = {("left_camera", "left_camera_optical"): CAMERA_FROM_OPTICAL}
    run = open_run(write(tmp_path / "x.bag", [static(over_the_mast), static(optical, 2), *drive()]))
    rig = RIG.with_sensors(LidarConfig, enabled=False)
    assert check_frames(run, rig).keys() == {("base_link", "right_camera"), ("right_camera", "right_camera_optical")}


# ---------------------------------------------------------------------------------------------------------------------
# Bags that cannot be annotated


def gap(park: World) -> list[Message]:
    return [*drive(last=20), *drive(first=35, last=40)]


def moved_object(park: World) -> list[Message]:
    models = {instance.name: instance.world_from_object for instance in park.instances[:3]}
    models[park.instances[1].name] = park.instances[1].world_from_object + transforms.pose((0.1, 0.0, 0.0)) - np.eye(4)
    return [states(k * 20_000_000, {**models, "husky": true_pose(k / 50)}) for k in range(1, 20)]


def other_camera(park: World) -> list[Message]:
    return [static({("base_link", "right_camera"): transforms.pose((0.15, -0.06, 0.72), (0, 91, 0))}), *drive()]


def halves(park: World) -> list[Message]:
    return [*drive(last=5), *(m._replace(stamp=m.stamp + 10**9) for m in drive(last=5))]


def other_words(message: Message) -> Kind:
    """Its connection, with another name for the header."""
    return message.kind._replace(definition=message.kind.definition.replace("Header header", "Header head", 1))


def of_type(topic: str, msgtype: str) -> list[Message]:
    return [Message(k, standard(topic, msgtype), bytes(8)) for k in (1, 2)]


BAD: list[tuple[str, Callable[[World], list[Message]], str]] = [
    (
        "no poses",
        lambda _: [static({})],
        "has no /ground_truth/odom, nor /gazebo/model_states in its place; available: ",
    ),
    ("no message", lambda _: [], "x.bag has no messages"),
    ("one pose", lambda _: drive(last=1), "/ground_truth/odom of x.bag has only one pose"),
    ("one pose 2", lambda _: [states(1, {"husky": true_pose(0)})], "/gazebo/model_states of x.bag has only one pose"),
    (
        "short",
        lambda _: [odometry(k, true_pose(0)) for k in (1, 2)],
        "no stereo stamp (a multiple of 0.04 s) lies between them",
    ),
    ("gap", gap, "has a gap: no pose from 0.400 s to 0.700 s; at most 0.2 s are allowed"),
    ("reset", halves, "two messages of /ground_truth/odom have the stamp 20000000 ns, so one pass was recorded over"),
    (
        "not finite",
        lambda _: [odometry(1, true_pose(0), length=2.0)],
        "/ground_truth/odom of x.bag at 1 ns: a pose must be finite, with a quaternion of length 1, got x, y, z, qx, ",
    ),
    (
        "frame",
        lambda _: [odometry(5, true_pose(0), "chassis"), odometry(6, true_pose(0), "chassis")],
        "has poses of 'chassis', which /tf_static does not connect",
    ),
    (
        "frames",
        lambda _: [odometry(5, true_pose(0)), odometry(6, true_pose(0), "mast")],
        "must have poses of one frame, got 'base_link' and 'mast'",
    ),
    (
        "robot",
        lambda _: [states(1, {"ground": true_pose(0), "husky_1": true_pose(0)})],
        "'husky'; did you mean 'husky_1'? Available: husky_1, ground",
    ),
    (
        "outside",
        lambda _: drive(lambda t: true_pose(t) + 26.0 * np.eye(4, k=2)),
        "outside of park, which spans x -50 to 50 m",
    ),
    (
        "below",
        lambda _: drive(lambda t: transforms.pose((0, 0, -1.0))),
        "with seed 0; was it recorded in another world?",
    ),
    (
        "type",
        lambda _: of_type("/ground_truth/odom", "std_msgs/msg/Float32"),
        "must be of type nav_msgs/Odometry, got std_msgs/Float32",
    ),
    (
        "frames' type",
        lambda _: [*of_type("/tf_static", "std_msgs/msg/Time"), *drive()],
        "must be of type tf2_msgs/TFMessage, got std_msgs/Time",
    ),
    (
        "definition",
        lambda _: [m._replace(kind=other_words(m)) for m in drive()],
        "has a different definition of ",
    ),
    ("other world", moved_object, "was recorded in another world: "),
    ("other camera", other_camera, "has 'right_camera' at x 0.150, y -0.060, z 0.720 m in base_link, the rig at"),
]


@pytest.mark.parametrize(("make", "line"), [row[1:] for row in BAD], ids=[row[0] for row in BAD])
def test_a_bag_that_cannot_be_annotated_is_a_one_line_error(
    make: Callable[[World], list[Message]],
    line: str,
    park: SensorWorld,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    bag = write(Path("x.bag"), make(park.world))
    with pytest.raises(FieldtruthError) as error:
        annotate(bag, "park", scene=park.scene)
    text = str(error.value).replace(f"{tmp_path}/", "")
    assert line in text
    assert "\n" not in text
    assert [path.name for path in tmp_path.iterdir()] == ["x.bag"]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--environment", "prak"], "unknown environment 'prak'; did you mean 'park'? Available: "),
        (["--environment", "park", "--out", "x.bag"], "x.bag already exists; remove it, or choose another --out"),
        (["--environment", "park", "--out", "x.bag/y.bag"], "cannot write x.bag/y.bag: "),
        (["--environment", "park", "--robot", "jackal"], "cannot read x.bag: "),
        (
            ["--environment", "park", "--experiment", "prak_1"],
            "unknown experiment 'prak_1'; did you mean 'park_1'? Available: ",
        ),
        ([], "the following arguments are required: --environment"),
    ],
)
def test_a_wrong_argument_is_a_one_line_error(
    words: list[str], line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    whole = write(Path("x.bag"), drive(last=200)).read_bytes()
    if "--robot" in words:
        Path("x.bag").write_bytes(whole[:5000])
    assert cli.main(["annotate", "x.bag", *words]) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"error: {line}")
    assert err.count("\n") == 1
    assert [path.name for path in Path().iterdir()] == ["x.bag"]


def test_an_interruption_shows_the_command_that_resumes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(annotation, "check_frames", stop)
    bag = write(tmp_path / "x.bag", drive())
    assert cli.main(["annotate", str(bag), "--environment", "park"]) == 130
    assert capsys.readouterr().err.endswith(f" resume with: fieldtruth annotate {bag} --environment park\n")
    assert [path.name for path in tmp_path.iterdir()] == ["x.bag"]


def test_a_rig_without_sensors_has_nothing_to_add(tmp_path: Path) -> None:
    bag = write(tmp_path / "x.bag", drive())
    with pytest.raises(ConfigurationError, match="nothing to add"):
        annotate(bag, "park", rig=paper_rig(cameras=StereoConfig(enabled=False), lidar=LidarConfig(enabled=False)))


def test_a_scene_must_be_a_scene(tmp_path: Path) -> None:
    bag = write(tmp_path / "x.bag", drive())
    with pytest.raises(ConfigurationError, match=r"^scene must be a Scene, got 'park'; see load_world$"):
        annotate(bag, "park", scene="park")  # type: ignore[arg-type]
    assert [path.name for path in tmp_path.iterdir()] == ["x.bag"]
