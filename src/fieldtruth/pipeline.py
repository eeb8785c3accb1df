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

from fieldtruth.actors.cast import ActorStates
from fieldtruth.bag import provenance
from fieldtruth.bag.decode import count_messages
from fieldtruth.bag.topics import in_namespace, latches_objects, topics_of_run
from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning
from fieldtruth.core.files import output_folder
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.drive.plan import expected_seconds
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.folder import run_folder
from fieldtruth.record.slices import SliceFolder, Slices, slices_key
from fieldtruth.record.streams import Sensors, Stream, sensor_factory, streams_of
from fieldtruth.report.card import data_card
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.known import sensor_class
from fieldtruth.simulation.first_run import wait_for_kernels
from fieldtruth.simulation.fleet import Fleet
from fieldtruth.simulation.stepped import Driven, Simulation
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


Engine = Callable[[Simulation, Progress], Prepared]
"""Builds the world of a simulation and drives, and knows where the slices are made."""


@dataclass(frozen=True)
class PreparedHere(Driven):
    """A run in this process."""

    reuse: bool = field(default=True, kw_only=True)
    new_sensors: Callable[[], Sensors] | None = field(default=None, kw_only=True)
    """Makes the sensors of a thread; None: those of the rig."""

    @cached_property
    def key(self) -> str:
        """Key of its slices."""
        others = [*[self.robots] * bool(self.robots), *([] if self.actors is None else [self.actors.digest()])]
        return slices_key(dump_experiment(self.experiment), self.world, self.track, *others)

    @property
    def actors(self) -> ActorStates | None:
        """Motion of the actors."""
        return None if self.company is None else self.company.actors

    @property
    def latched(self) -> bool:
        """Return whether static objects are published once."""
        return latches_objects(self.experiment, len(self.world.instances))

    def slices(self, folder: Path) -> Slices:
        """Build the scene and bake its light for the slices in a folder."""
        provenance.note(folder, [provenance.this_process()])
        own, streams = self.experiment.namespace, self.streams()
        streams = [each._replace(topics=tuple(in_namespace(name, own) for name in each.topics)) for each in streams]
        topics = topics_of_run(self.experiment, latched=self.latched)
        topics = tuple(each._replace(name=in_namespace(each.name, own)) for each in topics)
        return Slices(folder, streams, topics, self.new_sensors or sensor_factory(self.sensor_world, self.sensed()))

    def streams(self) -> list[Stream]:
        """Return every stream of the recording."""
        made = self.experiment
        return streams_of(
            self.world,
            self.track,
            made.rig,
            latched=self.latched,
            movement=self.movement,
            seed=made.noise_seed,
            robots=self.robots,
            actors=self.actors,
        )

    def sensed(self) -> Rig:
        """Return the rig with the sensors that are needed to make the streams."""
        return self.experiment.rig

    def card(self, counts: Mapping[str, int]) -> str:
        """Return the data card."""
        own = () if self.track.is_frames else self.experiment.rig.in_order()
        sensors = (sensor_class(config)(config, self.sensor_world) for config in own if not config.sees)
        measured = [line for sensor in sensors for line in sensor.facts(self.movement)]
        return data_card(self.experiment, self.world, self.track, counts, measured)


def prepare(simulation: Simulation, progress: Progress) -> PreparedHere:
    """Build the world, unless it is given, and drive, or take the poses that are given, in this process."""
    made = simulation.experiment
    with progress.stage("build the world"):
        world = simulation.world
    with progress.stage("drive", None if simulation.track_file else expected_seconds(made)) as advance:
        driven = simulation.drive(advance)
    return PreparedHere(made, world, driven.track, scene=driven.scene, company=driven.company)


def generate(
    experiment: Experiment | str | Path,
    out: Path | str,
    *,
    world: World | None = None,
    scene: Scene | None = None,
    workers: int | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Generate a data set: ``out/NAME/NAME.bag``, its experiment.yaml, data card, made_by.json and checksums.

    Of several robots each has a run of its own: ``out/NAME/ROBOT/NAME_ROBOT.bag`` with its files.

    The bytes do not depend on the number of workers or on interruptions. A run that was interrupted, by Ctrl-C, a kill
    or a full disk, resumes when it is called again.

    Args:
        experiment: what to simulate, or its name, or the path of its file.
        out: folder of data sets; nothing outside ``out/NAME`` is written.
        world: what it is simulated in; None builds the experiment's.
        scene: the world in the ray tracer, if it was built.
        workers: threads that make slices; None for one per core that the process may use.
        overwrite: replace an earlier run in the folder, finished or not.
        progress: receives the progress.

    Returns:
        Path of the bag; of several robots, the folder of their runs.

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
    simulation = Simulation(experiment, world=world, scene=scene)
    return generate_by(None, simulation, out, workers=workers, overwrite=overwrite, progress=progress)


def generate_by(
    engine: Engine | None,
    experiment: Experiment | Simulation,
    out: Path | str,
    *,
    workers: int | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Generate a data set as ``generate`` does, where world, drive and slices are made by an engine; None: here."""
    simulation = experiment if isinstance(experiment, Simulation) else Simulation(experiment)
    made, folder = simulation.experiment, output_folder(out, simulation.experiment.name)
    record = partial(
        _generate_run, workers=workers, overwrite=overwrite, progress=Silent() if progress is None else progress
    )
    if not made.robots:
        return record(engine or prepare, simulation, folder / made.name)
    if engine is not None:
        raise ConfigurationError(f"{made.name} has several robots, which drive in one process; leave the cluster out")
    fleet, driven = Fleet(made, world=simulation.given_world), dict[Simulation, PreparedHere]()

    def prepared(robot: Simulation, progress: Progress) -> PreparedHere:
        if not driven:
            driven.update(_prepare_fleet(fleet, progress))
        return driven[robot]

    if made.namespace is not None:  # one of them is made again
        return record(prepared, fleet.robots[made.namespace], folder / made.name)
    runs = {name: folder / made.name / name for name in fleet.robots}
    left = [name for name, path in runs.items() if overwrite or not (path / f"{made.name}_{name}.bag").exists()]
    for name in left or runs:  # those that are there say so
        record(prepared, fleet.robots[name], runs[name])
    return folder / made.name


def _prepare_fleet(fleet: Fleet, progress: Progress) -> dict[Simulation, PreparedHere]:
    """Build the world, and drive all robots together."""
    with progress.stage("build the world"):
        world = fleet.world
    seconds = [expected_seconds(each.experiment) or 0.0 for each in fleet.robots.values()]
    with progress.stage("drive", max(seconds)) as advance:
        driven = fleet.drive(advance)
    return {
        fleet.robots[name]: PreparedHere(each.experiment, world, each.track, company=each.company, robots=each.robots)
        for name, each in driven.items()
    }


def _generate_run(
    engine: Engine, simulation: Simulation, path: Path, *, workers: int | None, overwrite: bool, progress: Progress
) -> Path:
    """Generate the run of one robot in a folder."""
    made, track = simulation.experiment, simulation.track_file
    _warn_of_weather(made)
    text = None if track is None else track.csv()
    with run_folder(made, path, overwrite=overwrite, track=text) as run:
        prepared = engine(simulation, progress)
        run.begin(made, overwrite=overwrite, track=text)
        slices_folder = run.slices(prepared.key)
        with progress.stage("prepare the scene"):
            slices = prepared.slices(slices_folder)
        wait_for_kernels(progress)
        whole = slices_folder / "whole.bag"
        slices.record(whole, cpu_count() if workers is None else workers, progress)
        with progress.stage("card and checksums"):
            run.finish(whole, prepared.card(count_messages(whole)), provenance.noted(slices_folder))
    return run.bag


def _warn_of_weather(experiment: Experiment) -> None:
    """Warn of sensors that no weather reaches."""
    unreached = [each for each in experiment.rig.in_order() if each.needs_signal_for_weather]
    if unreached and not experiment.weather.is_clear:
        nouns = " and ".join(dict.fromkeys(f"{each.noun}s" for each in unreached))
        names = ", ".join(each.name for each in unreached)
        what = f"weather has no effect on ideal {nouns} ({names}); give them a signal, as --signal datasheet does"
        warnings.warn(what, FieldtruthWarning, stacklevel=4)
