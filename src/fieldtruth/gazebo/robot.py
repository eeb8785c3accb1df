# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot with the sensors of a rig: models for Gazebo and a description for ROS, written from our own numbers.

Frames, rays and masses are those of the rig and of the physics.

Contact of a tyre in Gazebo's ODE is rigid, because a soft one sways on a cylinder's changing contact points. Our own
physics has elastic tyres that envelop the ground (``drive.surroundings``); only the friction is the same in both.

The robot must not be seen by its own sensors, as in our images and clouds. A housing that another sensor would see is
not drawn, nothing casts a shadow, and the mast that obstacles touch ends below the beams of every LiDAR. So it holds
for cameras that look past chassis and wheels and beams that pass over them, as those of the paper do.
"""

import math
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from fieldtruth.bag import topics
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.geodesy import PAPER_ORIGIN, Origin
from fieldtruth.core.readings import Fix, Inertial, WheelSpeeds
from fieldtruth.drive import physics
from fieldtruth.drive.physics import FRICTION, body_boxes, skid_compensation
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.imaging_config import OPTICAL, Imager, ImagingConfig, LensConfig
from fieldtruth.experiment.rig import Box, Rig, sensor_views
from fieldtruth.experiment.robot_config import WHEELS, RobotConfig
from fieldtruth.experiment.scanning_config import ScanningConfig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.gazebo.files import render, write
from fieldtruth.report.card import robot_title

Flavour = Literal["classic", "gz"]
"""Gazebo 11 with ROS 1, or the newer Gazebo (gz sim) with ROS 2."""
_FIGURES: Final = {
    "stiffness": 1e7,  # [N/m] of a tyre's contact
    "damping": 1.0,  # [N s/m] of it
    "max_correction": 0.1,  # [m/s] by which a penetration is undone
    "min_depth": 0.0005,  # [m] that a contact may keep, so that it does not open and close
    "antenna_mass": 0.001,  # [kg]; a link of its own in ROS 1, whose GNSS plugin reads a link's position
    "antenna_inertia": 1e-6,  # [kg m^2]
    "friction": FRICTION,
}
# Housings that are drawn: data sheets of the OS1 and the ZED-2; a camera and an antenna of usual size.
_OS1: Final = (0.0425, 0.0735)  # [m] radius, height
_ZED2: Final = (0.033, 0.055, 0.030)  # [m] along x, y (more than the baseline), z
_SINGLE: Final = (0.04, 0.04, 0.04)  # [m] along x, y, z
_ANTENNA: Final = (0.045, 0.02)  # [m] radius, height
_POLE: Final = 0.015  # [m] radius
NEAR: Final = 0.1  # [m] from a camera, below which it sees nothing
YELLOW: Final = (0.8, 0.6, 0.05)
BLACK: Final = (0.12, 0.12, 0.12)


def write_robot(folder: Path, rig: Rig, flavour: Flavour, origin: Origin = PAPER_ORIGIN) -> None:
    """Write the robot into ``folder``, the root of a package of one flavour.

    - ``models/husky/model.sdf`` and ``model.config``: the model for Gazebo without ROS (classic), or for the newer
      Gazebo (gz). Gazebo 11 drives it by messages of type ``gazebo.msgs.Pose`` on ``~/husky/vel_cmd``: x is the speed
      [m/s], the yaw of the orientation the turn rate [rad/s], positive to the left. There the attitude of the IMU is
      relative to that at the start, and the wheels' radius is half the edge of their bounding box, by which the robot
      is up to 4 % slower when it starts at a few degrees from an axis of the world; with ROS neither is so.
    - ``urdf/husky.urdf.xacro`` and ``urdf/husky.urdf``, which is the same with the default arguments: the description
      for ROS, with the plugins of gazebo_ros. The newer Gazebo uses its frames only.

    Raises:
        ConfigurationError: a sensor that Gazebo does not have, see ``check_rig``.
    """
    check_rig(rig, [flavour])
    values = _values(rig, flavour) | {"origin": origin}
    sdf = render("robot", "husky.sdf.jinja", flavour=flavour, **values)
    version = "1.9" if flavour == "gz" else "1.7"
    words = {"robot": values["robot"], "sensors": _sensors(rig)}
    config = render("robot", "model.config.xml.jinja", version=version, **words)
    write(folder / "models" / "husky" / "model.sdf", sdf)
    write(folder / "models" / "husky" / "model.config", config)
    for name, xacro in (("husky.urdf.xacro", True), ("husky.urdf", False)):
        write(folder / "urdf" / name, render("robot", "husky.urdf.jinja", xacro=xacro, **values))


def _sensors(rig: Rig) -> str:
    """Name the kinds of sensors of a rig: ``LiDAR, stereo camera and IMU``."""
    imaging = sorted(rig.enabled(ImagingConfig), key=lambda each: -len(each.imagers()))
    found = (*rig.enabled(ScanningConfig), *imaging, *rig.giving(Inertial), *rig.giving(Fix))
    *rest, last = dict.fromkeys(sensor.noun for sensor in found) or ["none"]
    return f"{', '.join(rest)} and {last}" if rest else last


def _values(rig: Rig, flavour: Flavour) -> dict[str, Any]:
    mounts, usual = rig.mounts(), _without_own(rig, flavour)
    track = 2 * rig.wheels.half_track * skid_compensation(rig.wheels)
    return {
        "rig": rig,
        "robot": robot_words(rig.robot),
        "topics": topics,
        "mount_pose": mount_pose,
        "view_pose": view_pose,
        "scan_angles": scan_angles,
        "cloud_topic": cloud_topic,
        **_FIGURES,
        "frames": fixed_frames(rig),
        "scanners": usual.enabled(ScanningConfig),
        "imagers": usual.imagers,
        "inertial_sensors": usual.giving(Inertial),
        "receivers": usual.giving(Fix),
        "antennas": {receiver.frame for receiver in usual.giving(Fix)},
        "own": [text for each in rig.in_order() if (text := each.gazebo(flavour))],
        "shapes": body_shapes(rig),
        "tread": wheel_shape(rig),
        "near": NEAR,
        "yellow": YELLOW,
        "black": BLACK,
        "wheels": {wheel: mounts[f"{wheel}_wheel"].xyz for wheel in WHEELS},
        "tachometer_rate": tachometer_rate(rig),
        "inertia": chassis_inertia(rig.robot),
        "track": track,
        "anchor": track / 2 - rig.wheels.half_track,
        "wheel_inertia": wheel_inertia(rig.robot),
    }


class Frame(NamedTuple):
    """A fixed frame: position [m] and roll, pitch, yaw [rad] in its parent."""

    name: str
    parent: str
    xyz: tuple[float, ...]
    rpy: tuple[float, ...]


class RobotWords(NamedTuple):
    """Words for a robot: "Clearpath Husky", and after "the": "Husky". The model is called ``husky`` whatever it is."""

    title: str
    name: str


def robot_words(robot: RobotConfig) -> RobotWords:
    """Return the words for the robot of an experiment."""
    title = robot_title(robot)
    return RobotWords(title[0].upper() + title[1:], title.partition(" ")[2] if title[0].isupper() else "robot")


class Scan(NamedTuple):
    """Angles of a scanner [rad], both ends included: azimuth positive to the left, elevation positive upwards."""

    min_azimuth: float
    max_azimuth: float
    min_elevation: float
    max_elevation: float


def fixed_frames(rig: Rig) -> tuple[Frame, ...]:
    """Return the frames that do not turn: those in base_link (the paper's Table 2), and the cameras' optical frames."""
    turning = {f"{wheel}_wheel" for wheel in WHEELS}
    poses = {name: mount_pose(mount) for name, mount in rig.mounts().items() if name not in turning}
    table = [Frame(name, "base_link", pose[:3], pose[3:]) for name, pose in poses.items()]
    for sensor in rig.sensors:
        for name, (parent, parent_from_optical) in reversed(sensor.optical_frames().items()):
            table.append(Frame(name, parent, (0.0, 0.0, 0.0), tuple(_rpy(parent_from_optical).tolist())))
    return tuple(table)


def view_pose(imager: Imager) -> tuple[float, ...]:
    """Pose in base_link (x, y, z [m], roll, pitch, yaw [rad]) of a camera whose x axis looks ahead, as Gazebo's do."""
    if np.array_equal(imager.frame_from_optical, OPTICAL):
        return mount_pose(imager.mount)
    return (*imager.mount.xyz, *np.round(_rpy(imager.base_from_view), 15).tolist())


def mount_pose(mount: Mount) -> tuple[float, ...]:
    """Pose of a mount in base_link: x, y, z [m], roll, pitch, yaw [rad]."""
    return (*mount.xyz, *np.radians(mount.rpy_deg).tolist())


def scan_angles(config: ScanningConfig) -> Scan:
    """Return the angles of our rays, in Gazebo's order: from right to left, from the lowest ring to the highest.

    Gazebo's ray i of n has the angle min + i (max - min) / (n - 1). Its column i is our ``(n // 2 - i) % n``, because
    ours begin ahead and advance clockwise; its ring j is our ``rings - 1 - j``, or j where our ring 0 is the lowest.
    Its rays all leave at once: ``spinning`` and ``firing_offsets_ns`` have no counterpart.
    """
    step, elevations = 2 * math.pi / config.columns, config.ring_elevations
    first = -(config.columns // 2) * step
    return Scan(first, first + (config.columns - 1) * step, float(elevations.min()), float(elevations.max()))


def cloud_topic(config: ScanningConfig) -> str:
    """Topic of the LiDAR in the newer Gazebo, which adds /points to it for the cloud."""
    return config.topic.removesuffix("/points") or f"/{config.name}"


def _without_own(rig: Rig, flavour: Flavour) -> Rig:
    """Return the rig without the sensors that have an element of their own in place of that of their readings."""
    return rig.with_each(lambda each: {"enabled": False} if each.gazebo(flavour) else {})


def check_rig(rig: Rig, flavours: Iterable[Flavour]) -> None:
    """Check that the packages of these flavours can hold the sensors that are enabled.

    Raises:
        ConfigurationError: a kind of sensor that Gazebo does not have; beams that are uneven or leave their column; a
            lens other than a plain pinhole; a robot without four driven wheels.
    """
    if rig.robot.drive != "skid_steer":
        raise ConfigurationError("rig.robot.drive must be skid_steer: the models for Gazebo have four driven wheels")
    for flavour in flavours:
        _check_usual(_without_own(rig, flavour))


def _check_usual(rig: Rig) -> None:
    held = (*rig.enabled(ScanningConfig), *rig.enabled(ImagingConfig), *rig.giving(Inertial), *rig.giving(Fix))
    for sensor in rig.in_order():
        if sensor not in held and not sensor.needs_wheels:
            raise ConfigurationError(
                f"rig.sensors: {sensor.name} is of kind {sensor.kind}, which a Gazebo package cannot hold; "
                "give enabled: false"
            )
    for scanner in rig.enabled(ScanningConfig):
        if key := scanner.uneven:
            value = getattr(scanner, key)
            what = f"{'uneven ' * (key == 'elevations_deg')}{key}"
            why = "the beams of Gazebo's scanner are even and straight above each other"
            if isinstance(value, str):
                what, why = f"the {key} {value}", "Gazebo's scanner turns evenly"
            raise ConfigurationError(f"rig.sensors: {scanner.name} has {what}; {why}; give enabled: false")
    for imaging in rig.enabled(ImagingConfig):
        if imaging.lens != LensConfig():
            changed = [key for key, value in LensConfig() if getattr(imaging.lens, key) != value]
            own = (
                f"a lens with {', '.join(changed)}"
                if imaging.lens.model == "pinhole"
                else f"the lens {imaging.lens.model}"
            )
            raise ConfigurationError(
                f"rig.sensors: {imaging.name} has {own}; a Gazebo package has plain pinhole cameras only; "
                "give enabled: false"
            )


def wheel_inertia(figures: RobotConfig) -> Array:
    """Principal moments (3,) [kg m^2] of a wheel; the motor's rotor turns with it about the axle.

    SDF allows no moment above the sum of the others, so those across the axle are larger than the wheel's.
    """
    axle = figures.wheels.inertia[1] + physics.ROTOR_INERTIA * physics.servo_scale(figures)
    across = max(figures.wheels.inertia[0], axle / 2)
    return np.array([across, axle, across])


def chassis_inertia(figures: RobotConfig) -> Array:
    """Principal moments (3,) [kg m^2] of the chassis, less what ``wheel_inertia`` adds."""
    return figures.chassis_moments - 4 * (wheel_inertia(figures) - figures.wheels.inertia) * (1.0, 0.0, 1.0)


def _rpy(rotation_of: Array) -> Array:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # gimbal lock: of the many pairs of roll and yaw, any one
        angles: Array = Rotation.from_matrix(rotation_of[:3, :3]).as_euler("xyz")
    return angles


class Shape(NamedTuple):
    """A box (size along x, y, z) or a cylinder (radius, length along z) [m] in its link, turned by ``rpy`` [rad]."""

    name: str
    size: tuple[float, ...]
    xyz: tuple[float, ...]
    colour: tuple[float, float, float] = BLACK
    rpy: tuple[float, ...] = (0.0, 0.0, 0.0)
    drawn: bool = True
    solid: bool = False

    @property
    def is_box(self) -> bool:
        """True for a box."""
        return len(self.size) == 3


def body_shapes(rig: Rig) -> tuple[Shape, ...]:
    """Shapes of base_link: chassis and mast are solid, the housings of the sensors are only drawn."""
    boxes = body_boxes(rig)
    chassis = boxes["chassis"]
    shapes = [_chassis(rig)]
    if "mast" in boxes and (mast := _mast(rig, boxes["mast"], float(chassis.size[2]))):
        shapes.append(mast)
    housings = [*_scanner_housings(rig, chassis), *_view_housings(rig)]
    housings += [(each, _cylinder(f"{each.name}_housing", _ANTENNA, each.mount)) for each in rig.giving(Fix)]
    return (*shapes, *(shape for owner, shape in housings if not _observers(rig, shape, owner)))


def wheel_shape(rig: Rig) -> Shape:
    """Return the cylinder of a wheel, whose axis is y."""
    size = (rig.wheels.radius, round(rig.wheels.width, 9))
    return Shape("tread", size, (0.0, 0.0, 0.0), rpy=(math.pi / 2, 0.0, 0.0), solid=True)


def tachometer_rate(rig: Rig) -> float | None:
    """Messages of the wheels' speeds per second; a rig without them gets those of the default rig."""
    return rig.rate_of(WheelSpeeds) or Rig().rate_of(WheelSpeeds)


def observers(rig: Rig) -> list[str]:
    """Names of the LiDARs and views that see the chassis or a wheel, which ours never do."""
    mounts, tread = rig.mounts(), wheel_shape(rig)
    wheels = [tread._replace(xyz=mounts[f"{wheel}_wheel"].xyz) for wheel in WHEELS]
    return list(dict.fromkeys(name for shape in (_chassis(rig), *wheels) for name in _observers(rig, shape)))


def _chassis(rig: Rig) -> Shape:
    box = body_boxes(rig)["chassis"]
    return Shape("chassis", tuple(box.size.tolist()), tuple(box.centre.tolist()), YELLOW, solid=True)


def _scanner_housings(rig: Rig, chassis: Box) -> Iterator[tuple[SensorConfig | None, Shape]]:
    """LiDARs with the poles on which they stand, which end below the cameras."""
    top = float(chassis.size[2])
    heights = [imager.mount.xyz[2] for imager in rig.imagers]
    for scanner in rig.enabled(ScanningConfig):
        x, y, z = scanner.mount.xyz
        low = min([z, *heights]) - _OS1[1] / 2
        if low > top and (np.abs((x, y)) < chassis.size[:2] / 2).all():
            yield None, Shape(f"{scanner.name}_pole", (_POLE, low - top), (x, y, (low + top) / 2))
        yield scanner, _cylinder(f"{scanner.name}_housing", _OS1, scanner.mount)


def _view_housings(rig: Rig) -> Iterator[tuple[SensorConfig | None, Shape]]:
    """Boxes behind the centres of the lenses."""
    for imaging in rig.enabled(ImagingConfig):
        imagers = imaging.imagers()
        poses = [view_pose(imager) for imager in imagers]
        middle = np.mean([pose[:3] for pose in poses], axis=0)
        base_from_body = transforms.pose((0.0, 0.0, 0.0), np.degrees(poses[0][3:]).tolist())
        depth, width, height = _ZED2 if len(imagers) > 1 else _SINGLE
        size = (depth, round(width + imagers[-1].baseline, 9), height)
        centre = np.round(middle - base_from_body[:3, 0] * depth / 2, 12).tolist()
        yield imaging, Shape(f"{imaging.name}_housing", size, tuple(centre), rpy=poses[0][3:])


def _cylinder(name: str, size: tuple[float, float], mount: Mount) -> Shape:
    pose = mount_pose(mount)
    return Shape(name, size, pose[:3], rpy=pose[3:])


def _observers(rig: Rig, shape: Shape, owner: SensorConfig | None = None) -> list[str]:
    """Names of the sensors other than its ``owner`` that would see a shape of base_link, by points within it."""
    extent = shape.size if shape.is_box else (2 * shape.size[0], 2 * shape.size[0], shape.size[1])
    grid = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 7)] * 3), axis=-1).reshape(-1, 3) * extent
    points = transforms.transform(transforms.pose(shape.xyz, np.degrees(shape.rpy).tolist()), grid)
    found = []
    for view in sensor_views(rig):
        far = view.scans | (np.linalg.norm(points - view.position, axis=1) > NEAR)
        if view.config != owner and (view.sees(points) & far).any():
            found.append(view.name)
    return found


def _mast(rig: Rig, box: Box, bottom: float) -> Shape | None:
    """Return the mast of the physics, cut off below the LiDARs' beams, which Gazebo would otherwise let it meet."""
    low, high = box.centre - box.size / 2, box.centre + box.size / 2
    for scanner in rig.enabled(ScanningConfig):
        x, y, z = scanner.mount.xyz
        corner = max(math.hypot(cx - x, cy - y) for cx in (low[0], high[0]) for cy in (low[1], high[1]))
        tilt = math.degrees(math.acos(np.clip(scanner.mount.base_from_sensor[2, 2], -1.0, 1.0)))
        angles = scanner.elevations_deg
        below = tilt + (scanner.vertical_fov_deg / 2 if angles is None else max(-min(angles), 0.0))
        drop = corner * math.tan(math.radians(min(below, 89.0)))
        high[2] = min(high[2], z - drop - 0.01)
    if high[2] <= bottom:
        return None
    xyz = tuple(((high + low) / 2).tolist())
    return Shape("mast", tuple(np.round(high - low, 9).tolist()), xyz, drawn=False, solid=True)
