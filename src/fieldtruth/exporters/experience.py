# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export what images and clouds saw of the places that the robot drove over later, with what it measured there.

Places are ``SPACING`` apart along the path. A pixel with depth, or a point of a cloud, belongs to the nearest place, in
plan view, of those that are driven over after its stamp, if that is at most half the robot's width away and the
point's height differs by at most ``HEIGHT`` from the ground there. What is hidden has no pixel.
"""

import json
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.png import encode_png
from fieldtruth.core.readings import Cloud, Image, Joints
from fieldtruth.drive.physics import skid_compensation
from fieldtruth.exporters import Options
from fieldtruth.exporters.pixel_points import PixelPoints, views_with_depth
from fieldtruth.exporters.traction_images import HEADER, TABLE, row_of, tractions, write_images
from fieldtruth.local_maps import world_of_run, world_rays
from fieldtruth.local_maps.costs import CostMap, read_costs

SPACING: Final = 0.25
"""Distance [m] between places along the path."""
LENGTH: Final = 1.0
"""Length [m] of the path around a place over which costs are taken, as ``fieldtruth cost`` does."""
TURN: Final = 0.05
"""Least turn [rad] by the wheels over ``LENGTH`` of which a share is taken."""
HEIGHT: Final = 0.5  # [m]
RANGE: Final = 30.0
"""Greatest distance [m] from base_link, in plan view, at which something is seen."""
Places = dict[str, NDArray[Any]]
"""Arrays (n,) or (n, 3) by name; rows rise with the stamp."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write ``places.npz``, ``frames.jsonl``, and for each frame that saw a place ``SENSOR/STAMP.npz`` and photograph.

    Where wheels were recorded, photographs have images of traction, and ``data.csv`` a row for each.

    Raises:
        BagError: images without depth, or no true poses.
        ConfigurationError: the map of costs cannot be read, or is of another world.
    """
    (run,) = runs
    views = views_with_depth(run, "experience") if run.of(Image) else []
    costs = None if options.maps.cost is None else read_costs(Path(options.maps.cost))
    if costs is not None:
        costs.check_world(world_of_run(run))
    places = places_of(run, costs)
    target.mkdir()
    np.savez_compressed(target / "places.npz", allow_pickle=False, **places)
    rows = list[str]()
    with (target / "frames.jsonl").open("w", encoding="utf-8") as file:
        for source in (*views, *run.of(Cloud)):
            for line in filter(None, _write_frames(run, source, places, target / source.label, options)):
                file.write(json.dumps(line) + "\n")
                rows += [row_of(line, run.trajectory)] if line.get("traction") else []
    if rows:
        (target / TABLE).write_text(HEADER + "".join(rows), encoding="utf-8")


def _write_frames(run: Run, source: Source, places: Places, folder: Path, options: Options) -> Iterator[dict[str, Any]]:
    """Write the files of the frames of a sensor, and yield their lines."""
    folder.mkdir()
    is_image = source.type is Image
    points = PixelPoints(run, source) if is_image else None
    readings = run.readings(source.name, ["photo", "depth"] if is_image else (), labelled=False)

    def save(row: int) -> dict[str, Any]:
        reading = readings.read(row)
        return _save(_seen(run, source, points, places, reading), places, reading, folder)

    return options.each(f"{source.label}: frames", run, range(len(readings)), save)


def places_of(run: Run, costs: CostMap | None = None) -> Places:
    """Return the places of a run: stamp, position on the ground, heading, and costs over ``LENGTH`` around each.

    With s the way of base_link in space, t that of the treads (mean angle of the wheels times their radius), z the
    height of base_link: ``slip`` 1 - s / |t|, ``turn_slip`` the same of the heading and of the turn that the wheels ask
    for, NaN below ``TURN``, ``rms`` [m/s2] sqrt(mean((d2z / dt2)^2)) over the poses as recorded, ``tilt`` [rad] the
    greatest, ``speed`` [m/s]; ``energy`` [J/m] is that of the map of costs, if one is given.
    """
    path, robot = run.trajectory, run.rig.robot
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path.position[:, :2], axis=0), axis=1))])
    marks = np.arange(0.0, along[-1], SPACING)
    rows = np.searchsorted(along, marks)
    poses = [transforms.pose_from_quaternion_wxyz(path.position[k], path.quaternion_wxyz[k]) for k in rows]
    ground = np.array([transforms.transform(pose, robot.footprint.xyz) for pose in poses])
    heading = np.array([transforms.yaw_from_rotation(pose[:3, :3]) for pose in poses])
    ends = np.searchsorted(along, np.clip(marks[:, None] + [-LENGTH / 2, LENGTH / 2], 0.0, along[-1]))
    places = {"stamp_ns": path.stamps_ns[rows], "position": ground, "heading": heading} | _measured(run, ends)
    if costs is not None:
        places["energy"] = np.array(
            [_energy(costs, *row) for row in zip(ground, heading, places["speed"], strict=True)]
        )
    return places


def _measured(run: Run, ends: NDArray[np.intp]) -> dict[str, Array]:
    """Costs between rows of the trajectory (n, 2)."""
    path, times = run.trajectory, run.trajectory.stamps_ns / 1e9
    space = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path.position, axis=0), axis=1))])
    tread, turn = _asked(run, times)
    rising = np.gradient(np.gradient(path.position[:, 2], times), times)
    up = 1.0 - 2.0 * (path.quaternion_wxyz[:, 1] ** 2 + path.quaternion_wxyz[:, 2] ** 2)
    tilt = np.arccos(np.clip(up, -1.0, 1.0))
    w, x, y, z = path.quaternion_wxyz.T
    heading = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    between = [slice(a, b + 1) for a, b in ends]
    way, rolled, time, yaw, asked = (np.diff(each[ends], axis=1)[:, 0] for each in (space, tread, times, heading, turn))
    with np.errstate(divide="ignore", invalid="ignore"):
        slip, speed = 1.0 - way / np.abs(rolled), way / time
        turn_slip = np.where(np.abs(asked) >= TURN, 1.0 - yaw / asked, np.nan)
    rms = np.array([np.sqrt(np.mean(rising[rows] ** 2)) for rows in between])
    tilts = np.array([tilt[rows].max() for rows in between])
    return {"slip": slip, "turn_slip": turn_slip, "rms": rms, "tilt": tilts, "speed": speed}


def _asked(run: Run, times: Array) -> tuple[Array, Array]:
    """Return the way [m] and turn [rad] that the wheels ask for up to times (n,) [s]; NaN if none are recorded.

    Joints are left, right, left, right. A robot that skids turns by their difference over its effective track.
    """
    sources, wheels = run.of(Joints), run.rig.robot.wheels
    if not sources:
        return np.full(len(times), np.nan), np.full(len(times), np.nan)
    joints = run.readings(sources[0].name)[:]
    stamps = joints.stamp_ns / 1e9
    left, right = (np.interp(times, stamps, joints.angle[:, side::2].mean(axis=1) * wheels.radius) for side in (0, 1))
    return (left + right) / 2, (right - left) / (2 * wheels.half_track * skid_compensation(wheels))


def _energy(costs: CostMap, ground: Array, heading: float, speed: float) -> float:
    """Energy [J/m] at a place, of the nearest speed and heading on the map."""
    found = (re.fullmatch(r"energy_v(.+)_h(\d+)", name) for name in costs.layers)
    layers = {each[0]: (float(each[1]), float(each[2])) for each in found if each}

    def apart(name: str) -> tuple[float, float]:
        return abs(layers[name][0] - speed), abs(math.remainder(layers[name][1] - math.degrees(heading), 360.0))

    return float(costs.at(min(layers, key=apart), ground[:1], ground[1:2])[0, 0])


def place_numbers(places: Places, stamp_ns: int, base: Array, points: Array, radius: float) -> NDArray[np.int32]:
    """Return the place (n,) of points (n, 3) [m] in the world that are seen at a stamp from a place (2,) [m], or -1."""
    first, found = int(np.searchsorted(places["stamp_ns"], stamp_ns, side="right")), np.full(len(points), -1, np.int32)
    later = places["position"][first:]
    if not len(later):
        return found
    margin = np.array([radius, radius, HEIGHT])
    low, high = later.min(axis=0) - margin, later.max(axis=0) + margin
    with np.errstate(invalid="ignore"):
        near = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    near = near[np.hypot(*(points[near, :2] - base).T) <= RANGE]
    row = np.asarray(cKDTree(later[:, :2]).query(points[near, :2], distance_upper_bound=radius)[1])
    near, row = near[row < len(later)], row[row < len(later)]
    level = np.abs(points[near, 2] - later[row, 2]) <= HEIGHT
    found[near[level]] = first + row[level]
    return found


def _seen(
    run: Run, source: Source, points: PixelPoints | None, places: Places, reading: Any
) -> tuple[dict[str, NDArray[Any]], Array]:
    """Return the arrays of what a reading shows of places, and its coordinates: u, v of pixels, x, y, z of points."""
    pose = run.trajectory.world_from_base(reading.stamp_ns)
    if points is None:
        world = world_rays(reading, run.trajectory, run.calibration.base_from(source.name))[1]
    else:
        world = points.of(reading).reshape(-1, 3)
    number = place_numbers(places, reading.stamp_ns, pose[:2, 3], world, run.rig.robot.outline[1] / 2)
    rows = np.flatnonzero(number >= 0)
    if points is None:
        xyz = reading.xyz[rows]
        return {"point": rows.astype(np.int32), "xyz": xyz, "place": number[rows]}, xyz.astype(np.float64)
    pixel = np.stack(np.unravel_index(rows, reading.depth.shape)[::-1], axis=1)
    return {"pixel": pixel.astype(np.uint16), "place": number[rows]}, pixel.astype(np.float64)


def _save(seen: tuple[dict[str, NDArray[Any]], Array], places: Places, reading: Any, folder: Path) -> dict[str, Any]:
    """Write the files of a frame, and return its line; empty if it saw no place."""
    arrays, at = seen
    numbers, row, count = np.unique(arrays["place"], return_inverse=True, return_counts=True)
    if not len(numbers):
        return {}
    name, is_image = f"{folder.name}/{reading.stamp_ns}", isinstance(reading, Image)
    np.savez_compressed(folder.parent / f"{name}.npz", allow_pickle=False, **arrays)
    line: dict[str, Any] = {"sensor": folder.name, "stamp_ns": reading.stamp_ns, "file": f"{name}.npz"}
    if is_image:
        line["photo"] = name + (".jpg" if reading.jpeg else ".png")
        (folder.parent / line["photo"]).write_bytes(reading.jpeg or encode_png(reading.photo))
        traction = tractions(places["slip"], places["turn_slip"])
        line["traction"] = write_images(traction, arrays["pixel"], arrays["place"], reading, folder)
    ahead = (places["stamp_ns"][numbers] - reading.stamp_ns) / 1e9
    middle = np.stack([np.bincount(row, each) / count for each in at.T], axis=1)
    line |= {"place": numbers.tolist(), "seconds": ahead.tolist(), "count": count.tolist()}
    line["pixel" if is_image else "xyz"] = np.round(middle, 3).tolist()
    return line
