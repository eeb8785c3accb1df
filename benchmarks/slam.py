# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Odometry programs on our clouds, against the true poses of the LiDAR: the tables of docs/slam.md.

Run: python benchmarks/slam.py [--signal ideal|datasheet] [--envs NAME ...] [--seconds S] [--wind M_S] [--out DIR]

It needs: pip install kiss-icp rko_lio small_gicp evo. For each environment it records a spinning OS1-64 and an IMU of
200 Hz without cameras, exports the configuration files, runs each program that is installed with and without
deskewing, and prints a row with evo's errors. Bags and estimates that DIR has already are used again.

Times: a deskewed scan of KISS-ICP is as seen at its end, though it has the stamp of its beginning; RKO-LIO's poses have
the stamp of the end. A scan that is not deskewed has no time of its own; it is compared with the pose at its middle.
"""

import argparse
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml
from evo.core import metrics
from evo.core.trajectory import PoseTrajectory3D
from evo.core.units import Unit
from evo.tools import file_interface
from scipy.spatial.transform import Rotation

import fieldtruth as ft
from fieldtruth.bag.decode import points
from fieldtruth.bag.geometry import seconds
from fieldtruth.bag.run import open_run
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.wind_config import WindConfig
from fieldtruth.exporters import export
from fieldtruth.exporters.slam_configs import read_facts
from fieldtruth.pipeline import generate

TOPIC: Final = "/os1_cloud_node/points"
PERIOD: Final = 0.1
"""Of a scan [s]."""
RIG: Final = Rig.model_validate(
    {"lidar": {"model": "os1_64_gen1"}, "imu": {"rate_hz": 200.0}, "cameras": {"enabled": False}}
)
Work = Callable[[Path, Path, bool], Path]
"""Runs a program on a run's folder, in a folder of its own, with or without deskewing; the estimate as TUM."""


def recorded(environment: str, length_s: float, signal: str, wind: float, out: Path) -> Path:
    """Folder of the run, which is made unless it is there."""
    folder = out / (f"{signal}_wind_{wind:g}" if wind else signal) / f"{environment}_1"
    if not (folder / f"{environment}_1.bag").exists():
        experiment = load_experiment(f"{environment}_1").model_copy(update={"rig": RIG})
        experiment = experiment.model_copy(update={"wind": WindConfig(speed_m_s=wind)} if wind else {})
        generate(with_overrides(experiment, seconds=length_s, signal={"lidar": signal, "imu": signal}), folder.parent)
    if not (configs := folder / "configs").exists():
        export(folder, "slam-configs", out=configs)
    return folder


# ---------------------------------------------------------------------------------------------------------------------
# Programs


def called(command: list[str], log: Path, **environment: str) -> None:
    """Run a program, with its output in a file."""
    with log.open("w", encoding="utf-8") as file:
        subprocess.run(command, stdout=file, stderr=file, env=os.environ | environment, check=True)


def changed(configuration: Path, out: Path, change: Callable[[dict[str, Any]], None]) -> str:
    """Copy a configuration file with other values."""
    values = yaml.safe_load(configuration.read_text("utf-8"))
    change(values)
    (out / configuration.name).write_text(yaml.safe_dump(values), encoding="utf-8")
    return str(out / configuration.name)


def kiss_icp(run: Path, out: Path, deskew: bool) -> Path:
    """KISS-ICP with its defaults, and the LiDAR's ranges."""
    config = changed(run / "configs" / "kiss_icp.yaml", out, lambda values: values["data"].update(deskew=deskew))
    command = ["kiss_icp_pipeline", "--topic", TOPIC, "--config", config, str(run / f"{run.name}.bag")]
    called(command, out / "log", kiss_icp_out_dir=str(out))
    return next((out / "latest").resolve().glob("*_poses_tum.txt"))


def rko_lio(run: Path, out: Path, deskew: bool) -> Path:
    """RKO-LIO with its defaults, and the LiDAR's ranges and the mounts."""
    config = changed(run / "configs" / "rko_lio.yaml", out, lambda values: values.update(deskew=deskew))
    command = ["rko_lio", "--config", config, "--lidar", TOPIC, "--imu", "/imu/data", "-o", str(out), "-n", run.name]
    called([*command, str(run)], out / "log")
    return max(out.glob(f"{run.name}_*/*_tum.txt"))


def small_gicp(run: Path, out: Path, deskew: bool) -> Path:
    """Scan to map by small_gicp's VGICP; it has no deskewing of its own, so ours takes the last motion as constant."""
    import small_gicp as gicp

    target, pose, motion = gicp.GaussianVoxelMap(1.0), np.eye(4), np.eye(4)
    lines: list[str] = []
    for reading in ft.read_bag(run / f"{run.name}.bag", [TOPIC]):
        rows = points(reading.message)
        xyz = np.stack([rows[axis] for axis in "xyz"], axis=1).astype(np.float64)
        if deskew:
            xyz = at_the_end(xyz, rows["t"] / (1e9 * PERIOD), motion)
        cloud, _ = gicp.preprocess_points(xyz, 0.25, num_threads=os.cpu_count() or 1)
        if lines:
            found = gicp.align(target, cloud, init_T_target_source=pose @ motion, num_threads=os.cpu_count() or 1)
            motion, pose = np.linalg.inv(pose) @ found.T_target_source, found.T_target_source
        target.insert(cloud, pose)
        w, x, y, z = ft.transforms.quaternion_wxyz_from_rotation(pose[:3, :3])
        values = " ".join(f"{value:.9g}" for value in (*pose[:3, 3], x, y, z, w))
        lines.append(f"{seconds(reading.stamp_ns)} {values}\n")
    path = out / "estimate.tum"
    path.write_text("".join(lines), encoding="ascii")
    return path


def at_the_end(xyz: Array, share: Array, motion: Array) -> Array:
    """Points (n, 3), at shares of the scan, as seen from its end; it moves by ``motion`` (4, 4) from its beginning."""
    left = share - 1.0  # of the scan, backwards from its end
    vector = Rotation.from_matrix(motion[:3, :3]).as_rotvec()
    turned: Array = Rotation.from_rotvec(left[:, None] * vector).apply(xyz)
    return turned + left[:, None] * motion[:3, 3]


PROGRAMS: Final[dict[str, tuple[Work, float]]] = {
    "KISS-ICP": (kiss_icp, PERIOD),
    "RKO-LIO": (rko_lio, 0.0),
    "small_gicp": (small_gicp, PERIOD),
}
"""Function, and the time [s] from the stamp of a pose of a deskewed scan to the time that it is of."""


# ---------------------------------------------------------------------------------------------------------------------
# Errors


def errors(run: Path, estimate: Path, later_s: float) -> dict[str, float]:
    """evo's errors of the LiDAR's poses, whose times are ``later_s`` after their stamps."""
    bag = open_run(run)
    trajectory, sensor = bag.trajectory, read_facts(bag).cloud
    assert sensor is not None
    found = file_interface.read_tum_trajectory_file(estimate)
    stamps = np.rint(1e9 * (found.timestamps + later_s)).astype(np.int64)
    known = (stamps >= trajectory.stamps_ns[0]) & (stamps <= trajectory.stamps_ns[-1])
    found.reduce_to_ids(np.flatnonzero(known))
    poses = [trajectory.world_from_base(int(stamp)) @ sensor.base_from_sensor for stamp in stamps[known]]
    return compared(PoseTrajectory3D(poses_se3=poses, timestamps=found.timestamps), found)


def compared(truth: PoseTrajectory3D, estimate: PoseTrajectory3D) -> dict[str, float]:
    """Errors of positions after a rigid alignment, and of motions over 1 m and 5 m; NaN on a path below 1.2 of it."""
    estimate.align(truth)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((truth, estimate))
    row = {"poses": float(truth.num_poses), "path m": truth.path_length}
    row |= {f"APE {key} m": ape.get_statistic(metrics.StatisticsType(key)) for key in ("rmse", "max")}
    relations = {"m": metrics.PoseRelation.translation_part, "deg": metrics.PoseRelation.rotation_angle_deg}
    for metres in (1.0, 5.0):
        for unit, relation in relations.items():
            key = f"RPE {metres:g} m, {unit}"
            row[key] = math.nan
            if min(truth.path_length, estimate.path_length) > 1.2 * metres:  # without a pair, evo raises
                rpe = metrics.RPE(relation, metres, Unit.meters, all_pairs=True)
                rpe.process_data((truth, estimate))
                row[key] = rpe.get_statistic(metrics.StatisticsType.rmse)
    return row


def show(name: str, row: dict[str, float], header: bool) -> None:
    """Print a row of a table in Markdown."""
    if header:
        print("| run | " + " | ".join(row) + " |\n" + "|---" * (len(row) + 1) + "|", flush=True)
    print(f"| {name} | " + " | ".join(f"{value:.4g}" for value in row.values()) + " |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--envs", nargs="+", default=["park", "lake", "forest", "hillside"])
    parser.add_argument("--programs", nargs="+", default=list(PROGRAMS), choices=list(PROGRAMS))
    parser.add_argument("--signal", default="ideal", choices=["ideal", "datasheet"], help="of LiDAR and IMU")
    parser.add_argument("--seconds", type=float, default=40.0, help="simulated time of each run")
    parser.add_argument("--wind", type=float, default=0.0, help="mean speed [m/s], in which plants sway")
    parser.add_argument("--out", type=Path, default=Path("slam"))
    options = parser.parse_args()
    first = True
    for environment in options.envs:
        run = recorded(environment, options.seconds, options.signal, options.wind, options.out)
        for program in options.programs:
            work, later = PROGRAMS[program]
            for deskew in (True, False):
                folder = options.out / "estimates" / run.parent.name / environment / program
                folder = folder / ("deskewed" if deskew else "raw")
                try:
                    estimate = estimated(work, run, folder, deskew)
                except (OSError, ImportError, subprocess.CalledProcessError) as error:
                    print(f"{program} on {environment}: {error}; see {folder / 'log'}", file=sys.stderr)
                    continue
                middle = later - PERIOD / 2.0
                row = errors(run, estimate, later if deskew else middle)
                show(f"{environment}, {program}{'' if deskew else ', not deskewed'}", row, first)
                first = False


def estimated(work: Work, run: Path, folder: Path, deskew: bool) -> Path:
    """Path of the estimate, which is made unless it is there."""
    kept = folder / "kept.tum"
    if not kept.exists():
        folder.mkdir(parents=True, exist_ok=True)
        kept.write_bytes(work(run, folder, deskew).read_bytes())
    return kept


if __name__ == "__main__":
    main()
