# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The launch file of ROS 2 starts what its arguments ask for.

With stand-ins for ROS 2's launch packages, which Debian does not have.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml
from test_ros_package import package

from fieldtruth.experiment.rig import Rig
from fieldtruth.gazebo.robot import write_robot

ACTIONS = (
    "DeclareLaunchArgument",
    "ExecuteProcess",
    "IncludeLaunchDescription",
    "OpaqueFunction",
    "SetEnvironmentVariable",
)
FLAGS = {"x": "-x", "y": "-y", "z": "-z", "roll": "-R", "pitch": "-P", "yaw": "-Y"}


def action(kind: str) -> Callable[..., Any]:
    return lambda *given, **named: SimpleNamespace(kind=kind, given=given, **named)


@pytest.fixture
def declared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    modules: dict[str, dict[str, Any]] = {
        "launch": {"LaunchDescription": list},
        "launch.actions": {name: action(name) for name in ACTIONS},
        "launch.launch_description_sources": {"PythonLaunchDescriptionSource": str},
        "launch_ros": {},
        "launch_ros.actions": {"Node": action("Node")},
        "ament_index_python": {},
        "ament_index_python.packages": {"get_package_share_directory": lambda name: f"/share/{name}"},
    }
    for name, members in modules.items():
        module = ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)
    package(tmp_path, 2)
    write_robot(tmp_path, Rig(), "gz")
    file = tmp_path / "launch/world.launch.py"
    scope: dict[str, Any] = {"__name__": "world_launch", "__file__": str(file)}
    exec(compile(file.read_text(), str(file), "exec"), scope)
    result: list[Any] = scope["generate_launch_description"]()
    return result


def started(declared: list[Any], **changes: str) -> list[Any]:
    """Actions with these arguments, the defaults for the others."""
    defaults = {a.given[0]: a.default_value for a in declared if a.kind == "DeclareLaunchArgument"}
    (start,) = (a for a in declared if a.kind == "OpaqueFunction")
    return list(start.function(SimpleNamespace(launch_configurations=defaults | changes)))


def nodes(actions: list[Any]) -> list[str]:
    return [a.executable for a in actions if a.kind == "Node"]


def scripts(actions: list[Any]) -> list[str]:
    return [Path(a.cmd[1]).name for a in actions if a.kind == "ExecuteProcess"]


def gazebo_arguments(actions: list[Any]) -> str:
    (gazebo,) = (a for a in actions if a.kind == "IncludeLaunchDescription")
    return str(dict(gazebo.launch_arguments)["gz_args"])


def test_by_default_the_first_experiment_is_driven(declared: list[Any], tmp_path: Path) -> None:
    actions = started(declared)
    assert nodes(actions) == ["create", "parameter_bridge", "image_bridge", "robot_state_publisher"]
    assert scripts(actions) == ["relay.py", "waypoints.py"]
    assert gazebo_arguments(actions) == f"-r {tmp_path}/worlds/park.sdf"
    (create,) = (a.arguments for a in actions if getattr(a, "executable", "") == "create")
    pose = yaml.safe_load((tmp_path / "config/park_1.yaml").read_text())["start"]
    assert {key: float(create[create.index(flag) + 1]) for key, flag in FLAGS.items()} == pose


def test_arguments_change_what_is_started(declared: list[Any], tmp_path: Path) -> None:
    changes = {"experiment": "park_2", "drive": "false", "plain": "true", "gui": "false", "rviz": "true"}
    actions = started(declared, record="bag", **changes)
    assert scripts(actions) == ["relay.py", "record.sh"]
    assert nodes(actions)[-1] == "rviz2"
    assert gazebo_arguments(actions) == f"-r -s --headless-rendering {tmp_path}/worlds/park_plain.sdf"
