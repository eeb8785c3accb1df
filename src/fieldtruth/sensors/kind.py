# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Kinds of sensors: readings as arrays from the motion, a signal over them, and their messages.

A sensor gives the reading of an ``Output`` of its configuration in three steps, which all kinds have: the truth, what a
real sensor makes of it, and the messages. A kind is known once the module with its class is imported.
"""

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar, Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.drive.passability import Passability
from fieldtruth.drive.track import STEP_NS, PoseAt, Stamps, Track, poses_of, stamps_at_rate, standing_at, steps_at_rate
from fieldtruth.experiment.light_config import LightConfig, WeatherConfig
from fieldtruth.experiment.rig import Box, Cylinder, Rig, visible_parts
from fieldtruth.experiment.sensor_config import Output, SensorConfig
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.sense.interval import STILL, Moving
from fieldtruth.sense.leaning import Leaning
from fieldtruth.sense.scene import Scene
from fieldtruth.world.model import World

_Made = TypeVar("_Made")
SENSORS: Final[dict[type[SensorConfig], type["Sensor"]]] = {}
"""Sensors by the class of their configuration."""


class _Shared:
    """Keeps what is made once, and used by many threads."""

    def __init__(self) -> None:
        self._lock, self._made = threading.RLock(), dict[Hashable, Any]()

    def once(self, key: Hashable, make: Callable[[], _Made]) -> _Made:
        """Return the result of ``make``, called for the first request of this key only."""
        if key not in self._made:
            with self._lock:
                if key not in self._made:
                    self._made[key] = make()
        made: _Made = self._made[key]
        return made


class SensorWorld(_Shared):
    """A world in its light and weather, with the robot that carries the sensors. Threads may share it.

    Args:
        world: what they sense.
        rig: the robot.
        light: of photographs.
        weather: of photographs, and of sensors with a signal.
        scene: the world in the ray tracer, if it was built.
        baked: the scene with its light, if it was baked.
        seed: root of all randomness; None for the world's.
        reuse: whether the arrays of a reading may be overwritten by the next one, which saves time.
        workers: threads that may work on one reading.
        moving: what moves, which LiDARs and cameras see; that of the scene, if it is given.
    """

    def __init__(
        self,
        world: World,
        rig: Rig,
        light: LightConfig | None = None,
        weather: WeatherConfig | None = None,
        *,
        scene: Scene | None = None,
        baked: BakedScene | None = None,
        seed: int | None = None,
        reuse: bool = False,
        workers: int = 1,
        moving: Moving = STILL,
    ) -> None:
        super().__init__()
        self.seed = world.seed if seed is None else seed
        """Root of all randomness."""
        self.world, self.rig, self.reuse, self.workers, self.moving = world, rig, reuse, workers, moving
        self.light, self.weather = light or LightConfig(), weather or WeatherConfig()
        if scene is not None:
            self.once("scene", lambda: scene)
        if baked is not None:
            self.once("scene", lambda: baked.scene)
            self.once("baked", lambda: baked)

    def leant(self, leaning: Leaning) -> "SensorWorld":
        """Return the same, in which other plants lean."""
        options: dict[str, Any] = {"seed": self.seed, "reuse": self.reuse, "workers": self.workers}
        moving = replace(self.moving, leaning=leaning)
        return SensorWorld(self.world, self.rig, self.light, self.weather, moving=moving, **options)

    @property
    def wide_ids(self) -> bool:
        """Return whether instance ids need more than 16 bits."""
        return self.world.has_wide_ids

    @property
    def scene(self) -> Scene:
        """The world in the ray tracer; built at the first use."""
        return self.once("scene", lambda: Scene(self.world, self.moving))

    @property
    def baked(self) -> BakedScene:
        """The scene with its light; baked at the first use."""
        return self.once("baked", lambda: bake(self.scene, self.light, self.weather))

    @property
    def passability(self) -> Passability:
        """What it takes the robot to press down what is in the world; computed at the first use."""
        return self.once("passability", lambda: Passability(self.world, self.rig.robot, len(self.moving.bodies)))

    @cached_property
    def robot_parts(self) -> Sequence[Box | Cylinder]:
        """Parts of the robot that its sensors see."""
        return visible_parts(self.rig)


class Movement(_Shared):
    """Motion of the robot that carries the sensors, as far as it is known. Threads may share it.

    Args:
        pose: ``world_from_base`` at one stamp or several.
        track: the drive, which sensors of motion need.
    """

    def __init__(self, pose: PoseAt, track: Track | None = None) -> None:
        super().__init__()
        self.pose = pose
        self._track = track

    @property
    def track(self) -> Track:
        """The drive."""
        assert self._track is not None
        return self._track

    @property
    def stands(self) -> bool:
        """Return whether each pose is one by itself, at which the robot stands."""
        return self._track is not None and self._track.is_frames


def movement_of(track: Track) -> Movement:
    """Return the motion of a drive, to the end of the last sweep."""
    return Movement(poses_of(track.swept), track)


def standing(world_from_base: Array) -> Movement:
    """Return the motion of a robot that stands at a pose (4, 4)."""
    return Movement(standing_at(world_from_base))


class At(NamedTuple):
    """Stamps of a reading, and the motion around it."""

    number: Any
    """Of the reading, from 0: int, or (n,) of a series, whose stamps are (n,), too."""
    stamp_ns: Any
    """True time [ns]."""
    header_ns: Any
    """Time [ns] that the sensor's clock shows."""
    movement: Movement
    next_ns: int | None = None
    """Stamp [ns] of the next reading that is not lost; None after the last."""

    @property
    def stamps(self) -> dict[str, Any]:
        """Stamps of the reading, as ``core.readings`` names them."""
        return {"stamp_ns": self.stamp_ns, "header_ns": self.header_ns}


class Rays(NamedTuple):
    """Rays of a reading, and what traces them, for a comparison with the bare ray tracer."""

    directions: Float32Array
    """(h, w, 3) unit vectors in the frame of the reading."""
    far: float
    """Their length [m]."""
    tasks: Sequence[Mapping[str, Callable[[Array], object]]]
    """Called with a pose (4, 4) of that frame, by name; those of one mapping at each pose one after another."""


class Sensor(ABC):
    """A sensor in a world. Use one per thread: each owns its buffers.

    A subclass that sets ``config_type`` makes its kind known.

    Args:
        config: of type ``config_type``.
        sensor_world: shared by all sensors.
    """

    config_type: ClassVar[type[SensorConfig]]
    needs_light: ClassVar[bool] = False
    """True if a reading needs the light of the world, which is then baked before the first one."""

    def __init__(self, config: Any, sensor_world: SensorWorld) -> None:
        self.config, self.sensor_world = config, sensor_world

    def __init_subclass__(cls) -> None:
        """Make the kind known."""
        super().__init_subclass__()
        if "config_type" in vars(cls):
            SENSORS[cls.config_type] = cls

    @abstractmethod
    def truth(self, output: Output, at: At) -> Any:
        """Return the reading of an ideal sensor; of one with a signal, what its ``signal`` begins with."""

    def signal(self, output: Output, at: At, truth: Any) -> Any:
        """Return the reading that a real sensor makes of the truth, if the configuration has a signal."""
        return truth

    @abstractmethod
    def messages(self, output: Output, number: Any, reading: Any) -> Iterable[bytes]:
        """Serialise a reading: a message for each topic of the output."""

    def labels(self, output: Output, at: At) -> NDArray[np.uint8]:
        """Return the class ids of a reading without a signal: of the points (n,), or the pixels (h, w)."""
        labels: NDArray[np.uint8] = self.truth(output, at).label
        return labels

    def rays(self) -> Rays | None:
        """Return the rays of the first reading at a stamp, for ``bench``; None: it does not measure this sensor."""
        return None

    def difference(self, output: Output, reading: Any, messages: Sequence[Any]) -> str:
        """State in what the decoded messages of a bag differ from a reading that was made again; empty: in nothing.

        By default nothing is compared.
        """
        return ""

    def facts(self, movement: Movement) -> list[str]:
        """Return lines of the data card about what it has measured along a drive, if there is anything to say."""
        return []

    def read(self, output: Output, at: At) -> Any:
        """Return a reading as arrays: one of the types of ``core.readings``, or the kind's own."""
        truth = self.truth(output, at)
        return truth if output.ideal or self.config.signal is None else self.signal(output, at, truth)


class MotionSensor(Sensor):
    """A sensor that measures the robot's own motion. Its noise has a memory, so its readings are made in their order.

    It reads at steps of the physics; ``sees`` of its configuration is false. Readings depend neither on what follows
    them, nor on how a motion is cut into calls of ``extend``. Some come at 1000 Hz, so ``reading`` and ``messages``
    take n at once: numbers and stamps are then (n,), and messages are in the order of the readings, then of the topics.
    """

    @abstractmethod
    def begin(self) -> Any:
        """Return the memory of a sensor at the start of a drive, which can be copied: readings go on from it."""

    @abstractmethod
    def extend(self, memory: Any, track: Track) -> tuple[Any, Any]:
        """Return the ideal and the measured readings that are due since the last call with this memory.

        ``track`` is the whole motion, or its rows since the last reading that was made.
        """

    @abstractmethod
    def reading(self, output: Output, at: At, series: Any) -> Any:
        """Return reading ``at.number``, or a series, of those that one call of ``extend`` has returned."""

    def series(self, movement: Movement) -> tuple[Any, Any]:
        """Return all ideal and all measured readings along a drive; made once."""
        return movement.once(self.config.name, lambda: self.extend(self.begin(), movement.track))

    def truth(self, output: Output, at: At) -> Any:
        """Return the reading of an ideal sensor."""
        return self.reading(output, at, self.series(at.movement)[0])

    def read(self, output: Output, at: At) -> Any:
        """Return a reading."""
        true, measured = self.series(at.movement)
        return self.reading(output, at, true if output.ideal else measured)


def stamps_of(config: SensorConfig, output: Output, end_ns: int) -> Stamps:
    """Return the stamps [ns] of the readings of a sensor, up to and including ``end_ns``.

    A sensor of motion reads at steps of the physics.
    """
    if config.sees:
        return stamps_at_rate(output.rate_hz, end_ns)
    return steps_at_rate(output.rate_hz, end_ns) * STEP_NS
