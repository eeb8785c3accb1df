# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""All readings of a drive in time order: the robot drives first, and threads sense ahead."""

import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from functools import wraps
from itertools import groupby
from pathlib import Path
from typing import Any

from fieldtruth.core import transforms
from fieldtruth.core.parallel import cpu_count, in_order
from fieldtruth.drive.track import state_at
from fieldtruth.experiment.config import Experiment
from fieldtruth.record.streams import Series, sensor_factory, series_along
from fieldtruth.sense.scene import Scene
from fieldtruth.simulation.due import Frame, frame_of
from fieldtruth.simulation.stepped import Driven, Simulation
from fieldtruth.world.model import World


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
    simulation = Simulation(experiment, world=world, scene=scene, sensors=sensors)

    def drive() -> Iterator[Frame]:
        sensing = _Sensing(simulation.drive(), simulation.wanted)
        yield from in_order(sensing.due(), sensing.frame, cpu_count() if workers is None else workers)

    return drive()


class _Sensing:
    """The readings of a drive that are wanted, and what makes a frame of those with the same stamp."""

    def __init__(self, driven: Driven, wanted: set[str]) -> None:
        self._driven, rig = driven, driven.experiment.rig
        self._series = [
            series
            for config in rig.in_order()
            for series in series_along(config, rig, driven.track, driven.experiment.noise_seed)
            if series.output.name in wanted
        ]
        names = {series.config.name for series in self._series}
        kept = tuple(config for config in rig.sensors if config.name in names)
        self._new_sensors = sensor_factory(driven.sensor_world, rig.model_copy(update={"sensors": kept}))
        self._thread = threading.local()

    def due(self) -> Iterator[tuple[int, list[tuple[Series, int]]]]:
        """Yield each stamp with the readings that have it: series and row in it."""
        found = [
            (int(series.stamps_ns[number]), order, k)
            for order, series in enumerate(self._series)
            for k, number in enumerate(series.clock.kept.tolist())
        ]
        for stamp_ns, group in groupby(sorted(found), key=lambda each: each[0]):
            yield stamp_ns, [(self._series[order], k) for _, order, k in group]

    def frame(self, group: tuple[int, list[tuple[Series, int]]]) -> Frame:
        """Sense a group of ``due`` in the calling thread."""
        stamp_ns, due = group
        if not hasattr(self._thread, "sensors"):
            self._thread.sensors = self._new_sensors()
        pose = state_at(self._driven.track.motion, stamp_ns).world_from_base
        sensors, movement = self._thread.sensors, self._driven.movement
        readings = (sensors[series.config.name].read(series.output, series.at(k, movement)) for series, k in due)
        return frame_of(stamp_ns, pose, zip((series.output.name for series, _ in due), readings, strict=True))


def _moved(name: str) -> Callable[..., Any]:
    """Return a function of ``transforms`` that warns of its old name."""
    function: Callable[..., Any] = getattr(transforms, name)

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        warnings.warn(f"ft.frames.{name} is ft.transforms.{name} now", DeprecationWarning, stacklevel=2)
        return function(*args, **kwargs)

    return call


for _name in (name for name, value in vars(transforms).items() if callable(value)):
    setattr(frames, _name, _moved(_name))
