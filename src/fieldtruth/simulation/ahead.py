# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""All readings of a drive in time order, without a bag: the robot drives first, and threads sense ahead."""

import functools
import threading
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import groupby
from pathlib import Path
from typing import Any, Final

from fieldtruth.core import transforms
from fieldtruth.core.parallel import cpu_count
from fieldtruth.drive.track import Stamps, Track, state_at
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.sensor_config import Output
from fieldtruth.record.streams import Sensors, Series, sensor_factory, series_of
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.kind import Movement, SensorWorld, movement_of, stamps_of
from fieldtruth.simulation.due import wanted_outputs
from fieldtruth.simulation.frame import Frame, frame_of
from fieldtruth.simulation.motion import track_in, with_given_track
from fieldtruth.simulation.setup import experiment_for
from fieldtruth.world.build import world_of
from fieldtruth.world.model import World

_AHEAD: Final = 2
"""Frames in memory for each thread."""


def frames(
    experiment: Experiment | str | Path,
    *,
    sensors: Iterable[str] | None = None,
    world: World | None = None,
    scene: Scene | None = None,
    workers: int | None = None,
) -> Iterator[Frame]:
    """Yield the readings of a drive in time order: a frame for each stamp at which a sensor reads.

    The route, or the track file, is driven when the first frame is asked for; then threads sense ahead, a few frames
    each, while the caller works. The values are those of the bag that ``generate`` makes.

    Args:
        experiment: or its name, or the path of its file.
        sensors: names of the sensors or outputs that read, such as ``lidar`` or ``stereo/left``; None for all.
        world: replaces the experiment's.
        scene: ``world`` in the ray tracer, if it was built already.
        workers: threads; None for one per core that the process may use.

    Raises:
        UnknownNameError: an unknown name.
        RouteError, DriveError, TrackError: when the first frame is asked for: the route cannot be driven.
    """
    world = scene.world if scene is not None and world is None else world
    made, given = with_given_track(experiment_for(experiment, world=world))
    wanted = wanted_outputs(made.rig, sensors)

    def drive() -> Iterator[Frame]:
        there = world or world_of(made)
        sensor_world = SensorWorld(there, made.rig, made.light, made.weather, scene=scene, seed=made.seed)
        track = track_in(there, made, given)
        yield from _ahead(_Sensing(sensor_world, track, wanted), cpu_count() if workers is None else workers)

    return drive()


class _Sensing:
    """The readings of a drive that are wanted, and what makes a frame of those with the same stamp."""

    def __init__(self, sensor_world: SensorWorld, track: Track, wanted: set[str]) -> None:
        self._track, self._movement = track, movement_of(track)
        self._series = [
            series
            for config in sensor_world.rig.in_order()
            if config.sees or not track.is_frames
            for series in series_of(config, sensor_world.rig, self._stamps(config), sensor_world.seed)
            if series.output.name in wanted
        ]
        names = {series.config.name for series in self._series}
        kept = tuple(config for config in sensor_world.rig.sensors if config.name in names)
        self._new_sensors = sensor_factory(sensor_world, sensor_world.rig.model_copy(update={"sensors": kept}))
        self._thread = threading.local()

    def _stamps(self, config: Any) -> Callable[[Output], Stamps]:
        stamps = self._track.motion.stamps_ns
        return lambda output: stamps if self._track.is_frames else stamps_of(config, output, int(stamps[-1]))

    def due(self) -> Iterator[tuple[int, list[tuple[Series, int]]]]:
        """Yield each stamp with the readings that have it: series and row in it."""
        found = [
            (int(series.stamps_ns[number]), order, k)
            for order, series in enumerate(self._series)
            for k, number in enumerate(series.clock.kept.tolist())
        ]
        for stamp_ns, group in groupby(sorted(found), key=lambda each: each[0]):
            yield stamp_ns, [(self._series[order], k) for _, order, k in group]

    def frame(self, stamp_ns: int, due: list[tuple[Series, int]]) -> Frame:
        """Sense in the calling thread."""
        if not hasattr(self._thread, "sensors"):
            self._thread.sensors = self._new_sensors()
        pose = state_at(self._track.motion, stamp_ns).world_from_base
        return frame_of(stamp_ns, pose, (_read(series, k, self._movement, self._thread.sensors) for series, k in due))


def _read(series: Series, k: int, movement: Movement, sensors: Sensors) -> tuple[str, Any]:
    output = series.output
    return output.name, sensors[series.config.name].read(output, series.at(k, movement))


def _ahead(sensing: _Sensing, workers: int) -> Iterator[Frame]:
    """Yield frames in time order while threads sense those that follow."""
    waiting: deque[Future[Frame]] = deque()
    pool = ThreadPoolExecutor(workers, thread_name_prefix="frames")
    try:
        for stamp_ns, due in sensing.due():
            waiting.append(pool.submit(sensing.frame, stamp_ns, due))
            if len(waiting) > _AHEAD * workers:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        pool.shutdown(cancel_futures=True)


def _moved(name: str) -> Callable[..., Any]:
    """Return a function of ``transforms`` that warns of its old name."""
    function: Callable[..., Any] = getattr(transforms, name)

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        warnings.warn(f"ft.frames.{name} is ft.transforms.{name} now", DeprecationWarning, stacklevel=2)
        return function(*args, **kwargs)

    return call


for _name in (name for name, value in vars(transforms).items() if callable(value)):
    setattr(frames, _name, _moved(_name))
