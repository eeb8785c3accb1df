# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A simulation that is stepped: the robot drives, and its sensors read what is due."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple
from weakref import ref

import numpy as np

from fieldtruth.bag.track_file import TrackFile
from fieldtruth.core.errors import ConfigurationError, DriveError
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Advance
from fieldtruth.drive.physics import Command
from fieldtruth.drive.plan import experiments_in, plan_route
from fieldtruth.drive.simulate import SimulatedRobot
from fieldtruth.drive.track import STEP_NS, STEP_S, Motion, Track
from fieldtruth.experiment.config import Experiment, RouteConfig, route_from_metres
from fieldtruth.experiment.environment_file import is_environment_file
from fieldtruth.experiment.files import load_experiment, validated
from fieldtruth.experiment.names import EXPERIMENTS
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import Output, SensorConfig
from fieldtruth.ontology import check_others
from fieldtruth.sense.interval import Moving
from fieldtruth.sense.leaning import Lean
from fieldtruth.sense.scene import Scene, given_world
from fieldtruth.sense.wind import leaning_of
from fieldtruth.sensors.kind import At, MotionSensor, Movement, Sensor, SensorWorld, movement_of
from fieldtruth.sensors.known import sensor_class
from fieldtruth.simulation.company import ALONE, Company
from fieldtruth.simulation.due import DueReadings, Frame, frame_of, wanted_outputs
from fieldtruth.simulation.first_run import compile_beside
from fieldtruth.simulation.motion import GrowingMotion, LiveMotion, MotionState, motion_of, track_in, with_given_track
from fieldtruth.world.build import check_experiment, world_of
from fieldtruth.world.classes import CLASSES_KEY, as_layout, classes_of
from fieldtruth.world.model import World

_AHEAD: float = 3.0
"""[m] from a start to the waypoint that gives the robot its heading; so far the way must be free."""
_FARTHEST: float = 10_000.0
"""[m] of a start from the origin, and [rad] of its heading."""
_FREE: float = 2.0
"""[m] from the end of the route in a world without an experiment to the world's edge."""


def experiment_for(
    experiment: Experiment | str | Path | None = None,
    *,
    environment: str | None = None,
    robot: str | None = None,
    rig: Rig | None = None,
    world: World | None = None,
) -> Experiment:
    """Return an experiment, with what is given in place of its own.

    Args:
        experiment: or its name, or the path of its file. None: the first built-in one in the environment; in a world,
            or without one, a straight route from the middle northwards.
        environment: whose experiment is meant; a ``world`` has one.
        robot: a name from ``fieldtruth list robots``; it has its own sensors.
        rig: the robot with its sensors.
        world: to drive in.

    Raises:
        UnknownNameError: an unknown name.
        ConfigurationError: a combination that is not allowed.
    """
    if experiment is not None and environment is not None:
        raise ConfigurationError("environment must be None where an experiment is given: the experiment has one")
    if robot is not None and rig is not None:
        raise ConfigurationError("robot must be None where a rig is given: the rig has one")
    if experiment is None and environment is None and world is None:
        raise ConfigurationError("one of experiment, environment and world is required")
    found = load_experiment(experiment) if isinstance(experiment, str | Path) else experiment
    if found is None:
        found = _in_environment(environment, world)
    changed: dict[str, Any] = {} if rig is None else {"rig": rig.model_dump()}
    if robot is not None:
        changed["rig"] = {"robot": robot}
    if changed:
        found = validated(found.model_dump() | changed, "")
    if world is not None:
        return _with_classes(found, world)
    check_experiment(found)
    check_others(classes_of(found.environment, found.layout, actors=bool(found.actors)))
    return found


def _with_classes(experiment: Experiment, world: World) -> Experiment:
    """Return the experiment with the classes of a world that is given, so that readers of its bag know them."""
    known = classes_of(experiment.environment, experiment.layout, actors=bool(experiment.actors))
    if {*world.classes.coloured} <= {*known.coloured}:
        return experiment
    layout = experiment.layout | {CLASSES_KEY: as_layout(world.classes)}
    return experiment.model_copy(update={"layout": layout})


def _in_environment(environment: str | None, world: World | None) -> Experiment:
    if environment is not None and is_environment_file(environment):
        return experiments_in(environment)[0]
    name = environment or (world.name if world is not None else "")
    built_in = (load_experiment(each) for each in EXPERIMENTS)
    if world is None and (same := next((each for each in built_in if each.environment == name), None)) is not None:
        return same
    metres = [world.size[0] / 2 - _FREE if world is not None else 10.0, 0.0]
    route = {"metres": {"start": [0.0, 0.0], "waypoints": [metres]}}
    return validated({"name": name, "environment": name, "route": route}, "")


@dataclass(frozen=True)
class Driven:
    """An experiment whose robot has driven to the end: its readings can be made in any order, by any thread."""

    experiment: Experiment
    world: World
    track: Track
    scene: Scene | None = field(default=None, kw_only=True)
    """The world in the ray tracer, if it was built."""
    reuse: bool = field(default=False, kw_only=True)
    """True if the arrays of a reading may be overwritten by the next one."""
    company: Company | None = field(default=None, kw_only=True)
    """What moves with the robot; None: nothing."""
    robots: Mapping[str, Motion] = field(default_factory=dict, kw_only=True)
    """Motions of all robots of an experiment that has several."""

    @cached_property
    def sensor_world(self) -> SensorWorld:
        """World, light and weather in which the sensors read."""
        return _sensor_world_of(self.experiment, self.world, self.company, self.scene, reuse=self.reuse)

    @cached_property
    def movement(self) -> Movement:
        """Motion of the robot, with the series that sensors have measured of it."""
        return movement_of(self.track)


def _sensor_world_of(
    made: Experiment, world: World, company: Company | None, scene: Scene | None, **options: Any
) -> SensorWorld:
    """Return world, light and weather in which the sensors of an experiment read; options are of ``SensorWorld``.

    A scene that is given is of the world in which nothing moves.
    """
    if company is None:
        moving = Moving(leaning=leaning_of(made.wind, world, made.seed))
    else:
        moving = company.moving(made.namespace or ALONE)
    options |= {"scene": None if company or moving else scene, "seed": made.noise_seed, "moving": moving}
    return SensorWorld(world, made.rig, made.light, made.weather, **options)


class SimulationState(NamedTuple):
    """State of a simulation, for ``Simulation.restore``; it can be pickled."""

    experiment: Experiment
    motion: MotionState
    sensors: Mapping[str, Any]
    failed: str


class DueReading(NamedTuple):
    """A reading that became complete, and is sensed when it is asked for."""

    sensor: Sensor
    output: Output
    at: At
    known: Any = None
    """The reading, if it is there already."""

    def read(self) -> Any:
        """Return the reading."""
        return self.sensor.read(self.output, self.at) if self.known is None else self.known

    def messages(self) -> list[tuple[str, bytes]]:
        """Return its messages, as the bag has them, with their topics."""
        made = self.sensor.messages(self.output, self.at.number, self.read())
        return [(topic.name, data) for topic, data in zip(self.output.topics, made, strict=True)]


class Simulation:
    """A robot with sensors in a world, step by step. Equal seeds and commands give equal frames.

    The readings are those that ``generate`` writes into a bag for the same experiment, whatever the steps are, if the
    follower drives.

    Args:
        experiment: its name, or the path of its file. None: one for what is given below.
        environment: a name from ``list_environments``, in place of an experiment.
        robot: a name from ``fieldtruth list robots`` that replaces the rig: the robot with its own sensors.
        rig: replaces the experiment's.
        world: replaces the experiment's, and stays the same for every seed.
        scene: ``world`` in the ray tracer, if it was built already.
        sensors: names of the sensors or outputs that read, such as ``lidar`` or ``stereo/left``; None for all.

    Raises:
        UnknownNameError: an unknown name.
        ConfigurationError: arguments that exclude each other.
    """

    def __init__(
        self,
        experiment: Experiment | str | Path | None = None,
        *,
        environment: str | None = None,
        robot: str | None = None,
        rig: Rig | None = None,
        world: World | None = None,
        scene: Scene | None = None,
        sensors: Iterable[str] | None = None,
    ) -> None:
        world = given_world(world, scene)
        chosen = experiment_for(experiment, environment=environment, robot=robot, rig=rig, world=world)
        self._given = with_given_track(chosen)
        self._experiment = self._given.experiment
        self._own_world, self._own_scene = world, scene
        self.wanted = wanted_outputs(self._experiment.rig, sensors)
        """Names of the outputs that are read."""
        self._route: RouteConfig | None = None
        self._sensor_world: SensorWorld | None = None
        self._motion: GrowingMotion | None = None
        self._due: list[DueReadings] = []
        self._sensors: dict[str, Sensor] = {}
        self._wider: tuple[Lean, SensorWorld] | None = None
        """What sensors see since a robot left its route."""
        self._unread: list[tuple[int, ref[Movement]]] = []
        """Time [ns] from which on readings need the motion of others, and the movement that they have until then."""
        self._failed = ""
        self.endless = False
        """True: from the next ``reset`` on, a drive does not end at the last waypoint, where the robot then stands."""
        self.company: Company | None = None
        """The robots of an experiment with several, of which this one is stepped by ``Fleet``."""

    @property
    def experiment(self) -> Experiment:
        """The experiment, with the seed of the last ``reset``."""
        return self._experiment

    @property
    def world(self) -> World:
        """The world: terrain, objects, materials; ``world.terrain.field.height_at(x, y)`` is the ground [m]."""
        return self._built().world

    @property
    def given_world(self) -> World | None:
        """The world that was given; None if the experiment's is built."""
        return self._own_world

    @property
    def scene(self) -> Scene:
        """The world in the ray tracer; built when it is first used, and shared by all sensors."""
        return self._built().scene

    @property
    def robot(self) -> SimulatedRobot:
        """The robot in the physics: its pose, velocity, wheels and command.

        Raises:
            ConfigurationError: the experiment has poses that are given, and no robot that drives.
        """
        motion = self._ready()[1]
        if not isinstance(motion, LiveMotion):
            raise ConfigurationError(f"{self._experiment.name} has poses that are given, and no robot in the physics")
        return motion.robot

    @property
    def seconds(self) -> float:
        """Simulated time [s] that is reached."""
        return self._ready()[1].reached_ns / 1e9

    @property
    def done(self) -> bool:
        """Return whether the drive has ended.

        It ends half a second after the fix that reaches the last waypoint, after ``experiment.seconds``, or with a
        ``DriveError``.
        """
        return bool(self._failed) or (self._motion is not None and self._motion.ended)

    @property
    def failed(self) -> str:
        """Why the drive ended before its end; empty if it did not."""
        return self._failed

    @property
    def track(self) -> Track:
        """The true motion that is known: of the last step, and as far back as readings that are not complete need."""
        return self._ready()[1].known()

    @property
    def route(self) -> RouteConfig | None:
        """The route that was planned; None along given poses, and before the first ``reset``."""
        return self._route

    @property
    def track_file(self) -> TrackFile | None:
        """The poses that the experiment follows, if it has a track file."""
        return self._given.track

    def drive(self, advance: Advance | None = None) -> Driven:
        """Plan the route and drive to its end at once, or take the poses that are given.

        A random route is driven while it is planned. ``advance`` receives the simulated time [s] that was driven.

        Raises:
            RouteError, TrackError: no route, poses or free ground to stand on.
            DriveError: the robot cannot drive this route.
        """
        made, world, company = self._experiment, self.world, self.company
        track = track_in(world, made, self._given.track, advance, company)
        return Driven(made, world, track, scene=self._own_scene, company=company)

    def _built(self) -> SensorWorld:
        """Return the world with its scene and light; it is built at the first use."""
        if self._sensor_world is None:
            made = self._experiment
            if made.robots and (self.company is None or made.namespace is None):
                robots = ", ".join(made.robots)
                raise ConfigurationError(f"{made.name} has several robots ({robots}), which a Fleet drives")
            if made.is_living and not made.robots:
                self.company = Company(made, self._world_alone)
            self._route = None
            read = {name.partition("/")[0] for name in self.wanted}
            rig = self._experiment.rig.with_each(lambda each: {} if each.name in read else {"enabled": False})
            compile_beside(self._experiment.model_copy(update={"rig": rig}))
            company, scene = self.company, self._own_scene
            world = self._world_alone() if company is None else company.world
            self._sensor_world = _sensor_world_of(made, world, company, scene, workers=cpu_count())
        return self._sensor_world

    def _world_alone(self) -> World:
        """Return the world without robots and actors."""
        return world_of(self._experiment) if self._own_world is None else self._own_world

    def prepare(self) -> None:
        """Build the scene, and the light if a sensor needs it, for which the first reading would wait."""
        sensor_world, read = self._built(), {name.partition("/")[0] for name in self.wanted}
        configs = [config for config in self._experiment.rig.in_order() if config.name in read and config.sees]
        if configs:
            sensor_world.scene  # noqa: B018
        if any(sensor_class(config).needs_light for config in configs):
            sensor_world.baked  # noqa: B018

    def reset(self, seed: int | None = None, start: tuple[float, float, float] | None = None) -> Frame:
        """Put the robot at its start, at time 0, and return a frame with its pose and without readings.

        Args:
            seed: of the experiment: its world, unless one was given, and the errors of all sensors with a signal or a
                clock. None: that of the last reset, at first the experiment's. Worlds are cached on the disk.
            start: where the robot is put in place of the route's start: x, y [m] and heading [rad], 0 along x. From
                there the follower drives to the route's first waypoint, and nothing looks what is in between.

        Raises:
            RouteError: the route cannot be driven in this world, or there is no room at ``start``.
            DriveError: the robot does not come to rest at the start.
        """
        if seed is not None and seed != self._experiment.seed:
            self._experiment, self._sensor_world = self._experiment.model_copy(update={"seed": seed}), None
        made = self._experiment
        world = self.world
        if self._route is None and made.route is not None and made.frames is None:
            self._route = plan_route(world, made)
        route = self._route if start is None else self._route_from(start)
        self._motion = motion_of(world, made, self._given.track, route, endless=self.endless, company=self.company)
        if start is not None and self.company is not None:
            self.company.set_free(0)
        stands = self._motion.stands
        self._due = [
            DueReadings(config, made.rig, made.noise_seed, stands)
            for config in made.rig.in_order()
            if (config.sees or stands is None)
            and self.wanted & {output.name for output in config.outputs_on(made.rig.robot)}
        ]
        self._sensors, self._unread, self._failed = {}, [], ""
        return frame_of(0, self._motion.world_from_base, ())

    def _route_from(self, start: tuple[float, float, float]) -> RouteConfig:
        """Return the route with another start, whose first waypoint is ahead of it."""
        made, (x, y, heading) = self._experiment, start
        if self._route is None:
            raise ConfigurationError("start must be None: this experiment has poses that are given, and no route")
        if not all(abs(value) <= _FARTHEST for value in start):  # also false for nan
            raise ConfigurationError(f"start must be x, y and heading up to {_FARTHEST:g}, got {start!r}")
        ahead = x + _AHEAD * math.cos(heading), y + _AHEAD * math.sin(heading)
        begin = route_from_metres((x, y), [ahead], self.world.origin)
        plan_route(self.world, made.model_copy(update={"route": begin}))
        return begin.model_copy(update={"waypoints": begin.waypoints + self._route.waypoints})

    def step(
        self,
        seconds: float,
        command: tuple[float, float] | None = None,
        *,
        sensors: Iterable[str] | None = None,
    ) -> Frame:
        """Drive on, and return the readings that became complete, with the true pose at the time that is reached.

        A reading is complete when the sweep or the shutter of its sensor is over, with optical flow at the camera's
        next image; it has its own stamp. Others that were due are not sensed.

        Args:
            seconds: simulated time [s], rounded to steps of the physics of 1 ms; the last step ends with the drive.
            command: forward speed [m/s] and turn rate [rad/s], to the left, that the robot accelerates to. None: the
                follower of the route drives.
            sensors: names of those that read in this step; None for all that the simulation has.

        Raises:
            ConfigurationError: a time or a command that is not allowed.
            UnknownNameError: an unknown sensor.
            DriveError: the robot tipped over, touched an obstacle, drove into water, left the world or is stuck: the
                drive has ended. Or it had ended before.
        """
        found = [(each.output.name, each.read()) for each in self.due(seconds, command, sensors=sensors)]
        motion = self._ready()[1]
        return frame_of(motion.reached_ns, motion.world_from_base, found)

    def due(
        self,
        seconds: float,
        command: tuple[float, float] | None = None,
        *,
        sensors: Iterable[str] | None = None,
    ) -> list[DueReading]:
        """Drive on as ``step`` does, and return the readings that became complete, which are not sensed yet.

        Threads may read them while the simulation is stepped, each sensor one after another. Raises as ``step``.
        """
        sensor_world, motion = self._ready()
        steps, target = self._checked(seconds, command)
        wanted = self.wanted if sensors is None else self.wanted & wanted_outputs(self._experiment.rig, sensors)
        if self.done:
            raise DriveError(
                self._failed or f"the drive has ended at {motion.reached_ns / 1e9:g} s; reset() begins another"
            )
        keep_ns = self._keep_ns(motion)
        if isinstance(motion, LiveMotion):
            motion.forget_others(int(min(keep_ns, self.needed_ns)))
        try:
            motion.advance(steps, target, keep_ns)
        except DriveError as error:
            self._failed = f"{error}; reset() begins another drive"
            raise
        return self._complete(sensor_world, motion, wanted)

    def _keep_ns(self, motion: GrowingMotion) -> int:
        """Time [ns] from which on readings that are not complete need the motion."""
        return min((due.needed_ns(motion.reached_ns) for due in self._due), default=motion.reached_ns)

    @property
    def needed_ns(self) -> float:
        """Time [ns] from which on readings may still ask where others are: those to come, and those not yet read."""
        self._unread = [(stamp, movement) for stamp, movement in self._unread if movement() is not None]
        coming = [] if self.done else [self._keep_ns(self._ready()[1])]
        return min([*coming, *(stamp for stamp, _ in self._unread)], default=math.inf)

    def _complete(self, sensor_world: SensorWorld, motion: GrowingMotion, wanted: set[str]) -> list[DueReading]:
        """Return the readings that became complete and are wanted, in time order."""
        track = motion.known()
        movement, found, seen = movement_of(track), list[DueReading](), list[DueReading]()
        if self.company is not None:
            self._unread.append((self._keep_ns(motion), ref(movement)))
        for due in self._due:
            if due.config.sees:
                for output, at in due.seen(movement, motion.reached_ns, motion.end_ns):
                    if output.name in wanted:
                        sensor = self._sensor(self._world_at(sensor_world, at.stamp_ns), due.config, output.name)
                        seen.append(DueReading(sensor, output, at))
            elif motion.ended or motion.reached_ns > STEP_NS:  # the reading at the first step of all needs the second
                sensor = self._sensor(sensor_world, due.config, due.config.name)
                assert isinstance(sensor, MotionSensor)
                made = due.measured(sensor, track, motion.reached_ns)
                found += [
                    DueReading(sensor, output, at, reading) for (output, at), reading in made if output.name in wanted
                ]
        return sorted([*found, *seen], key=lambda each: each.at.stamp_ns)

    def save(self) -> SimulationState:
        """Return what ``restore`` needs to go on from here, with the same bits."""
        _, motion = self._ready()
        sensors = {due.config.name: due.save() for due in self._due}
        return SimulationState(self._experiment, motion.save(), sensors, self._failed)

    def restore(self, state: SimulationState) -> None:
        """Go on from where ``save`` was called, in this simulation or another of the same experiment.

        Raises:
            ConfigurationError: the state is that of another experiment, or of other sensors.
        """
        other = "state must come from a simulation of the same experiment with the same sensors"
        if state.experiment.model_copy(update={"seed": self._experiment.seed}) != self._experiment:
            raise ConfigurationError(other)
        if self._motion is None or state.experiment.seed != self._experiment.seed:
            self.reset(state.experiment.seed)
        if state.sensors.keys() != {due.config.name for due in self._due}:
            raise ConfigurationError(other)
        _, motion = self._ready()
        motion.restore(state.motion)
        for due in self._due:
            due.restore(state.sensors[due.config.name])
        self._failed, self._sensors = state.failed, {}

    def _ready(self) -> tuple[SensorWorld, GrowingMotion]:
        if self._motion is None:
            self.reset()
        assert self._motion is not None
        return self._built(), self._motion

    def _sensor(self, sensor_world: SensorWorld, config: SensorConfig, name: str) -> Sensor:
        """Return the sensor of an output, so that several of one sensor can be read at once."""
        known = self._sensors.get(name)
        if known is None or known.sensor_world is not sensor_world:
            self._sensors[name] = known = sensor_class(config)(config, sensor_world)
        return known

    def _world_at(self, sensor_world: SensorWorld, stamp_ns: int) -> SensorWorld:
        """Return what sensors see at a stamp [ns]: more plants lean where a robot has left its route."""
        pressed = None if self.company is None else next(iter(self.company.leans), None)
        if pressed is None or (lean := pressed.until(stamp_ns)) is pressed:
            return sensor_world
        leaning = sensor_world.moving.leaning
        assert leaning is not None
        if self._wider is None or not np.array_equal(lean.rows, self._wider[0].rows):
            self._wider = lean, sensor_world.leant(leaning.with_cause(pressed, lean))
        return self._wider[1]

    def _checked(self, seconds: float, command: tuple[float, float] | None) -> tuple[int, Command | None]:
        """Return the steps of the physics in a time, and a command that the robot can take."""
        if not STEP_S / 2 < seconds <= 86_400.0:
            raise ConfigurationError(f"seconds must be between {STEP_S:g} and 86400, got {seconds!r}")
        if command is None:
            return round(seconds / STEP_S), None
        robot, target = self._experiment.rig.robot, Command(*map(float, command))
        for what, value, limit, unit in (
            ("speed", target.speed, robot.max_speed, "m/s"),
            ("turn rate", target.turn_rate, robot.max_turn_rate, "rad/s"),
        ):
            if not (math.isfinite(value) and abs(value) <= limit):
                raise ConfigurationError(f"command: {what} must be from -{limit:g} to {limit:g} {unit}, got {value!r}")
        return round(seconds / STEP_S), target
