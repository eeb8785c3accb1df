# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Motion and matter, before and now: what wheels, IMU and LiDAR measure in the four environments, as one table.

Run: python benchmarks/motion.py [--picture docs/motion_spectra.png]. "Before" is the state at version 0.1 of June, as
it was measured on park_1 and short drives. Docs: docs/physics.md.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from time import process_time
from typing import NamedTuple

import matter
import mujoco
import numpy as np
from matter import Row
from planes import among_trunks, experiment_on_plane, plane
from scipy.signal import welch
from scipy.spatial.transform import Rotation

import fieldtruth as ft
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import DriveError
from fieldtruth.core.transforms import rotation_from_quaternion_wxyz, yaw_from_rotation
from fieldtruth.drive.physics import build_physics
from fieldtruth.drive.plan import plan_route
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.track import Motion, Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import WHEELS
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.imu.sensing import point_velocity, read_imu
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig
from fieldtruth.sensors.wheel_odometry.sensing import WheelTruth
from fieldtruth.world.build import world_of
from fieldtruth.world.model import World

EXPERIMENTS = ("park_1", "lake_1", "forest_1", "hillside_1")
SECONDS, GRAVITY = 60.0, np.array([0.0, 0.0, 9.81])
RATE = 1000.0  # [Hz], of the physics
SLOPE_DEG = 13.0
SOILS = ("paving", "gravel", "lawn", "forest_floor", "pebbles", "scree", "sand", "mud")


class Drive(NamedTuple):
    """An experiment, its world, a minute of its drive, and how many times faster than real time that was simulated."""

    experiment: Experiment
    world: World
    track: Track
    speed: float

    @property
    def name(self) -> str:
        """Name of the environment."""
        return self.experiment.environment


def drive_of(name: str) -> Drive:
    """Drive a minute of a built-in experiment."""
    experiment = with_overrides(load_experiment(name), seconds=SECONDS)
    world = world_of(experiment)
    route = plan_route(world, experiment)
    drive(world, experiment.model_copy(update={"route": route, "seconds": 0.1}))  # compiles and caches
    track, speed = timed(world, experiment.model_copy(update={"route": route}))
    return Drive(experiment, world, track, speed)


def timed(world: World, experiment: Experiment) -> tuple[Track, float]:
    """A drive, and how many times faster than real time it was, its set-up included."""
    start = process_time()
    track = drive(world, experiment)
    return track, track.duration_s / (process_time() - start)


def vertical_acceleration(motion: Motion) -> Array:
    """Of base_link (n - 1,) [m/s^2] at the rate of the physics."""
    acceleration: Array = np.diff(motion.linear_velocity[:, 2]) * RATE
    return acceleration


def roll_and_pitch_rate(motion: Motion) -> Array:
    """(n, 2) [rad/s] in base_link."""
    world_from_base = rotation_from_quaternion_wxyz(motion.quaternion_wxyz)
    rates: Array = np.einsum("nji,nj->ni", world_from_base, motion.angular_velocity)[:, :2]
    return rates


# ---------------------------------------------------------------------------------------------------------------------
# On planes


def flat_ground() -> Iterator[Row]:
    """Vertical acceleration on level nodes, straight and turning."""
    for spacing, before in ((0.2, "0.093"), (0.1, "0.128"), (0.05, "not measured")):
        world = plane(spacing=spacing)
        straight = drive(world, experiment_on_plane((0, 0), (8, 0), seconds=10.0))
        turning = drive(world, experiment_on_plane((0, 0), (2.5, 0), (-6, 0), seconds=6.0))  # at 0.6 rad/s from 2 s on
        now = [float(vertical_acceleration(track.motion)[3000:].std()) for track in (straight, turning)]
        text = f"{now[0]:.1e}, turning {now[1]:.1e}"
        yield Row(f"vertical acceleration on flat ground, {spacing:g} m grid, std [m/s2]", before, text)


def mass_centres() -> Iterator[Row]:
    """Distance of the wheels' mass centres from their axles, and the mass of the robot."""
    model = build_physics(plane(), Rig()).model
    wheels = [model.body(name).id for name in WHEELS]
    away = np.hypot(model.body_ipos[wheels, 0], model.body_ipos[wheels, 2]).max()
    yield Row("mass centre of a wheel from its axle [m]", "0.26", f"{away:.3f}")
    mass = float(model.body_subtreemass[mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "base_link")])
    yield Row("mass of the robot [kg]", "50", f"{mass:.3f}")


def climbing() -> Iterator[Row]:
    """Slip at constant speed straight uphill, by soil."""
    for soil in SOILS:
        experiment = experiment_on_plane((-8, 0), (8, 0), seconds=12.0, soil={"trodden_earth": soil})
        try:
            track = drive(plane(slope_deg=SLOPE_DEG), experiment)
        except DriveError:
            yield Row(f"slip climbing {SLOPE_DEG:g} deg on {soil}", "0.17 %", "does not get up")
            continue
        assert track.base is not None
        rows = slice(6000, 12000)
        moved = np.linalg.norm(track.motion.position[rows][-1] - track.motion.position[rows][0])
        turned = track.base.wheels.angle[rows]
        rolled = (turned[-1] - turned[0]).mean() * Rig().wheels.radius
        yield Row(f"slip climbing {SLOPE_DEG:g} deg on {soil}", "0.17 %", f"{1 - moved / rolled:.1%}")


# ---------------------------------------------------------------------------------------------------------------------
# In the environments


def shaking(drives: list[Drive]) -> Iterator[Row]:
    """Accelerations and turn rates in each environment, and the speed of the simulation."""
    for d in drives:
        vertical, rates = vertical_acceleration(d.track.motion), roll_and_pitch_rate(d.track.motion)
        roll, pitch = np.degrees(rates.std(axis=0))
        text = f"{vertical.std():.3f}; roll {roll:.2f}, pitch {pitch:.2f} deg/s"
        yield Row(f"vertical acceleration on {d.experiment.name}, std [m/s2]", "0.134 to 0.160", text)
    trunks, way = among_trunks(plane(spacing=0.05, size=(100.0, 50.0)), 600), experiment_on_plane((-20, 0), (20, 0))
    _, among = timed(trunks, way.model_copy(update={"seconds": SECONDS}))
    speeds = ", ".join(f"{d.name} {d.speed:.0f}" for d in drives) + f", plane with 600 trunks {among:.0f}"
    yield Row("drive, times real time on one core", "24", speeds)


def imu_errors(drives: list[Drive]) -> Iterator[Row]:
    """Aliasing, and what integrating the readings gives."""
    for sampling, before in (("instant", "39 to 46 %"), ("mean", "no such mode")):
        shares = [share_above(d.track.motion, sampling) for d in drives]
        yield Row(f"IMU, {sampling}: vertical variance from above 25 Hz", before, spread(shares, "{:.0%}"))
    for sampling, before in (("instant", "0.10 m/s, 0.58 m"), ("mean", "no such mode")):
        config = ImuConfig(sampling="mean" if sampling == "mean" else "instant")
        errors = np.array([with_true_attitude(d.track.motion, config) for d in drives])
        text = f"{spread(errors[:, 0], '{:.1e}')} m/s, {spread(errors[:, 1], '{:.1e}')} m"
        yield Row(f"IMU, {sampling}: error of 10 s with the true attitude", before, text)
        errors = np.array([strapdown(d.track.motion, config) for d in drives])
        text = f"{spread(errors[:, 0], '{:.1e}')} deg, {spread(errors[:, 1], '{:.2g}')} m"
        yield Row(f"IMU, {sampling}: error of 60 s of strapdown integration", "", text)


def odometry_errors(drives: list[Drive]) -> Iterator[Row]:
    """Wheel odometry at the end of a minute, beside the true motion in the frame of its beginning."""
    for d in drives:
        assert d.track.base is not None
        motion = d.track.motion
        odometry = (
            WheelTruth(WheelOdometryConfig(), Rig().wheels).extend(motion.stamps_ns, d.track.base.wheels).odometry
        )
        world_from_base = rotation_from_quaternion_wxyz(motion.quaternion_wxyz[::100])
        true = world_from_base[0].T @ (motion.position[-1] - motion.position[0])
        x, y, yaw = odometry.pose[-1]
        turned = np.unwrap(yaw_from_rotation(world_from_base))
        away, angle = np.hypot(*(true[:2] - (x, y))), np.degrees(yaw - (turned[-1] - turned[0]))
        text = (
            f"{away:.2f} m of {d.track.length_m:.1f} m, {angle:+.1f} deg of {np.degrees(np.ptp(turned)):.0f} deg turned"
        )
        yield Row(f"wheel odometry on {d.experiment.name}, error after a minute", "not published", text)


def spread(values: Array | list[float], form: str) -> str:
    """Smallest to largest."""
    return " to ".join(form.format(value) for value in (np.min(values), np.max(values)))


def share_above(motion: Motion, sampling: str, limit: float = 25.0) -> float:
    """Share of the variance in readings at twice the ``limit`` [Hz] that is vibration above it."""
    frequency, power = welch(vertical_acceleration(motion)[1000:], RATE, nperseg=4096)
    if sampling == "mean":
        power = power * np.sinc(frequency / (2 * limit)) ** 2
    return float(power[frequency > limit].sum() / power[frequency > 0.2].sum())


def with_true_attitude(motion: Motion, config: ImuConfig) -> tuple[float, float]:
    """Errors of velocity [m/s] and position [m] after 10 s, mean over the windows of a drive."""
    imu, lever = read_imu(motion, config), config.mount.base_from_sensor[:3, 3]
    rows = np.searchsorted(motion.stamps_ns, imu.stamps_ns)
    true_velocity = point_velocity(motion, rows, lever)
    path = motion.position[rows] + rotation_from_quaternion_wxyz(motion.quaternion_wxyz[rows]) @ lever
    force = np.einsum("nij,nj->ni", rotation_from_quaternion_wxyz(imu.quaternion_wxyz), imu.linear_acceleration)
    dt, found = 1 / config.rate_hz, []
    for first in range(0, len(rows) - 500, 500):
        steps = slice(first + 1, first + 501)
        velocity = true_velocity[first] + np.cumsum(force[steps] - GRAVITY, axis=0) * dt
        before = np.concatenate([true_velocity[first][None], velocity[:-1]])
        moved = path[first] + ((velocity + before) / 2 * dt).sum(axis=0)
        found.append((velocity[-1] - true_velocity[first + 500], moved - path[first + 500]))
    return tuple(np.linalg.norm(found, axis=2).mean(axis=0))


def strapdown(motion: Motion, config: ImuConfig) -> tuple[float, float]:
    """Errors of attitude [deg] and position [m] at the end, from the true state at the first reading."""
    imu, mount = read_imu(motion, config), config.mount.base_from_sensor
    rows = np.searchsorted(motion.stamps_ns, imu.stamps_ns[[0, -1]])
    world_from_base = rotation_from_quaternion_wxyz(motion.quaternion_wxyz[rows])
    attitude, path = world_from_base @ mount[:3, :3], motion.position[rows] + world_from_base @ mount[:3, 3]
    r, v, p, dt = attitude[0], point_velocity(motion, rows[:1], mount[:3, 3])[0], path[0], 1 / config.rate_hz
    turns = Rotation.from_rotvec(imu.angular_velocity[1:] * dt).as_matrix()
    for turn, force in zip(turns, imu.linear_acceleration[1:], strict=True):
        r = r @ turn
        before, v = v, v + (r @ force - GRAVITY) * dt
        p = p + (before + v) / 2 * dt
    angle = Rotation.from_matrix(r.T @ attitude[1]).magnitude()
    return float(np.degrees(angle)), float(np.linalg.norm(p - path[1]))


def write_picture(drives: list[Drive], path: Path) -> None:
    """Spectra of vertical acceleration, roll rate and pitch rate per environment."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 3, figsize=(13.5, 4.2), sharex=True, layout="constrained")
    titles = ("vertical acceleration [(m/s²)²/Hz]", "roll rate [(deg/s)²/Hz]", "pitch rate [(deg/s)²/Hz]")
    for d in drives:
        motion = d.track.motion
        signals = (vertical_acceleration(motion), *np.degrees(roll_and_pitch_rate(motion)).T)
        for axis, signal in zip(axes, signals, strict=True):
            frequency, power = welch(signal[1000:], RATE, nperseg=8192)
            shown = (frequency > 0.2) & (frequency < 100.0)
            axis.loglog(frequency[shown], power[shown], label=d.name, linewidth=1.2)
    for axis, title in zip(axes, titles, strict=True):
        axis.set(title=title, xlabel="frequency [Hz]")
        axis.grid(alpha=0.3)
    axes[0].legend()
    figure.savefig(path, dpi=110)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--picture", type=Path, help="write the spectra to this file")
    picture = parser.parse_args().picture
    print(f"fieldtruth {ft.__version__}\n\n| finding | before | now |\n|---|---|---|", flush=True)

    def show(rows: Iterator[Row]) -> None:
        for row in rows:
            print(f"| {row.finding} | {row.before or 'not measured'} | {row.now} |", flush=True)

    show(flat_ground())
    show(mass_centres())
    drives = [drive_of(name) for name in EXPERIMENTS]
    show(shaking(drives))
    show(imu_errors(drives))
    show(odometry_errors(drives))
    if picture is not None:
        write_picture(drives, picture)
    show(climbing())
    for d in drives:
        show(matter.of_environment(d.experiment, d.world))


if __name__ == "__main__":
    main()
