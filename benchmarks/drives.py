# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Short drives of a LiDAR at poses that are known exactly, for benchmarks against the truth of the world."""

import argparse
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import fieldtruth as ft
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.files import with_overrides
from fieldtruth.experiment.rig import Rig
from fieldtruth.simulation.stepped import experiment_for
from fieldtruth.world.model import World

RIG: Final = {
    "lidar": {"model": "os1_64_gen1", "spinning": False, "columns": 1024, "rate_hz": 0.5, "parts": True},
    "cameras": {"enabled": False},
}
"""Of the paper's Husky; all rays of a scan leave at once, so that no error is one of its motion."""


class Scan(NamedTuple):
    """One turn of the LiDAR: points (n, 3) [m] in the world, and class, instance id and part of a plant of each."""

    points: Array
    label: NDArray[Any]
    instance: NDArray[Any]
    part: NDArray[Any]


class Drive(NamedTuple):
    """Scans in a world, and the poses ``world_from_lidar`` (k, 4, 4) at which they were taken."""

    world: World
    scans: list[Scan]
    poses: Array

    def distance(self, xy: Array) -> Array:
        """Distance [m] of places (n, 2) from the nearest position of the LiDAR."""
        return np.asarray(cKDTree(self.poses[:, :2, 3]).query(xy)[0], np.float64)


def driven(environment: str, seconds: float, signal: str) -> Drive:
    """Drive along the first route of an environment, from its start, with a scan every two seconds.

    Raises:
        UnknownNameError: an environment that does not exist.
    """
    return scanned(with_lidar(environment, signal, seconds=seconds))


def with_lidar(environment: str, signal: str, **values: Any) -> ft.Experiment:
    """Return the first experiment of an environment with the LiDAR, and other values; raises as ``driven``."""
    base = experiment_for(environment=environment)
    experiment = base.model_copy(update={"rig": Rig.model_validate(RIG)})
    return with_overrides(experiment, signal={"lidar": signal}, **values)


def scanned(experiment: ft.Experiment) -> Drive:
    """Sense all scans of an experiment."""
    world = ft.load_world(experiment.environment, experiment.seed, experiment.layout)
    base_from_lidar = experiment.rig.first_of(ft.LidarConfig).mount.base_from_sensor
    scans, poses = [], []
    for frame in ft.frames(experiment, sensors=["lidar"], world=world):
        cloud, pose = frame["lidar"], frame.pose @ base_from_lidar
        scans.append(Scan(transforms.transform(pose, cloud.xyz), cloud.label, cloud.instance, cloud.others["part"]))
        poses.append(pose)
    return Drive(world, scans, np.array(poses))


class Score(NamedTuple):
    """Share [%] of what was asked for that has an estimate, and figures of the errors [m] of these."""

    share: float
    bias: float
    median: float
    rmse: float
    p95: float
    """95th percentile of the absolute errors."""


FIGURES: Final = ("found %", "bias", "median", "RMSE", "95 %")
"""Names of the columns of a ``Score``."""


def score(error: Array) -> Score:
    """Figures of errors (n,) [m], NaN where there is no estimate; n is at least 1."""
    known = error[np.isfinite(error)]
    if not len(known):
        return Score(0.0, *4 * (np.nan,))
    rmse, p95 = np.sqrt((known**2).mean()), np.percentile(np.abs(known), 95)
    figures = (100 * len(known) / len(error), known.mean(), np.median(known), rmse, p95)
    return Score(*map(float, figures))


def arguments(doc: str, environments: Sequence[str]) -> argparse.ArgumentParser:
    """Parser of the options that the benchmarks have in common."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--envs", nargs="+", default=list(environments), metavar="ENVIRONMENT")
    parser.add_argument("--signal", default="ideal", choices=["ideal", "datasheet"], help="of the LiDAR")
    parser.add_argument(
        "--method", action="append", default=[], metavar="FILE.py:FUNCTION", help="one of your own, or MODULE:FUNCTION"
    )
    return parser


def drive_arguments(doc: str, environments: Sequence[str]) -> argparse.ArgumentParser:
    """Parser of these options and those of drives."""
    parser = arguments(doc, environments)
    parser.add_argument("--seconds", type=_seconds, default=60.0, help="simulated time of each drive (default: 60)")
    parser.add_argument("--picture", metavar="FILE", help="picture of the last environment")
    return parser


def _seconds(text: str) -> float:
    value = float(text)
    if not 2.0 <= value <= 3600.0:  # the first scan is that of 2 s
        raise argparse.ArgumentTypeError(f"must be 2 to 3600, got {text}")
    return value


def show(columns: Sequence[str], rows: Sequence[Sequence[object]], *, header: bool = True) -> None:
    """Print rows of a table in Markdown; numbers have three decimals, NaN is a dash."""
    if header:
        print("| " + " | ".join(columns) + " |\n" + "|---" * len(columns) + "|")
    for row in rows:
        print("| " + " | ".join(_cell(value) for value in row) + " |", flush=True)


def _cell(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.3f}" if np.isfinite(value) else "-"
    return str(value)
