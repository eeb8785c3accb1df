# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's post-processing: labelled images, and clouds, for a bag that somebody recorded elsewhere, in Gazebo say.

The bag's true poses say where the robot was; the world's name and seed say what it saw there. The input is only read:
what it holds goes unchanged, with what was seen in between, into a new bag.
"""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fieldtruth.annotation.check import check_frames, check_objects, check_place
from fieldtruth.annotation.poses import Poses, read_poses
from fieldtruth.annotation.weave import weave
from fieldtruth.bag import topics as table
from fieldtruth.bag.model_states import ROBOT
from fieldtruth.bag.reader import BagError
from fieldtruth.bag.robot_messages import tf_static
from fieldtruth.bag.run import Run, open_run
from fieldtruth.bag.types import F8
from fieldtruth.core.errors import ConfigurationError, OutputError
from fieldtruth.core.files import locked, output_errors
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.experiment.config import LightConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.folder import RunFolder, new_folder
from fieldtruth.record.sensors import sensor_factory
from fieldtruth.record.slices import Slices, slices_key
from fieldtruth.record.streams import Stream, camera_stream, lidar_stream
from fieldtruth.world.build import check_layout, load_world


def annotate(
    bag: Path,
    environment: str,
    *,
    seed: int = 0,
    out: Path | None = None,
    lidar: bool = False,
    rig: Rig | None = None,
    light: LightConfig | None = None,
    layout: Mapping[str, Any] | None = None,
    robot: str = ROBOT,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write a new bag: all messages of another one, and what the rig's cameras saw from the true poses in it.

    The bytes are the same however many threads made them. When it was stopped, by Ctrl-C, a kill or a full disk, the
    same call goes on where it stopped.

    Args:
        bag: with /ground_truth/odom or /gazebo/model_states; or the folder of a run. It is only read.
        environment: the world in which it was recorded; with ``seed`` and ``layout`` as for ``load_world``.
        seed: of that world.
        out: the new bag; by default it stands beside the other, its name ending in ``_annotated``.
        lidar: add clouds, too.
        rig: what cameras and LiDAR there are, where they sit and how fast they are; None is the paper's.
        light: the sun; None is the default's.
        layout: changes to the environment's configuration.
        robot: the model in /gazebo/model_states that carries the sensors; its pose there is base_link's.
        workers: threads; None takes every core that the process may use.
        progress: is told how far the work has come.

    Returns:
        Path of the new bag, ``out``.

    Raises:
        UnknownNameError: no such environment, or no such robot in the bag.
        ConfigurationError: a layout that is not allowed, or a rig without a sensor to add.
        BagError: the bag cannot be read, has no poses or a gap in them, has what would be added already, or was
            recorded with other sensors or in another place.
        OutputError: the output is there already, in use, or cannot be written.
    """
    check_layout(environment, layout)
    workers = cpu_count() if workers is None else workers
    progress = Silent() if progress is None else progress
    light = LightConfig() if light is None else light
    rig = Rig() if rig is None else rig
    rig = rig.model_copy(update={"lidar": rig.lidar.model_copy(update={"enabled": lidar})})
    run = open_run(bag)
    target = run.folder / f"{run.name}_annotated.bag" if out is None else out
    added = _added_topics(run, rig)
    with _work_folder(target) as folder:
        frames = check_frames(run, rig)
        with progress.stage("read the poses", run.duration_s) as advance:
            poses = read_poses(run, rig, robot, advance)
        streams = _streams(poses, rig)
        with progress.stage("build the world"):
            world = load_world(environment, seed, layout)
        check_objects(run, world)
        check_place(poses.trajectory, streams, rig, world)

        work = folder.slices(slices_key(world, rig, light, poses.trajectory))
        start_ns = min(int(stream.stamps_ns[0]) for stream in streams) - 1
        with progress.stage("prepare the scene"):
            sensors = sensor_factory(world, rig, light)
        slices = Slices(work, streams, added, sensors, start_ns)
        seconds = (slices.end_ns - start_ns) / 1e9
        with progress.stage("sense and label", seconds, slices.seconds_done) as advance:
            slices.make(workers, advance)
        with progress.stage("write the bag", run.duration_s) as advance:
            weave(run, slices, target, _fixed(poses, frames), poses.recorded_at, advance)
    return target


@contextmanager
def _work_folder(target: Path) -> Iterator[RunFolder]:
    """Open and lock a hidden folder for slices beside the new bag; it is kept when the work is interrupted.

    Raises:
        OutputError: the bag exists, another process is making it, or it cannot be written.
    """
    path = target.with_name(f".{target.name}.parts")
    with output_errors(target):
        if os.path.lexists(target):
            raise OutputError(f"{target} already exists; remove it, or choose another --out")
    folder = RunFolder(path, target)
    with new_folder(path):
        with locked(path):
            yield folder
            folder.clean()
        path.rmdir()


def _added_topics(run: Run, rig: Rig) -> list[table.Topic]:
    added = [topic for topic in table.topics_of(rig) if topic.sensor != "robot"]
    if not added:
        raise ConfigurationError("this rig has no cameras, and no clouds are asked for: there is nothing to add")
    if there := [topic.name for topic in added if topic.name in run.counts]:
        raise BagError(
            f"{run.bag} has {', '.join(there)} already; annotate a bag without them "
            f"(rosbag filter old.bag new.bag \"topic not in ('{there[0]}', ...)\")"
        )
    return added


def _streams(poses: Poses, rig: Rig) -> list[Stream]:
    """Sense at all multiples of a sensor's period for which there are poses, in the topic table's order."""
    pose_at = poses.trajectory.world_from_base
    streams: list[Stream] = []
    if rig.lidar.enabled:
        sweep_ns = round(1e9 / rig.lidar.rate_hz) if rig.lidar.spinning else 0
        streams.append(lidar_stream(rig.lidar, poses.stamps("lidar", rig.lidar.rate_hz, sweep_ns), pose_at))
    if rig.cameras.enabled:
        stamps = poses.stamps("camera", rig.cameras.rate_hz)
        streams += [camera_stream(rig.cameras, side, stamps, pose_at) for side in table.SIDES]
    return streams


def _fixed(poses: Poses, frames: Mapping[tuple[str, str], F8]) -> dict[str, tuple[int, bytes]]:
    """/tf_static of some frames, with the first pose: its stamp in the bag [ns], and bytes."""
    first_ns = int(poses.trajectory.stamps_ns[0])
    return {table.TF_STATIC: (poses.recorded_at(first_ns), tf_static(first_ns, frames))} if frames else {}
