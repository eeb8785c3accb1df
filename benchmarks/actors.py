# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What actors cost: time of a scan and of a photograph among them over that in the still scene, side by side.

Run: python benchmarks/actors.py [COUNT ...] [--environment park] [--repeats N]

People wander within some metres of the robot. Each reading is made in both scenes in turn, in one process, and the
table has medians [ms] of both and their ratio; the last line what the actors' own motion takes.
"""

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any, Final

from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment, validated
from fieldtruth.record.streams import series_along
from fieldtruth.sensors.known import new_sensors
from fieldtruth.simulation.stepped import Driven, Simulation

SECONDS: Final = 1.5
UP: Final = {"xyz": [0.3, 0.0, 0.9]}
RIG: Final[dict[str, Any]] = {
    "sensors": [
        {"kind": "imu"},
        {"kind": "gnss"},
        {"kind": "lidar", "name": "spinning", "columns": 1024, "rings": 64, "spinning": True, "mount": UP},
        {"kind": "lidar", "name": "instantaneous", "columns": 1024, "rings": 64, "mount": UP, "topic": "/whole/points"},
        {"kind": "camera", "name": "photograph", "width": 640, "height": 360, "mount": UP},
    ]
}


def experiment_with(count: int, environment: str) -> Experiment:
    """Return the first experiment of an environment with people who wander."""
    base = load_experiment(f"{environment}_1")
    people = {"people": {"kind": "person", "count": count, "behaviour": "wander"}} if count else {}
    route = None if base.route is None else base.route.model_dump()
    values = {"name": "cost", "environment": environment, "seconds": SECONDS, "rig": RIG, "route": route}
    return validated(values | {"actors": people}, "")


def reading_of(driven: Driven, name: str) -> Callable[[], object]:
    """Return the function that makes a reading of a sensor in the middle of a drive."""
    made, world = driven.experiment, driven.sensor_world
    config = next(each for each in made.rig.in_order() if each.name == name)
    sensor = new_sensors(world)[name]
    if sensor.needs_light:
        world.baked  # noqa: B018
    series = series_along(config, made.rig, driven.track, made.noise_seed)[0]
    at = series.at(len(series.stamps_ns) // 2, driven.movement)
    return lambda: sensor.read(series.output, at)


def medians(readings: list[Callable[[], object]], repeats: int) -> list[float]:
    """Return the median time [ms] of each reading, made in turn after one that does not count."""
    times: list[list[float]] = [[] for _ in readings]
    for number in range(repeats + 1):
        for own, read in zip(times, readings, strict=True):
            began = time.perf_counter()
            read()
            own += [1e3 * (time.perf_counter() - began)] * (number > 0)
    return [statistics.median(own) for own in times]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("counts", type=int, nargs="*", default=[20], metavar="COUNT")
    parser.add_argument("--environment", default="park")
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    still = Simulation(experiment_with(0, options.environment)).drive()
    print(f"{'actors':>6}  {'reading':14} {'still':>8} {'among':>8}  ratio")
    for count in options.counts:
        simulation = Simulation(experiment_with(count, options.environment))
        began = time.process_time()
        among = simulation.drive()
        took = time.process_time() - began
        for name in ("instantaneous", "spinning", "photograph"):
            without, with_them = medians([reading_of(still, name), reading_of(among, name)], options.repeats)
            print(f"{count:6}  {name:14} {without:8.1f} {with_them:8.1f}  {with_them / without:.2f}")
        print(f"{count:6}  drive and motion of all: {took:.1f} s of the processor for {SECONDS:g} s")


if __name__ == "__main__":
    main()
