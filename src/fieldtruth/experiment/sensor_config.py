# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of all sensors: outputs, topics, clock and signal. A subclass with a ``kind`` is a kind of sensor."""

import math
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, ClassVar, Final, NamedTuple

from pydantic import Field, model_validator

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, nearest_first, suggestion
from fieldtruth.core.readings import Message, Reading
from fieldtruth.core.registry import Registry, load_module
from fieldtruth.core.yaml_io import parse_mapping, read_text
from fieldtruth.experiment.catalogue import datasheet_of, figures_of, models, preset_of
from fieldtruth.experiment.fields import (
    Boolean,
    Frozen,
    LocatedError,
    Mount,
    Number,
    Rate,
    condition_at,
    part,
    shortened,
)
from fieldtruth.experiment.robot_config import RobotConfig

BASE: Final = "base_link"
ODOM: Final = "odom"
"""Frame in which wheel odometry starts (REP-105). It is not in /tf, where the parent of base_link is the world."""


class Topic(NamedTuple):
    """A topic that a run publishes; without ``rate_hz`` it has one message per bag."""

    name: str
    msgtype: str
    rate_hz: float | None
    kind: str = "robot"
    """Kind of the sensor that publishes it, ``robot`` for the truth and ``objects`` for the static objects."""
    sensor: str = ""
    """Name of that sensor."""

    @property
    def latched(self) -> bool:
        """True for topics that are published once: late subscribers get the last message."""
        return self.rate_hz is None


class Output(NamedTuple):
    """A series of readings of a sensor; each makes one message for each of ``topics``."""

    name: str
    """Name of the sensor, with a part or ``truth`` behind a slash: ``lidar``, ``stereo/left``, ``imu/truth``."""
    topics: tuple[Topic, ...]
    part: str = ""
    """Name of the series, if the sensor has several, such as ``left``."""
    ideal: bool = False
    """True for the readings of an ideal sensor beside the series of one that is not ideal."""
    clock: str = ""
    """Part of the sensor that loses readings by a draw of its own; see ``record.streams.series_of``."""
    frame: str = ""
    """Frame in the headers of its messages; empty if they have none."""
    reading: type[Reading] = Message
    """Type of its readings."""
    fields: Mapping[str, Topic] = {}
    """Topic by part of the reading: of an image by its field, also of those that are off; of wheels by name. Empty:
    its first topic has all."""
    label: str = ""
    """Of a view, that of its imager: left and right of the paper's pair, ``NAME_left`` of others."""
    info: str = ""
    """Topic of the calibration of a view."""

    @property
    def rate_hz(self) -> float:
        """Rate of the readings."""
        rate_hz = self.topics[0].rate_hz
        assert rate_hz is not None
        return rate_hz


class ClockConfig(Frozen):
    """The clock shows ``t + offset_s + drift_ppm 1e-6 t + jitter`` at the simulated time t."""

    offset_s: Annotated[Number, Field(ge=-3600, le=3600)] = 0.0
    drift_ppm: Annotated[Number, Field(ge=-10_000, le=10_000)] = 0.0
    jitter_s: Annotated[Number, Field(ge=0, le=1)] = 0.0
    """Standard deviation [s] of the normal error that each stamp has of its own."""
    drop_share: Annotated[Number, Field(ge=0, le=0.9)] = 0.0
    """Share of the readings that are lost at random, each with this probability."""

    @property
    def may_lose(self) -> bool:
        """True if readings can be missing: lost ones, and those at which the clock shows 0 or less."""
        return self.drop_share > 0.0 or self.offset_s < 0.0 or self.jitter_s > 0.0


SIGNAL: Final = "signal"
IDEAL: Final = "ideal"
DATASHEET: Final = "datasheet"
CLEAN: Final = "clean"
"""Another word for ideal."""
ROBOT: Final = "robot"
"""The signal of photographs as robots take them; of sensors that are no cameras, that of the data sheet."""
WORDS: Final = (IDEAL, DATASHEET, CLEAN, ROBOT)
FORMS: Final = f"{', '.join(WORDS)}, the path of a YAML file, or a mapping"
PRESET: Final = "preset"
"""Key of a signal that is a mapping: one of the words, whose figures it changes."""
_ENDINGS: Final = (".yaml", ".yml")


class SignalConfig(Frozen):
    """Figures of a real sensor; each kind has a subclass. Without any value given, nothing differs from ideal."""


def signal_values(given: Any, family: str, model: str) -> Any:
    """Return the figures that ``signal`` of a sensor means: a mapping, or None for ideal.

    Args:
        given: value of the key.
        family: of the sensor's kind.
        model: whose data sheet ``datasheet`` means.

    Raises:
        LocatedError: not one of the forms, or a file that cannot be read.
    """
    if given is None or given in (IDEAL, CLEAN):
        return None
    if given == ROBOT and (preset := preset_of(family, ROBOT)):
        return preset
    if given in (DATASHEET, ROBOT):
        if not model:
            raise LocatedError("must be ideal: this kind of sensor has no data sheet", [SIGNAL])
        return datasheet_of(family, model)
    if isinstance(given, Mapping) and PRESET in given:
        if given[PRESET] not in WORDS:
            raise LocatedError(f"must be {', '.join(WORDS)}; got {shortened(given[PRESET])}", [SIGNAL, PRESET])
        rest = {key: value for key, value in given.items() if key != PRESET}
        return {**(signal_values(given[PRESET], family, model) or {}), **rest}
    if not isinstance(given, str):
        return given
    if not given.endswith(_ENDINGS):
        raise LocatedError(f"must be {FORMS}; got {shortened(given)}", [SIGNAL])
    try:
        return signal_values(parse_mapping(read_text(Path(given)), given), family, model)
    except ConfigurationError as error:
        raise LocatedError(f"cannot be used: {error}", [SIGNAL]) from error


def with_signal_files(rig: Any, folder: Path) -> Any:
    """Return the values of a rig with the figures that are in files, whose paths may be relative to ``folder``.

    Raises:
        ConfigurationError: a file that cannot be read.
    """
    if not isinstance(rig, Mapping):
        return rig
    changed = {key: _with_file(value, folder) if key != "sensors" else value for key, value in rig.items()}
    if isinstance(rig.get("sensors"), list | tuple):
        changed["sensors"] = [_with_file(item, folder) for item in rig["sensors"]]
    return changed


def _with_file(sensor: Any, folder: Path) -> Any:
    given = sensor.get(SIGNAL) if isinstance(sensor, Mapping) else None
    if not isinstance(given, str) or not given.endswith(_ENDINGS):
        return sensor
    path = folder / given
    return {**sensor, SIGNAL: parse_mapping(read_text(path), str(path))}


SensorName = Annotated[
    str,
    Field(pattern=r"^[a-z][a-z0-9_]{0,31}$", description="a word of at most 32 lower-case letters, digits and _"),
]
TopicName = Annotated[
    str, Field(pattern=r"^(/[A-Za-z][A-Za-z0-9_]{0,63}){1,8}$", description="the name of a ROS topic, like /imu/data")
]
FrameName = Annotated[
    str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,63}$", description="the name of a frame: letters, digits and _")
]


class Section(NamedTuple):
    """A key of the short form of a rig, such as ``lidar`` or ``odometry``."""

    config: type[Frozen] | None = None
    """Class of its value; None: the configuration of the sensor."""
    keys: Mapping[str, str] = {}
    """Names of its keys in the configuration, where they differ."""


TRUTH: Final = "/truth"
"""Ends the name of a topic that has what an ideal sensor reads, beside that of a sensor that is not ideal."""
KINDS: Final[dict[str, type["SensorConfig"]]] = {}
"""Configuration of each kind of sensor, in the order in which their topics are in a bag."""


class SensorConfig(Frozen):
    """A sensor of a rig. A subclass that sets a default of ``kind`` is known in experiments.

    Its other defaults are those of a sensor without a name of its own: the paper's.
    """

    noun: ClassVar[str] = ""
    """Name of such a sensor in texts, like ``LiDAR``; empty: its kind."""
    gives: ClassVar[type[Reading]] = Message
    """Type of its readings."""
    family: ClassVar[str] = ""
    """Folder of its models in ``models``, and of entry points, which other kinds may share; by default its kind."""
    sees: ClassVar[bool] = True
    """True if it senses the world around it, so that a reading depends on a pose alone."""
    needs_wheels: ClassVar[bool] = False
    """True if it belongs to a robot with wheels, whose commands are published with it; a rig has at most one."""
    in_hull: ClassVar[bool] = True
    """True if it may be inside the robot's hull, unless it ``sees``."""
    bag_order: ClassVar[float] = math.inf
    """Rank of its topics among those of other kinds in a bag."""
    frame_order: ClassVar[float] = math.inf
    """Rank of its frames among those of other kinds in /tf_static."""
    sections: ClassVar[Mapping[str, "Section"]] = {}
    """Keys of the short form of a rig that change the first sensor of this kind; the paper has one of such kinds."""
    switch: ClassVar[str] = ""
    """Word with which all sensors of the kind are turned on and off, as ``cameras`` of ``--no-cameras``."""
    extras: ClassVar[tuple[str, ...]] = ()
    """Keys of what it publishes only if they are true."""
    topic_of_name: ClassVar[str] = "/{}"
    """Topic of a sensor by its name, if it is not that of the class."""
    datasheet: ClassVar[str] = ""
    """Model whose data sheet ``signal: datasheet`` means of a sensor without ``model``."""
    needs_mount: ClassVar[bool] = False
    """True if a rig must give ``mount``, because its default is for a sensor that is used on its own."""

    kind: str
    name: SensorName
    enabled: Boolean = True
    model: Annotated[str, Field(description="a name from `fieldtruth list sensors`")] | None = None
    """Gives every value that is not set, from the model's data file. None: the defaults."""
    rate_hz: Rate
    topic: TopicName
    signal: SignalConfig | None = None
    """Figures of a real sensor, by which its readings differ from ideal ones. None: ideal."""
    clock: ClockConfig | None = None
    """The clock that stamps its messages, and which of them are lost. None: simulated time, and none."""

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Make the kind known."""
        super().__pydantic_init_subclass__(**kwargs)
        kind = cls.model_fields["kind"].default
        if isinstance(kind, str):
            KINDS[kind], cls.family, cls.noun = cls, vars(cls).get("family", kind), cls.noun or kind

    @model_validator(mode="before")
    @classmethod
    def _completed(cls, given: Any) -> Any:
        """Add what name, model and data sheet give."""
        if not isinstance(given, Mapping):
            return given
        kind, name, model = cls.model_fields["kind"].default, given.get("name"), given.get("model")
        known, has_own_name = models(cls.family), isinstance(name, str) and name != cls.model_fields["name"].default
        if has_own_name and "mount" in cls.model_fields and "mount" not in given:
            raise LocatedError(f"is required: {condition_at(cls, ['mount'])}", ["mount"])
        if isinstance(model, str) and model not in known:
            nearest = ", ".join(nearest_first(model, known)) or "none"
            raise LocatedError(f"must be a model of kind {kind}, nearest first: {nearest}; got {model!r}", ["model"])
        values = cls.completed(dict(given), figures_of(cls.family, model) if isinstance(model, str) else {})
        if SIGNAL in values:
            model = model if isinstance(model, str) else cls.datasheet
            values[SIGNAL] = signal_values(values[SIGNAL], cls.family, model)
        return cls.of_name(str(name)) | values if has_own_name else values

    @classmethod
    def of_name(cls, name: str) -> dict[str, Any]:
        """Values that a sensor has by its name, if it is not that of the class."""
        return {"topic": cls.topic_of_name.format(name)}

    @classmethod
    def completed(cls, given: dict[str, Any], figures: Mapping[str, Any]) -> dict[str, Any]:
        """Add the figures of the sensor's model, if it has one, for what is not given or None."""
        added = {key: value for key, value in figures.items() if key in cls.model_fields and given.get(key) is None}
        return given | added

    def outputs(self) -> tuple[Output, ...]:
        """Series of readings that it publishes, in the order of their messages."""
        raise NotImplementedError

    def outputs_on(self, robot: RobotConfig) -> tuple[Output, ...]:
        """Series of readings that it publishes on a robot."""
        return self.outputs()

    def topics(self) -> tuple[Topic, ...]:
        """Topics that it publishes, in the order of its messages."""
        return tuple(topic for output in self.outputs() for topic in output.topics)

    @property
    def sweep_s(self) -> float:
        """Time [s] that a reading takes from its stamp on."""
        return 0.0

    @property
    def late_s(self) -> float:
        """Time [s] after its stamp up to which a reading needs the motion: of a sweep, or a shutter."""
        return self.sweep_s

    @property
    def early_s(self) -> float:
        """Time [s] before its stamp from which on a reading needs the motion: of an exposure, or of metering."""
        return 0.0

    @property
    def needs_next(self) -> bool:
        """True if a reading needs the pose at the next one, as optical flow does."""
        return False

    @property
    def is_ideal(self) -> bool:
        """True if its messages have the true readings at the true time, and none is lost."""
        return self.signal is None and self.clock is None

    def output(
        self, *topics: Topic, part: str = "", clock: str = "", frame: str = "", reading: type[Reading] = Message
    ) -> Output:
        """Return a series of readings of the sensor, or of a part of it; in its own frame, unless another is given."""
        name = f"{self.name}/{part}" if part else self.name
        own = frame or next(iter(self.frames()), "")
        return Output(name, topics, part, clock=clock, frame=own, reading=reading)

    def with_truth(self, *outputs: Output) -> tuple[Output, ...]:
        """Return series of its readings and, if it is not ideal, those of the ideal readings after them."""
        ideal = () if self.is_ideal else outputs
        return (
            *outputs,
            *(
                each._replace(
                    name=each.name + TRUTH,
                    topics=tuple(topic._replace(name=topic.name + TRUTH) for topic in each.topics),
                    ideal=True,
                )
                for each in ideal
            ),
        )

    def true_topic(self, name: str) -> str:
        """Return the topic with the ideal readings of one of its topics that ``with_truth`` knows."""
        return name if self.is_ideal else name + TRUTH

    def frames(self) -> dict[str, Mount]:
        """Its frames that have base_link as parent, by name."""
        return {}

    def optical_frames(self) -> dict[str, tuple[str, Any]]:
        """Its REP-103 optical frames: parent and (4, 4) ``parent_from_optical`` by name."""
        return {}

    def base_from_frames(self) -> dict[str, Array]:
        """Poses (4, 4) of its frames and its optical frames in base_link, by name."""
        found = {name: mount.base_from_sensor for name, mount in self.frames().items()}
        return found | {name: found[parent] @ pose for name, (parent, pose) in self.optical_frames().items()}

    @property
    def needs_signal_for_weather(self) -> bool:
        """True if weather changes nothing for it, because it is ideal."""
        return False

    @property
    def unfit_for_frames(self) -> tuple[str, str] | None:
        """The key that must be false where an experiment makes separate frames, and why."""
        return None

    def figures(self) -> str:
        """Return what it measures, in a few words."""
        return "-"

    def summary(self) -> str:
        """Return its figures as sentences of the data card; empty: it is named only beside others of its kind."""
        return ""

    def notes(self, named: str) -> list[str]:
        """Return how it takes its readings, as lines of the data card; ``named`` is what they call it."""
        return []

    def gazebo(self, flavour: str) -> str:
        """Return its ``<sensor>`` of SDF in base_link for Gazebo ``classic`` or ``gz``; empty: the one of its readings.

        Every package has one of a ``ScanningConfig``, of an ``ImagingConfig``, and of sensors in a frame of their own
        that give ``Inertial`` or ``Fix``; other kinds without one of their own are refused.
        """
        return ""

    def kalibr(self) -> str:
        """Return the file in which Kalibr reads its noise; empty for a kind that Kalibr has no such file of."""
        return ""

    def measured(self, message: Any, points: Any) -> dict[str, Any]:
        """Return values that it has by a message of a bag without an experiment.

        Args:
            message: decoded, of its first topic.
            points: rows of the points of a cloud, a structured array (n,); None of other messages.
        """
        return {}

    def cloud_fields(self) -> dict[str, str]:
        """Return NumPy's type of each field of its clouds; empty if it has none, or any."""
        return {}

    def new_topic(self, name: str, msgtype: str, rate_hz: float | None = None) -> Topic:
        """Return a topic of the sensor, by default at its rate."""
        return Topic(name, msgtype, self.rate_hz if rate_hz is None else rate_hz, self.kind, self.name)


class MountedConfig(SensorConfig):
    """A sensor in a frame of its own."""

    mount: Mount
    frame: FrameName

    @classmethod
    def of_name(cls, name: str) -> dict[str, Any]:
        """Topic and frame that a sensor has by its name."""
        return {**super().of_name(name), "frame": f"{name}_link"}

    def frames(self) -> dict[str, Mount]:
        """Its frame."""
        return {self.frame: self.mount}


_MODULES: Final[Registry[ModuleType]] = Registry(
    "module of sensors",
    "sensors",
    ".py",
    lambda name, found: load_module(f"fieldtruth_sensors_{name}", found) if isinstance(found, Path) else found,
    {},
)
"""Modules of other packages and of the user; the import of one makes the kinds that it defines known."""


def load_added_kinds() -> None:
    """Import the modules of other packages and of the user that define kinds of sensors.

    Raises:
        ConfigurationError: one of them cannot be imported.
    """
    for name in _MODULES:
        _MODULES[name]


def known_switches() -> list[str]:
    """Words with which sensors are turned on and off, of all kinds."""
    load_added_kinds()
    return [*dict.fromkeys(config.switch for config in KINDS.values() if config.switch)]


def known_extras() -> list[str]:
    """``extras`` of all kinds."""
    load_added_kinds()
    return [*dict.fromkeys(name for config in KINDS.values() for name in config.extras)]


def sensor_of(value: Any) -> SensorConfig:
    """Return the configuration that an item of ``rig.sensors`` describes.

    Raises:
        ValueError: not a mapping, or an unknown kind.
        PartError: a value that is not allowed.
    """
    if isinstance(value, SensorConfig):
        return value
    if not isinstance(value, Mapping):
        raise ValueError(f"must be a mapping with the keys kind, name, ..., got {shortened(value)}")
    kind = value.get("kind")
    if kind is None:
        raise LocatedError(f"is required: one of {', '.join(sorted(KINDS))}", ["kind"])
    if kind not in KINDS:
        load_added_kinds()
    if kind not in KINDS:
        raise LocatedError(f"{shortened(kind)} is unknown; {suggestion(str(kind), sorted(KINDS))}", ["kind"])
    config = KINDS[kind]
    if config.needs_mount and "mount" not in value:
        raise LocatedError(f"is required: {condition_at(config, ['mount'])}", ["mount"])
    return part(config, value)
