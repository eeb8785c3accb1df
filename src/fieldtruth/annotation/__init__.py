# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Labelled images and clouds for a bag that was recorded elsewhere, such as in Gazebo (the paper's post-processing).

The bag's true poses give the robot's position; the world's name and seed give what its sensors see there. The input is
only read: its messages are copied unchanged, merged with the new ones, into a new bag.
"""

import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from heapq import merge
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Connection

from fieldtruth.annotation.check import Poses, check_frames, check_objects, check_poses, read_poses
from fieldtruth.bag import topics as table
from fieldtruth.bag.messages import tf_static
from fieldtruth.bag.reader import open_bag
from fieldtruth.bag.run import Run, open_run
from fieldtruth.bag.topics import ROBOT
from fieldtruth.bag.writer import BagWriter
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning
from fieldtruth.core.files import locked, output_errors, output_path
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Advance, Progress, Silent, timed
from fieldtruth.drive.track import Stamps
from fieldtruth.experiment.light_config import LightConfig, WeatherConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import KINDS, Output, SensorConfig, Topic
from fieldtruth.record.folder import RunFolder, new_folder
from fieldtruth.record.slices import Slices, slices_key
from fieldtruth.record.streams import Stream, sensor_factory, series_of, stream_of
from fieldtruth.sensors.kind import Movement, SensorWorld
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.world.build import check_layout, load_world
from fieldtruth.world.model import World

CAMERAS_ONLY = Rig().with_sensors(LidarConfig, enabled=False)
"""The paper's stereo camera."""


@dataclass(frozen=True)
class WorldConfig:
    """The world in which a bag was recorded, its light and weather; an experiment has the same fields."""

    environment: str
    seed: int = 0
    layout: Mapping[str, Any] | None = None
    """Changes to the environment's configuration."""
    light: LightConfig = field(default_factory=LightConfig)
    weather: WeatherConfig = field(default_factory=WeatherConfig)


def annotate(
    bag: Path | str,
    world: str | WorldConfig,
    *,
    rig: Rig = CAMERAS_ONLY,
    robot: str = ROBOT,
    out: Path | str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write a new bag: all messages of another one, and what the rig's cameras and LiDAR sense at its true poses.

    Images and clouds that the bag has already are kept, too: their topics get the prefix /recorded.

    The bytes do not depend on the number of workers. If interrupted, the same call resumes.

    Args:
        bag: with /ground_truth/odom or /gazebo/model_states; or the folder of a run. It is only read.
        world: where it was recorded; a string is the name of an environment, with seed 0.
        rig: sensors to add, with their mounts and rates; a sensor that is not enabled is not added.
        robot: the model in /gazebo/model_states that carries the sensors; its pose there is that of base_link.
        out: the new bag; by default beside the other, with a name that ends in ``_annotated``.
        workers: threads; None for one per core that the process may use.
        progress: receives the progress.

    Returns:
        Path of the new bag, ``out``.

    Raises:
        UnknownNameError: unknown environment, or the bag has no such robot.
        ConfigurationError: a layout that is not allowed, or a rig without a sensor to add.
        BagError: the bag cannot be read, has no poses or a gap in them, or was recorded with other sensors or in
            another world.
        OutputError: the output already exists, is in use, or cannot be written.
    """
    target = None if out is None else output_path(out, single=True)
    config = WorldConfig(world) if isinstance(world, str) else world
    check_layout(config.environment, config.layout)
    progress = Silent() if progress is None else progress
    run, rig = open_run(bag), rig.with_sensors(SensorConfig, clock=None)
    if target is None:
        target = output_path(run.folder / f"{run.name}_annotated.bag")
    added = _added_topics(run, rig)
    with _work_folder(target) as folder:
        frames = check_frames(run, rig)
        with progress.stage("read the poses", run.duration_s) as advance:
            poses = read_poses(run, rig, robot, advance)
        built = _world(run, config, robot, progress)
        slices = _slices(built, config, rig, poses, added, folder, progress)
        seconds = (slices.end_ns - slices.start_ns) / 1e9
        with progress.stage("sense and label", seconds, slices.seconds_done) as advance:
            slices.make(cpu_count() if workers is None else workers, advance)
        with progress.stage("write the bag", run.duration_s) as advance:
            merge_bags(run, slices, target, _latched(poses, frames), poses.recorded_at, advance)
    return target


def _world(run: Run, config: WorldConfig, robot: str, progress: Progress) -> World:
    """Build the world, and check that the bag was recorded there."""
    with progress.stage("build the world"):
        world = load_world(config.environment, config.seed, config.layout)
    check_objects(run, world, robot)
    return world


def _slices(
    world: World,
    config: WorldConfig,
    rig: Rig,
    poses: Poses,
    added: list[Topic],
    folder: RunFolder,
    progress: Progress,
) -> Slices:
    """Check that the poses fit into the world, and prepare the slices of what the sensors see there."""
    streams = _streams(poses, rig)
    check_poses(poses.trajectory, streams, rig, world)
    with progress.stage("prepare the scene"):
        sensors = sensor_factory(SensorWorld(world, rig, config.light, config.weather, reuse=True))
    path = folder.slices(slices_key(world, rig, config.light, config.weather, poses.trajectory))
    return Slices(path, streams, added, sensors, start_ns=min(int(stream.stamps_ns[0]) for stream in streams) - 1)


@contextmanager
def _work_folder(target: Path) -> Iterator[RunFolder]:
    """Open and lock a hidden folder for slices beside the new bag; it is kept when the work is interrupted.

    Raises:
        OutputError: the bag is in use, or cannot be written.
    """
    path = target.with_name(f".{target.name}.parts")
    folder = RunFolder(path, target)
    with new_folder(path, target):
        with locked(path):
            yield folder
            folder.clean()
        path.rmdir()


def _added_topics(run: Run, rig: Rig) -> list[Topic]:
    added = [topic for topic in table.topics_of(rig) if topic.kind in KINDS and KINDS[topic.kind].sees]
    if not added:
        raise ConfigurationError("nothing to add: the rig has neither cameras nor a LiDAR that is enabled")
    if present := [topic.name for topic in added if topic.name in run.counts]:
        renamed = f"the bag's own messages of {', '.join(present)} have the prefix {RECORDED} in the new bag"
        warnings.warn(renamed, FieldtruthWarning, stacklevel=3)
    return added


def _streams(poses: Poses, rig: Rig) -> list[Stream]:
    """Streams at all multiples of a sensor's period for which there are poses, in the order of ``topics_of``."""

    def pose_at(stamp_ns: int | NDArray[np.int64]) -> Array:
        if isinstance(stamp_ns, np.ndarray):
            known = np.clip(stamp_ns, *poses.trajectory.stamps_ns[[0, -1]])  # a camera meters before its stamp
            return np.stack([poses.trajectory.world_from_base(stamp) for stamp in known.tolist()])
        return poses.trajectory.world_from_base(stamp_ns)

    def stamps(config: SensorConfig, output: Output) -> Stamps:
        return poses.stamps(config.name, output.rate_hz, round(1e9 * config.sweep_s))

    movement, streams = Movement(pose_at), list[Stream]()
    for config in (each for each in rig.in_order() if each.sees):
        streams += [stream_of(series, movement) for series in series_of(config, rig, partial(stamps, config), 0)]
    return streams


def _latched(poses: Poses, frames: Mapping[tuple[str, str], Array]) -> dict[str, tuple[int, bytes]]:
    """/tf_static of the added frames at the first pose: its stamp in the bag [ns], and its bytes."""
    first_ns = int(poses.trajectory.stamps_ns[0])
    return {table.TF_STATIC: (poses.recorded_at(first_ns), tf_static(first_ns, frames))} if frames else {}


RECORDED: Final = "/recorded"
"""Prefix of the bag's own topics where new ones have their names."""


class _Entry(NamedTuple):
    """A message for the new bag: its stamp there [ns], its topic or the connection that recorded it, and its bytes."""

    stamp_ns: int
    topic: str | Connection
    data: bytes


def merge_bags(
    run: Run,
    slices: Slices,
    target: Path,
    latched: Mapping[str, tuple[int, bytes]],
    recorded_at: Callable[[int], int],
    advance: Advance,
) -> None:
    """Write all messages in time order; of those with the same stamp the other bag's come first.

    One chunk of each is in memory at a time.

    Args:
        run: the other bag, all of whose messages are copied; topics that are new, too, get the prefix ``RECORDED``.
        slices: the new messages; all slices are finished.
        target: the new bag; it appears when it is complete.
        latched: stamp in the bag [ns] and bytes, by topic, of messages that are published once.
        recorded_at: stamp in the bag [ns] of a reading taken at a stamp [ns].
        advance: called with the time [s] just written.
    """
    once = [topic for topic in table.PAPER_TOPICS if topic.name in latched]
    with (
        output_errors(target, resumes=True),
        open_bag(run.bag, own_names=True) as source,
        BagWriter(target, [*once, *slices.topics]) as bag,
    ):
        new = {topic.name for topic in slices.topics}
        kept = [c._replace(topic=RECORDED + c.topic) if c.topic in new else c for c in source.connections]
        connections = {connection.id: bag.carry(connection) for connection in kept}

        def original() -> Iterator[_Entry]:
            for raw in source.messages():
                yield _Entry(raw.stamp_ns, connections[raw.connection], raw.data)

        def added() -> Iterator[_Entry]:
            yield from (_Entry(stamp, topic, data) for topic, (stamp, data) in latched.items())
            for k in range(slices.count):
                with open_bag(slices.path(k)) as part:
                    for raw in part.messages():
                        yield _Entry(recorded_at(raw.stamp_ns), raw.topic, raw.data)

        entries = merge(original(), added(), key=lambda entry: entry.stamp_ns)
        for entry in timed(entries, advance, run.start_ns):
            bag.write(entry.topic, entry.stamp_ns, entry.data)
