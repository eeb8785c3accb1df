# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A run as readings of its sensors: frames by sensor and stamp, the true trajectory and the calibration, as arrays.

This is the one reader of bags by sensor: of data sets, exports, reports and the viewer. It has no file open and keeps
no message, so that runs may be pickled, forked and read by threads.
"""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import points, stamp_ns
from fieldtruth.bag.file import BagError, BagFile, experiment_of, find_bag
from fieldtruth.bag.geometry import (
    Calibration,
    Poses,
    Trajectory,
    first_message,
    pose_topic,
    read_objects,
    read_poses,
)
from fieldtruth.bag.movers import Movers, movers_of
from fieldtruth.bag.reader import Storage, decoder, open_bag
from fieldtruth.bag.readings import Readings, warn_of_intensity
from fieldtruth.bag.stamps import Stream, read_streams
from fieldtruth.bag.topics import Source, sources_of
from fieldtruth.core.arrays import Counts
from fieldtruth.core.classes import CLASSES, ClassTable
from fieldtruth.core.errors import FieldtruthError, FieldtruthWarning, UnknownNameError
from fieldtruth.core.readings import Cloud, Frame, Message, Reading
from fieldtruth.core.yaml_io import parse_mapping, read_text
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.world.classes import CLASSES_FILE, classes_of, with_own

_TOLERANCE: Final = 0.2
"""Relative difference of a rate from which on it is another."""
_SHOWN: Final = 4
"""Misfits that are listed."""


def measured_rig(run: BagFile) -> Rig:
    """Return the paper's rig with the rates, sizes and frames that a bag without an experiment has.

    What cannot be measured, because a message is missing or odd, stays as in the paper.
    """
    rig, found = table.PAPER_RIG, dict[str, tuple[Any, float | None]]()
    names = [topic.name for sensor in rig.sensors for topic in sensor.topics() if topic.name in run.counts]
    with open_bag(run.bag) as bag, suppress(BagError):
        decode, indices = decoder(bag), bag.index(names)
        for name, index in indices.items():
            with suppress(BagError, AttributeError, IndexError):
                ends = [bag.message(bag.chunk(int(index.chunk[k])), int(index.offset[k])) for k in (0, -1)]
                found[name] = _first_and_rate([decode(raw) for raw in ends], index.stamps_ns)
    return rig.model_copy(update={"sensors": tuple(_measured(sensor, found) for sensor in rig.sensors)})


def _first_and_rate(ends: Sequence[Any], stamps_ns: Counts) -> tuple[Any, float | None]:
    """Return the first message of a topic, and its rate [Hz] between the first and the last header or stamp."""
    has_header = hasattr(ends[0], "header")
    first, last = (stamp_ns(each.header) for each in ends) if has_header else stamps_ns[[0, -1]].tolist()
    count = len(stamps_ns)
    return ends[0], float(f"{(count - 1) / ((last - first) / 1e9):.3g}") if count > 2 and last > first else None


def _measured(sensor: SensorConfig, found: Mapping[str, tuple[Any, float | None]]) -> SensorConfig:
    names = [topic.name for topic in sensor.topics() if topic.name in found]
    if not names:
        return sensor
    values: dict[str, Any] = {"rate_hz": found[sensor.topic if sensor.topic in names else names[0]][1]}
    values |= _stated(sensor, found[names[0]][0])
    known = {key: value for key, value in values.items() if value}
    return sensor.model_copy(update=known)


def _stated(sensor: SensorConfig, message: Any) -> dict[str, Any]:
    """Return values that a sensor has by one of its messages; nothing if it cannot be understood."""
    with suppress(FieldtruthError, AttributeError, ValueError, TypeError, KeyError, IndexError):
        return sensor.measured(message, points(message) if hasattr(message, "fields") else None)
    return {}


def unlike(source: Source, message: Any) -> str:
    """Describe differences of a message from its sensor's configuration: frame, size, rays and fields of clouds."""
    frame = str(message.header.frame_id).strip("/") if hasattr(message, "header") else ""
    found = [f"the frame {frame!r}, not {source.frame!r}"] if source.frame and frame not in ("", source.frame) else []
    for key, value in _stated(source.config, message).items():
        own = getattr(source.config, key)
        # The uppermost rings may see the sky only, so that no point has their number.
        if key != "frame" and (value > own if key in ("rings", "columns") else value != own):
            found.append(f"{value} {key}, not {own}")
    return " and ".join([*found, *_other_fields(source.config.cloud_fields(), message)])


def _other_fields(due: Mapping[str, str], message: Any) -> Iterator[str]:
    """Describe how the fields of a cloud differ from those that its sensor writes."""
    if not due or not hasattr(message, "fields"):
        return
    with suppress(BagError):
        dtype = points(message).dtype
        found = {name: dtype[name].str for name in dtype.names or ()}
        lacking, more = [name for name in due if name not in found], [name for name in found if name not in due]
        if lacking:
            yield f"no field {', '.join(lacking)}"
        if more and not (more == ["t"] and not lacking):  # of LiDARs that do not spin it is zero, or left out
            yield f"a further field {', '.join(more)}"
        # Ids have 16 or 32 bits, by the number of objects.
        other = [n for n in due if n in found and n != "instance" and np.dtype(due[n]) != np.dtype(found[n])]
        for name in other:
            yield f"{name} as {found[name][1:]}, not {due[name][1:]}"


def misfits(run: "Run") -> str:
    """Describe how the experiment beside a bag does not fit it, in one line; empty for a bag that it fits.

    Of clouds, the first message is looked at: frame, rays and fields.
    """
    if run.experiment is None:
        return ""
    topics = table.topics_of_run(run.experiment, latched=table.STATIC_MODEL_STATES in run.counts)
    found = []
    for topic in topics:
        due = 1.0 if topic.rate_hz is None else topic.rate_hz * run.duration_s / 2.0
        if topic.name not in run.counts and due >= 1.0:
            found.append(f"no {topic.name}")
        rate = _rate(run, topic.name)
        if rate and topic.rate_hz and abs(rate - topic.rate_hz) > _TOLERANCE * topic.rate_hz + 1.0 / run.duration_s:
            found.append(f"{topic.name} has {rate:.3g} Hz, not {topic.rate_hz:g} Hz")
    for source in run.of(Cloud):
        with suppress(BagError):  # a cloud that cannot be understood says so when it is read
            text = unlike(source, first_message(run, source.topic))
            run._compared.add(source.name)
            found += [f"{source.topic} has {text}"] * bool(text)
    more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    return f"experiment.yaml beside {run.bag} does not fit the bag: {'; '.join(found[:_SHOWN])}{more}" if found else ""


def _rate(run: BagFile, topic: str) -> float | None:
    """Mean rate [Hz] of a topic; None of fewer than three messages."""
    count = run.counts.get(topic, 0)
    return (count - 1) / run.duration_s if count > 2 and run.duration_s > 0.0 else None


class Run(BagFile):
    """A bag whose sensors are read by name: ``run["lidar"][3].xyz``, ``run["stereo/left"].at(stamp_ns).photo``.

    Names are those of the rig; of a pair's views ``NAME/left`` and ``NAME/right``.
    """

    def __repr__(self) -> str:
        """Name of the bag, its duration, and its messages by topic, like ``rosbag info``."""
        topics = ", ".join(f"{topic}: {count}" for topic, count in self.counts.items())
        return f"<Run {self.bag}, {self.duration_s:.3f} s, {sum(self.counts.values())} messages, {topics}>"

    @cached_property
    def rig(self) -> Rig:
        """The rig that recorded it; of a bag from elsewhere the paper's, which is said with a warning."""
        if self.experiment is not None:
            return self.experiment.rig
        warnings.warn(f"{self.bag}: {self.assumed}", FieldtruthWarning, stacklevel=3)
        return measured_rig(self)

    @property
    def assumed(self) -> str:
        """Assumptions about a bag that has no experiment.yaml beside it; else empty."""
        if self.experiment is not None:
            return ""
        return (
            "there is no experiment.yaml of this bag beside it, so its sensors are taken for those of the paper's rig; "
            "rates, sizes of images and clouds, and frames are measured from the bag"
        )

    @cached_property
    def classes(self) -> ClassTable:
        """Classes that points and pixels may have; of a bag from elsewhere all, and those of the file beside it.

        Raises:
            ConfigurationError: own classes that are not allowed.
        """
        if self.experiment is not None:
            made = self.experiment
            return classes_of(made.environment, made.layout, actors=bool(made.actors))
        path = self.bag.with_suffix(CLASSES_FILE)
        return with_own(parse_mapping(read_text(path), str(path)), source=str(path)) if path.is_file() else CLASSES

    @cached_property
    def sensors(self) -> Mapping[str, Source]:
        """Sensors of the rig that are enabled, by name, also those that the bag has no messages of."""
        return sources_of(self.rig)

    @cached_property
    def trajectory(self) -> Trajectory:
        """True poses of base_link.

        Raises:
            BagError: the bag has none, or is damaged, or their stamps do not rise.
        """
        return read_poses(self).trajectory

    @cached_property
    def poses(self) -> Poses:
        """True poses by stamp, each read when it is asked for; raises as ``trajectory``."""
        topic = pose_topic(self)
        return Poses(self.storage, self.streams([topic])[topic])

    @cached_property
    def movers(self) -> Movers:
        """What moves beside the robot of the run, as far as an experiment beside the bag says it.

        Raises:
            BagError: the bag lacks what moves, or is damaged.
        """
        if self.experiment is None or not (self.experiment.robots or self.experiment.actors):
            return Movers()
        self.require(table.MODEL_STATES)
        found = movers_of(self.experiment, read_objects(self)[0])
        return Movers(found, self.storage, self.streams([table.MODEL_STATES])[table.MODEL_STATES])

    @property
    def has_poses(self) -> bool:
        """True if the bag has true poses."""
        return table.ODOMETRY in self.counts or table.MODEL_STATES in self.counts

    @cached_property
    def calibration(self) -> Calibration:
        """Mounts of the sensors, and lenses of the cameras, by name of the sensor."""
        return Calibration(self, self.sensors)

    def source(self, name: str) -> Source:
        """Return a sensor by its name, or a view by its name in files.

        Raises:
            UnknownNameError: the rig has no such sensor.
        """
        labels = {source.label: source for source in self.sensors.values()}
        if name not in self.sensors and name not in labels:
            raise UnknownNameError("sensor", name, self.sensors, str(self.bag))
        return self.sensors.get(name) or labels[name]

    def of(self, kind: type[Reading], *parts: str, recorded: bool = True) -> list[Source]:
        """Return the sensors whose readings have a type, in the order of the rig; with ``recorded`` those in the bag.

        Args:
            kind: type of the readings, such as ``Cloud``.
            parts: what the bag must have of them; by default the first part.
            recorded: whether the bag must have them.
        """
        found = (source for source in self.sensors.values() if source.type is kind)
        return [source for source in found if not recorded or source.has(self.counts, *parts)]

    def __getitem__(self, name: str) -> Readings:
        """Return the readings of a sensor, with all parts that the bag has.

        Raises:
            UnknownNameError: the rig has no such sensor.
            BagError: the bag has no readings of it, or is damaged, or their stamps do not rise.
        """
        return self.readings(name)

    def readings(self, name: str, parts: Sequence[str] = (), *, labelled: bool = True) -> Readings:
        """Return the readings of a sensor, with some of its parts, by default all that the bag has; raises as above.

        If not ``labelled``, the points of clouds have no classes, and none are looked for.
        """
        source = self.source(name)
        parts = tuple(parts) or source.recorded(self.counts) or tuple(source.topics)[:1]
        topics = [source.topics[part] for part in parts]
        self.require(*topics)
        streams = self.streams(topics)
        found = Readings(
            source, parts, [streams[topic] for topic in topics], self.storage, labelled=labelled, classes=self.classes
        )
        if len(found) and (source.name, labelled) not in self._said:
            self._said.add((source.name, labelled))
            with suppress(BagError):  # a reading that cannot be understood says so when it is read
                self._say(found, labelled=labelled)
        return found

    def _say(self, found: Readings, *, labelled: bool) -> None:
        """Warn of classes that are read from the intensity, and of a sensor that its configuration does not fit."""
        source, message = found.source, found.message(0)
        if labelled and source.type is Cloud:
            warn_of_intensity(message, source.topic, self.bag)
        if self.experiment is None or source.name in self._compared:
            return
        self._compared.add(source.name)
        if text := unlike(source, message):
            name = f"{self.bag}: {source.topics[found.parts[0]]} has {text}, unlike experiment.yaml; the bag counts"
            warnings.warn(name, FieldtruthWarning, stacklevel=5)

    def messages(self, topic: str) -> Readings:
        """Return the messages of any topic as readings; raises as ``readings``."""
        self.require(topic)
        types = {topic: self.msgtypes[topic]}
        source = Source(topic, topic, Message, {"main": topic}, types, "", None, topic)
        return Readings(source, ["main"], [self.streams([topic])[topic]], self.storage)

    def frames(self, sensors: Sequence[str] | None = None) -> Iterator[Frame]:
        """Yield the readings of some sensors, or of all, in time order; those with the same stamp together.

        Raises:
            UnknownNameError: the rig has no such sensor.
            BagError: the bag has no readings of one that is asked for, or is damaged, or stamps do not rise.
        """
        names = [n for n, s in self.sensors.items() if s.recorded(self.counts)] if sensors is None else sensors
        self.streams([t for name in names for t in self.source(name).topics.values() if t in self.counts])
        opened = {name: self[name] for name in names}
        poses = self.poses if self.has_poses else None
        for stamp in np.unique(np.concatenate([each.stamps_ns for each in opened.values()])).tolist():
            rows = {name: each.row_at(stamp) for name, each in opened.items()}
            found = {name: opened[name].read(row) for name, row in rows.items() if row is not None}
            pose = poses.world_from_base(stamp) if poses and poses.cover(np.array([stamp]))[0] else None
            yield Frame(stamp_ns=stamp, readings=found, pose=pose)

    @cached_property
    def storage(self) -> Storage:
        """The messages by position."""
        with open_bag(self.bag) as bag:
            return Storage(bag, self.clocked)

    def streams(self, topics: Sequence[str]) -> dict[str, Stream]:
        """Stamps and positions of the messages of topics; read once.

        Raises:
            BagError: the bag is damaged, or stamps do not rise.
        """
        new = [topic for topic in dict.fromkeys(topics) if topic not in self._streams]
        if new:
            with open_bag(self.bag) as bag:
                self._streams.update(read_streams(bag, self.storage, new))
        return {topic: self._streams[topic] for topic in topics}

    @cached_property
    def _streams(self) -> dict[str, Stream]:
        return {}

    @cached_property
    def _compared(self) -> set[str]:
        """Sensors whose first message was compared with their configuration."""
        return set()

    @cached_property
    def _said(self) -> set[tuple[str, bool]]:
        """Sensors of which warnings were given, and whether with those of labels."""
        return set()


def open_run(path: Path | str) -> Run:
    """Open the folder of a run, or a bag.

    An experiment.yaml beside the bag that does not fit it is reported with a warning.

    Raises:
        BagError: no such path, no bag in the folder or several, an unreadable bag, or one without messages.
        ConfigurationError: the experiment.yaml of this bag cannot be read.
    """
    bag = find_bag(path)
    with open_bag(bag) as stored:
        counts = {topic: count for topic, count in stored.counts.items() if count}
        if not counts:
            raise BagError(f"{bag} has no messages")
        run = Run(bag, experiment_of(bag), counts, stored.msgtypes, stored.start_ns, stored.end_ns)
    if text := misfits(run):
        warnings.warn(text, FieldtruthWarning, stacklevel=2)
    return run
