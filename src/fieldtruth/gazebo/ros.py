# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A package of ROS around a world and the robot: launch files, waypoints, the nodes that drive and record, RViz.

Topics of the newer Gazebo come to ROS 2 through ros_gz_bridge; images through ros_gz_image.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

import fieldtruth
from fieldtruth.bag import topics
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.readings import Fix, Inertial, WheelSpeeds
from fieldtruth.core.transforms import xyzw_from_wxyz
from fieldtruth.drive.physics import resting_pose
from fieldtruth.experiment.config import DriveConfig, Experiment, geodetic_route, metres_from_route
from fieldtruth.experiment.environment_file import environment_of
from fieldtruth.experiment.files import dump_experiment, load_experiment
from fieldtruth.experiment.imaging_config import Imager, ImagingConfig
from fieldtruth.experiment.names import EXPERIMENTS
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.scanning_config import ScanningConfig
from fieldtruth.gazebo.files import render, write
from fieldtruth.gazebo.robot import Flavour, cloud_topic, observers, robot_words, tachometer_rate
from fieldtruth.world.model import World

_CONFIG: Final = (
    "start: pose of base_link in the world [m, rad]; waypoints: latitude, longitude [deg]; the rest in SI units"
)


def rviz_configuration(rig: Rig, ros: int, highest: int = Label.PARTICLE) -> str:
    """Return RViz's file for ROS 1 or 2: the cloud of each LiDAR, photograph and tag image of each camera or pair.

    Colours of clouds span the classes up to ``highest``.

    The frames of cameras are hidden, because their optical frames hide them.
    """
    hidden = [imager.frame for each in rig.sensors if isinstance(each, ImagingConfig) for imager in each.imagers()]
    sensors = {"scanners": rig.enabled(ScanningConfig), "imaging": rig.enabled(ImagingConfig)}
    return render("ros", "fieldtruth.rviz.jinja", ros=ros, hidden_frames=hidden, highest=highest, **sensors)


def bridge_text(rig: Rig) -> str:
    """Return ros_gz_bridge's table; images go through ros_gz_image, see ``image_topics``."""
    return render(
        "ros",
        "bridge.yaml.jinja",
        topics=topics,
        inertial=rig.giving(Inertial),
        receivers=rig.giving(Fix),
        scanners=rig.enabled(ScanningConfig),
        cloud_topic=cloud_topic,
        infos=[imager.topic_of("camera_info") for imager in rig.imagers],
    )


def image_topics(rig: Rig) -> list[str]:
    """Topics of images, the same in Gazebo and ROS; ROS's image transport adds the compressed ones."""
    photographs = [imager.topic_of("photograph").removesuffix("/compressed") for imager in rig.imagers]
    kinds = ("labels_map", "colored_map")
    return [*photographs, *(f"{imager.topic}/segmentation/{kind}" for imager in rig.imagers for kind in kinds)]


def builtin_experiments(environment: str) -> tuple[Experiment, ...]:
    """Return the built-in experiments without actors in an environment, in the order of their names."""
    experiments = (load_experiment(name) for name in EXPERIMENTS)
    return tuple(each for each in experiments if each.environment == environment and not each.actors)


def write_ros_package(
    folder: Path, world: World, rig: Rig, flavour: Flavour, experiments: Sequence[Experiment] | None = None
) -> None:
    """Write all of a package of ROS but its worlds and models into ``folder``, the root of a package of one flavour.

    The package is one of ROS 1 (classic) or ROS 2 (gz). It expects the world in ``worlds/{name}.world`` (classic) or
    ``.sdf`` (gz), its plain twin in ``{name}_plain``, and what ``write_robot`` writes.

    Args:
        folder: the package; existing files of the same names are replaced.
        world: gives the name and the height of the ground at the starts.
        rig: the sensors, as in ``write_robot``.
        flavour: for which Gazebo.
        experiments: those whose start and waypoints are written, with routes that are not random; None takes the
            built-in ones of the environment. Without any there is nothing to start, and nothing is written.

    Raises:
        ConfigurationError: no IMU or no GNSS receiver, by which the robot is steered.
    """
    chosen = builtin_experiments(world.name) if experiments is None else tuple(experiments)
    if not chosen:
        return
    _check_steering(rig)
    configs = {experiment.name: _config(experiment, world, rig) for experiment in chosen}
    ros = 1 if flavour == "classic" else 2
    values = _values(world, rig, ros, configs)
    launch = "world.launch" if ros == 1 else "world.launch.py"
    for path, template in {
        "package.xml": f"package_ros{ros}.xml.jinja",
        "CMakeLists.txt": f"CMakeLists_ros{ros}.txt.jinja",
        "README.md": f"README_ros{ros}.md.jinja",
        "scripts/waypoints.py": f"waypoints_ros{ros}.py.jinja",
        "scripts/relay.py": f"relay_ros{ros}.py.jinja",
        "scripts/record.sh": "record.sh.jinja",
        f"launch/{launch}": f"{launch}.jinja",
    }.items():
        write(folder / path, render("ros", template, **values))
    for script in ("waypoints.py", "relay.py", "record.sh"):
        (folder / "scripts" / script).chmod(0o755)
    for name, config in configs.items():
        write(folder / "config" / f"{name}.yaml", _yaml(config, _CONFIG))
        if ros == 1:
            text = render("ros", "experiment.launch.jinja", name=name, **values | config)
            write(folder / "launch" / f"{name}.launch", text)
    _write_shared_config(folder, world, rig, _again(chosen[0], world, rig, ros))
    if ros == 2:
        write(folder / "config" / "bridge.yaml", bridge_text(rig))
    write(folder / "rviz" / "fieldtruth.rviz", rviz_configuration(rig, ros, len(world.classes) - 1))


def _write_shared_config(folder: Path, world: World, rig: Rig, again: Experiment) -> None:
    """Write what the experiments of a package have in common: layout, sensors and calibration of the cameras."""
    if world.layout:
        layout = json.loads(json.dumps(dict(world.layout)))  # lists instead of tuples
        write(folder / "config" / "layout.yaml", _yaml(layout, f"Changes to the layout of {world.name}."))
    if rig != Rig():
        write(folder / "config" / "experiment.yaml", dump_experiment(again))
    calibrations = {imager.topic_of("camera_info"): _calibration(imager) for imager in rig.imagers}
    write(folder / "config" / "cameras.yaml", _yaml(calibrations, "Calibration of the cameras, as in CameraInfo."))


def _check_steering(rig: Rig) -> None:
    for sensor in (rig.first(Inertial), rig.first(Fix)):
        if not sensor.enabled:
            raise ConfigurationError(
                f"rig.sensors: no {sensor.kind} is enabled; the waypoint node of a Gazebo package steers by one; "
                f"add {{kind: {sensor.kind}, name: {sensor.name}}}"
            )


def _values(world: World, rig: Rig, ros: int, configs: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the templates of a package ask for; ``configs`` are those of its experiments by name."""
    wheels = [output for each in rig.in_order() for output in each.outputs() if output.reading is WheelSpeeds]
    return {
        "environment": world.name,
        "base": environment_of(world.name, world.layout),  # of which `layout` is a layout
        "version": fieldtruth.__version__,
        "experiments": list(configs),
        "start": next(iter(configs.values()))["start"],
        "world": world.name,
        "seed": world.seed,
        "layout": world.layout,
        "plain_world": f"{world.name}_plain",
        "rig": rig,
        "robot": robot_words(rig.robot),
        "scanners": rig.enabled(ScanningConfig),
        "inertial": rig.first(Inertial),
        "receiver": rig.first(Fix),
        "other": rig != Rig(),
        "observers": observers(rig),
        "lenses": [each.projection for each in rig.enabled(ImagingConfig)],
        "ros": ros,
        "topics": topics,
        "names": [topic.name for topic in topics.topics_of(rig)],
        "tachometer_rate": tachometer_rate(rig),
        "wheels": {name: topic.name for speeds in wheels for name, topic in speeds.fields.items()},
        "images": image_topics(rig),
    }


def _config(experiment: Experiment, world: World, rig: Rig) -> dict[str, Any]:
    """Return what the waypoint node and the launch files read; start is base_link's pose in the world [m], [rad]."""
    route, control = geodetic_route(experiment.route, world.origin), experiment.control
    start, ahead = metres_from_route(route, world.origin)[:2]
    yaw = float(np.arctan2(ahead[1] - start[1], ahead[0] - start[0]))
    position, quaternion = resting_pose(world.terrain.field, start, yaw, rig)
    roll, pitch, yaw = Rotation.from_quat(xyzw_from_wxyz(quaternion)).as_euler("xyz").tolist()
    pose = (*position.tolist(), roll, pitch, yaw)
    names = ("x", "y", "z", "roll", "pitch", "yaw")
    base_from_sensor = Rotation.from_matrix(rig.first(Inertial).mount.base_from_sensor[:3, :3]).as_quat(canonical=True)
    return {
        "experiment": experiment.name,
        "start": {name: round(value, 6) for name, value in zip(names, pose, strict=True)},
        **control.model_dump(),
        "origin": [world.origin.latitude, world.origin.longitude],
        "base_from_sensor": np.round(base_from_sensor, 15).tolist(),
        "waypoints": [list(waypoint) for waypoint in route.waypoints],
    }


def _again(experiment: Experiment, world: World, rig: Rig, ros: int) -> Experiment:
    """Return what annotates a bag of ROS 1, or senses again along a recording of ROS 2, in this world with this rig."""
    values = {"rig": rig, "seed": world.seed, "layout": dict(world.layout)}
    if ros == 2:
        values |= {"name": "again", "route": None, "drive": DriveConfig(track=f"/tmp/{experiment.name}")}
    return experiment.model_copy(update=values)


def _calibration(imager: Imager) -> dict[str, Any]:
    lens = imager.config.projection
    matrix = np.array([[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]])
    shift = np.array([[-lens.fx * imager.baseline if imager.baseline else 0.0], [0.0], [0.0]])
    return {
        "frame_id": imager.optical_frame,
        "width": imager.config.width,
        "height": imager.config.height,
        "K": matrix.ravel().tolist(),
        "R": np.eye(3).ravel().tolist(),
        "P": np.hstack([matrix, shift]).ravel().tolist(),
    }


def _yaml(values: dict[str, Any], comment: str) -> str:
    return f"# {comment}\n" + yaml.safe_dump(values, sort_keys=False, default_flow_style=None, width=120)
