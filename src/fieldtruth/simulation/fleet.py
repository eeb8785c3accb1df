# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Several robots that are stepped together: each is a simulation that sees the others and touches them."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path

from fieldtruth.core.errors import ConfigurationError, DriveError, UnknownNameError
from fieldtruth.core.progress import Advance
from fieldtruth.experiment.config import Experiment
from fieldtruth.sense.moving import KNOT_NS
from fieldtruth.simulation.company import Company, errors_of
from fieldtruth.simulation.due import Frame, frame_of
from fieldtruth.simulation.stepped import Driven, DueReading, Simulation, experiment_for
from fieldtruth.world.build import world_of
from fieldtruth.world.model import World


class Fleet:
    """The robots of an experiment with several, step by step. Equal seeds and commands give equal frames.

    The readings are those that ``generate`` writes for the same experiment, whatever the steps are, if the followers
    drive.

    Args:
        experiment: with robots; or its name, or the path of its file.
        world: replaces the experiment's, and stays the same for every seed.
        sensors: names of the sensors or outputs of each robot that read, such as ``lidar``; None for all.

    Raises:
        UnknownNameError: an unknown name.
        ConfigurationError: an experiment without robots.
    """

    def __init__(
        self,
        experiment: Experiment | str | Path,
        *,
        world: World | None = None,
        sensors: Iterable[str] | None = None,
    ) -> None:
        self.experiment = experiment_for(experiment, world=world)
        """The experiment, with the seed of the last ``reset``."""
        if not self.experiment.robots:
            raise ConfigurationError(f"{self.experiment.name} has one robot, which a Simulation drives; give it robots")
        self._world, self._sensors = world, None if sensors is None else list(sensors)
        self._stamp_ns, self._begun = 0, False
        self._waiting: dict[str, list[DueReading]] = {}
        self._company = self._assemble()

    def _assemble(self) -> Company:
        """Make the simulations of an experiment."""
        made, world = self.experiment, self._world
        company = Company(made, lambda: world_of(made) if world is None else world)
        self.robots = {
            name: Simulation(own, world=world, sensors=self._sensors) for name, own in company.experiments.items()
        }
        """The simulation of each robot, which only the fleet steps."""
        for each in self.robots.values():
            each.company = company
        return company

    @property
    def world(self) -> World:
        """The world, with the instance ids of the robots in ``world.object_names``."""
        return self._company.world

    @property
    def seconds(self) -> float:
        """Simulated time [s] that is reached."""
        return self._stamp_ns / 1e9

    @property
    def done(self) -> bool:
        """Return whether the drives of all robots have ended."""
        return self._begun and all(each.done for each in self.robots.values())

    def reset(self, seed: int | None = None) -> dict[str, Frame]:
        """Put all robots at their starts, at time 0, and return frames with their poses and without readings.

        Args:
            seed: of the experiment, as ``Simulation.reset`` takes it.

        Raises:
            RouteError, DriveError: a robot, and why it cannot stand at its start, or drive its route.
        """
        if seed is not None and seed != self.experiment.seed:
            self.experiment = self.experiment.model_copy(update={"seed": seed})
            self._company = self._assemble()
        frames = dict[str, Frame]()
        for name, each in self.robots.items():
            with errors_of(name):
                frames[name] = each.reset()
            self._company.poses[name].restart(frames[name].pose)
        self._company.begin({name: each.route for name, each in self.robots.items()})
        self._stamp_ns, self._begun, self._waiting = 0, True, {name: [] for name in self.robots}
        return frames

    def step(self, seconds: float, commands: Mapping[str, tuple[float, float]] | None = None) -> dict[str, Frame]:
        """Drive all robots on, and return by robot the readings that became complete, as ``Simulation.step`` does.

        A robot whose drive has ended stands where it stopped. The readings at its end come when the motion of the
        others is known, too.

        Args:
            seconds: simulated time [s], a multiple of 0.01.
            commands: forward speed [m/s] and turn rate [rad/s] by robot; the followers of their routes drive others.

        Raises:
            ConfigurationError: a time or a command that is not allowed.
            UnknownNameError: an unknown robot.
            DriveError: a robot touched another one, or cannot go on for another reason: its drive has ended. The next
                step drives on with the others. Or all drives had ended before.
        """
        blocks, given = self._checked(seconds), commands or {}
        if unknown := given.keys() - self.robots.keys():
            raise UnknownNameError("robot", min(unknown), self.robots)
        if not self._begun:
            self.reset()
        if self.done:
            raise DriveError(f"all drives have ended at {self.seconds:g} s; reset() begins others")
        for _ in range(blocks):
            if not self.done:
                self._drive_block(given)
        return {name: self._frame(name) for name in self.robots}

    def drive(self, advance: Advance | None = None) -> dict[str, Driven]:
        """Plan all routes and drive to the ends of all drives at once; raises as ``Company.drive``."""
        company = self._company
        tracks = company.drive(advance)
        motions = {name: track.swept for name, track in tracks.items()}
        return {
            name: Driven(company.experiments[name], self.world, track, company=company, robots=motions)
            for name, track in tracks.items()
        }

    def _checked(self, seconds: float) -> int:
        """Return the number of blocks in a time."""
        blocks = round(seconds * 1e9 / KNOT_NS) if math.isfinite(seconds) else 0
        if blocks < 1 or abs(blocks * KNOT_NS / 1e9 - seconds) > 1e-9 or seconds > 86_400.0:
            raise ConfigurationError(f"seconds must be a multiple of {KNOT_NS / 1e9:g} up to 86400, got {seconds!r}")
        return blocks

    def _drive_block(self, commands: Mapping[str, tuple[float, float]]) -> None:
        """Drive from one knot to the next."""
        company, failed = self._company, list[DriveError]()
        running = {name: each for name, each in self.robots.items() if not each.done}
        if commands:
            company.set_free(self._stamp_ns)
        company.meet({name: each.robot for name, each in running.items()}, self._stamp_ns)
        self._stamp_ns += KNOT_NS
        for name, each in running.items():
            try:
                with errors_of(name):
                    self._waiting[name] += each.due(KNOT_NS / 1e9, commands.get(name))
                company.add(name, each.track.swept)
            except DriveError as error:
                failed.append(error)
        company.step_actors(self._stamp_ns)
        company.forget(int(min(self._stamp_ns, *(each.needed_ns for each in self.robots.values()))))
        if self.done:
            company.end_actors(self._stamp_ns)
        if failed:
            raise failed[0]

    def _frame(self, name: str) -> Frame:
        """Sense what waits and for which the motion of the others is known."""
        known = math.inf if all(each.done for other, each in self.robots.items() if other != name) else self._stamp_ns
        waiting = self._waiting[name]
        ready = [each for each in waiting if _until_ns(each) <= known]
        self._waiting[name] = [each for each in waiting if _until_ns(each) > known]
        pose = self._company.poses[name]([self._stamp_ns])[0]
        return frame_of(self._stamp_ns, pose, [(each.output.name, each.read()) for each in ready])


def _until_ns(reading: DueReading) -> int:
    """Time [ns] up to which a reading needs the motion of others."""
    config = reading.sensor.config
    return int(reading.at.stamp_ns + math.ceil(round(1e9 * config.late_s, 3))) if config.sees else 0
