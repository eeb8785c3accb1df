# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Noise for a run that is finished: the same bag as if it had been generated with these signals.

The world is made again from the run's experiment, because what a real sensor reads depends on surfaces that no ideal
message states. What sensors without a signal have read is taken from the bag. So is the motion, if the bag has all that
the others need of it: sensors that see need it until the last sweep is complete, which is after the end of the bag, and
wheels need their angles at every step of the physics. For these the robot drives again.
"""

import threading
from array import array
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from fieldtruth.bag import provenance
from fieldtruth.bag.file import EXPERIMENT, BagError
from fieldtruth.bag.geometry import ModelStatesReader
from fieldtruth.bag.provenance import fits_checksums, read_checksums, sha256_of
from fieldtruth.bag.reader import BagReader, open_bag
from fieldtruth.bag.run import Run, open_run
from fieldtruth.bag.topics import COMMANDS, MODEL_STATES, ODOMETRY
from fieldtruth.core.arrays import Counts
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.progress import Progress
from fieldtruth.core.transforms import wxyz_from_xyzw
from fieldtruth.drive.track import Base, Commands, Motion, Track, WheelMotion
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import with_overrides
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.pipeline import PreparedHere, generate_by, prepare
from fieldtruth.record.slices import Slices, slices_key
from fieldtruth.record.streams import Sensors, Stream
from fieldtruth.sense.scene import Scene
from fieldtruth.simulation.stepped import Simulation

_CHUNKS: Final = 16
"""Decompressed parts of the bag in memory, some for each worker thread."""


def degrade(
    source: Path | str,
    out: Path | str,
    *,
    signal: str | dict[str, Any] = "datasheet",
    scene: Scene | None = None,
    workers: int | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Add to the sensors of a finished run what real ones add: ``out/NAME/NAME.bag`` and what belongs beside it.

    Args:
        source: folder of a run of this package, or its bag; not changed.
        out: folder of data sets.
        signal: as in ``with_overrides``: ``datasheet``, or a mapping of names or kinds of sensors to their ``signal``.
        scene: the run's world in the ray tracer, if it was built.
        workers: as in ``generate``.
        overwrite: as in ``generate``.
        progress: as in ``generate``.

    Returns:
        Path of the new bag; its bytes are those of ``generate`` with the same signals.

    Raises:
        BagError: no such run, one without its experiment, one that has signals already, or one that this version of
            the package would not record again.
        ConfigurationError: a signal that is not allowed, or none.
        OutputError, EngineError, SliceError: as ``generate``.
    """
    run = open_run(source)
    experiment = with_overrides(_ideal_experiment(run), signal=signal)
    changed = [old for new, old in zip(experiment.rig.sensors, run.rig.sensors, strict=True) if new != old]
    if not any(sensor.enabled for sensor in changed):
        raise ConfigurationError("signal must change a sensor of the run: all of them stay ideal")
    with open_bag(run.bag) as bag:
        stored = _Stored(bag, run, changed)

        def engine(simulation: Simulation, progress: Progress) -> _Degraded:
            if stored.drives:
                made = prepare(simulation, progress)
                parts = made.experiment, made.world, made.track, run, stored
                return _Degraded(*parts, scene=made.scene, company=made.company)
            with progress.stage("build the world"):
                world, track = simulation.world, stored.track()
            return _Degraded(simulation.experiment, world, track, run, stored, scene=scene)

        simulation = Simulation(experiment, scene=scene, sensors=[each.name for each in changed if each.enabled])
        return generate_by(engine, simulation, out, workers=workers, overwrite=overwrite, progress=progress)


def _ideal_experiment(run: Run) -> Experiment:
    """Experiment of a run without signals; other runs are refused."""
    if run.experiment is None:
        raise BagError(f"{run.bag} has no experiment.yaml beside it; only a run of fieldtruth can be degraded")
    if run.experiment.robots:
        raise BagError(f"{run.bag} is of one of several robots; generate their runs again, with --signal")
    if noisy := [sensor.name for sensor in run.rig.sensors if sensor.signal is not None]:
        raise BagError(f"{run.bag} has signals of real sensors already: {', '.join(noisy)}")
    return run.experiment


class _Stored:
    """Messages in a bag that stay as they are; threads may share it.

    They are those of sensors that see and do not change; where the robot need not drive again, all but those of the
    sensors that change.
    """

    def __init__(self, bag: BagReader, run: Run, changed: Collection[SensorConfig]) -> None:
        moved = any(sensor.sees or sensor.needs_wheels for sensor in changed)
        among = run.experiment is not None and bool(run.experiment.actors)
        self.drives = moved or among or not fits_checksums(run.folder, run.bag.name, EXPERIMENT)
        """True if the robot drives again, as it does among actors."""
        self.sha256 = "" if self.drives else read_checksums(run.folder)[run.bag.name]
        """Of the bag, if it was computed."""
        kept = [each for each in run.rig.in_order() if each not in changed and (each.sees or not self.drives)]
        self.sensors = {sensor.name for sensor in kept}
        topics = {topic.name for sensor in kept for topic in sensor.topics()}
        if not self.drives:
            topics = {*bag.counts} - {topic.name for sensor in changed for topic in sensor.topics()}
        self._bag, self._topics, self._is_frames = bag, topics & bag.counts.keys(), run.is_frames
        self._index = bag.index(sorted({*topics, ODOMETRY} & bag.counts.keys()))
        self._lock = threading.Lock()
        self._chunk = lru_cache(_CHUNKS)(bag.chunk)

    def replaces(self, stream: Stream) -> Stream:
        """Return the stream of the bag with these topics; the stream itself if it does not stay.

        Raises:
            BagError: the bag has readings at other stamps.
        """
        if not self._topics >= {*stream.topics}:
            return stream
        for topic in stream.topics:
            if not np.array_equal(self._index[topic].stamps_ns, stream.stamps_ns):
                raise _other_version(self._bag, topic)

        def messages(rows: Counts, _: Sensors) -> Iterator[list[bytes]]:
            return ([self._message(topic, k) for topic in stream.topics] for k in rows.tolist())

        return Stream(stream.topics, stream.stamps_ns, messages)

    def track(self) -> Track:
        """Return the motion in the bag, without what follows its end; of wheels and commands the stamps only."""
        states, stamps, rows = ModelStatesReader(), array("q"), array("d")
        for raw in self._bag.messages([MODEL_STATES]):
            row = states.row(raw.data)
            stamps.append(raw.stamp_ns)
            rows.extend((*states.poses(raw.data)[row].tolist(), *states.twists(raw.data)[row].tolist()))
        table = np.frombuffer(rows).reshape(-1, 13)
        motion = Motion(
            stamps_ns=np.frombuffer(stamps, np.int64),
            position=table[:, :3],
            quaternion_wxyz=wxyz_from_xyzw(table[:, 3:7]),
            linear_velocity=table[:, 7:10],
            angular_velocity=table[:, 10:],
        )
        base = None
        if COMMANDS in self._topics:
            none, due = np.zeros((0, 0)), self._index[COMMANDS].stamps_ns
            commands = Commands(stamps_ns=due, command=np.zeros((len(due), 2)))
            base = Base(wheels=WheelMotion(angle=none, speed=none), commands=commands)
        return Track(motion=motion, swept=motion, base=base, is_frames=self._is_frames)

    def _message(self, topic: str, k: int) -> bytes:
        index = self._index[topic]
        with self._lock:
            return self._bag.message(self._chunk(int(index.chunk[k])), int(index.offset[k])).data

    def check(self, stream: Stream) -> None:
        """Raise BagError unless the first and the last message of a topic are those of a stream."""
        (topic,) = stream.topics
        ends = np.array([0, len(stream.stamps_ns) - 1])
        if [(self._message(topic, k),) for k in ends.tolist()] != list(stream.messages(ends, {})):
            raise _other_version(self._bag, topic)


def _other_version(bag: BagReader, topic: str) -> BagError:
    reason = provenance.difference(provenance.makers_of(bag.path.parent)) or "its experiment or version was another"
    what = f"{bag.path} differs in {topic} from what fieldtruth records here ({reason})"
    return BagError(f"{what}; generate it again, with --signal")


@dataclass(frozen=True)
class _Degraded(PreparedHere):
    """A run that takes what stays as it was from a bag."""

    run: Run
    stored: _Stored

    @property
    def key(self) -> str:
        """Key of its slices."""
        return slices_key(super().key, self.stored.sha256 or sha256_of(self.run.bag))

    def slices(self, folder: Path) -> Slices:
        """Build the scene for the slices in a folder, and keep what made the readings that are taken from the bag."""
        provenance.note(folder, provenance.makers_of(self.run.folder) if self.stored.sensors else ())
        return super().slices(folder)

    def streams(self) -> list[Stream]:
        """Return its streams; raises BagError if the robot drove otherwise in the bag."""
        streams = super().streams()
        for stream in streams:
            if stream.topics == (ODOMETRY,) and self.stored.drives:
                self.stored.check(stream)
        return [self.stored.replaces(stream) for stream in streams]

    def sensed(self) -> Rig:
        """Return the rig with the sensors whose readings are not in the bag."""
        rig = super().sensed()
        kept = tuple(sensor for sensor in rig.sensors if sensor.name not in self.stored.sensors)
        return rig.model_copy(update={"sensors": kept})
