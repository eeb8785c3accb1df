# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Effect of a bed of reeds on a robot: IMU, torque, slip and speed across it, beside the same path mown.

    python benchmarks/reeds.py [SECONDS]

It drives ``lake_reeds`` twice, with its stems and without them, and prints a table of the time in the bed.
"""

import argparse
from typing import NamedTuple

import numpy as np

from fieldtruth.drive.plan import plan_route
from fieldtruth.drive.simulate import Drive
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment
from fieldtruth.world.build import world_of
from fieldtruth.world.model import World

BED = (-8.0, 14.0)
"""x [m] between which the path leads through reeds."""


class Crossing(NamedTuple):
    """Means over the time in the bed."""

    speed: float  # [m/s]
    slip: float
    torque: float  # [N m] of all wheels together
    shake: float  # [m/s^2] root of the mean square of base_link's acceleration, without gravity
    motors: float  # [J/m]
    stems: float  # [J/m]


def crossing(world: World, experiment: Experiment, seconds: float) -> Crossing:
    """Drive for some seconds, and return the means of the time in the bed."""
    drive = Drive(world, experiment, plan_route(world, experiment))
    robot, radius, rows = drive.robot, experiment.rig.wheels.radius, []
    for step in range(1, round(seconds * 1000) + 1):
        drive.drive_to(step)
        data = robot.surroundings.data
        stems = 0.0 if robot.stems is None else robot.stems.work
        speeds = robot.wheel_speeds
        power = float(data.actuator_force @ speeds)
        rows.append([*data.qpos[:2], *data.qvel[:3], speeds.mean() * radius, data.actuator_force.sum(), power, stems])
    found = np.array(rows)
    x, speed, tread = found[:, 0], np.linalg.norm(found[:, 2:5], axis=1), found[:, 5]
    inside = np.flatnonzero((x > BED[0]) & (x < BED[1]))
    first, last = int(inside[0]), int(inside[-1])
    inside = np.arange(first, last + 1)
    path = np.linalg.norm(np.diff(found[inside, :2], axis=0), axis=1).sum()
    shake = np.diff(found[inside, 2:5], axis=0) * 1000
    return Crossing(
        float(speed[inside].mean()),
        float(1 - speed[inside].mean() / tread[inside].mean()),
        float(found[inside, 6].mean()),
        float(np.sqrt((shake**2).sum(axis=1).mean())),
        float(found[inside, 7].sum() / 1000 / path),
        float((found[last, 8] - found[first, 8]) / path),
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("seconds", nargs="?", type=float, default=55.0, help="simulated time of each drive (55)")
    seconds = parser.parse_args().seconds
    if not 20.0 <= seconds <= 600.0:  # the bed begins after some metres
        parser.error(f"argument seconds: must be 20 to 600, got {seconds:g}")
    experiment = load_experiment("lake_reeds")
    world = world_of(experiment)
    mown = experiment.model_copy(update={"plants": type(experiment.plants)()})
    found = {name: crossing(world, each, seconds) for name, each in (("reeds", experiment), ("mown", mown))}
    print(f"{'':7}" + "".join(f"{name:>10}" for name in Crossing._fields))
    for name, each in found.items():
        print(f"{name:7}" + "".join(f"{value:10.3f}" for value in each))


if __name__ == "__main__":
    main()
