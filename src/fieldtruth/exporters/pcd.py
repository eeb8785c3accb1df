# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export clouds as PCD files, which CloudCompare, PCL and Open3D show in the colours of the classes."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.calibration import base_from_lidar, read_static_frames
from fieldtruth.bag.decode import stamp_ns
from fieldtruth.bag.reader import BagError, decoder, open_bag
from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import read_trajectory
from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import CLASSES, PALETTE
from fieldtruth.core.parallel import in_order
from fieldtruth.core.progress import timed
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import LIDAR, lidars_of
from fieldtruth.exporters.sequences import Returns, first_lidar, returns
from fieldtruth.ontology.label_map import LabelMap

_TYPES: Final = {"f": "F", "u": "U", "i": "I"}
"""PCD's TYPE by NumPy's dtype kind."""
_README: Final = """\
# Clouds of {name}

One PCD file (version 0.7, binary) per cloud; its name is the cloud's stamp in nanoseconds of simulated time.
{folders}
- `x y z` [m]: in the LiDAR's frame (x forward, y left, z up).
- `VIEWPOINT`: the LiDAR's true pose in the world (x north, y west, z up), position [m] and quaternion w x y z. It
  transforms the points of all clouds into one map.
- `rgb`: the colour of the class, packed as in PCL (0x00RRGGBB in the bits of a float).
- `label`: the id of the class, see the table.
- All other fields are those of the bag. In a run of fieldtruth they are `intensity` (fieldtruth's id of the class),
  `ring` and `column` of the ray, `instance` (row of /gazebo/model_states; 1 is the ground) and, from a spinning LiDAR,
  `t` [ns] after the stamp. From a LiDAR with a signal also `true_range` [m], `signal` [photon], `reflectivity` (1 for a
  white surface; an Ouster's in percent), `echo` and `mixed`.

| label | class | red green blue |
|---|---|---|
"""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: ``<stamp in ns>.pcd`` for each cloud, and a README.

    Clouds of LiDARs other than the paper's are in folders of their names.

    Raises:
        BagError: the bag has no clouds, true poses or /tf_static, clouds have no labels, or the bag is damaged.
    """
    (run,) = runs
    lidars = {lidar.topic: lidar for lidar in lidars_of(run) or [first_lidar(run)]}
    static, trajectory = read_static_frames(run), read_trajectory(run)
    mounts = {topic: base_from_lidar(run, static, lidar) for topic, lidar in lidars.items()}
    folders = {topic: target / ("" if lidar.name == LIDAR else lidar.name) for topic, lidar in lidars.items()}
    ids, colours = _ids_and_colours(options.label_map)
    for folder in (target, *folders.values()):
        folder.mkdir(exist_ok=True)
    (target / "README.md").write_text(_readme(run, options.label_map), encoding="utf-8")

    def save(read: tuple[str, Any]) -> None:
        topic, cloud = read
        stamp = stamp_ns(cloud.header)
        world_from_lidar = trajectory.world_from_base(stamp) @ mounts[topic]
        rows = _with_colours(returns(cloud, run), ids, colours)
        (folders[topic] / f"{stamp}.pcd").write_bytes(_header(rows, world_from_lidar) + rows.tobytes())

    with (
        open_bag(run.bag, true_stamps=run.clocked) as bag,
        options.progress.stage("write the clouds", run.duration_s) as advance,
    ):
        decode, seen = decoder(bag), set[tuple[str, int]]()

        def clouds() -> Iterator[tuple[str, Any]]:
            for raw in timed(bag.messages([*lidars]), advance, run.start_ns):
                cloud = decode(raw)
                stamp = stamp_ns(cloud.header)
                if (raw.topic, stamp) in seen:
                    raise BagError(f"{run.bag} has two clouds with the stamp {stamp} ns")
                seen.add((raw.topic, stamp))
                yield raw.topic, cloud

        for _ in in_order(clouds(), save, options.workers):
            pass


def _ids_and_colours(label_map: LabelMap | None) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Written id by class id (18,), and RGB by written id (n, 3)."""
    if label_map is None:
        return np.arange(len(CLASSES), dtype=np.uint8), PALETTE
    return label_map.ids, label_map.colours()


def _with_colours(found: Returns, ids: NDArray[np.uint8], colours: NDArray[np.uint8]) -> NDArray[np.void]:
    """Points as stored: x, y, z, rgb, label (32 bits, as in PCL's PointXYZRGBL), then all other fields."""
    dtype = found.rows.dtype
    others = [name for name in dtype.names or () if name not in ("x", "y", "z", "rgb", "label")]
    kinds = [(name, dtype[name].base, dtype[name].shape) for name in ("x", "y", "z", *others)]
    rows = np.empty(len(found.rows), [*kinds[:3], ("rgb", "<u4"), ("label", "<u4"), *kinds[3:]])
    for name, _, _ in kinds:
        rows[name] = found.rows[name]
    rows["label"] = ids[found.label]
    red, green, blue = colours[rows["label"]].astype(np.uint32).T
    rows["rgb"] = red << 16 | green << 8 | blue
    return rows


def _header(rows: NDArray[np.void], world_from_lidar: Array) -> bytes:
    names = rows.dtype.names or ()
    kinds = [rows.dtype[name] for name in names]
    types = ["F" if name == "rgb" else _TYPES[kind.base.kind] for name, kind in zip(names, kinds, strict=True)]
    quaternion = frames.quaternion_wxyz_from_rotation(world_from_lidar[:3, :3])
    viewpoint = np.round([*world_from_lidar[:3, 3], *quaternion], 12) + 0.0
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


def _readme(run: Run, label_map: LabelMap | None) -> str:
    if label_map is None:
        rows = [(c.label.value, c.name, c.rgb) for c in CLASSES if c.rgb is not None]
    else:
        rows = [(number, other.name, other.rgb) for number, other in sorted(label_map.classes.items())]
    lines = [f"| {number} | {name} | {' '.join(map(str, rgb))} |\n" for number, name, rgb in rows]
    others = [f"`{lidar.name}/`" for lidar in lidars_of(run) if lidar.name != LIDAR]
    folders = f"Clouds of these LiDARs are in folders of their names: {', '.join(others)}.\n" if others else ""
    return _README.format(name=run.name, folders=folders) + "".join(lines)
