# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground and plants of a world as LiDAR and inventory measure them: rows of the table of motion.py."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

import fieldtruth as ft
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.drive.ground import bearing_field
from fieldtruth.drive.plan import expected_path, pose_on_ground, poses_along
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.interchange.inventory import COLUMNS, inventory
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.world.build import load_world
from fieldtruth.world.environments.layout import PLANTINGS
from fieldtruth.world.materials import ISO_CLASSES
from fieldtruth.world.model import Heightfield, Mesh, World
from fieldtruth.world.plants import GRASSES, TREES, grow_tree

SCANS, RANGES = 8, (4.0, 15.0)
LIDAR = LidarConfig(columns=2048)
PROFILE_STEP = 0.025  # [m]
FEW = 300
"""Differences of ranges below which a ground type is left out."""
HALF_TRACK, REACH = Rig().wheels.half_track, 0.35  # [m]
ROUGHNESS_BEFORE = {"park": 0.19, "hillside": 0.39, "lake": 0.61, "forest": 2.0}  # [mm]
HECTARE = 10_000.0
HARD = (Label.GROUND, Label.TRAIL, Label.ROCK)


class Row(NamedTuple):
    """A line of the table."""

    finding: str
    before: str
    now: str


def of_environment(experiment: Experiment, world: World) -> Iterator[Row]:
    """All rows of one environment."""
    yield from roughness(experiment, world)
    scene = ft.Scene(world)
    poses = [
        pose_on_ground(world.terrain.field, pose, experiment.rig) @ LIDAR.mount.base_from_sensor
        for pose in poses_along(expected_path(experiment, world), 10.0)[:SCANS]
    ]
    yield from ring_noise(world, ft.Lidar(LIDAR, scene), poses)
    yield from stones(experiment, world)
    yield from leaves(world)
    if world.name == "forest":
        yield from crowns()
        yield from trunks(world)
    if world.name == "hillside":
        yield from rocks(world)
    if world.name == "park":
        yield from beyond(world, scene, poses)


def roughness(experiment: Experiment, world: World) -> Iterator[Row]:
    """Rms height at wavelengths of 0.5 to 1 m along both wheel tracks of the route, and its class of ISO 8608."""
    rms = profile_rms(world.terrain.field, expected_path(experiment, world))
    # With waviness 2, Gd(n) = Gd(n0) (n0 / n)^2: its integral from 1 to 2 cycles/m is Gd(n0) n0^2 / 2.
    unevenness = rms**2 / (0.1**2 / 2)
    iso = min(ISO_CLASSES, key=lambda letter: abs(np.log(ISO_CLASSES[letter] / unevenness)))
    before = f"{ROUGHNESS_BEFORE[world.name]:g} mm"
    yield Row(f"roughness on {experiment.name}, 0.5 to 1 m, rms", before, f"{1e3 * rms:.2f} mm, class {iso}")


def profile_rms(field: Heightfield, path: Array) -> float:
    """Rms height [m] at 1 to 2 cycles/m along the wheels' tracks beside a path (n, 3) of x, y [m] and heading [rad]."""
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1))])
    at = np.arange(0.0, arc[-1], PROFILE_STEP)
    x, y, heading = (np.interp(at, arc, column) for column in (*path[:, :2].T, np.unwrap(path[:, 2])))
    power = []
    for side in (-HALF_TRACK, HALF_TRACK):
        heights = field.height_at(x - side * np.sin(heading), y + side * np.cos(heading))
        n, gd = welch(heights, 1 / PROFILE_STEP, nperseg=1024)
        power.append(gd[(n >= 1.0) & (n < 2.0)].sum() * (n[1] - n[0]))
    return float(np.sqrt(np.mean(power)))


def ground_types(world: World, x: Array, y: Array) -> NDArray[np.str_]:
    """Name of the ground type (n,) that has the largest share at each position."""
    terrain = world.terrain
    names = np.array(
        [world.materials[name].ground_type for name in (*terrain.ground_materials, terrain.trail_material)]
    )
    kind = np.argmax(terrain.cover.at(x, y).reshape(len(x), -1), axis=1)
    return np.asarray(names[np.where(terrain.trail_distance.at(x, y) < 0, len(names) - 1, kind)])


def ring_noise(world: World, lidar: ft.Lidar, poses: list[Array]) -> Iterator[Row]:
    """Noise along rings on the ground between 4 and 15 m: 1.4826 MAD of the second difference over sqrt(6)."""
    noise: dict[str, list[Array]] = {}
    for pose in poses:
        scan = lidar.scan(pose)
        range_m, kind = np.full((LIDAR.columns, LIDAR.rings), np.nan), np.full((LIDAR.columns, LIDAR.rings), "", "U20")
        near = (scan.instance == 1) & (scan.range_m > RANGES[0]) & (scan.range_m < RANGES[1])
        cell = scan.column[near], scan.ring[near]
        x, y = ft.transforms.transform(pose, scan.xyz[near].astype(np.float64))[:, :2].T
        range_m[cell], kind[cell] = scan.range_m[near], ground_types(world, x, y)
        second = range_m[2:] - 2 * range_m[1:-1] + range_m[:-2]
        same = (kind[2:] == kind[1:-1]) & (kind[1:-1] == kind[:-2]) & np.isfinite(second)
        for name in np.unique(kind[1:-1][same]):
            noise.setdefault(str(name), []).append(second[same & (kind[1:-1] == name)])
    for name, parts in sorted(noise.items()):
        values = np.concatenate(parts)
        if len(values) >= FEW:
            mad = 1.4826 * np.median(np.abs(values - np.median(values))) / np.sqrt(6)
            before = "0.01 to 0.06 mm" if name in ("lawn", "meadow") else ""
            yield Row(f"LiDAR noise along rings on {name}, {world.name}", before, f"{1e3 * mad:.1f} mm")


def stones(experiment: Experiment, world: World) -> Iterator[Row]:
    """Stones of swarms within reach of the wheels on the route, and those that the wheels would pass through."""
    path = expected_path(experiment, world)[:, :2]
    bearing, soil = bearing_field(world), world.terrain.field
    tops = [top for swarm in world.swarms for top in _tops(world, swarm.meshes, swarm.mesh, swarm.world_from_object)]
    at = np.array(tops).reshape(-1, 3)
    near = np.array([np.linalg.norm(path - xy, axis=1).min() < REACH for xy in at[:, :2]], np.bool_)
    at = at[near]
    height = at[:, 2] - soil.height_at(at[:, 0], at[:, 1])
    at, height = at[height > 0.005], height[height > 0.005]
    around = np.stack(
        [bearing.height_at(at[:, 0] + dx, at[:, 1] + dy) for dx in (-0.03, 0.0, 0.03) for dy in (-0.03, 0.0, 0.03)]
    )
    through = at[:, 2] - around.max(axis=0) > 0.01
    tallest = f"{1e2 * height.max():.1f} cm" if len(height) else "none"
    before = "458, 92, 5.9 cm, 458" if world.name == "hillside" else ""
    now = f"{len(height)}, {int((height > 0.03).sum())}, {tallest}, {int(through.sum())}"
    yield Row(f"stones in reach on {experiment.name}: visible, above 3 cm, tallest, without body", before, now)


def _tops(world: World, names: tuple[str, ...], rows: NDArray[np.int32], poses: Array) -> Iterator[Array]:
    """Highest point (3,) of each member of a swarm that is hard."""
    for row, name in enumerate(names):
        mesh = world.meshes[name]
        hard = [k for k, material in enumerate(mesh.materials) if world.materials[material].label in HARD]
        corners = mesh.vertices[np.unique(mesh.faces[np.isin(mesh.material, hard)])].astype(np.float64)
        for pose in poses[rows == row] if len(corners) else ():
            placed = corners @ pose[:3, :3].T + pose[:3, 3]
            yield placed[np.argmax(placed[:, 2])]


def leaves(world: World) -> Iterator[Row]:
    """Median longest edge of the leaves' triangles of the tallest tree of each species."""
    tallest: dict[str, tuple[float, float]] = {}
    for instance in world.instances:
        mesh = world.meshes[instance.mesh]
        if instance.kind in TREES and len(corners := _leaf_corners(world, mesh)):
            scale = float(np.cbrt(np.linalg.det(instance.world_from_object[:3, :3])))
            height = scale * float(np.ptp(mesh.vertices[:, 2]))
            if height > tallest.get(instance.kind, (0.0, 0.0))[0]:
                edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
                tallest[instance.kind] = height, scale * float(np.median(edges))
    before = {"forest": "beech 64, oak 61, birch 30 cm", "park": "8 to 12 cm"}.get(world.name, "")
    now = ", ".join(f"{name} {1e2 * edge:.0f}" for name, (_, edge) in sorted(tallest.items()))
    if now:
        yield Row(f"longest edge of leaves' triangles, median, {world.name}", before, f"{now} cm")


def crowns() -> Iterator[Row]:
    """Readings of a LiDAR of an old tree of the forest from 12 m, compared with the same tree with all its leaves."""
    sys.path.append(str(Path(__file__).resolve().parents[1] / "tests/world"))
    from crown_statistics import crown_statistics

    for name in ("beech", "oak", "birch", "pine", "spruce"):
        fine, coarse = (
            grow_tree(
                TREES[name], name=name, height=20.0, rng=np.random.default_rng(3), detail=detail, grown_in="stand"
            )
            for detail in (1.0, PLANTINGS["forest"].groups["old"].detail)
        )
        own, true = crown_statistics(coarse, fine, 12.0), crown_statistics(fine, fine, 12.0)
        passing = f"{own.passing:.0%} pass, {own.jumps:.0%} jump above 0.5 m, by {1e2 * own.median_jump:.0f} cm"
        leaves = f"with true leaves {true.passing:.0%}, {true.jumps:.0%}, {1e2 * true.median_jump:.0f} cm"
        yield Row(f"LiDAR in the crown of an old {name}", "", f"{passing}; {leaves}")


def _leaf_corners(world: World, mesh: Mesh) -> Array:
    leafy = [k for k, name in enumerate(mesh.materials) if world.materials[name].label == Label.TREETOP]
    return mesh.vertices[mesh.faces[np.isin(mesh.material, leafy)]].astype(np.float64)


def trunks(world: World) -> Iterator[Row]:
    """Allometry and density of the forest's trees, from its inventory, and its clumps of grass."""
    rows = [dict(zip(COLUMNS, row, strict=True)) for row in inventory(world)]
    living = [row for row in rows if row["kind"] in TREES]
    height, diameter = (np.array([row[name] for row in living], float) for name in ("height_m", "trunk_diameter_m"))
    stems = diameter >= 0.07
    hectares = world.size[0] * world.size[1] / HECTARE
    slender = np.median((height / diameter)[stems & (height > 9.0)])
    yield Row("forest: height over diameter of trunks, median", "47", f"{slender:.0f}")
    area = np.pi / 4 * (diameter[stems] ** 2).sum() / hectares
    yield Row("forest: basal area", "51 m2/ha", f"{area:.0f} m2/ha of {stems.sum() / hectares:.0f} stems/ha")
    half = np.array(world.size) / 2
    clumps = sum(
        int((np.abs(swarm.world_from_object[:, :2, 3]) <= half).all(axis=1).sum())
        for swarm in world.swarms
        if any(set(world.meshes[name].species) & set(GRASSES) for name in swarm.meshes)
    )
    yield Row("forest: clumps of grass, herbs and ferns in 5,000 m2", "576", f"{clumps}")


def rocks(world: World) -> Iterator[Row]:
    """Rock types of stones and ledges on the hillside, and what grows there."""
    meshes = {instance.mesh for instance in world.instances} | {name for swarm in world.swarms for name in swarm.meshes}
    rock, plants = set[str](), set[str]()
    for name in meshes:
        mesh = world.meshes[name]
        hard = any(world.materials[material].label == Label.ROCK for material in mesh.materials)
        (rock if hard else plants).update(mesh.species)
    before = "limestone, granite, schist; heather and gorse"
    yield Row("hillside: rock types; plants", before, f"{', '.join(sorted(rock))}; {', '.join(sorted(plants))}")


def beyond(world: World, scene: ft.Scene, poses: list[Array]) -> Iterator[Row]:
    """Share of a scan's points outside the edge, with the land beyond it and without."""
    alone = ft.Scene(load_world(world.name, world.seed, {"beyond": False}))
    config, half = LidarConfig(), np.array(world.size) / 2
    shares = []
    for each in (scene, alone):
        lidar = ft.Lidar(config, each)
        points = np.concatenate(
            [ft.transforms.transform(pose, lidar.scan(pose).xyz.astype(np.float64)) for pose in poses]
        )
        shares.append(float((np.abs(points[:, :2]) > half).any(axis=1).mean()))
    now = f"{shares[0]:.1%}; {shares[1]:.1%} with beyond: false"
    yield Row(f"points outside the 100 m x 50 m, {world.name}", "16.5 %", now)
