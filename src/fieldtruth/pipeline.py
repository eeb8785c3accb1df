# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From an experiment to its bag: build the world, drive through it, sense and label, write the bag.

The stages are those of the paper's sections 3 and 4; each passes plain data to the next.
"""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Protocol

from fieldtruth.bag import provenance
from fieldtruth.bag.decode import count_messages
from fieldtruth.bag.topics import latches_objects, topics_of_run
from fieldtruth.bag.track_file import TrackFile
from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.core.outputs import output_folder
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.drive.plan import expected_seconds
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.folder import RunFolder, run_folder
from fieldtruth.record.slices import SliceFolder, Slices, slices_key
from fieldtruth.record.streams import Sensors, Stream, sensor_factory, streams_of
from fieldtruth.report.card import data_card
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.kind import Movement, SensorWorld, movement_of
from fieldtruth.sensors.known import sensor_class
from fieldtruth.simulation.motion import track_in, with_given_track
from fieldtruth.world.build import check_experiment, world_of
from fieldtruth.world.model import World


class Prepared(Protocol):
    """A run whose world is built and whose robot has driven."""

    @property
    def key(self) -> str:
        """Key of its slices; see ``slices_key``."""
        ...

    def slices(self, folder: Path) -> SliceFolder:
        """Return the slices in a folder of this key."""
        ...

    def card(self, counts: Mapping[str, int]) -> str:
        """Return the data card; ``counts`` has the number of messages by topic."""
        ...


Engine = Callable[[Experiment, TrackFile | None, Progress], Prepared]
"""Builds the world and drives, or follows the track file, and knows where the slices are made."""


@dataclass(frozen=True)
class PreparedHere:
    """A run in this process."""

    experiment: Experiment
    world: World
    track: Track
    scene: Scene | None = field(default=None, kw_only=True)
    """The world in the ray tracer, if it was built."""
    new_sensors: Callable[[], Sensors] | None = field(default=None, kw_only=True)
    """Makes the sensors of a thread; None: those of the rig."""

    @cached_property
    def key(self) -> str:
        """Key of its slices."""
        return slices_key(dump_experiment(self.experiment), self.world, self.track)

    @property
    def latched(self) -> bool:
        """Whether static objects are published once."""
        return latches_objects(self.experiment, len(self.world.instances))

    def slices(self, folder: Path) -> Slices:
        """Build the scene and bake its light for the slices in a folder."""
        provenance.note(folder, [provenance.this_process()])
        streams = self.streams()
        sensors = self.new_sensors or sensor_factory(self.sensor_world, self.sensed())
        return Slices(folder, streams, topics_of_run(self.experiment, latched=self.latched), sensors)

    @cached_property
    def sensor_world(self) -> SensorWorld:
        """Where the sensors are."""
        made = self.experiment
        return SensorWorld(self.world, made.rig, made.light, made.weather, scene=self.scene, seed=made.seed, reuse=True)

    def streams(self) -> list[Stream]:
        """Return every stream of the recording."""
        return streams_of(self.world, self.track, self.experiment.rig, latched=self.latched, movement=self.movement)

    @cached_property
    def movement(self) -> Movement:
        """Motion of the robot, with the series that sensors have measured of it."""
        return movement_of(self.track)

    def sensed(self) -> Rig:
        """Return the rig with the sensors that are needed to make the streams."""
        return self.experiment.rig

    def card(self, counts: Mapping[str, int]) -> str:
        """Return the data card."""
        own = () if self.track.is_frames else self.experiment.rig.in_order()
        sensors = (sensor_class(config)(config, self.sensor_world) for config in own if not config.sees)
        measured = [line for sensor in sensors for line in sensor.facts(self.movement)]
        return data_card(self.experiment, self.world, self.track, counts, measured)


def prepare(
    experiment: Experiment,
    given: TrackFile | None,
    progress: Progress,
    *,
    world: World | None = None,
    scene: Scene | None = None,
) -> PreparedHere:
    """Build the world, unless it is given, and drive, or follow the poses of a track file, in this process."""
    if world is None:
        with progress.stage("build the world"):
            world = world_of(experiment) if scene is None else scene.world
    with progress.stage("drive", None if given is not None else expected_seconds(experiment)) as advance:
        return PreparedHere(experiment, world, track_in(world, experiment, given, advance), scene=scene)


def generate(
    experiment: Experiment,
    out: Path | str,
    *,
    world: World | None = None,
    scene: Scene | None = None,
    workers: int | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Generate a data set: ``out/NAME/NAME.bag``, its experiment.yaml, data card, provenance.json and checksums.

    The bytes do not depend on the number of workers or on interruptions. A run that was interrupted, by Ctrl-C, a kill
    or a full disk, resumes when it is called again.

    Args:
        experiment: what to simulate.
        out: folder of data sets; nothing outside ``out/NAME`` is written.
        world: what it is simulated in; None builds the experiment's.
        scene: the world in the ray tracer, if it was built.
        workers: threads that make slices; None for one per core that the process may use.
        overwrite: replace an earlier run in the folder, finished or not.
        progress: receives the progress.

    Returns:
        Path of the bag.

    Raises:
        UnknownNameError: unknown environment.
        ConfigurationError: a layout that the environment does not allow.
        OutputError: the folder holds another run, is in use, or cannot be written.
        SliceError: a worker failed.
        RouteError: the route meets an obstacle, or no free route of the requested length or no free ground is found.
        DriveError: the robot cannot drive this route.
        TrackError, BagError: a track file that cannot be read, or leads out of the world or into something solid.
        EngineError: the installed Embree is not the version for which the kernels were written.
    """
    folder = output_folder(out, experiment.name)
    if world is None and scene is None:
        check_experiment(experiment)
    engine = partial(prepare, world=world, scene=scene)
    return _generate(engine, experiment, folder, workers, overwrite=overwrite, progress=progress)


def generate_by(
    engine: Engine | None,
    experiment: Experiment,
    out: Path | str,
    *,
    workers: int | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Generate a data set as ``generate`` does, where world, drive and slices are made by an engine; None: here."""
    folder = output_folder(out, experiment.name)
    check_experiment(experiment)
    return _generate(engine or prepare, experiment, folder, workers, overwrite=overwrite, progress=progress)


def _generate(
    engine: Engine,
    experiment: Experiment,
    out: Path,
    workers: int | None,
    *,
    overwrite: bool,
    progress: Progress | None,
) -> Path:
    _warn_of_weather(experiment)
    experiment, given = with_given_track(experiment)
    text = None if given is None else given.csv()
    progress = Silent() if progress is None else progress
    with run_folder(experiment, out, overwrite=overwrite, track=text) as run:
        prepared = engine(experiment, given, progress)
        run.begin(experiment, overwrite=overwrite, track=text)
        _record(prepared, run, cpu_count() if workers is None else workers, progress)
    return run.bag


def _warn_of_weather(experiment: Experiment) -> None:
    """Warn of sensors that no weather reaches."""
    unreached = [each for each in experiment.rig.in_order() if each.needs_signal_for_weather]
    if unreached and not experiment.weather.is_clear:
        nouns = " and ".join(dict.fromkeys(f"{each.noun or each.kind}s" for each in unreached))
        names = ", ".join(each.name for each in unreached)
        what = f"weather has no effect on ideal {nouns} ({names}); give them a signal, as --signal datasheet does"
        warnings.warn(what, FieldtruthWarning, stacklevel=4)


def _record(prepared: Prepared, run: RunFolder, workers: int, progress: Progress) -> None:
    """Make the slices, join them to the bag, and write what belongs beside it."""
    folder = run.slices(prepared.key)
    with progress.stage("prepare the scene"):
        slices = prepared.slices(folder)
    whole = folder / "whole.bag"
    slices.record(whole, workers, progress)
    with progress.stage("card and checksums"):
        run.finish(whole, prepared.card(count_messages(whole)), provenance.noted(folder))
