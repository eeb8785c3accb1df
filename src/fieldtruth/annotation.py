# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Labelled images and clouds for a bag that was recorded elsewhere, such as in Gazebo (the paper's post-processing).

The bag's true poses give the robot's position; the world's name and seed give what its sensors see there. The input is
only read: its messages are copied unchanged, merged with the new ones, into a new bag.

Labels of a bag that does not fit the rig and the world would be wrong without an error, so it is checked first. Two
clocks may differ: that of the message headers, which stamps readings, and that of the bag. ``rosbag record`` uses the
computer's time for the latter unless /use_sim_time is set.
"""

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from heapq import merge
from operator import attrgetter
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import geometry
from fieldtruth.bag import topics as table
from fieldtruth.bag.bodies import moving_in
from fieldtruth.bag.file import BagError, read_errors
from fieldtruth.bag.geometry import (
    ModelStatesReader,
    RecordedPoses,
    StaticFrames,
    Trajectory,
    pose_topic,
    read_objects,
    read_static_frames,
)
from fieldtruth.bag.messages import ModelStatesWriter, tf_static
from fieldtruth.bag.reader import RawMessage, open_bag
from fieldtruth.bag.run import Run, open_run
from fieldtruth.bag.topics import ROBOT
from fieldtruth.bag.writer import BagWriter
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning
from fieldtruth.core.files import output_errors, output_path
from fieldtruth.core.locks import locked
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Advance, Progress, Silent, timed
from fieldtruth.core.readings import Cloud
from fieldtruth.core.transforms import inverse, pose_from_quaternion_wxyz, quaternion_wxyz_from_rotation
from fieldtruth.core.yaml_io import write_mapping
from fieldtruth.drive.track import Stamps
from fieldtruth.experiment.actor_config import actor_names
from fieldtruth.experiment.files import dump_experiment
from fieldtruth.experiment.light_config import LightConfig, WeatherConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import BASE, KINDS, Output, SensorConfig, Topic
from fieldtruth.record.folder import RunFolder, new_folder
from fieldtruth.record.slices import Slices, slices_key
from fieldtruth.record.streams import Stream, sensor_factory, series_of, stream_of
from fieldtruth.sense.scene import Scene, given_world
from fieldtruth.sensors.kind import Movement, SensorWorld
from fieldtruth.world.build import check_layout, load_world
from fieldtruth.world.classes import CLASSES_FILE, CLASSES_KEY, as_layout
from fieldtruth.world.model import World

_SAME: Final = 1e-3
"""Tolerance [m] of equal frames, also for entries of rotations; values in a robot's description are rounded."""
_MOVED: Final = 0.05
"""Tolerance [m] of an object's position."""
_TURNED: Final = 1e-3
"""Tolerance of the product of two quaternions, 5 degrees."""


def check_type(run: Run, topic: str) -> None:
    """Check that a topic has the message type that it has in our runs.

    Raises:
        BagError: it has another type.
    """
    expected = next(row.msgtype for row in table.PAPER_TOPICS if row.name == topic)
    if (found := run.msgtypes[topic]) != expected:
        found, expected = (name.replace("/msg/", "/") for name in (found, expected))
        raise BagError(f"{topic} of {run.bag} must be of type {expected}, got {found}")


def static_frames(run: Run) -> StaticFrames:
    """Read the fixed frames of a bag; there may be none.

    Raises:
        BagError: /tf_static is damaged, or has another type or an unusual definition.
    """
    topic = table.TF_STATIC
    if topic not in run.counts:
        return StaticFrames({}, str(run.bag))
    check_type(run, topic)
    try:
        with read_errors(run.bag):
            return read_static_frames(run)
    except AttributeError as error:
        raise BagError(f"{topic} of {run.bag} has an unusual definition: {error}") from error


def check_frames(run: Run, rig: Rig) -> dict[tuple[str, str], Array]:
    """Return ``parent_from_child`` by (parent, child) of the frames that the rig's sensors need and the bag lacks.

    Raises:
        BagError: the bag has one of them at another pose.
    """
    seeing = [sensor for sensor in rig.in_order() if sensor.sees]
    needed = [frame for sensor in seeing for frame in (*sensor.frames(), *sensor.optical_frames())]
    ours, theirs = StaticFrames.of_rig(rig), static_frames(run)
    for frame in needed:
        if frame not in theirs.parents:
            continue
        here, there = ours.base_from(frame), theirs.base_from(frame)
        if not np.allclose(here, there, 0.0, _SAME):
            raise BagError(
                f"/tf_static of {run.bag} has {frame!r} at {_xyz(there[:3, 3])} in base_link, the rig at "
                f"{_xyz(here[:3, 3])}, or rotated; set its mount in an experiment file (--experiment)"
            )
    missing = {*needed} - theirs.parents.keys()
    return {(parent, child): pose for child, (parent, pose) in ours.parents.items() if child in missing}


def check_objects(run: Run, world: World, robot: str = ROBOT, moving: Iterable[str] = ()) -> None:
    """Check that the static objects of a bag are those of the world: the same names at the same poses.

    Models beside them and those of ``moving``, such as a second robot, are allowed with a warning, unless their names
    are those of objects that another layout has. A bag without models is taken as it is, with a warning.

    Raises:
        BagError: an object of the world is missing or has another pose, or the bag has more of its kind.
    """
    topic, where = table.objects_topic(run.counts), f"{world.name} with seed {world.seed}"
    if topic not in run.counts:
        text = f"{run.bag} has no {topic}, so that nothing shows whether it was recorded in {where}; this is assumed"
        warnings.warn(text, FieldtruthWarning, stacklevel=4)
        return
    check_type(run, topic)
    expected = ModelStatesReader()
    poses = expected.poses(ModelStatesWriter(world).template)[1:]
    ours = dict(zip(expected.names[1:], poses, strict=True))
    theirs = dict(zip(*read_objects(run), strict=True))
    missing = [name for name in ours if name not in theirs]
    moved = [name for name in ours if name in theirs and not _is_near(theirs[name], ours[name])]
    # Gazebo has the land beyond the edge as models of their own, and may have any number of robots.
    usual = {robot, ROBOT, f"{world.name}_backdrop", *ours, *moving, *(f"{name}_beyond" for name in ours)}
    others, kinds = [name for name in theirs if name not in usual], {*map(_kind, ours)}
    extra = [name for name in others if _kind(name) in kinds]
    if missing or moved or extra:
        differ = [f"{name!r} is at {_xyz(theirs[name])}, in this world at {_xyz(ours[name])}" for name in moved[:1]]
        differ += [f"{len(missing)} are missing, first {missing[0]!r}"] if missing else []
        differ += [f"{len(extra)} are not in this world, first {extra[0]!r}"] if extra else []
        raise BagError(
            f"{run.bag} was recorded in another world: {len(ours) - len(missing) - len(moved)} of the {len(ours)} "
            f"objects of {where} match; {'; '.join(differ)}; give its --environment, --seed, or layout (--experiment)"
        )
    if others:
        text = f"{run.bag} has models that {where} lacks, so that no added sensor sees them: {', '.join(others)}"
        warnings.warn(text, FieldtruthWarning, stacklevel=4)


def _is_near(found: Array, expected: Array) -> bool:
    """Return True if two poses (7,) are those of one object; heights differ a little between grids of the ground."""
    turned = 1.0 - abs(float(found[3:] @ expected[3:]))
    return bool(np.linalg.norm(found[:3] - expected[:3]) <= _MOVED) and abs(turned) <= _TURNED


def _kind(name: str) -> str:
    """Return the name of an object without its number."""
    return name.rstrip("0123456789")


def check_poses(trajectory: Trajectory, streams: Sequence[Stream], rig: Rig, world: World) -> None:
    """Check that the robot is within the world, and its sensors above the ground, at all their stamps.

    Raises:
        BagError: with time and position.
    """
    mounts = [mount for sensor in rig.in_order() if sensor.sees for mount in sensor.frames().values()]
    half = np.array(world.size) / 2.0
    stamps = np.unique(np.concatenate([stream.stamps_ns for stream in streams]))
    for stamp in stamps.tolist():
        world_from_base = trajectory.world_from_base(stamp)
        when = f"at {stamp / 1e9:.3f} s base_link is at {_xyz(world_from_base[:3, 3])}"
        if (np.abs(world_from_base[:2, 3]) > half).any():
            x, y = half
            raise BagError(f"{when}, outside of {world.name}, which spans x -{x:g} to {x:g} m, y -{y:g} to {y:g} m")
        origins = transforms.transform(world_from_base, [mount.xyz for mount in mounts])
        depth = world.terrain.field.height_at(origins[:, 0], origins[:, 1]) - origins[:, 2]
        if (depth > 0.0).any():
            raise BagError(
                f"{when}, so that its sensors are up to {depth.max():.1f} m below the ground of {world.name} "
                f"with seed {world.seed}; was it recorded in another world?"
            )


def _xyz(xyz: Array) -> str:
    return "x {:.3f}, y {:.3f}, z {:.3f} m".format(*xyz[:3])


LARGEST_STEP_NS: Final = 200_000_000
"""Largest time [ns] between two poses; over a longer gap interpolation is not accurate to a pixel."""


def read_poses(run: Run, rig: Rig, robot: str, advance: Advance) -> RecordedPoses:
    """Read the poses of base_link; the whole bag is read, so that damage is found before hours of rendering.

    Raises:
        BagError: no poses or only one, a gap between them, poses of a frame that is not connected to base_link, or as
            ``bag.geometry.read_poses``.
        UnknownNameError: no such robot.
    """
    topic = pose_topic(run)
    check_type(run, topic)
    found = geometry.read_poses(run, topic, robot=robot, coarse=True, advance=advance)
    trajectory = found.trajectory
    if len(trajectory) < 2:
        raise BagError(f"{topic} of {run.bag} has only one pose; at least two are required")
    steps = np.diff(trajectory.stamps_ns)
    if steps.max() > LARGEST_STEP_NS:
        before, after = (f"{stamp / 1e9:.3f} s" for stamp in trajectory.stamps_ns[np.argmax(steps) :][:2])
        raise BagError(
            f"{topic} has a gap: no pose from {before} to {after}; at most {LARGEST_STEP_NS / 1e9:g} s are allowed; "
            "annotate a bag that ends before it or begins after it"
        )
    base_from_frame = _base_from(found.frame, run, rig)
    if base_from_frame is not None:
        world_from_frame = pose_from_quaternion_wxyz(trajectory.position, trajectory.quaternion_wxyz)
        pose = world_from_frame @ inverse(base_from_frame)
        quaternion = quaternion_wxyz_from_rotation(pose[:, :3, :3])
        trajectory = Trajectory(trajectory.stamps_ns, pose[:, :3, 3], quaternion)
    return found._replace(trajectory=trajectory)


def _base_from(frame: str, run: Run, rig: Rig) -> Array | None:
    """Pose in base_link of the recorded frame, from the bag's /tf_static or the rig; None for base_link itself."""
    if frame in ("", BASE):
        return None
    static = static_frames(run)
    if frame in static.parents or frame in {parent for parent, _ in static.parents.values()}:
        return static.base_from(frame)
    if frame in (ours := StaticFrames.of_rig(rig)).parents:
        return ours.base_from(frame)
    raise BagError(
        f"{table.ODOMETRY} of {run.bag} has poses of {frame!r}, which /tf_static does not connect to {BASE!r}"
    )


IMAGES_ONLY: Final = Rig().with_each(lambda each: {"enabled": False} if each.gives is Cloud else {})
"""The paper's rig without those of its sensors that give clouds."""


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
    rig: Rig = IMAGES_ONLY,
    robot: str = ROBOT,
    out: Path | str | None = None,
    scene: Scene | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write a new bag: all messages of another one, and readings of the rig's sensors at its true poses.

    Messages of these sensors that the bag has already are kept, too: their topics get the prefix /recorded.

    The bytes do not depend on the number of workers. If interrupted, the same call resumes.

    Args:
        bag: with /ground_truth/odom or /gazebo/model_states; or the folder of a run. It is only read.
        world: where it was recorded; a string is the name of an environment, with seed 0.
        rig: sensors to add, with their mounts and rates; a sensor that is not enabled is not added.
        robot: the model in /gazebo/model_states that carries the sensors; its pose there is that of base_link.
        out: the new bag; by default beside the other, with a name that ends in ``_annotated``.
        scene: that world in the ray tracer, if it was built; then no other is.
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
    given = given_world(None, scene)
    target = None if out is None else output_path(out, single=True)
    config = WorldConfig(world) if isinstance(world, str) else world
    check_layout(config.environment, config.layout)
    progress = Silent() if progress is None else progress
    run, rig = open_run(bag), rig.with_sensors(SensorConfig, clock=None)
    if target is None:
        target = output_path(run.folder / f"{run.name}_annotated.bag")
    addition = _Addition(run, rig, robot, config, given, scene, _added_topics(run, rig))
    _write(addition, target, cpu_count() if workers is None else workers, progress)
    return target


class _Addition(NamedTuple):
    """Arguments of ``annotate`` after they are checked, and the topics that the new bag has beside those of the run."""

    run: Run
    rig: Rig
    robot: str
    config: WorldConfig
    world: World | None
    scene: Scene | None
    topics: list[Topic]


def _write(addition: _Addition, target: Path, workers: int, progress: Progress) -> None:
    """Sense in slices, and write the new bag."""
    run, rig, robot, config, world, *_ = addition
    with _work_folder(target) as folder:
        frames = check_frames(run, rig)
        with progress.stage("read the poses", run.duration_s) as advance:
            poses = read_poses(run, rig, robot, advance)
        with progress.stage("build the world"):
            world = world or load_world(config.environment, config.seed, config.layout)
        made = run.experiment
        check_objects(run, world, robot, [] if made is None else [*made.robots, *dict(actor_names(made.actors))])
        sensor_world = _sensor_world(addition, world)
        slices = _slices(addition, sensor_world, poses, folder, progress)
        seconds = (slices.end_ns - slices.start_ns) / 1e9
        with progress.stage("sense and label", seconds, slices.seconds_done) as advance:
            slices.make(workers, advance)
        if own := as_layout(sensor_world.world.classes):
            text = write_mapping({CLASSES_KEY: own})
            target.with_suffix(CLASSES_FILE).write_text(text, encoding="utf-8")
        with progress.stage("write the bag", run.duration_s) as advance:
            merge_bags(run, slices, target, _latched(poses, frames), poses.recorded_at, advance)


def _sensor_world(addition: _Addition, world: World) -> SensorWorld:
    """Return a world in its light, with what moves in the run, if the bag is one of this package.

    Raises:
        BagError: the bag lacks what moves.
    """
    run, rig, _, config, _, scene, _ = addition
    made, options = run.experiment, dict[str, Any](scene=scene)
    if made is not None and made.moving:
        world, moving = moving_in(world, run, made)
        options = {"moving": moving}
    return SensorWorld(world, rig, config.light, config.weather, reuse=True, **options)


def _slices(
    addition: _Addition, sensor_world: SensorWorld, poses: RecordedPoses, folder: RunFolder, progress: Progress
) -> Slices:
    """Check that the poses fit into the world, and prepare the slices of what the sensors see there."""
    world, rig, trajectory = sensor_world.world, sensor_world.rig, poses.trajectory
    streams = _streams(poses, rig)
    check_poses(trajectory, streams, rig, world)
    with progress.stage("prepare the scene"):
        sensors = sensor_factory(sensor_world)
    made = addition.run.experiment
    moving = [dump_experiment(made)] if made is not None and made.moving else []
    path = folder.slices(slices_key(world, rig, sensor_world.light, sensor_world.weather, trajectory, *moving))
    return Slices(
        path, streams, addition.topics, sensors, start_ns=min(int(stream.stamps_ns[0]) for stream in streams) - 1
    )


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
        raise ConfigurationError("nothing to add: no sensor of the rig that sees the world is enabled")
    if present := [topic.name for topic in added if topic.name in run.counts]:
        renamed = f"the bag's own messages of {', '.join(present)} have the prefix {RECORDED} in the new bag"
        warnings.warn(renamed, FieldtruthWarning, stacklevel=3)
    return added


def _streams(poses: RecordedPoses, rig: Rig) -> list[Stream]:
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


def _latched(poses: RecordedPoses, frames: Mapping[tuple[str, str], Array]) -> dict[str, tuple[int, bytes]]:
    """/tf_static of the added frames at the first pose: its stamp in the bag [ns], and its bytes."""
    first_ns = int(poses.trajectory.stamps_ns[0])
    return {table.TF_STATIC: (poses.recorded_at(first_ns), tf_static(first_ns, frames))} if frames else {}


RECORDED: Final = "/recorded"
"""Prefix of the bag's own topics where new ones have their names."""


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

        def added() -> Iterator[RawMessage]:
            yield from (RawMessage(stamp, topic, "", data) for topic, (stamp, data) in latched.items())
            for k in range(slices.count):
                with open_bag(slices.path(k)) as part:
                    for raw in part.messages():
                        yield RawMessage(recorded_at(raw.stamp_ns), raw.topic, raw.msgtype, raw.data)

        messages = merge(source.messages(), added(), key=attrgetter("stamp_ns"))
        for raw in timed(messages, advance, run.start_ns):
            bag.write(connections.get(raw.connection, raw.topic), raw.stamp_ns, raw.data)
