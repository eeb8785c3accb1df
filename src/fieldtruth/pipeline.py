# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From an experiment to its bag: build the world, drive through it, sense and label, write the bag.

The stages are those of the paper's sections 3 and 4; each passes plain data to the next.
"""

from pathlib import Path

from fieldtruth.bag.decode import count_messages
from fieldtruth.bag.topics import topics_of
from fieldtruth.bag.track_file import read_track_file
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.drive.plan import plan_route
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment
from fieldtruth.record.folder import RunFolder, run_folder
from fieldtruth.record.following import follow_track, with_stored_track
from fieldtruth.record.sensors import sensor_factory
from fieldtruth.record.slices import Slices, slices_key
from fieldtruth.record.streams import streams_of
from fieldtruth.report.card import data_card
from fieldtruth.world.build import check_experiment, world_of
from fieldtruth.world.model import World


def generate(
    experiment: Experiment,
    out: Path | str,
    *,
    workers: int | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Generate a data set: ``out/NAME/NAME.bag``, its experiment.yaml, data card and checksums.

    The bytes do not depend on the number of workers or on interruptions. A run that was interrupted, by Ctrl-C, a kill
    or a full disk, resumes when it is called again.

    Args:
        experiment: what to simulate.
        out: folder of data sets; nothing outside ``out/NAME`` is written.
        workers: threads that make slices; None for one per core that the process may use.
        overwrite: replace an earlier run in the folder, finished or not.
        progress: receives the progress.

    Returns:
        Path of the bag.

    Raises:
        UnknownNameError: unknown environment.
        ConfigurationError: a layout that the environment does not allow.
        OutputError: the folder holds another run, is in use, or cannot be written.
        RouteError: the route meets an obstacle, or no free route of the requested length is found.
        DriveError: the robot cannot drive this route.
        TrackError, BagError: a track file that cannot be read, or leads out of the world or into something solid.
        EngineError: the installed Embree is not the version for which the kernels were written.
    """
    check_experiment(experiment)
    given = None if experiment.drive is None else read_track_file(experiment.drive)
    if given is not None:
        experiment = with_stored_track(experiment, given)
    text = None if given is None else given.csv()
    workers = cpu_count() if workers is None else workers
    progress = Silent() if progress is None else progress
    with run_folder(experiment, Path(out), overwrite=overwrite, track=text) as run:
        with progress.stage("build the world"):
            world = world_of(experiment)
        with progress.stage("drive"):
            track = _driven(experiment, world) if given is None else follow_track(experiment, world, given)
        run.begin(experiment, overwrite=overwrite, track=text)
        _record(experiment, world, track, run, workers, progress)
    return run.bag


def _driven(experiment: Experiment, world: World) -> Track:
    route = plan_route(world, experiment)
    return drive(world, experiment.model_copy(update={"route": route}))


def _record(
    experiment: Experiment, world: World, track: Track, run: RunFolder, workers: int, progress: Progress
) -> None:
    """Make the slices, join them to the bag, and write what belongs beside it."""
    rig = experiment.rig
    with progress.stage("prepare the scene"):
        sensors = sensor_factory(world, rig, experiment.light)
    folder = run.slices(slices_key(dump_experiment(experiment), world, track))
    slices = Slices(folder, streams_of(world, track, rig), topics_of(rig), sensors)
    with progress.stage("sense and label", track.duration_s, slices.seconds_done) as advance:
        slices.make(workers, advance)
    whole = folder / "whole.bag"
    whole.unlink(missing_ok=True)
    with progress.stage("write the bag", track.duration_s) as advance:
        slices.join(whole, advance)
    with progress.stage("card and checksums"):
        run.finish(whole, data_card(experiment, world, track, count_messages(whole)))
