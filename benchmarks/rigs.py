# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cost of rigs, and of one more sensor, in one world whose scene all sensors share.

Run: python benchmarks/rigs.py [--environment NAME] [--seconds S] [--tries N] [--workers N]

- rigs: images and scans per second, each over the time of the whole recording; rigs take turns, the best try counts.
- sensors: time of recording a LiDAR and one more sensor, minus that of the LiDAR alone, over the time of that sensor
  alone. 1 means that sensors share the scene and nothing else. They take turns, too.
- memory: what the process holds more after the scene, which is in it once, and the arrays of each rig's sensors in it.
"""

import argparse
import os
import tracemalloc
from collections.abc import Callable, Iterable, Iterator, Mapping
from math import ceil
from pathlib import Path
from typing import Final

from views import Recorded, record

import fieldtruth as ft
from fieldtruth.bench import settings_of
from fieldtruth.bench.sensors import Stretches, sensors_of
from fieldtruth.drive.simulate import drive
from fieldtruth.experiment.files import with_overrides
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.world.build import world_of
from fieldtruth.world.model import World

Row = dict[str, float | str]
Work = Callable[[Rig], Recorded]

IMAGE: Final = {"width": 640, "height": 360, "rate_hz": 5.0}
MANY: Final = [
    {"kind": "lidar", "name": "top", "model": "vlp_16", "mount": {"xyz": [0, 0, 0.9]}},
    {"kind": "lidar", "name": "low", "model": "vlp_16", "mount": {"xyz": [0.55, 0, 0.2], "rpy_deg": [0, 15, 0]}},
    {"kind": "stereo", "name": "pair", "mount": {"xyz": [0.3, 0, 0.6]}, **IMAGE},
    {"kind": "camera", "name": "front", "mount": {"xyz": [0.4, 0, 0.7]}, **IMAGE},
    {"kind": "camera", "name": "rear", "mount": {"xyz": [-0.5, 0, 0.5], "rpy_deg": [0, 10, 180]}, **IMAGE},
    {"kind": "camera", "name": "fisheye", "model": "fisheye_190", "mount": {"xyz": [0.5, 0, 0.4]}, **IMAGE},
    {
        "kind": "camera", "name": "panorama", "mount": {"xyz": [0, 0, 1.1]}, **IMAGE,
        "lens": {"model": "equirectangular"}, "horizontal_fov_deg": 360, "vertical_fov_deg": 180,
    },
]  # fmt: skip
RIGS: Final = {
    "paper": Rig(),
    "many": Rig.model_validate({"sensors": MANY}),
    "one LiDAR": Rig.model_validate({"sensors": MANY[:1]}),
}


def only(*sensors: SensorConfig) -> Rig:
    """A rig of these sensors."""
    return Rig(sensors=sensors)


def best(tries: int, rigs: Mapping[str, Rig], work: Work) -> dict[str, Recorded]:
    """Let rigs take turns, so that other load slows all; of each the fastest try."""
    found: dict[str, list[Recorded]] = {name: [] for name in rigs}
    for _ in range(tries):
        for name, rig in rigs.items():
            found[name].append(work(rig))
    return {name: min(rows) for name, rows in found.items()}


def held_mb() -> float:
    """Memory [10^6 bytes] that this process holds now (Linux)."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def rates(tries: int, work: Work) -> Iterator[Row]:
    """Images and scans per second of each rig."""
    for name, (took, images, scans) in best(tries, RIGS, work).items():
        yield {"rig": name, "took s": took, "images/s": images / took, "scans/s": scans / took}


def added(tries: int, work: Work) -> Iterator[Row]:
    """Cost of each sensor beside the first LiDAR, and over its cost alone."""
    first, *others = RIGS["many"].sensors
    for other in others:
        rigs = {"base": only(first), "alone": only(other), "both": only(first, other)}
        took = {name: found.took_s for name, found in best(tries, rigs, work).items()}
        more = took["both"] - took["base"]
        yield {"sensor": other.name, "alone s": took["alone"], "added s": more, "added/alone": more / took["alone"]}


def memory(world: World, light: LightConfig) -> Iterator[Row]:
    """Memory of scene and light, and of the arrays of the sensors of each rig in it, of one worker."""
    before = held_mb()
    baked = ft.bake(ft.Scene(world), light)
    yield {"part": "scene and light", "MB": held_mb() - before}
    for name, rig in RIGS.items():
        tracemalloc.start()
        kept = sensors_of(baked, rig, used=True)
        yield {"part": f"sensors of the rig: {name}", "MB": tracemalloc.get_traced_memory()[0] / 1e6}
        tracemalloc.stop()
        del kept


def show(rows: Iterable[Row]) -> None:
    """Print a table, row by row."""
    for k, row in enumerate(rows):
        if k == 0:
            print("\n" + "".join(f"{key:>16}" if j else f"{key:<32}" for j, key in enumerate(row)))
        cells = (f"{value:>16.3g}" if isinstance(value, float) else f"{value:<32}" for value in row.values())
        print("".join(cells), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--environment", default="park")
    parser.add_argument("--seconds", type=float, default=2.0, help="simulated time of each recording")
    parser.add_argument("--tries", type=int, default=3)
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    experiment = with_overrides(settings_of(options.environment).experiment, seconds=options.seconds)
    world = world_of(experiment)
    show(memory(world, experiment.light))
    baked, track = ft.bake(ft.Scene(world), experiment.light), drive(world, experiment)

    def work(rig: Rig) -> Recorded:
        return record(baked, track, rig, Stretches(tuple(range(ceil(options.seconds))), 1000), workers=options.workers)

    show(rates(options.tries, work))
    show(added(options.tries, work))


if __name__ == "__main__":
    main()
