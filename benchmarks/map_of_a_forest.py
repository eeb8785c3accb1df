# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Time and memory of a map of a large forest: the built-in one, repeated side by side.

Run: python benchmarks/map_of_a_forest.py [--side 500] [--resolution 0.1] [--to geotiff] [--workers 2] [--folder .]
     [--layers ground,slope]

The terrain is one plane, with the trees, bushes, dead wood, stones and herbs of the forest in every 100 m x 50 m of it.
Docs: docs/maps.md.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event, Thread

import numpy as np

from fieldtruth.world.build import load_world
from fieldtruth.world.model import Heightfield, Raster, World
from fieldtruth.world_maps import write_map


def repeated(world: World, side: float) -> World:
    """The world side by side over a square [m], on level ground."""
    length, width = world.size
    shifts = [
        (x, y)
        for x in np.arange((length - side) / 2, side / 2, length)
        for y in np.arange((width - side) / 2, side / 2, width)
    ]
    instances, swarms = [], []
    for x, y in shifts:
        for each in world.instances:
            pose = each.world_from_object.copy()
            pose[:2, 3] += x, y
            instances.append(replace(each, world_from_object=pose))
    for swarm in world.swarms:
        own = (np.abs(swarm.world_from_object[:, :2, 3]) <= (length / 2, width / 2)).all(axis=1)
        poses = np.concatenate([swarm.world_from_object[own]] * len(shifts))
        poses[:, :2, 3] += np.repeat(shifts, own.sum(), axis=0)
        mesh, tint = np.tile(swarm.mesh[own], len(shifts)), np.tile(swarm.tint[own], (len(shifts), 1))
        swarms.append(replace(swarm, mesh=mesh, world_from_object=poses, tint=tint))
    grid = {"spacing": side, "x0": -side / 2, "y0": -side / 2}
    terrain = replace(
        world.terrain,
        field=Heightfield(heights=np.zeros((2, 2), np.float32), **grid),
        trail_distance=Raster(values=np.ones((2, 2), np.float32), **grid),
        cover=Raster(values=np.ones((2, 2, len(world.terrain.ground_materials)), np.float32), **grid),
        layer=None,
        snow=None,
        colour=None,
    )
    return replace(world, size=(side, side), terrain=terrain, instances=tuple(instances), swarms=tuple(swarms))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--side", type=float, default=500.0)
    parser.add_argument("--resolution", type=float, default=0.1)
    parser.add_argument("--to", default="geotiff")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--layers", help="by default all, which need 87 bytes a cell while they are made")
    options = parser.parse_args()
    world = repeated(load_world("forest"), options.side)
    members = len(world.instances) + sum(len(swarm.mesh) for swarm in world.swarms)
    before, most, done = own_memory(), [0], Event()
    watch = Thread(target=watch_memory, args=(most, done), daemon=True)
    watch.start()
    with TemporaryDirectory(dir=options.folder) as folder:
        start = time.monotonic(), time.process_time()
        made = {"to": options.to, "resolution": options.resolution, "workers": options.workers}
        layers = None if options.layers is None else options.layers.split(",")
        out = write_map(world, Path(folder) / "map", layers=layers, **made)
        size = sum(path.stat().st_size for path in ([out] if out.is_file() else out.iterdir()))
        wall, processor = time.monotonic() - start[0], time.process_time() - start[1]
    cells = round(options.side / options.resolution) ** 2
    done.set()
    watch.join()
    print(f"{cells / 1e6:g} million cells, {members} objects: {wall:.0f} s, {processor:.0f} s of processor time")
    print(f"{size / 1e6:.0f} MB of output")
    print(f"memory without files: {before / 1e6:.0f} MB with the world, {most[0] / 1e6:.0f} MB at most")


def own_memory() -> int:
    """Memory [byte] of this process, without files that are mapped."""
    lines = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return int(lines["RssAnon"].split()[0]) * 1024


def watch_memory(most: list[int], done: Event) -> None:
    while not done.wait(0.1):
        most[0] = max(most[0], own_memory())


if __name__ == "__main__":
    main()
