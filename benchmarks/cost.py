# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Figures and pictures of docs/cost.md.

python benchmarks/cost.py steps                           greatest step of each robot
python benchmarks/cost.py curves docs/cost_curves.png     slip and energy of a Husky by slope and soil
python benchmarks/cost.py sweeps park -1,-1,1,1 [SPOTS]   sweeps of an area against its spots driven singly, or some
python benchmarks/cost.py picture park PICTURE MAP.npz... maps of robots beside what is there
"""

import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

import fieldtruth as ft
from fieldtruth.cost.stretch import Cause, Passage, SpotRobot
from fieldtruth.cost.tiles import Order, TileDrives
from fieldtruth.experiment.catalogue import ROBOTS
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.world.model import Heightfield, Raster, World
from fieldtruth.world_maps import grid_of
from fieldtruth.world_maps.layers import Grid

SOILS = ("paving", "trodden_earth", "lawn", "forest_floor", "scree", "sand")
STEP_SOILS = ("paving", "trodden_earth", "lawn", "forest_floor")
HEIGHTS = np.arange(0.04, 0.361, 0.02)
SLOPES = np.arange(-24, 25, 3)
COLOURS = ("black", "0.8", "tab:blue", "tab:red", "tab:purple", "tab:orange", "gold", "tab:brown")
Layers = dict[str, NDArray[Any]]


def ground(like: World, soil: str, slope_deg: float = 0.0, step: float = 0.0) -> World:
    """A plane of one soil that rises along x, with a step [m] at x = 0."""
    x = np.linspace(-10.0, 10.0, 401)
    heights = np.where(x < 0.0, 0.0, step) + np.tan(np.radians(slope_deg)) * x
    heights = np.repeat(heights[:, None], 401, axis=1).astype(np.float32)
    field = Heightfield(heights=heights, spacing=0.05, x0=-10.0, y0=-10.0)
    far = Raster(values=np.full((2, 2), 100.0, np.float32), spacing=100.0, x0=-50.0, y0=-50.0)
    cover = replace(far, values=np.ones((2, 2, 1), np.float32))
    name, material = next(iter(like.materials.items()))
    terrain = replace(
        like.terrain, field=field, layer=None, trail_distance=far, cover=cover, ground_materials=(name,),
        trail_material=name, border_material=name,
    )  # fmt: skip
    materials = {name: replace(material, ground_type=soil)}
    return replace(
        like, size=(20.0, 20.0), terrain=terrain, instances=(), swarms=(), water_level=None, materials=materials
    )


def over(world: World, robot: str, speed: float) -> tuple[Cause, Passage]:
    """Drive over the middle of a world, along x."""
    return SpotRobot(world, Rig.model_validate({"robot": robot}), np.zeros(2)).over(np.zeros(2), 0.0, speed)


def steps() -> None:
    """Print the highest step, of multiples of 2 cm, that each robot climbs at 0.3 m/s."""
    like = ft.load_world("park", 0)
    print("| robot | " + " | ".join(STEP_SOILS) + " |")
    for robot in ROBOTS:
        found = []
        for soil in STEP_SOILS:
            climbed = 0.0
            for height in HEIGHTS:
                if over(ground(like, soil, step=float(height)), robot, 0.3)[0] != Cause.PASSES:
                    break
                climbed = float(height)
            found.append(f"{climbed * 100:.0f}")
        print(f"| `{robot}` | " + " | ".join(found) + " |", flush=True)


def curves(path: str) -> None:
    """Draw slip and energy of a Husky at 0.5 m/s by slope and soil; a cross: it does not get up."""
    from matplotlib import pyplot

    like, (_, (left, right)) = ft.load_world("park", 0), pyplot.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for soil in SOILS:
        found = [over(ground(like, soil, float(slope)), "husky", 0.5) for slope in SLOPES]
        [line] = left.plot(SLOPES, [costs.slip for _, costs in found], ".-", label=soil)
        right.plot(SLOPES, [costs.energy for _, costs in found], ".-", color=line.get_color())
        stops = [slope for slope, (cause, _) in zip(SLOPES, found, strict=True) if cause != Cause.PASSES]
        print(soil, [(int(s), c.name) for s, (c, _) in zip(SLOPES, found, strict=True) if c], flush=True)
        left.plot(stops, [0.75 + 0.02 * SOILS.index(soil)] * len(stops), "x", color=line.get_color())
    up = SLOPES[SLOPES >= 0]
    right.plot(up, 50.0 * GRAVITY * np.tan(np.radians(up)), "k:", label="weight alone")
    for axes, label in ((left, "slip"), (right, "energy [J/m]")):
        axes.set(xlabel="slope [deg]", ylabel=label)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    pyplot.savefig(path, dpi=90)


def read(path: str) -> tuple[Layers, Grid, int]:
    """Return the layers of a map, its grid, and the number of its headings."""
    with np.load(path) as file:
        layers = dict(file)
    shape = layers["passes_v1"].shape
    grid = Grid(float(layers["x0"]), float(layers["y0"]), float(layers["resolution"]), (shape[0], shape[1]))
    return layers, grid, sum(name.startswith("cause_v1_h") for name in layers)


def sweeps(environment: str, area: str, count: str = "1000000") -> None:
    """Print processor times of sweeps over an area and of its spots, or some of them, and how the outcomes differ."""
    world = ft.load_world(environment, 0)
    order = Order(Rig(), grid_of(world, 0.25, [float(v) for v in area.split(",")]), 8)
    over(world, "husky", 1.0)  # which loads the kernels
    [tile], began = order.tiles(), time.process_time()
    swept = TileDrives(world, order).costs(tile, 1.0)
    took = time.process_time() - began
    share = (swept.cause == Cause.PASSES).mean()
    print(f"{environment}: {swept.cause.size} spots, {share:.3f} pass; swept in {took:.1f} s", flush=True)
    spots = [
        (k, line, n)
        for k, angle in enumerate(order.angles())
        for line in order.lines(tile, float(angle))
        for n in range(len(line.spots))
    ]
    chosen = np.random.default_rng(0).permutation(len(spots))[: int(count)].tolist()
    robot, wrong, off = SpotRobot(world, order.rig, np.mean(order.middles(tile), axis=1)), [], []
    began = time.process_time()
    for k, line, n in (spots[row] for row in chosen):
        cause, costs = robot.sweep(line.xy, line.spots[n : n + 1], float(order.angles()[k]), 1.0)[0]
        at = line.cells[0][n], line.cells[1][n], k
        wrong.append((int(swept.cause[at]), int(cause)))
        off.append(np.abs(swept.values[at] - np.array(costs)))
    print(f"{len(chosen)} singly in {time.process_time() - began:.1f} s")
    kinds = Counter(each for each in wrong if each[0] != each[1])
    passing = sum((a == 0) != (b == 0) for a, b in wrong) / len(wrong)
    print(f"cause wrong: {kinds.total() / len(wrong):.4f}; whether it passes: {passing:.4f}; (swept, singly): {kinds}")
    found = np.array(off)[~np.isnan(off).any(axis=1)]
    for name, each in zip(Passage._fields, found.T, strict=True):
        print(f"{name} {each.mean():.4f} ({np.percentile(each, 95):.4f}), at most {each.max():.3f}")


def picture(environment: str, path: str, *maps: str) -> None:
    """Draw what is there, and for each map the mean energy, over it in black where no heading passes."""
    from matplotlib import pyplot

    world = ft.load_world(environment, 0)
    _, grid, _ = read(maps[0])
    (x0, y0), (x1, y1) = (
        (grid.x0, grid.y0),
        (grid.x0 + grid.shape[0] * grid.resolution, grid.y0 + grid.shape[1] * grid.resolution),
    )
    with TemporaryDirectory() as folder:
        seen = ft.write_map(world, Path(folder) / "seen.npz", to="npz", area=[x0, y0, x1, y1], workers=1)
        with np.load(seen) as file:
            ids = np.where(file["plant_top_class"] > 0, file["plant_top_class"], file["ground_class"])
            ids = np.where(file["overhang_class"] > 0, file["overhang_class"], ids)
            obstacle = file["obstacle"] > 0
    image = ft.PALETTE[ids]
    image[obstacle] //= 2
    figure, axes = pyplot.subplots(
        1, 1 + len(maps), figsize=(4 * (1 + len(maps)), 4), layout="constrained", squeeze=False
    )

    def turned(values: NDArray[Any]) -> NDArray[Any]:
        return values[::-1, ::-1]

    box = (-y1, -y0, x0, x1)  # north up, west to the left
    axes[0, 0].imshow(turned(image), extent=box)
    axes[0, 0].set_title(f"{environment}: classes, obstacles dark", fontsize=9)
    for each, name in zip(axes[0, 1:], maps, strict=True):
        layers, _, headings = read(name)
        weight = np.nanmedian(layers["energy_v1"])
        share = layers["passes_v1"] / headings
        drawn = each.imshow(turned(layers["energy_v1"] / weight), extent=box, vmin=0.5, vmax=2.0, cmap="viridis")
        each.imshow(turned(np.where(share < 1.0, 1.0 - share, np.nan)), extent=box, cmap="Reds", vmin=0.0, vmax=1.0)
        each.set_title(f"{Path(name).stem}: median {weight:.0f} J/m, {share.mean():.0%} pass", fontsize=9)
        figure.colorbar(drawn, ax=each, shrink=0.7, label="energy over its median")
    pyplot.savefig(path, dpi=80)


if __name__ == "__main__":
    known: dict[str, Any] = {"steps": steps, "curves": curves, "sweeps": sweeps, "picture": picture}
    name, *arguments = sys.argv[1:] or [""]
    if name not in known:
        print(f"error: the first argument must be one of {', '.join(known)}, got {name!r}", file=sys.stderr)
        sys.exit(2)
    known[name](*arguments)
