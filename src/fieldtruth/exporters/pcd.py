# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export clouds as PCD files, which CloudCompare, PCL and Open3D show in the colours of the classes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.core.readings import Cloud
from fieldtruth.core.yaml_io import package_data
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import PAPER, first_of_clouds, intensity_is_class, noun_of
from fieldtruth.ontology import LabelMap

_TYPES: Final = {"f": "F", "u": "U", "i": "I"}
"""PCD's TYPE by NumPy's dtype kind."""
_TEXTS: Final = package_data("fieldtruth.exporters", "pcd.yaml")


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: ``<stamp in ns>.pcd`` for each cloud, and a README.

    Clouds of sensors other than the paper's are in folders of their names.

    Raises:
        BagError: the bag has no clouds, true poses or /tf_static, clouds have no labels, or the bag is damaged.
    """
    (run,) = runs
    sensors = run.of(Cloud) or [first_of_clouds(run)]
    mounts, trajectory = {each.name: run.calibration.base_from(each.name) for each in sensors}, run.trajectory
    folders = {each.name: target / ("" if each.name == PAPER else each.name) for each in sensors}
    run.streams([each.topic for each in sensors])
    clouds = {each.name: run[each.name] for each in sensors}
    for folder in (target, *folders.values()):
        folder.mkdir(exist_ok=True)
    (target / "README.md").write_text(_readme(run, sensors, options.labels), encoding="utf-8")

    def save(job: tuple[int, str, int]) -> None:
        stamp, name, row = job
        world_from_sensor = trajectory.world_from_base(stamp) @ mounts[name]
        data = pcd_bytes(clouds[name].read(row), options.labels, world_from_sensor)
        (folders[name] / f"{stamp}.pcd").write_bytes(data)

    jobs = sorted((s, name, row) for name, each in clouds.items() for row, s in enumerate(each.stamps_ns.tolist()))
    for _ in options.each("write the clouds", run, jobs, save):
        pass


def pcd_bytes(cloud: Cloud, labels: LabelMap, world_from_sensor: Array) -> bytes:
    """Return the file of a cloud that was taken at a pose (4, 4)."""
    rows = _with_colours(cloud, labels)
    return _header(rows, world_from_sensor) + rows.tobytes()


def _with_colours(cloud: Cloud, labels: LabelMap) -> NDArray[np.void]:
    """Points as stored: x, y, z, rgb, label (32 bits, as in PCL's PointXYZRGBL), then all other fields."""
    fields = {name: values for name, values in cloud.fields().items() if name not in ("rgb", "label")}
    kinds = [(name, values.dtype, values.shape[1:]) for name, values in fields.items()]
    axes = [kind for axis in "xyz" for kind in kinds if kind[0] == axis]
    others = [kind for kind in kinds if kind not in axes]
    rows = np.empty(len(cloud.xyz), [*axes, ("rgb", "<u4"), ("label", "<u4"), *others])
    for name, values in fields.items():
        rows[name] = values
    rows["label"] = labels.ids[cloud.label]
    red, green, blue = labels.colours()[rows["label"]].astype(np.uint32).T
    rows["rgb"] = red << 16 | green << 8 | blue
    return rows


def _header(rows: NDArray[np.void], world_from_sensor: Array) -> bytes:
    names = rows.dtype.names or ()
    kinds = [rows.dtype[name] for name in names]
    types = ["F" if name == "rgb" else _TYPES[kind.base.kind] for name, kind in zip(names, kinds, strict=True)]
    quaternion = transforms.quaternion_wxyz_from_rotation(world_from_sensor[:3, :3])
    viewpoint = np.round([*world_from_sensor[:3, 3], *quaternion], 12) + 0.0
    lines = {
        "VERSION": ["0.7"],
        "FIELDS": names,
        "SIZE": [kind.base.itemsize for kind in kinds],
        "TYPE": types,
        "COUNT": [int(np.prod(kind.shape)) for kind in kinds],
        "WIDTH": [len(rows)],
        "HEIGHT": [1],
        "VIEWPOINT": viewpoint.tolist(),
        "POINTS": [len(rows)],
        "DATA": ["binary"],
    }
    text = "".join(f"{key} {' '.join(map(str, values))}\n" for key, values in lines.items())
    return f"# .PCD v0.7 - Point Cloud Data file format\n{text}".encode("ascii")


def _readme(run: Run, sensors: Sequence[Source], labels: LabelMap) -> str:
    own_void = int(Label.VOID) if labels.is_own else None
    rows = [(number, name, rgb) for number, (name, rgb) in sorted(labels.classes.items()) if number != own_void]
    lines = [f"| {number} | {name} | {' '.join(map(str, rgb))} |\n" for number, name, rgb in rows]
    noun, others = noun_of(sensors), [f"`{each.name}/`" for each in sensors if each.name != PAPER]
    folders = f"Clouds of these {noun}s are in folders of their names: {', '.join(others)}.\n" if others else ""
    by_class = all(map(intensity_is_class, sensors))
    intensity = "fieldtruth's id of the class" if by_class else "that of the class or the reflectivity"
    words = {"name": run.name, "noun": noun, "folders": folders, "intensity": intensity}
    return str(_TEXTS["readme"]).format_map(words) + "".join(lines)
