# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Class shares of pixels and points along the path of an experiment (paper, Figure 21).

There is a viewpoint every 2 m of the expected path, which is every 6.7 s at the paper's speed. Each has one reading of
every sensor that gives clouds or images; of a stereo pair the left one, because the right one sees nearly the same.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Final

import numpy as np

from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.classes import CLASSES, ClassTable
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.drive.plan import expected_path, pose_on_ground, poses_along
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.kind import At, SensorWorld, standing
from fieldtruth.sensors.known import new_sensors
from fieldtruth.world.build import world_of

SPACING: Final = 2.0  # [m]


@dataclass(frozen=True, kw_only=True)
class ClassShares:
    """Counts by viewpoint and class id: ``pixels`` and ``points`` are (poses, classes)."""

    pixels: Counts
    points: Counts
    classes: ClassTable = CLASSES

    @property
    def pixel_share(self) -> Array:
        """Share of each class (classes,) in all pixels; zeros without pixels."""
        return _share(self.pixels)

    @property
    def point_share(self) -> Array:
        """Share of each class (classes,) in all points; zeros without points."""
        return _share(self.points)

    def as_dict(self) -> dict[str, Any]:
        """Number of poses, and counts of the classes that occur, by name."""
        counts = {"pixels": self.pixels.sum(axis=0).tolist(), "points": self.points.sum(axis=0).tolist()}
        named = {key: {c.name: n for c, n in zip(self.classes, row, strict=True) if n} for key, row in counts.items()}
        return {"poses": len(self.pixels), **named}


def class_shares(
    experiment: Experiment, *, spacing: float = SPACING, scene: Scene | None = None, workers: int = 1
) -> ClassShares:
    """Count the classes in images and scans along the expected path of an experiment.

    Args:
        experiment: environment, seed, rig and route; disabled sensors are counted, too.
        spacing: distance [m] between viewpoints along the path.
        scene: of the experiment's world; None builds it.
        workers: threads.
    """
    if scene is None:
        scene = Scene(world_of(experiment))
    field, rig = scene.world.terrain.field, experiment.rig
    poses = [
        pose_on_ground(field, station, rig) for station in poses_along(expected_path(experiment, scene.world), spacing)
    ]
    return count_classes(scene, rig, poses, workers=workers)


def shares_of(
    experiments: Sequence[Experiment], *, progress: Progress | None = None, workers: int = 1
) -> dict[str, ClassShares]:
    """Class shares of experiments by name; consecutive experiments in the same world load it once."""
    progress, found = Silent() if progress is None else progress, {}
    for (environment, *_), members in groupby(experiments, key=lambda e: (e.environment, e.seed, e.layout)):
        group = list(members)
        with progress.stage(f"load {environment}"):
            scene = Scene(world_of(group[0]))
        for experiment in group:
            with progress.stage(f"count along {experiment.name}"):
                found[experiment.name] = class_shares(experiment, scene=scene, workers=workers)
    return found


def count_classes(scene: Scene, rig: Rig, poses: Sequence[Array], *, workers: int = 1) -> ClassShares:
    """Count the classes that the sensors of a rig see from poses world_from_base (4, 4), one row per pose.

    Sensors that are not enabled count, too, and all as ideal ones. Of a stereo pair only the left view counts.
    """
    rig = rig.with_each(lambda each: {"enabled": True, "signal": None, "clock": None})
    classes = scene.world.classes
    counts = {reading: np.zeros((len(poses), len(classes)), np.int64) for reading in (Image, Cloud)}
    sensor_world = SensorWorld(scene.world, rig, scene=scene, reuse=True)

    def count(rows: range) -> None:
        for sensor in new_sensors(sensor_world).values():
            output = sensor.config.outputs()[0]
            found = next((counts[reading] for reading in counts if issubclass(sensor.config.gives, reading)), None)
            if found is None:
                continue
            for row in rows:
                labels = sensor.labels(output, At(row, 0, 0, standing(poses[row])))
                found[row] += np.bincount(labels.ravel(), minlength=len(classes))

    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(count, [range(first, len(poses), workers) for first in range(workers)]))
    return ClassShares(pixels=counts[Image], points=counts[Cloud], classes=classes)


def shares_table(shares: Mapping[str, ClassShares]) -> str:
    """Format two tables in percent, of pixels and points: a row per class that occurs, a column per experiment.

    0.00 means less than 0.005 %, a dash means no pixel or point.
    """
    blocks = []
    for title in ("pixels", "points"):
        counts = {name: found.as_dict()[title] for name, found in shares.items()}
        lines = [f"{title + ' [%]':<18}" + "".join(f"{name:>12}" for name in counts)]
        rows = sorted({row for each in shares.values() for row in each.classes})
        for name in dict.fromkeys(row.name for row in rows):
            if any(name in count for count in counts.values()):
                shown = [_percent(count.get(name, 0), sum(count.values())) for count in counts.values()]
                lines.append(f"{name:<18}" + "".join(f"{text:>12}" for text in shown))
        lines.append(f"{'counted':<18}" + "".join(f"{sum(count.values()):>12}" for count in counts.values()))
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks)


def _percent(count: int, total: int) -> str:
    return f"{100.0 * count / total:.2f}" if count else "-"


def _share(counts: Counts) -> Array:
    total = counts.sum(axis=0).astype(np.float64)
    share: Array = total / max(total.sum(), 1.0)
    return share
