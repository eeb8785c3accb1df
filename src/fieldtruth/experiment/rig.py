# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of the robot and its sensors, by default the paper's (Tables 1, 2 and 5): rules, short form, shapes.

The short form has a key for each sensor of the paper, such as ``lidar: {rate_hz: 20}``. It changes the first sensor of
its kind in ``sensors``, or adds the paper's; ``wheels`` and ``base_footprint`` change the robot.
"""

import itertools
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Final, NamedTuple, Self, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field, SerializeAsAny, model_validator

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning, UnknownNameError
from fieldtruth.core.readings import Reading
from fieldtruth.experiment.catalogue import figures_of, models
from fieldtruth.experiment.field_of_view import SensorView
from fieldtruth.experiment.fields import Boolean, Frozen, LocatedError, Mount, part, shortened
from fieldtruth.experiment.imaging_config import Imager, ImagingConfig
from fieldtruth.experiment.robot_config import RobotConfig, WheelConfig
from fieldtruth.experiment.scanning_config import ScanningConfig
from fieldtruth.experiment.sensor_config import (
    KINDS,
    SIGNAL,
    WORDS,
    MountedConfig,
    SensorConfig,
    known_switches,
    sensor_of,
)
from fieldtruth.experiment.urdf import KEY as URDF
from fieldtruth.experiment.urdf import with_urdf_mounts
from fieldtruth.sensors.configs import CONFIGS, FirstOfKinds

OWN_TOPICS: Final = (
    "/clock",
    "/tf",
    "/tf_static",
    "/gazebo/model_states",
    "/gazebo/static_model_states",
    "/ground_truth/odom",
    "/cmd_vel",
)
MOST_JITTER: Final = 0.2
"""Of a clock, in periods of the sensor; with more, stamps would no longer rise by themselves."""
OWN_FRAMES: Final = ("world", "odom", "base_link")


def check_sensors(sensors: Sequence[SensorConfig], own_frames: Mapping[str, Mount], robot: RobotConfig) -> None:
    """Check the list of sensors of a robot with these frames of its own.

    Raises:
        LocatedError: the key of the sensor, and what it has in common with which other.
    """
    of_wheels = [i for i, sensor in enumerate(sensors) if sensor.needs_wheels]
    if len(of_wheels) > 1:
        second = of_wheels[1]
        raise LocatedError(f"must differ: a rig has at most one {sensors[second].kind}", ("sensors", second, "kind"))
    _differ(sensors, "name", [(sensor.name,) for sensor in sensors], {})
    views = [
        [imager.name for imager in sensor.imagers()] if isinstance(sensor, ImagingConfig) else [] for sensor in sensors
    ]
    _differ(sensors, "name", views, {}, "the name of a camera")
    topics = [[topic.name for topic in sensor.topics()] for sensor in sensors]
    _differ(sensors, "topic", topics, dict.fromkeys(OWN_TOPICS, "the robot"))
    frames = [[*sensor.frames(), *sensor.optical_frames()] for sensor in sensors]
    _differ(sensors, "frame", frames, dict.fromkeys((*OWN_FRAMES, *own_frames), "the robot"))
    for i, sensor in enumerate(sensors):
        if sensor.clock is not None and sensor.clock.jitter_s > (most := MOST_JITTER / sensor.rate_hz):
            at = ("sensors", i, "clock", "jitter_s")
            raise LocatedError(f"must be at most {most:g}, a fifth of the period; got {sensor.clock.jitter_s:g}", at)
        if sensor.enabled and (sensor.sees or not sensor.in_hull):
            for frame, mount in sensor.frames().items():
                _check_outside(mount, frame, robot, ("sensors", i, "mount"))


def _differ(
    sensors: Sequence[SensorConfig], key: str, values: Sequence[Iterable[str]], taken: dict[str, str], what: str = ""
) -> None:
    what = what or f"a {key}"
    for i, own in enumerate(values):
        for value in own:
            if value in taken:
                raise LocatedError(f"{value!r} is already {what} of {taken[value]}", ("sensors", i, key))
            taken[value] = f"sensors[{i}]"


def _check_outside(mount: Mount, frame: str, robot: RobotConfig, at: tuple[str | int, ...]) -> None:
    """Check that a frame is not inside the chassis."""
    x, y, z = mount.xyz
    length, width, top = robot.outline[0], robot.chassis_width, robot.chassis_top
    if abs(x) < length / 2 and abs(y) < width / 2 and 0.0 < z < top:
        raise LocatedError(
            f"{frame} is inside the robot's hull at {list(mount.xyz)}: it spans x -{length / 2:g} to {length / 2:g} m, "
            f"y -{width / 2:g} to {width / 2:g} m, z 0 to {top:g} m in base_link",
            at,
        )


_OF_PAPER: Final = tuple(config for config in CONFIGS if "sections" in vars(config))
"""The sensors of the paper, in the order of the topics in a bag."""
_SECTIONS: Final = {key: (config, each) for config in _OF_PAPER for key, each in config.sections.items()}
SECTIONS: Final[dict[str, type[Frozen]]] = {key: each.config or config for key, (config, each) in _SECTIONS.items()}
"""Class of the value of each section."""
ROBOT: Final = "robot"
ROBOT_SECTIONS: Final[dict[str, type[Frozen]]] = {"wheels": WheelConfig, "base_footprint": Mount}
"""Keys of a rig that change the part of ``robot`` with the same name."""
MODELS: Final = "models"
"""Key of a stored rig: models of the robot and of the sensors by name, None of one without a model."""


def without_models(given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the values of a rig without ``models``, which says in a stored file whose figures robot and sensors have.

    These have every value there, so to change a ``model`` alone would change the name alone.

    Raises:
        LocatedError: one that has another ``model`` than figures.
    """
    if MODELS not in given:
        return given
    stored, sensors = given[MODELS], given.get("sensors")
    of_sensors = stored.get("sensors") if isinstance(stored, Mapping) else None
    if not isinstance(of_sensors, Mapping):
        raise LocatedError(f"must be a mapping with the keys robot and sensors, got {shortened(stored)}", [MODELS])
    items: list[tuple[tuple[str | int, ...], Any, Any, str]] = []
    if stored.get(ROBOT):
        items.append(((ROBOT, "model"), given.get(ROBOT), stored[ROBOT], f"{MODELS}.{ROBOT}"))
    for i, item in enumerate(sensors if isinstance(sensors, list | tuple) else ()):
        name = item.get("name") if isinstance(item, Mapping) else None
        if name in of_sensors:
            items.append((("sensors", i, "model"), item, of_sensors[name], f"{MODELS}.sensors.{name}"))
    for at, item, whose, key in items:
        if isinstance(item, Mapping) and (model := item.get("model")) != whose:
            what = f"is {model or 'null'}, but the figures are those of {whose or 'a sensor without a model'}"
            rest = f"leave out what {model} shall give, and rig.{key}" if model else f"name {whose}"
            raise LocatedError(f"{what}; {rest}", at)
    return {key: value for key, value in given.items() if key != MODELS}


def with_robot(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a rig with its sections of the robot as parts of ``robot``.

    Raises:
        PartError: a value that is not allowed.
    """
    rest = {key: value for key, value in given.items() if key not in ROBOT_SECTIONS}
    if len(rest) == len(given):
        return rest
    robot = part(RobotConfig, rest.get("robot", {}), "robot").model_dump()
    for key, config in ROBOT_SECTIONS.items():
        if key in given:
            value, known = given[key], robot[key]
            if isinstance(value, Mapping) and isinstance(known, Mapping):
                value = {**known, **value}
            robot[key] = part(config, value, key).model_dump()
    return {**rest, "robot": part(RobotConfig, robot)}


def with_sections(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a rig with its sections as items of ``sensors``; without ``sensors`` these are the paper's.

    Raises:
        PartError: a value of a section that is not allowed.
    """
    rest = {key: value for key, value in given.items() if key not in SECTIONS}
    sections = {key: given[key] for key in SECTIONS if key in given}
    items = rest.get("sensors", [{"kind": config.model_fields["kind"].default} for config in _OF_PAPER])
    if not isinstance(items, list | tuple):
        return rest  # the field reports it
    for key, section in sections.items():
        items = _changed(list(items), key, section)
    return {**rest, "sensors": items}


def _changed(items: list[Any], key: str, section: Any) -> list[Any]:
    kind, change = _item(key, section)
    at = next((i for i, item in enumerate(items) if _kind(item) == kind), None)
    if at is None:
        return [*items, part(KINDS[kind], {"kind": kind, **change}, key)]
    if isinstance(section, SensorConfig):
        return [*items[:at], section, *items[at + 1 :]]
    own = items[at].model_dump(exclude_unset=True) if isinstance(items[at], SensorConfig) else items[at]
    if change.get("model") is not None:  # its figures replace those of the item
        of_models = _given_by_models(KINDS[kind])
        own = {name: own[name] for name in own if name not in of_models and (name != SIGNAL or own[name] in WORDS)}
    return [*items[:at], part(KINDS[kind], {**own, **change}, key), *items[at + 1 :]]


def _given_by_models(config: type[SensorConfig]) -> set[str]:
    """Return the keys of a kind of sensor that a model may give."""
    figures = (figures_of(config.family, model) for model in models(config.family))
    return {key for each in figures for key in config.completed({}, each)}


def _item(key: str, section: Any) -> tuple[str, dict[str, Any]]:
    """Kind of sensor that a section changes, and its values by the names that they have in an item."""
    config, own = _SECTIONS[key]
    if own.config is not None or not isinstance(section, Mapping):
        section = part(own.config or config, section, key).model_dump(exclude_unset=True)
    return str(config.model_fields["kind"].default), {
        own.keys.get(name, name): value for name, value in section.items()
    }


def _kind(item: Any) -> Any:
    return item.get("kind") if isinstance(item, Mapping) else getattr(item, "kind", None)


PAPER_SENSORS: Final[tuple[SensorConfig, ...]] = tuple(config.model_validate({}) for config in _OF_PAPER)
_Config = TypeVar("_Config", bound=SensorConfig)
Sensor = Annotated[SerializeAsAny[SensorConfig], BeforeValidator(sensor_of)]


class Rig(Frozen, FirstOfKinds):
    """The robot with its sensors."""

    also: ClassVar = (*SECTIONS, URDF, *ROBOT_SECTIONS, MODELS)

    robot: Annotated[
        RobotConfig, Field(description="a name from `fieldtruth list robots`, or a mapping with the key model")
    ] = RobotConfig()
    sensors: Annotated[
        tuple[Sensor, ...],
        Field(max_length=64, description="a list of at most 64 sensors: mappings with the keys kind, name, ..."),
    ] = PAPER_SENSORS

    visible: Annotated[Boolean, Field(description="true or false")] = False
    """True if the sensors see the robot's chassis and wheels: class robot, instance id 0."""

    @model_validator(mode="before")
    @classmethod
    def _listed(cls, given: Any) -> Any:
        if not isinstance(given, Mapping):
            return given
        return with_sections(with_robot(with_urdf_mounts(without_models(given))))

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_sensors(self.sensors, self._own_frames(), self.robot)
        return self

    @property
    def wheels(self) -> WheelConfig:
        """The robot's wheels."""
        return self.robot.wheels

    def giving(self, reading: type[Reading]) -> tuple[MountedConfig, ...]:
        """Return the sensors in a frame of their own that are enabled and whose readings are of a type."""
        return tuple(each for each in self.enabled(MountedConfig) if issubclass(each.gives, reading))

    def first_of(self, config: type[_Config]) -> _Config:
        """Return the first sensor of a class; of a rig without one that of the class, not enabled."""
        own = self.enabled(config) or [sensor for sensor in self.sensors if isinstance(sensor, config)]
        return own[0] if own else config.model_validate({"enabled": False})

    def first(self, reading: type[Reading]) -> MountedConfig:
        """Return the first sensor whose readings are of a type; of a rig without one the paper's, not enabled.

        The first that gives ``Inertial`` and the first that gives ``Fix`` steer the robot.
        """
        own = [each for each in self.sensors if isinstance(each, MountedConfig) and issubclass(each.gives, reading)]
        if own:
            return next((each for each in own if each.enabled), own[0])
        paper = (each for each in PAPER_SENSORS if isinstance(each, MountedConfig) and issubclass(each.gives, reading))
        return next(paper).model_copy(update={"enabled": False})

    def rate_of(self, reading: type[Reading]) -> float | None:
        """Return the rate [Hz] of the first series of readings of a type; None if no enabled sensor has one."""
        outputs = (output for each in self.sensors if each.enabled for output in each.outputs_on(self.robot))
        return next((output.rate_hz for output in outputs if issubclass(output.reading, reading)), None)

    @property
    def imagers(self) -> tuple[Imager, ...]:
        """The views of the sensors that are enabled."""
        return tuple(imager for sensor in self.enabled(ImagingConfig) for imager in sensor.imagers())

    @property
    def reports_wheels(self) -> bool:
        """True if a sensor reports of the robot's wheels; then its commands are published, too."""
        return any(sensor.needs_wheels and sensor.enabled for sensor in self.sensors)

    def enabled(self, config: type[_Config]) -> tuple[_Config, ...]:
        """The sensors of a class, or of one derived from it, that are enabled."""
        return tuple(sensor for sensor in self.sensors if isinstance(sensor, config) and sensor.enabled)

    def models(self) -> dict[str, Any]:
        """Models of the robot and of the sensors by name, as ``MODELS``."""
        return {ROBOT: self.robot.model, "sensors": {sensor.name: sensor.model for sensor in self.sensors}}

    def in_order(self) -> tuple[SensorConfig, ...]:
        """The sensors that are enabled, in the order in which their topics are in a bag."""
        return tuple(sorted((each for each in self.sensors if each.enabled), key=lambda each: each.bag_order))

    def switched(self, **switches: bool | None) -> Self:
        """Return a rig in which all sensors with a switch, such as ``cameras``, are on or off; None keeps them.

        Raises:
            UnknownNameError: no kind of sensor has this switch.
        """
        for name in switches:
            if name not in (known := known_switches()):
                raise UnknownNameError("switch", name, known)
        given = {name: on for name, on in switches.items() if on is not None}
        return self.with_each(lambda each: {"enabled": given[each.switch]} if each.switch in given else {})

    def with_sensors(self, config: type[SensorConfig], **values: Any) -> Self:
        """Return a rig in which all sensors of a class, or of one derived from it, have other values."""
        return self.with_each(lambda sensor: values if isinstance(sensor, config) else {})

    def with_each(self, change: Callable[[SensorConfig], Mapping[str, Any]]) -> Self:
        """Return a rig in which each sensor has the values that ``change`` returns for it."""
        changed = tuple(sensor.model_copy(update=change(sensor)) for sensor in self.sensors)
        return self.model_copy(update={"sensors": changed})

    def mounts(self) -> dict[str, Mount]:
        """Every frame that is fixed in base_link by name: those of the sensors and of the robot."""
        sensors = sorted(self.sensors, key=lambda sensor: sensor.frame_order)
        return dict(frame for sensor in sensors for frame in sensor.frames().items()) | self._own_frames()

    def _own_frames(self) -> dict[str, Mount]:
        w = self.wheels
        sides = {"left": w.half_track, "right": -w.half_track}
        axles = {"front": w.half_wheelbase, "rear": -w.half_wheelbase}
        wheels = {
            f"{axle}_{side}_wheel": Mount(xyz=(axles[axle], sides[side], w.axle_height))
            for side, axle in itertools.product(("right", "left"), ("front", "rear"))
            if f"{axle}_{side}" in w.names
        }
        return wheels | {"base_footprint": self.robot.footprint}


def _short_key(config: type[SensorConfig]) -> str:
    """Return the key of the short form that is the whole sensor, such as ``lidar``, else the kind."""
    whole = (key for key, (owner, each) in _SECTIONS.items() if owner is config and each.config is None)
    return next(whole, str(config.model_fields["kind"].default))


def paper_rig(**sensors: SensorConfig | None) -> Rig:
    """Return the paper's rig, in which others take the place of the sensors ``imu``, ``gnss`` and so on.

    Args:
        sensors: by the key of the short form, else the kind; ``cameras`` may also be given by its kind, ``stereo``.

    Raises:
        ConfigurationError: a setting of another type, or two names of one sensor.
        UnknownNameError: no such sensor.
    """
    by_kind = {str(paper.kind): _short_key(type(paper)) for paper in PAPER_SENSORS}
    for name in sensors:
        if name not in (*by_kind, *by_kind.values()):
            raise UnknownNameError("sensor of the paper", name, by_kind.values())
    given = {name: own for name, own in sensors.items() if own is not None}
    for kind, key in by_kind.items():
        if kind != key and kind in given:
            if key in given:
                raise ConfigurationError(f"{kind} must be None where {key} is given: it is the old name of {key}")
            warnings.warn(f"{kind} is now called {key}", FieldtruthWarning, stacklevel=2)
            given[key] = given.pop(kind)
    changed = []
    for paper in PAPER_SENSORS:
        own = given.pop(name := by_kind[paper.kind], paper)
        if not isinstance(own, type(paper)):
            raise ConfigurationError(f"{name} must be of type {type(paper).__name__}, got {shortened(own)}")
        changed.append(own)
    return Rig(sensors=tuple(changed))


def sensor_views(rig: Rig) -> tuple[SensorView, ...]:
    """Return the sensors of a rig that scan, and its views, that are enabled."""
    scan = tuple(SensorView(each.name, each, each.mount.base_from_sensor) for each in rig.enabled(ScanningConfig))
    return (*scan, *(SensorView(each.name, each.config, each.base_from_optical) for each in rig.imagers))


class Box(NamedTuple):
    """An axis-aligned box in base_link: edge lengths (3,) [m] and centre (3,) [m]."""

    size: Array
    centre: Array


class Cylinder(NamedTuple):
    """A wheel or caster: its frame, its centre (3,) [m] in base_link, radius and width [m]; the axle is y."""

    frame: str
    centre: Array
    radius: float
    width: float

    @property
    def box(self) -> Box:
        """Smallest box around it."""
        return Box(np.array([2 * self.radius, self.width, 2 * self.radius]), self.centre)


def chassis_box(rig: Rig) -> Box:
    """Box of the robot's hull without wheels and sensors."""
    robot = rig.robot
    deck = robot.chassis_top
    return Box(np.array([robot.outline[0], robot.chassis_width, deck]), np.array([0.0, 0.0, deck / 2]))


def wheel_cylinders(rig: Rig) -> tuple[Cylinder, ...]:
    """The driven wheels, by ``rig.wheels.names``."""
    mounts, wheels = rig.mounts(), rig.wheels
    frames = (f"{name}_wheel" for name in wheels.names)
    return tuple(Cylinder(name, np.array(mounts[name].xyz), wheels.radius, wheels.width) for name in frames)


def rollers(rig: Rig) -> tuple[Cylinder, ...]:
    """All that touches the ground: the driven wheels, and the caster of a robot that has one, fixed in base_link."""
    caster = rig.robot.caster
    if caster is None:
        return wheel_cylinders(rig)
    centre = np.array([caster.x, 0.0, caster.radius - rig.robot.ground_clearance])
    return (*wheel_cylinders(rig), Cylinder("base_link", centre, caster.radius, caster.width))


def body_parts(rig: Rig) -> Sequence[Box | Cylinder]:
    """Return chassis, wheels and caster, which hide what is behind them; mast and housings have no known shape."""
    return (chassis_box(rig), *rollers(rig))


def visible_parts(rig: Rig) -> Sequence[Box | Cylinder]:
    """Return the parts of the robot that its sensors see: none, unless ``rig.visible``."""
    return body_parts(rig) if rig.visible else ()
