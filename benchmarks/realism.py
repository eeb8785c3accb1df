# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clouds beside a real frame: an Ouster OS1-64 on a Warthog in bush and grass (RELLIS-3D, frame 000104).

Run: python benchmarks/realism.py [--signal ideal|datasheet|FILE] [--count N]

A LiDAR as that of the frame (64 rings of +16.6 to -16.6 deg, 2,048 columns, from 0.8 m) stands at N poses beside each
route. Read from the bag, as a user would:

- returns: share of rays with a return, of all rings, those above the horizon, and those from -4 to -14.5 deg.
- median range [m] of what is farther than 2.5 m; nearer, a fifth of the real returns are the robot and people.
- jumps: of neighbours in a ring, both on trunks or treetops, those farther than 0.5 m apart in range; the median and
  the 90th percentile of all differences [m].
- noise [mm]: second difference of range along the ring between 4 and 15 m, as a standard deviation of one range
  (1.4826 MAD / sqrt 6); the relief of the ground is in it.
- reflectivity: median by class over that of grass.
- drops: share of rays that meet a surface and return nothing, by its range and by the angle of incidence (with a signal
  only).
"""

import argparse
import itertools
import tempfile
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

import fieldtruth as ft
from fieldtruth.bag.decode import points
from fieldtruth.experiment.files import parse_experiment, read_signal, with_overrides

RINGS: Final = 64
COLUMNS: Final = 2048
FOV_DEG: Final = 33.2
ROUTES: Final = ("park_2", "lake_1", "forest_1", "hillside_1")
TREES: Final = (int(ft.Label.TRUNK), int(ft.Label.TREETOP))
GRASS: Final = (int(ft.Label.GROUND), int(ft.Label.HIGH_GRASS))
REAL: Final = {
    "returns, all [%]": 59.0,
    "returns, above the horizon [%]": 28.0,
    "returns, -4 to -14.5 deg [%]": 98.0,
    "median range beyond 2.5 m [m]": float("nan"),
    "jumps above 0.5 m on trees [%]": 33.0,
    "jump, median [m]": 0.21,
    "jump, 90th percentile [m]": 3.6,
    "noise, trail [mm]": 3.6,
    "noise, ground [mm]": 12.0,
    "noise, high grass [mm]": 12.0,
    "reflectivity, tree / grass": 1795 / 1703,
}
"""Of the real frame. Its concrete stands beside our trails, its grass beside our ground and high grass; all returns are
in its shares, of which 19 % are the robot and people within 2.5 m."""

EXPERIMENT: Final = """\
name: realism_{route}
environment: {environment}
seed: {seed}
frames: {{count: {count}, seed: 5, pitch_deg: 0, roll_deg: 0, raised_m: 0}}
rig:
  sensors:
    - kind: lidar
      name: lidar
      rings: {rings}
      columns: {columns}
      vertical_fov_deg: {fov}
      min_range: 0.8
      mount: {{xyz: [0.09, 0.0, 0.826]}}
"""


class Grid(NamedTuple):
    """Clouds as (frames, rings, columns): ``range_m``, NaN without a return, ``label``, and ``reflectivity``."""

    range_m: NDArray[np.float64]
    label: NDArray[np.uint16]
    reflectivity: NDArray[np.float64]


def recorded(route: str, signal: str, count: int, folder: Path) -> Path:
    """Record frames beside a route; returns the bag."""
    base = ft.load_experiment(route)
    text = EXPERIMENT.format(
        route=route,
        environment=base.environment,
        seed=base.seed,
        count=count,
        rings=RINGS,
        columns=COLUMNS,
        fov=FOV_DEG,
    )
    experiment = parse_experiment(text).model_copy(update={"route": base.route})
    return ft.generate(with_overrides(experiment, signal=read_signal(signal)), folder / signal.replace("/", "_"))


def grid_of(bag: Path) -> Grid:
    """Read all clouds of a bag."""
    frames: list[Grid] = []
    for reading in ft.read_bag(bag, ["/os1_cloud_node/points"]):
        cloud: Any = points(reading.message)
        at = (cloud["ring"], cloud["column"])
        xyz = np.stack([cloud[axis] for axis in "xyz"], axis=-1).astype(np.float64)
        shape = (RINGS, COLUMNS)
        grid = Grid(np.full(shape, np.nan), np.zeros(shape, np.uint16), np.full(shape, np.nan))
        grid.range_m[at], grid.label[at] = np.linalg.norm(xyz, axis=1), cloud["label"]
        if "reflectivity" in (cloud.dtype.names or ()):
            grid.reflectivity[at] = cloud["reflectivity"]
        frames.append(grid)
    return Grid(*(np.stack(parts) for parts in zip(*frames, strict=True)))


def figures(grid: Grid) -> dict[str, float]:
    """Return the figures of ``REAL`` for clouds."""
    elevation = np.linspace(FOV_DEG / 2, -FOV_DEG / 2, RINGS)
    returned = np.isfinite(grid.range_m)
    found = {
        "returns, all [%]": 100 * returned.mean(),
        "returns, above the horizon [%]": 100 * returned[:, elevation > 0].mean(),
        "returns, -4 to -14.5 deg [%]": 100 * returned[:, (elevation < -4) & (elevation > -14.5)].mean(),
        "median range beyond 2.5 m [m]": float(np.nanmedian(grid.range_m[grid.range_m > 2.5])),
    }
    jump = np.abs(np.diff(grid.range_m, axis=2))
    on_trees = np.isin(grid.label, TREES)
    jump = jump[on_trees[:, :, 1:] & on_trees[:, :, :-1] & np.isfinite(jump)]
    if jump.size:
        found["jumps above 0.5 m on trees [%]"] = 100 * float((jump > 0.5).mean())
        found["jump, median [m]"], found["jump, 90th percentile [m]"] = map(float, np.quantile(jump, [0.5, 0.9]))
    for name, label in (
        ("trail", ft.Label.TRAIL),
        ("ground", ft.Label.GROUND),
        ("high grass", ft.Label.HIGH_GRASS),
    ):
        found[f"noise, {name} [mm]"] = 1000 * noise(grid, int(label))
    grass = grid.reflectivity[np.isin(grid.label, GRASS)]
    trees = grid.reflectivity[on_trees]
    if np.isfinite(grass).any() and np.isfinite(trees).any():
        found["reflectivity, tree / grass"] = float(np.nanmedian(trees) / np.nanmedian(grass))
    return found


def noise(grid: Grid, label: int) -> float:
    """Robust standard deviation [m] of a range of a class between 4 and 15 m, from second differences along rings."""
    usable = (grid.label == label) & (grid.range_m > 4.0) & (grid.range_m < 15.0)
    whole = usable[:, :, 2:] & usable[:, :, 1:-1] & usable[:, :, :-2]
    second = np.diff(grid.range_m, n=2, axis=2)[whole]
    if second.size < 100:
        return float("nan")
    return float(1.4826 * np.median(np.abs(second - np.median(second))) / np.sqrt(6.0))


def drops(ideal: Grid, real: Grid) -> dict[str, list[tuple[str, float]]]:
    """Share of rays with a return of the ideal LiDAR and none of the real one, by range, and by class."""
    met, lost = np.isfinite(ideal.range_m), ~np.isfinite(real.range_m)
    edges = (0, 10, 20, 40, 60, 80, 100, 120)
    by_range = []
    for low, high in itertools.pairwise(edges):
        those = met & (ideal.range_m >= low) & (ideal.range_m < high)
        if those.any():
            by_range.append((f"{low} to {high} m", 100 * float(lost[those].mean())))
    names = {int(row.label): row.name for row in ft.CLASSES}
    by_class = [
        (names[label], 100 * float(lost[met & (ideal.label == label)].mean())) for label in np.unique(ideal.label[met])
    ]
    return {"range": by_range, "class": by_class}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--signal", default="datasheet")
    parser.add_argument("--count", type=int, default=7)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        grids = {
            route: {s: grid_of(recorded(route, s, options.count, Path(folder))) for s in {"ideal", options.signal}}
            for route in ROUTES
        }
    print("|", " | ".join(["", "real", *(f"{route} {s}" for route in ROUTES for s in grids[route])]), "|")
    print("|---" * (2 + sum(map(len, grids.values()))) + "|")
    columns = [figures(grid) for by_signal in grids.values() for grid in by_signal.values()]
    for name, real in REAL.items():
        print(
            "|", name, "|", " | ".join(f"{value:.3g}" for value in (real, *(c.get(name, np.nan) for c in columns))), "|"
        )
    if options.signal != "ideal":
        for route, by_signal in grids.items():
            for kind, rows in drops(by_signal["ideal"], by_signal[options.signal]).items():
                print(f"{route}, drops by {kind}:", ", ".join(f"{name} {share:.1f} %" for name, share in rows))


if __name__ == "__main__":
    main()
