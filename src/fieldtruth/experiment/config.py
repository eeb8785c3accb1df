# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of an experiment: environment, route or track file, rig, light and seed, as frozen data.

Routes are geodetic, as in the paper, in metres of the world frame, or random. Print one that is given in metres in its
geodetic form::

    print(fieldtruth.route_yaml(fieldtruth.route_from_metres((-33, -6), [(-22, -3), (-10, 2)])))
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, Final, Literal, Self

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from fieldtruth.core.errors import ConfigurationError, RouteError, UnknownNameError
from fieldtruth.core.geodesy import PAPER_ORIGIN, Origin, geodetic_from_world, world_from_geodetic
from fieldtruth.core.random import seed_of
from fieldtruth.experiment.actor_config import MOST_ACTORS, ActorConfig, actor_names
from fieldtruth.experiment.environment_file import CENTRE, Chosen, is_environment_file, resolved
from fieldtruth.experiment.fields import Boolean, Frozen, Integer, LocatedError, Mount, Name, Number, Positive
from fieldtruth.experiment.light_config import LightConfig, WeatherConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.wind_config import WindConfig

Latitude = Annotated[Number, Field(ge=-90, le=90)]
Longitude = Annotated[Number, Field(ge=-180, le=180)]
Metre = Annotated[Number, Field(ge=-10_000, le=10_000)]
ROUTE_FORMS: Final = (
    "one of {start: ..., waypoints: ...}, {metres: {start: ..., waypoints: ...}}, {random: {length_m: ..., seed: ...}}"
)
OneLine = Annotated[
    str,
    Field(max_length=200, pattern=r"^[^\r\n\x85\u2028\u2029]*$", description="a single line of at most 200 characters"),
]


class ControlConfig(Frozen):
    """Waypoint following (paper, section 3): constant speed, turn rate proportional to the heading error."""

    speed: Positive = 0.3  # [m/s]
    heading_gain: Positive = 1.0  # [(rad/s) / rad]
    max_turn_rate: Positive = 0.6  # [rad/s]
    arrival_distance: Positive = 2.0  # [m]; below it the next waypoint becomes the target
    yield_to: Annotated[Number, Field(ge=0.5, le=50)] | None = None
    """Distance [m] ahead at which the robot begins to slow down for actors and other robots in its way; None: never."""


class RouteConfig(Frozen):
    """Start and waypoints as (latitude, longitude) [deg]; the robot starts heading for the first waypoint."""

    start: Annotated[tuple[Latitude, Longitude], Field(description="[latitude, longitude] in degrees")]
    waypoints: Annotated[
        tuple[tuple[Latitude, Longitude], ...],
        Field(min_length=1, description="a list with at least one [latitude, longitude] in degrees"),
    ]


class MetresConfig(Frozen):
    """Start and waypoints as (x north, y west) [m] in the world frame, whose origin is the middle of the world."""

    start: Annotated[tuple[Metre, Metre], Field(description="[x, y] in metres")]
    waypoints: Annotated[
        tuple[tuple[Metre, Metre], ...], Field(min_length=1, description="a list with at least one [x, y] in metres")
    ]


class MetresRouteConfig(Frozen):
    """A route in metres: ``metres: {start: [x, y], waypoints: [[x, y], ...]}``."""

    metres: MetresConfig


class RandomConfig(Frozen):
    """Length [m] of a random route, and the seed that selects it."""

    length_m: Annotated[Number, Field(ge=20, le=5000)]
    seed: Annotated[Integer, Field(ge=0, le=2**63 - 1)]


class RandomRouteConfig(Frozen):
    """A random route on the free ground of the world: ``random: {length_m: 150, seed: 3}``."""

    random: RandomConfig


RANDOM_ROUTE: Final[Mapping[str, Any]] = {"random": {"length_m": 100, "seed": 0}}
"""Route of an experiment in an environment's file that gives none."""


def _form(route: object) -> str | None:
    keys = set(route if isinstance(route, Mapping) else type(route).model_fields if isinstance(route, Frozen) else ())
    other = keys & {"metres", "random"}
    if len(other) == 0 and isinstance(route, Mapping | Frozen):
        return "degrees"
    return other.pop() if len(keys) == 1 else None


Route = RouteConfig | MetresRouteConfig | RandomRouteConfig
"""The three forms; ``fieldtruth.plan_route`` turns any of them into a ``RouteConfig``."""
_Route = Annotated[
    Annotated[RouteConfig, Tag("degrees")]
    | Annotated[MetresRouteConfig, Tag("metres")]
    | Annotated[RandomRouteConfig, Tag("random")],
    Discriminator(_form),
    Field(description=ROUTE_FORMS),
]


class DriveConfig(Frozen):
    """A track file that replaces route and physics: ``drive: {track: flight.csv}``. See docs/tracks.md."""

    track: Annotated[
        str, Field(min_length=1, description="the path of a TUM or CSV file, a bag or the folder of a run")
    ]
    topic: Annotated[str, Field(description="a topic of type nav_msgs/Odometry")] | None = None
    """Of a bag. None: /ground_truth/odom, or where that is missing the robot in /gazebo/model_states."""
    pose_of: Annotated[str, Field(description="a frame of the rig")] | None = None
    """The frame whose poses the file has. None: base_link, or what the odometry of a bag says."""
    start_s: Annotated[Number, Field(ge=-10_000_000_000, le=10_000_000_000)] | None = None
    """Stamp in the file [s] that becomes time 0. None: the first."""
    world_from_track: Mount | None = None
    """Pose of the file's reference frame in the world; None if it is the world frame."""
    allow_inside: Boolean = False
    """True if the robot and its sensors may be below the ground, under water or in an obstacle."""


class PlantsConfig(Frozen):
    """Forces between plants and robot: ``plants: {yielding: true}``. See docs/yielding_plants.md."""

    yielding: Boolean = False
    """True: stems and twigs resist the robot, bend before it, and lie in its track. Otherwise it drives through grass
    without any effect, and bushes stop it."""


class GroundConfig(Frozen):
    """What wheels do to the ground: ``ground: {ruts: true}``. See docs/ruts.md."""

    ruts: Boolean = False
    """True: wheels leave ruts in soft soil, which sensors see and wheels meet again."""


Through = Literal["none", "grass", "flexible"]
"""Plants that a route may lead through: none, high grass, or flexible bushes, too."""


class PlanConfig(Frozen):
    """Planning of the route: ``plan: {through: flexible}``."""

    through: Annotated[Through, Field(description="none, grass or flexible")] = "grass"


FRAME_RATE: Final = 10.0
"""Frames per second of simulated time, where an experiment makes frames instead of a drive."""


class FramesConfig(Frozen):
    """Separate frames instead of a drive: ``frames: {count: 2000}``. See docs/experiments.md.

    Each is a stereo pair and a cloud of a robot that stands on free ground with a random heading, or on a trail with a
    view along it, tilted and raised by random amounts.
    """

    count: Annotated[Integer, Field(ge=1, le=864_000)]
    seed: Annotated[Integer, Field(ge=0, le=2**63 - 1)] = 0
    """Selects positions and poses in the same world."""
    aside_m: Annotated[Number, Field(ge=0.1, le=1000)] = 3.0
    """Greatest distance [m] from the route of an experiment that has one; without a route all free ground is used."""
    along: Annotated[Literal["trail"], Field(description="trail")] | None = None
    """trail: the robot stands on trails and looks along them, either way. None: anywhere, at any heading."""
    turn_deg: Annotated[Number, Field(ge=0, le=180)] = 20.0
    """Greatest angle [deg] between heading and trail, to both sides."""
    pitch_deg: Annotated[Number, Field(ge=0, le=45)] = 8.0
    """Greatest pitch and roll [deg], up and down, in addition to those of the ground."""
    roll_deg: Annotated[Number, Field(ge=0, le=45)] = 4.0
    raised_m: Annotated[Number, Field(ge=0, le=2)] = 0.3
    """Greatest height [m] above that of a robot that stands on the ground."""


StaticObjects = Annotated[Literal["auto", "repeated", "latched"], Field(description="auto, repeated or latched")]
"""Objects that do not move are in every /gazebo/model_states of a bag, as Gazebo publishes them, or once, in
/gazebo/static_model_states. auto: once in worlds of more than 500 named objects."""


MOST_ROBOTS: Final = 8
_NAME: Final = re.compile("[a-z][a-z0-9_]{0,31}")
_LONGEST_NAME: Final = 64


def _check_names(names: Iterable[str], key: str) -> None:
    """Raise LocatedError if a name is not one of ROS."""
    for name in names:
        if not _NAME.fullmatch(name):
            what = "must be named by at most 32 lower-case letters, digits and _, a letter first"
            raise LocatedError(what, (key, name))


class RobotChanges(Frozen):
    """What one of several robots has in place of the experiment's; None: that of the experiment."""

    rig: Annotated[Rig, Field(description="a name from `fieldtruth list robots`, or a rig")] | None = None
    route: _Route | None = None
    control: ControlConfig | None = None

    @model_validator(mode="before")
    @classmethod
    def _named(cls, given: Any) -> Any:
        if isinstance(given, Mapping) and isinstance(given.get("rig"), str):
            return {**given, "rig": {"robot": given["rig"]}}
        return given


class Experiment(Frozen):
    """One drive through one environment: the complete input of a data set. Same experiment, same bytes."""

    name: Name
    description: OneLine = ""
    """Shown by ``fieldtruth list``."""
    environment: Name
    seed: Annotated[Integer, Field(ge=0, le=2**63 - 1)] = 0
    layout: dict[str, Any] = Field(default_factory=dict, description="a mapping with keys of the environment")
    """Changes to the environment's layout, for example ``{old_trees: 60}``; see docs/environments.md."""
    soil: dict[str, str] = Field(default_factory=dict, description="a mapping of ground types to soils")
    """Soils that replace those of ground types, for example ``{gravel: sand}``; see docs/environments.md."""
    seconds: Annotated[Number, Field(ge=0.001, le=86_400)] | None = None
    """End after this simulated time [s]; None drives to the last waypoint."""
    route: _Route | None = None
    drive: DriveConfig | None = None
    """A track file in place of a route."""
    frames: FramesConfig | None = None
    """Separate frames in place of a drive, over all free ground or along the route."""
    control: ControlConfig = ControlConfig()
    plan: PlanConfig = PlanConfig()
    plants: PlantsConfig = PlantsConfig()
    ground: GroundConfig = GroundConfig()
    rig: Rig = Rig()
    light: LightConfig = LightConfig()
    weather: WeatherConfig = WeatherConfig()
    static_objects: StaticObjects = "auto"
    robots: Annotated[
        Mapping[str, RobotChanges], Field(description=f"a mapping of 2 to {MOST_ROBOTS} names to changes")
    ] = {}
    """Several robots in one world by name; see docs/several_robots.md."""
    namespace: Annotated[str, Field(description="one of the robots")] | None = None
    """Of the run of one of ``robots``: its name, and the namespace of its topics."""
    actors: Annotated[
        Mapping[str, ActorConfig], Field(description=f"a mapping of names to actors, {MOST_ACTORS} at most")
    ] = {}
    """People, animals and vehicles that move; see docs/actors.md."""
    wind: WindConfig | None = None
    """In which plants lean and sway; None: still. See docs/wind.md."""

    @model_validator(mode="before")
    @classmethod
    def _environment_of_file(cls, given: Any) -> Any:
        """Replace the path of an environment by what its file says, with a random route and a sun of its own."""
        layout = given.get("layout", {}) if isinstance(given, Mapping) else None
        if not isinstance(given, Mapping) or not isinstance(layout, Mapping):
            return given
        values, light = dict(given), given.get("light", {})
        if is_environment_file(given.get("environment")):
            chosen = resolved(given["environment"], layout)
            layout = chosen.layout
            values |= {"environment": chosen.environment, "layout": layout}
            if all(given.get(key) is None for key in ("route", "drive", "frames")):
                values["route"] = RANDOM_ROUTE
        if CENTRE in layout and isinstance(light, Mapping | str | LightConfig):
            latitude, longitude, _ = origin_of(layout)
            if isinstance(light, LightConfig):
                light = light.model_dump(exclude_unset=True)
            own = {"preset": light} if isinstance(light, str) else light
            values["light"] = {"latitude": latitude, "longitude": longitude, **own}
        return values

    @model_validator(mode="after")
    def _within_limits(self) -> Self:
        _check_limits(self.control, self.rig, ())
        for name, own in self.robots.items():
            _check_limits(own.control or self.control, own.rig or self.rig, ("robots", name))
        return self

    @model_validator(mode="after")
    def _several(self) -> Self:
        if self.namespace is not None and self.namespace not in self.robots:
            raise LocatedError(f"must be one of the robots, got {self.namespace}", ("namespace",))
        if not self.robots:
            return self
        if not 2 <= len(self.robots) <= MOST_ROBOTS:
            raise LocatedError(f"must be 2 to {MOST_ROBOTS}, got {len(self.robots)}", ("robots",))
        _check_names(self.robots, "robots")
        if given := [key for key in ("drive", "frames") if getattr(self, key) is not None]:
            raise LocatedError(f"exclude {given[0]}: all robots drive", ("robots",))
        if lacking := [name for name, own in self.robots.items() if own.route is None and self.route is None]:
            raise LocatedError(f"is required: {ROUTE_FORMS}", ("robots", lacking[0], "route"))
        if self.namespace is None and len(self.name) + 1 + max(map(len, self.robots)) > _LONGEST_NAME:
            raise LocatedError(f"and a robot's name must have {_LONGEST_NAME - 1} letters at most together", ("name",))
        return self

    @model_validator(mode="after")
    def _actors_allowed(self) -> Self:
        _check_names(self.actors, "actors")
        if (count := sum(config.count for config in self.actors.values())) > MOST_ACTORS:
            raise LocatedError(f"must be {MOST_ACTORS} at most, got {count}", ("actors",))
        names = [*(name for name, _ in actor_names(self.actors)), *self.robots]
        if twice := [name for name, number in Counter(names).items() if number > 1]:
            raise LocatedError(f"and robots must have different names, got {twice[0]} twice", ("actors",))
        if self.actors and self.frames is not None:
            raise LocatedError("exclude frames: they move while a robot drives", ("actors",))
        return self

    @model_validator(mode="after")
    def _plants_allowed(self) -> Self:
        if self.plan.through == "flexible" and not self.plants.yielding:
            raise LocatedError("flexible needs plants: {yielding: true}: bushes stop the robot", ("plan", "through"))
        if self.plants.yielding and (given := [key for key in ("drive", "frames") if getattr(self, key) is not None]):
            raise LocatedError(f"true excludes {given[0]}: stems resist a robot that drives", ("plants", "yielding"))
        return self

    @model_validator(mode="after")
    def _ruts_allowed(self) -> Self:
        if self.ground.ruts and (given := [key for key in ("drive", "frames") if getattr(self, key) is not None]):
            raise LocatedError(f"true excludes {given[0]}: wheels leave ruts where a robot drives", ("ground", "ruts"))
        return self

    @model_validator(mode="after")
    def _one_motion(self) -> Self:
        if self.frames is not None:
            if self.drive is not None or self.seconds is not None:
                raise ValueError("frames exclude drive and seconds: frames.count says how many there are")
            if self.frames.along is not None and self.route is not None:
                raise LocatedError("and route exclude each other: trails replace the route", ("frames", "along"))
            unfit = [(each.name, each.unfit_for_frames) for each in self.rig.sensors if each.enabled]
            for key, why in dict.fromkeys(problem for _, problem in unfit if problem):
                names = ", ".join(name for name, problem in unfit if problem == (key, why))
                raise ValueError(f"frames need {key}: false of {names}, as {why}")
            return self
        if self.route is None and self.drive is None and not self.robots:
            raise ValueError(
                f"route is required: {ROUTE_FORMS}; or drive: {{track: FILE}}, or frames: {{count: NUMBER}}"
            )
        if self.route is not None and self.drive is not None:
            raise ValueError("route and drive exclude each other: a track file replaces the route")
        return self

    def of_robot(self, name: str) -> Self:
        """Return the experiment of one of several robots: its rig, route and control, beside the others.

        Raises:
            UnknownNameError: no such robot.
        """
        if name not in self.robots:
            raise UnknownNameError("robot", name, self.robots)
        keys = RobotChanges.model_fields
        robots = {
            each: RobotChanges.model_construct(**{key: getattr(own, key) or getattr(self, key) for key in keys})
            for each, own in self.robots.items()
        }
        values = {key: getattr(robots[name], key) for key in keys}
        whole = self.name.removesuffix(f"_{self.namespace}")
        return self.model_copy(update={**values, "name": f"{whole}_{name}", "robots": robots, "namespace": name})

    @property
    def is_living(self) -> bool:
        """True if actors, plants that yield or ruts change with the robot, so that one process steps them all."""
        return bool(self.actors) or self.plants.yielding or self.ground.ruts

    @property
    def moving(self) -> list[str]:
        """Names of what moves beside the robot."""
        every = {
            "robots": self.robots,
            "actors": self.actors,
            "plants that yield": self.plants.yielding,
            "ruts": self.ground.ruts,
            "wind": self.wind is not None and self.wind.speed_m_s > 0,
        }
        return [name for name, given in every.items() if given]

    @property
    def noise_seed(self) -> int:
        """Root of the errors of its sensors: the seed; of one of several robots a child of it."""
        if self.namespace is None:
            return self.seed
        return int(seed_of(self.seed, "robot", self.namespace).generate_state(1, np.uint64)[0] >> np.uint64(1))

    @property
    def world_name(self) -> str:
        """Name of the world: of the environment, or of its file."""
        return Chosen(self.environment, self.layout).world_name

    @property
    def origin(self) -> Origin:
        """Origin of the world, as far as the experiment says it: the height of a site's is that of its ground."""
        return origin_of(self.layout)


def _check_limits(control: ControlConfig, rig: Rig, at: tuple[str, ...]) -> None:
    """Raise LocatedError if a robot cannot drive as fast as it shall."""
    robot = rig.robot
    for key, limit, unit in (("speed", robot.max_speed, "m/s"), ("max_turn_rate", robot.max_turn_rate, "rad/s")):
        value = getattr(control, key)
        if value > limit:
            what = f"must be at most {limit:g} {unit}, the limit of the robot {robot.model}, got {value:g}"
            raise LocatedError(what, (*at, "control", key))


def origin_of(layout: Mapping[str, Any]) -> Origin:
    """Return the origin of the world of a layout: a site's centre, at height 0; else that of the paper.

    Raises:
        ConfigurationError: the centre is no pair of numbers, or no place.
    """
    centre = layout.get(CENTRE)
    if centre is None:
        return PAPER_ORIGIN
    pair: Any = centre if isinstance(centre, list | tuple) and len(centre) == 2 else (None, None)
    are_numbers = all(isinstance(n, int | float) and not isinstance(n, bool) for n in pair)
    if not are_numbers or not (abs(pair[0]) <= 85 and abs(pair[1]) <= 180):  # as a site's Config
        what = "[latitude, longitude], in degrees, from -85 to 85 and -180 to 180"
        raise ConfigurationError(f"layout.{CENTRE} must be {what}, got {centre!r:.60}")
    return Origin(float(centre[0]), float(centre[1]), 0.0)


DECIMALS: Final = 9
"""Decimals of a degree: 0.1 mm on the ground."""


def route_from_metres(
    start: Sequence[float], waypoints: Sequence[Sequence[float]], origin: Origin = PAPER_ORIGIN
) -> RouteConfig:
    """Make a geodetic route of points (x north, y west) [m] in the world frame, at the height of its ``origin``."""
    points = np.array([start, *waypoints], np.float64)
    geodetic = geodetic_from_world(np.column_stack([points, np.zeros(len(points))]), origin)
    pairs = [
        (round(float(latitude), DECIMALS), round(float(longitude), DECIMALS)) for latitude, longitude, _ in geodetic
    ]
    return RouteConfig(start=pairs[0], waypoints=tuple(pairs[1:]))


def random_route(length_m: float, seed: int) -> RandomRouteConfig:
    """Make a random route of this length [m]; another seed gives another route through the same world."""
    return RandomRouteConfig(random=RandomConfig(length_m=length_m, seed=seed))


def geodetic_route(route: Route | None, origin: Origin = PAPER_ORIGIN) -> RouteConfig:
    """Return the route with its points in degrees; ``origin`` is that of the world.

    Raises:
        RouteError: no route, as in an experiment with a track file; or a random one, which must be planned first.
    """
    if route is None:
        raise RouteError("the experiment has no route: it follows a track file, or makes frames on free ground")
    if isinstance(route, RandomRouteConfig):
        raise RouteError(
            "a random route has no waypoints before it is planned; call fieldtruth.plan_route(world, experiment)"
        )
    if isinstance(route, MetresRouteConfig):
        return route_from_metres(route.metres.start, route.metres.waypoints, origin)
    return route


def metres_from_route(
    route: Route | None, origin: Origin = PAPER_ORIGIN
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Start and n waypoints (1 + n, 2) of a route as x, y [m] in the world frame of an ``origin``.

    Raises:
        RouteError: as for ``geodetic_route``.
    """
    if isinstance(route, MetresRouteConfig):
        return np.array([route.metres.start, *route.metres.waypoints], np.float64)
    route = geodetic_route(route, origin)
    points = np.array([route.start, *route.waypoints], np.float64)
    return world_from_geodetic(np.column_stack([points, np.full(len(points), origin.height)]), origin)[:, :2]


def route_yaml(route: RouteConfig, origin: Origin = PAPER_ORIGIN) -> str:
    """Return the ``route:`` part of an experiment file, each point with its x, y [m] in a comment."""
    pairs = [route.start, *route.waypoints]
    metres = np.round(metres_from_route(route, origin), 1) + 0.0  # no -0.0
    texts = [
        f"[{latitude:.{DECIMALS}f}, {longitude:.{DECIMALS}f}]  # x {x:5.1f} m, y {y:5.1f} m"
        for (latitude, longitude), (x, y) in zip(pairs, metres, strict=True)
    ]
    return (
        "\n".join(["route:", f"  start: {texts[0]}", "  waypoints:", *(f"    - {text}" for text in texts[1:])]) + "\n"
    )
