# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Mounts of sensors from the fixed joints of a URDF: equal poses, and one line for what cannot be used."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from many_sensors import many_rig

from fieldtruth import ConfigurationError, dump_experiment, load_experiment, parse_experiment
from fieldtruth.bag.messages import rig_transforms
from fieldtruth.core import transforms
from fieldtruth.experiment.rig import Rig
from fieldtruth.report.rig import FORMATS

LINKS = ("map", "base_link", "mast", "eye_left", "eye_right", "pan", "gripper", "lidar_link", "imu")
ROBOT = """\
<?xml version="1.0"?>
<robot name="own">
{links}
  <joint name="under" type="fixed"><parent link="map"/><child link="base_link"/><origin xyz="0 0 -0.5"/></joint>
  <joint name="to_mast" type="fixed">
    <parent link="base_link"/><child link="mast"/><origin xyz="0.1 0 0.5" rpy="0 0 1.5707963267948966"/>
  </joint>
  <joint name="l" type="fixed"><parent link="mast"/><child link="eye_left"/><origin xyz="0.05 0 0.3"/></joint>
  <joint name="r" type="fixed"><parent link="mast"/><child link="eye_right"/><origin xyz="0.05 -0.2 0.3"/></joint>
  <joint name="turn" type="revolute"><parent link="mast"/><child link="pan"/><axis xyz="0 0 1"/></joint>
  <joint name="grip" type="fixed"><parent link="pan"/><child link="gripper"/></joint>
  <joint name="top" type="fixed"><parent link="mast"/><child link="lidar_link"/><origin xyz="0 0 0.4"/></joint>
  <joint name="imu" type="fixed"><parent link="map"/><child link="imu"/><origin xyz="0 0 0.25"/></joint>
</robot>
"""


def robot(folder: Path, old: str = "", new: str = "", name: str = "robot.urdf") -> str:
    text = ROBOT.format(links="\n".join(f'  <link name="{link}"/>' for link in LINKS))
    assert old in text
    (folder / name).write_text(text.replace(old, new), "utf-8")
    return name


def experiment(folder: Path, sensors: list[dict[str, Any]], urdf: object = "robot.urdf") -> Path:
    path = folder / "own.yaml"
    route = {"start": [49.9, 8.9], "waypoints": [[49.9001, 8.9]]}
    values = {"name": "own", "environment": "park", "route": route, "rig": {"urdf": urdf, "sensors": sensors}}
    path.write_text(yaml.safe_dump(values), "utf-8")
    return path


def assert_equal_rigs(found: Rig, expected: Rig) -> None:
    transforms, wanted = rig_transforms(found), rig_transforms(expected)
    assert list(transforms) == list(wanted)
    for pair, matrix in wanted.items():
        np.testing.assert_allclose(transforms[pair], matrix, rtol=0, atol=1e-9)
    for sensor, other in zip(found.sensors, expected.sensors, strict=True):
        without = {"mount": None, "baseline": None}
        assert sensor.model_dump() | without == other.model_dump() | without


@pytest.mark.parametrize("rig", [Rig(), many_rig()], ids=["paper", "many"])
def test_a_rig_comes_back_through_the_urdf_that_is_written_of_it(rig: Rig, tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(FORMATS["urdf"].text(rig), "utf-8")
    sensors = [sensor.model_dump(mode="json") for sensor in rig.sensors]
    for values in sensors:
        values.pop("mount", None)
        values.pop("baseline", None)
    found = load_experiment(experiment(tmp_path, sensors))
    assert_equal_rigs(found.rig, rig)
    # What is stored beside the bag does not need the URDF.
    (tmp_path / "robot.urdf").unlink()
    stored = dump_experiment(found)
    assert "urdf" not in stored
    assert parse_experiment(stored) == found


def test_poses_are_those_along_the_chain_of_fixed_joints(tmp_path: Path) -> None:
    robot(tmp_path)
    sensors: list[dict[str, Any]] = [
        {"kind": "lidar", "name": "top", "frame": "lidar_link"},
        {"kind": "imu", "name": "own_imu", "frame": "imu"},
        {"kind": "stereo", "name": "pair", "frame": "eye_{side}"},
        {"kind": "gnss", "name": "antenna", "frame": "mast", "mount": {"xyz": [0.0, 0.0, 1.0]}},
    ]
    lidar, imu, pair, antenna = load_experiment(experiment(tmp_path, sensors)).rig.sensors
    assert lidar.frames()["lidar_link"].model_dump() == {"xyz": (0.1, 0.0, 0.9), "rpy_deg": (0.0, 0.0, 90.0)}
    assert imu.frames()["imu"].xyz == (0.0, 0.0, 0.75)  # its parent is also that of base_link
    assert pair.frames()["eye_left"].xyz == pytest.approx((0.1, 0.05, 0.8), abs=1e-12)
    assert pair.frames()["eye_right"].xyz == pytest.approx((0.3, 0.05, 0.8), abs=1e-12)
    assert antenna.frames()["mast"].xyz == (0.0, 0.0, 1.0)  # what is given stays
    turned = pair.frames()["eye_left"].base_from_sensor[:3, :3]
    np.testing.assert_allclose(turned, transforms.pose((0, 0, 0), (0, 0, 90))[:3, :3], atol=1e-12)


def test_the_short_form_takes_frames_of_the_urdf_too(tmp_path: Path) -> None:
    robot(tmp_path)
    rig = Rig.model_validate({"urdf": str(tmp_path / "robot.urdf"), "lidar": {"frame": "lidar_link"}})
    assert rig.lidar.mount.xyz == (0.1, 0.0, 0.9)
    assert rig.imu == Rig().imu


LIDAR = {"kind": "lidar", "name": "top", "frame": "lidar_link"}
MISTAKES: list[tuple[dict[str, Any], str]] = [
    (
        {"frame": "lidar_lnk"},
        "rig.sensors[0].frame 'lidar_lnk' is not a link of {file}; nearest first: lidar_link, ",
    ),
    (
        {"frame": "gripper"},
        "rig.sensors[0].frame 'gripper' moves against base_link: joint 'turn' of {file} is 'revolute', not fixed; ",
    ),
    ({"frame": "lidar_link", "name": "Top"}, "rig.sensors[0].name must be a word of at most 32 "),
    (
        {"kind": "stereo", "frame": "eye_{{side}}", "baseline": 0.3},
        "rig.sensors[0].baseline must be 0.2, as in {file}, got 0.3",
    ),
    ({"kind": "stereo", "frame": "{{side}}_eye"}, "rig.sensors[0].frame 'left_eye' is not a link of {file}; nearest "),
]


@pytest.mark.parametrize(("change", "line"), MISTAKES)
def test_a_frame_that_cannot_be_used_is_one_line(change: dict[str, Any], line: str, tmp_path: Path) -> None:
    robot(tmp_path)
    sensor = {key: value.format() if isinstance(value, str) else value for key, value in (LIDAR | change).items()}
    path = experiment(tmp_path, [sensor])
    with pytest.raises(ConfigurationError) as error:
        load_experiment(path)
    assert str(error.value).startswith(f"{path}: {line.format(file=tmp_path / 'robot.urdf')}")
    assert "\n" not in str(error.value)


BOMB = '<!DOCTYPE robot [<!ENTITY a "aaaa"><!ENTITY b SYSTEM "file:///etc/hostname">]>\n<robot'
FILES = [
    ("<robot", BOMB, "robot.urdf has a document type, which a URDF does not need"),
    ("</robot>", '<xacro:wheel name="a"/></robot>', "robot.urdf needs xacro first; run: xacro "),
    ("</robot>", "", "robot.urdf is not XML: "),
    ('<?xml version="1.0"?>', '<?xml version="1.0" encoding="none"?>', "robot.urdf is not XML: "),
    ('<?xml version="1.0"?>', '<?xml version="1.0" encoding="utf-7"?>', "robot.urdf is not XML: "),
    ('<?xml version="1.0"?>', '<?xml version="1.0" encoding="gb2312"?>', "robot.urdf is not XML: "),
    ('type="revolute"', 'type="revolute" type="fixed"', "robot.urdf is not XML: "),
    ('<link name="base_link"/>', '<link name="base"/>', "robot.urdf has no link 'base_link'; nearest first: "),
    ('xyz="0 0 0.4"', 'xyz="0 0"', "robot.urdf joint 'top': xyz of its origin must be three numbers, got '0 0'"),
    ('xyz="0 0 0.4"', 'xyz="0 0 nan"', "robot.urdf joint 'top': xyz of its origin must be three numbers, got "),
    ('link="imu"', 'link="mast"', "robot.urdf has two joints with the child 'mast'"),
    ('<parent link="map"/><child link="base_link"/>', '<parent link="mast"/><child link="base_link"/>', "has a cycle"),
]


@pytest.mark.parametrize(("old", "new", "line"), FILES, ids=[line for *_, line in FILES])
def test_a_file_that_cannot_be_used_is_one_line(old: str, new: str, line: str, tmp_path: Path) -> None:
    robot(tmp_path, old, new)
    path = experiment(tmp_path, [LIDAR])
    with pytest.raises(ConfigurationError) as error:
        load_experiment(path)
    assert str(error.value).startswith(f"{path}: rig.urdf {tmp_path}")
    assert line in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("urdf", "line"),
    [
        (3, "rig.urdf must be the path of a URDF, got 3"),
        ("", "rig.urdf must be the path of a URDF, got ''"),
        ("none.urdf", "rig.urdf cannot read "),
        (".", "rig.urdf cannot read "),
        ("own.yaml", "is not XML: "),
    ],
)
def test_a_urdf_that_cannot_be_read_is_one_line(urdf: object, line: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError) as error:
        load_experiment(experiment(tmp_path, [LIDAR], urdf))
    assert line in str(error.value)
    assert "\n" not in str(error.value)


def test_a_large_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot(tmp_path)
    monkeypatch.setattr("fieldtruth.experiment.urdf.MAX_FILE_SIZE", 100)
    with pytest.raises(ConfigurationError, match="is too large for a URDF"):
        load_experiment(experiment(tmp_path, [LIDAR]))


def test_angles_give_their_rotation_back_at_every_pitch() -> None:
    random = np.random.default_rng(7)
    for near in (0.0, 1e-10, 1e-8, 1e-6, 1e-3, 1.0, 30.0):
        for roll, yaw in random.uniform(-180.0, 180.0, (50, 2)):
            for pitch in (90.0 - near, near - 90.0):
                rotation = transforms.pose((0.0, 0.0, 0.0), (roll, pitch, yaw))[:3, :3]
                again = transforms.pose((0.0, 0.0, 0.0), transforms.rpy_deg_from_rotation(rotation).tolist())[:3, :3]
                np.testing.assert_allclose(again, rotation, rtol=0, atol=1e-11)
