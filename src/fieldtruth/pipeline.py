# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From an experiment to its bag: build the place, drive through it, look at it from there, write it down.

The stages are those of the paper's sections 3 and 4; each hands plain data to the next.
"""

from pathlib import Path

from fieldtruth.bag.decode import count_messages
from fieldtruth.bag.topics import topics_of
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.drive import drive, plan_route
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment
from fieldtruth.record.folder import RunFolder, fingerprint, run_folder
from fieldtruth.record.slices import Slices
from fieldtruth.record.streams import Sensors, streams_of
from fieldtruth.render.bake import bake
from fieldtruth.render.camera import Camera
from fieldtruth.report.card import data_card
from fieldtruth.sense.lidar import Lidar
from fieldtruth.sense.scene import Scene
from fieldtruth.world.build import check_experiment, world_of
from fieldtruth.world.model import World


def generate(
    experiment: Experiment,
    out: Path,
    *,
    workers: int | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Make a data set: ``out/NAME/NAME.bag`` and beside it what made it, its card and its checksums.

    The bytes are the same however it is made. A run that was stopped, by Ctrl-C, a kill or a full disk, goes on where
    it stopped when it is called again.

    Args:
        experiment: what to do.
        out: folder of data sets; nothing outside ``out/NAME`` is written.
        workers: threads that make slices; None takes every core that the process may use.
        overwrite: throw away what the folder holds of a run: its bag, or finished parts of one.
        progress: is told how far the work has come.

    Returns:
        Path of the bag.

    Raises:
        UnknownNameError: unknown environment.
        ConfigurationError: a layout that the environment does not allow.
        OutputError: the folder is occupied, in use, unwritable or full.
        RouteError: the route leads into something, or no free one of the wished length is found.
        DriveError: the robot cannot drive this route.
        EngineError: the ray engine is not the one that the kernels were written for.
    """
    check_experiment(experiment)
    workers = cpu_count() if workers is None else workers
    progress = Silent() if progress is None else progress
    with run_folder(experiment, out, overwrite=overwrite) as run:
        with progress.stage("build the world"):
            world = world_of(experiment)
        with progress.stage("drive"):
            route = plan_route(world, experiment)
            track = drive(world, experiment.model_copy(update={"route": route}))
        run.begin(experiment, overwrite=overwrite)
        _sense_and_write(experiment, world, track, run, workers, progress)
    return run.bag


def _sense_and_write(
    experiment: Experiment, world: World, track: Track, run: RunFolder, workers: int, progress: Progress
) -> None:
    rig = experiment.rig
    with progress.stage("prepare the scene"):
        scene = Scene(world)
        baked = bake(scene, experiment.light) if rig.cameras.enabled else None

    def sensors() -> Sensors:
        lidar = Lidar(rig.lidar, scene) if rig.lidar.enabled else None
        camera = Camera(rig.cameras, baked, reuse=True) if baked is not None else None
        return Sensors(lidar, camera)

    work = run.work(fingerprint(dump_experiment(experiment), world, track))
    slices = Slices(work, streams_of(world, track, rig), topics_of(rig), sensors)
    done = track.duration_s - sum(map(slices.seconds, slices.missing()))
    with progress.stage("sense and label", track.duration_s, done) as advance:
        slices.make(workers, advance)
    whole = work / "whole.bag"
    whole.unlink(missing_ok=True)
    with progress.stage("write the bag", track.duration_s) as advance:
        slices.join(whole, advance)
    with progress.stage("sum it up"):
        run.finish(whole, data_card(experiment, world, track, count_messages(whole)))
