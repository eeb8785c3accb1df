# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds from maps: what a large one costs, and how near it is to its maps.

Run: python benchmarks/site.py [size] [images] [heights] [trees] [stems], by default all, or --scan FILE.laz
--at LATITUDE LONGITUDE --size LENGTH WIDTH.

- size: build time and peak memory of 1 km x 1 km with 50,000 trees of an inventory, on a DEM, with paths; processor
  time, which other work slows little, and wall time.
- images: processor time of photographs at random positions in a part of it, 100 m x 50 m with the same density, over
  that of the built-in forest.
- heights: the ground at the raster's data nodes, before and with its microrelief.
- trees: a forest of known trees is scanned from the air by our own ray tracer, written as a LAZ file, and its trees are
  found: detection rate, false ones, errors of height, crown and position. Found and true trees are pairs if each is the
  other's nearest within ``REACH``.
- stems: a forest of ours is scanned by our own ray tracer from six places on the ground, with noise of 4 mm: how many
  stems are found, and errors of their diameters.
- scan: the canopy of a real airborne scan, and that of the world that is built of it, scanned again with as many
  pulses: differences of their heights, and those of a world with as many trees of mean height at random places.
"""

import argparse
import resource
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, Final

import laspy
import numpy as np
import pyproj
import rasterio
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree
from views import poses_on_route

from fieldtruth.bench import settings_of
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.core.geodesy import Origin, geodetic_from_world, world_from_geodetic
from fieldtruth.core.transforms import pose
from fieldtruth.kernels.cast import Hits
from fieldtruth.maps.canopy import Canopy, read_canopy_points
from fieldtruth.maps.elevation import read_raster
from fieldtruth.maps.stems import find_stems
from fieldtruth.maps.trees import Tree, find_trees
from fieldtruth.render.bake import bake
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.sensing import Camera
from fieldtruth.world.build import build_world, load_world
from fieldtruth.world.model import World
from fieldtruth.world.plants import TREES
from fieldtruth.world.plants.trees import COLLIDER

PLACE: Final = Origin(47.6, 11.3, 0.0)
SIDE, COUNT, CELL = 1000.0, 50_000, 2.0
"""Side [m] of the large site, its trees, and the cells [m] of its elevation model."""
REACH: Final = 2.5
"""Distance [m] between a found and a true top that are the same tree, at most."""
PULSES: Final = 8.0
"""Pulses to the square metre of a scan."""
VIEWS: Final = 6
"""Poses of photographs in each world."""
SWATH_DEG: Final = 12.0
"""Greatest angle of a pulse from the vertical."""
FOOTPRINT: Final = 0.3
"""Width [m] of a pulse on the ground."""
ABOVE: Final = 200.0
"""Height [m] from which pulses start."""
STATIONS: Final = [(x, y) for x in (-20.0, 0.0, 20.0) for y in (-10.0, 10.0)]
"""Positions [m] of scans from the ground."""
KINDS: Final = {"Picea abies": 0.4, "Fagus sylvatica": 0.35, "Quercus robur": 0.15, "Betula pendula": 0.1}


def terrain_file(path: Path, size: float, rng: np.random.Generator, cell: float = CELL) -> Path:
    """Write a raster of hills in UTM zone 32 that reaches 900 m beyond a square, so that it is the land there, too."""
    east, north = pyproj.Transformer.from_crs(4326, 32632, always_xy=True).transform(PLACE.longitude, PLACE.latitude)
    n = int((size + 1800.0) / cell)
    heights = np.zeros((n, n))
    for width, height in ((120.0, 8.0), (30.0, 1.2), (8.0, 0.15)):
        heights += height * gaussian_filter(rng.standard_normal((n, n)), width / cell, mode="wrap") * width / cell * 3.5
    transform = rasterio.transform.from_origin(east - n * cell / 2, north + n * cell / 2, cell, cell)
    profile = {"driver": "GTiff", "dtype": "float32", "count": 1, "height": n, "width": n, "transform": transform}
    with rasterio.open(path, "w", crs="EPSG:32632", **profile) as dataset:
        dataset.write((700.0 + heights).astype(np.float32), 1)
    return path


def inventory(path: Path, size: tuple[float, float], count: int, rng: np.random.Generator) -> Path:
    """Write trees at least about half of their mean distance apart, with heights, crowns and species."""
    across = max(1, round(np.sqrt(count * size[1] / size[0])))
    along = int(np.ceil(count / across))
    cells = np.stack(np.meshgrid(np.arange(along), np.arange(across), indexing="ij"), axis=-1).reshape(-1, 2)[:count]
    xy = (cells + rng.uniform(0.15, 0.85, cells.shape)) / (along, across) * size - np.array(size) / 2
    height = rng.uniform(9.0, 27.0, count)
    crown = height * rng.normal(0.13, 0.02, count).clip(0.08, 0.2)
    species = rng.choice(list(KINDS), count, p=list(KINDS.values()))
    rows = zip(*xy.T.round(3), height.round(2), crown.round(2), species, strict=True)
    lines = [",".join(map(str, row)) for row in rows]
    path.write_text("\n".join(["x,y,height_m,crown_radius_m,species", *lines]))
    return path


def paths_file(path: Path, size: float) -> Path:
    """Write a map with a grid of tracks, 250 m apart; a small one has two."""
    nodes, ways = list[str](), list[str]()
    for k, offset in enumerate(np.arange(min(125.0, size / 2) - size / 2, size / 2, 250.0)):
        for turned in (False, True):
            ids = []
            for at in np.linspace(-size / 2 - 10, size / 2 + 10, 20):
                wave = offset + 12.0 * np.sin(at / 60.0 + k)
                x, y = (wave, at) if turned else (at, wave)
                latitude, longitude, _ = geodetic_from_world((x, y, 0.0), PLACE)
                nodes.append(f'<node id="{len(nodes) + 1}" version="1" lat="{latitude:.9f}" lon="{longitude:.9f}"/>')
                ids.append(len(nodes))
            refs = "".join(f'<nd ref="{each}"/>' for each in ids)
            ways.append(f'<way id="{len(ways) + 1}" version="1">{refs}<tag k="highway" v="track"/></way>')
    path.write_text(f'<osm version="0.6">{"".join(nodes)}{"".join(ways)}</osm>')
    return path


def layout(folder: Path, size: tuple[float, float], count: int, cell: float = CELL) -> dict[str, Any]:
    """Layout of a site of a DEM, trees to a number, and tracks."""
    rng = np.random.default_rng(7)
    return {
        "centre": [PLACE.latitude, PLACE.longitude],
        "size": list(size),
        "elevation": {"file": str(terrain_file(folder / "dem.tif", max(size), rng, cell)), "reference": "ellipsoid"},
        "trees": {"file": str(inventory(folder / "trees.csv", size, count, rng)), "crs": "world"},
        "map": {"file": str(paths_file(folder / "tracks.osm", max(size)))},
    }


def measure_size(folder: Path) -> None:
    """Print what the large site costs."""
    own = layout(folder, (SIDE, SIDE), COUNT)
    start, processor = perf_counter(), process_time()
    world = build_world("site", 0, own)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    trees = sum(len(world.meshes[each.mesh].species) > 0 for each in world.instances)
    print(
        f"size: {SIDE:g} m x {SIDE:g} m, {trees:,} trees, {sum(len(s.mesh) for s in world.swarms):,} plants in swarms: "
        f"{perf_counter() - start:.0f} s, {process_time() - processor:.0f} s of processor time, peak {peak:.2f} GB"
    )


def random_poses(world: World, count: int) -> list[Array]:
    """Poses of a camera 0.8 m above the ground on the tracks, where there are any, and along them."""
    field, rng = world.terrain.field, np.random.default_rng(3)
    half = np.array(world.size) / 2 - 4.0
    xy = rng.uniform(-half, half, (4000, 2))
    xy = xy[world.terrain.trail_distance.at(*xy.T) < -0.5][:count]
    base_from_optical = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
    return [
        pose((x, y, float(field.height_at(x, y)) + 0.8), (0.0, 0.0, float(rng.uniform(0, 360)))) @ base_from_optical
        for x, y in xy
    ]


def measure_images(folder: Path) -> None:
    """Print the time of images in a site over that in the built-in forest, at poses on their trails."""
    settings = settings_of("forest")
    rig, light = settings.experiment.rig, settings.experiment.light
    forest, site = load_world("forest"), build_world("site", 0, layout(folder, (100.0, 50.0), COUNT // 200))
    cameras, poses = list[Camera](), list[list[Array]]()
    for world in (site, forest):
        cameras.append(Camera(rig.stereo, bake(Scene(world), light, folder=None), reuse=True))
        poses.append(random_poses(world, VIEWS))
    route = poses_on_route(settings.experiment.route, forest, rig, VIEWS)
    poses.append([each @ rig.imagers[0].base_from_optical for each in route])
    own, trail, driven = (fastest(cameras[k], poses[j]) for k, j in ((0, 0), (1, 1), (1, 2)))
    print(
        f"images: {1e3 * own:.0f} ms a pair in the site, {1e3 * trail:.0f} ms at such poses in the forest: ratio "
        f"{own / trail:.2f} (forest_1's route: {1e3 * driven:.0f} ms, ratio {own / driven:.2f})"
    )


def fastest(camera: Camera, poses: Sequence[Array], tries: int = 2) -> float:
    """Mean over poses of the least processor time [s]."""
    best = np.full(len(poses), np.inf)
    camera.render(poses[0])
    for _ in range(tries):
        for k, each in enumerate(poses):
            start = process_time()
            camera.render(each)
            best[k] = min(best[k], process_time() - start)
    return float(best.mean())


def measure_heights(folder: Path) -> None:
    """Print how far the ground is from the raster at its nodes."""
    own = layout(folder, (80.0, 60.0), 12)
    path = Path(own["elevation"]["file"])
    surface = read_raster(path, PLACE, (80.0, 60.0), reference="ellipsoid")
    world = build_world("site", 0, {**own, "litter": 0, "beyond": False})
    with rasterio.open(path) as dataset:
        rows, columns = (n.ravel() for n in np.meshgrid(*map(np.arange, dataset.shape), indexing="ij"))
        east, north = dataset.transform @ (columns + 0.5, rows + 0.5)
        heights = dataset.read(1)[rows, columns].astype(np.float64)
    longitude, latitude = pyproj.Transformer.from_crs(32632, 4326, always_xy=True).transform(east, north)
    points = world_from_geodetic(np.stack([latitude, longitude, heights], axis=-1), world.origin)
    inside = (np.abs(points[:, :2]) < np.array([38.0, 28.0])).all(axis=1)
    points = points[inside]
    step = np.array([0.0, 0.01])  # a spline has no single node
    smooth = [float(surface.at(x + step, y + step, world.origin)[0, 0]) for x, y, _ in points[::9]]
    away = np.abs(np.array(smooth) - points[::9, 2])
    built = np.abs(world.terrain.field.height_at(*points[:, :2].T) - points[:, 2])
    off = world.terrain.trail_distance.at(*points[:, :2].T) > 1.0
    print(
        f"heights at {len(points)} data nodes: before microrelief mean {1e3 * away.mean():.3f} mm, largest "
        f"{1e3 * away.max():.3f} mm; with it mean {1e3 * built[off].mean():.1f} mm, "
        f"95 % {1e3 * np.quantile(built[off], 0.95):.1f} mm"
    )


def airborne(path: Path, world: World, pulses: float, rng: np.random.Generator) -> Path:
    """Scan a world from the air, and write first returns and, where a pulse reaches it, the ground as last ones.

    A pulse is five rays over its footprint, of which the first hit counts: rays of no width see gaps between leaves.
    """
    scene, (length, width) = Scene(world), world.size
    count = round(pulses * length * width)
    target = rng.uniform(-0.5, 0.5, (count, 2)) * (length, width)
    angle = np.radians(rng.uniform(-SWATH_DEG, SWATH_DEG, count))
    down = np.stack([np.zeros(count), np.sin(angle), -np.cos(angle)], axis=-1)
    ground = world.terrain.field.height_at(*target.T)
    origins = np.column_stack([target, ground]) - down * (ABOVE / np.cos(angle))[:, None]
    around = np.concatenate([[[0.0, 0.0]], FOOTPRINT / 2.0 * np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])])
    shots = [scene.cast(origins + np.append(shift, 0.0), down) for shift in around]
    nearest = np.argmin([each.range_m for each in shots], axis=0)
    hits = Hits(*(np.choose(nearest if v[0].ndim == 1 else nearest[:, None], v) for v in zip(*shots, strict=True)))
    first = hits.position[np.isfinite(hits.range_m)]
    bare = np.isin(hits.label, (Label.GROUND, Label.TRAIL)) & np.isfinite(hits.range_m)
    # Of pulses that a crown stops, a part goes on to the ground, which classifiers find in most scans.
    further = ~bare & (rng.random(count) < 0.25)
    own = np.column_stack([target, ground])[further]
    points = np.concatenate([first, own])
    number = np.concatenate([np.ones(len(first)), np.full(len(own), 2)]).astype(np.uint8)
    of_ground = np.concatenate([bare[np.isfinite(hits.range_m)], np.ones(len(own), np.bool_)])
    latitude, longitude, height = geodetic_from_world(points, world.origin).T
    east, north = pyproj.Transformer.from_crs(4326, 32632, always_xy=True).transform(longitude, latitude)
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.add_crs(pyproj.CRS(32632))
    header.scales, header.offsets = np.full(3, 0.001), np.floor([east.min(), north.min(), 0.0])
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = east, north, height
    cloud.return_number, cloud.number_of_returns = number, np.full(len(number), 2, np.uint8)
    cloud.classification = np.where(of_ground, 2, 5).astype(np.uint8)
    cloud.write(path)
    return path


def measure_trees(folder: Path) -> None:
    """Print how many trees of known forests are found, and how well."""
    for per_ha in (100, 250, 500):
        size = (120.0, 80.0)
        own = layout(folder, size, round(per_ha * size[0] * size[1] / 1e4))
        world = build_world("site", 0, {**own, "litter": 0, "grass_per_m2": 0, "beyond": False})
        path = airborne(folder / "als.laz", world, PULSES, np.random.default_rng(5))
        found = find_trees(read_canopy_points(path, world.origin, size))
        print(f"trees, {per_ha} to the hectare, {PULSES:g} pulses to the m2: {matched(world, found)}")


def measure_stems(_: Path) -> None:
    """Print how many stems of a known forest are found in scans from the ground, and how well."""
    size, rng = (60.0, 40.0), np.random.default_rng(5)
    layout = {
        "size": size,
        "old_trees": 36,
        "grown_trees": 36,
        "young_trees": 20,
        "snags": 0,
        "beyond": False,
        "litter": 0,
    }
    world = build_world("forest", 1, layout)
    scene, field = Scene(world), world.terrain.field
    turn, rise = (np.radians(each) for each in np.meshgrid(np.arange(0, 360, 0.1), np.arange(-20, 20, 0.1)))
    rays = np.stack([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)], axis=-1).reshape(-1, 3)
    seen = []
    for x, y in STATIONS:
        origin = np.array([x, y, float(field.height_at(x, y)) + 1.6])
        hits = scene.cast(np.broadcast_to(origin, rays.shape), rays)
        kept = np.isfinite(hits.range_m) & (hits.range_m < 30.0)
        seen.append(hits.position[kept] + rng.normal(0.0, 0.004, (int(kept.sum()), 1)) * rays[kept])
    points = np.concatenate(seen)
    points[:, 2] -= field.height_at(*points[:, :2].clip(-np.array(size) / 2, np.array(size) / 2).T)
    trees = [each for each in world.instances if each.kind in TREES]
    sizes = [float(np.linalg.norm(each.world_from_object[:3, 0])) for each in trees]
    radii = [s * world.meshes[t.mesh].colliders[0].size[0] / COLLIDER for s, t in zip(sizes, trees, strict=True)]
    known = np.array([(*each.world_from_object[:2, 3], radius) for each, radius in zip(trees, radii, strict=True)])
    found = np.array([circle[:3] for circle in find_stems(points, rng)])
    away, row = (np.atleast_1d(each) for each in cKDTree(known[:, :2]).query(found[:, :2]))
    good = away < 0.3
    off = 200.0 * (found[good, 2] - known[row[good], 2])
    print(
        f"stems, {len(STATIONS)} scans of 0.24 ha from the ground: {len({*row[good].tolist()})} of {len(known)} found, "
        f"{(~good).sum()} false; diameter {off.mean():+.1f} cm, rms {np.sqrt((off**2).mean()):.1f} cm"
    )


def matched(world: World, found: Sequence[Tree]) -> str:
    """Compare found trees with those of a world: tops, heights and crowns of their meshes."""
    true = []
    for each in world.instances:
        mesh, at = world.meshes[each.mesh], each.world_from_object
        if mesh.species and mesh.vertices[:, 2].max() > 2.5:
            corners = mesh.vertices.astype(np.float64) @ at[:3, :3].T + at[:3, 3]
            top, radius = corners[np.argmax(corners[:, 2])], np.hypot(*(corners[:, :2] - at[:2, 3]).T)
            true.append((top[0], top[1], top[2] - at[2, 3], np.quantile(radius, 0.95)))
    known = np.array(true)
    seen = np.array([(tree.x, tree.y, tree.height or 0.0, tree.crown_radius or np.nan) for tree in found])
    away, nearest = (np.atleast_1d(each) for each in cKDTree(known[:, :2]).query(seen[:, :2]))
    back = np.atleast_1d(cKDTree(seen[:, :2]).query(known[:, :2])[1])
    pairs = [(k, j) for k, j in enumerate(nearest) if back[j] == k and away[k] < REACH]
    k, j = np.array(pairs).T
    height, crown = seen[k, 2] - known[j, 2], seen[k, 3] - known[j, 3]
    return (
        f"{len(pairs)} of {len(known)} found ({len(pairs) / len(known):.0%}), {len(seen) - len(pairs)} false; height "
        f"{height.mean():+.2f} m, rms {np.sqrt((height**2).mean()):.2f} m; crown radius {np.nanmean(crown):+.2f} m, "
        f"rms {np.sqrt(np.nanmean(crown**2)):.2f} m; top off by {away[k].mean():.2f} m"
    )


def measure_scan(
    folder: Path, path: Path, centre: tuple[float, float], size: tuple[float, float], species: Sequence[str]
) -> None:
    """Print how far the canopy of a site that is built of a scan is from that of the scan."""
    own: dict[str, Any] = {
        "centre": list(centre), "size": list(size), "litter": 0, "grass_per_m2": 0, "beyond": False,
        "elevation": {"file": str(path), "reference": "ellipsoid"}, "species": dict.fromkeys(species, 1.0),
    }  # fmt: skip
    site = build_world("site", 0, {**own, "trees": {"file": str(path)}})
    real = read_canopy_points(path, site.origin, size)
    pulses = pulses_of(path)
    half = np.array(size) / 2 - 2.0
    places = np.random.default_rng(1).uniform(-half, half, (40_000, 2))
    wanted = heights_at(real, places)
    found = find_trees(real)
    rng, mean = np.random.default_rng(2), float(np.mean([tree.height or 0.0 for tree in found]))
    rows = [f"{x:.2f},{y:.2f},{mean:.1f}" for x, y in rng.uniform(-half, half, (len(found), 2))]
    (folder / "mean.csv").write_text("\n".join(["x,y,height_m", *rows]))
    plain = build_world("site", 0, {**own, "trees": {"file": str(folder / "mean.csv"), "crs": "world"}})
    print(f"scan: {path.name}, {len(found)} trees found, mean canopy {wanted.mean():.1f} m")
    for name, world in (("as many trees of mean height at random", plain), ("its trees", site)):
        own_scan = airborne(folder / "again.laz", world, pulses, rng)
        away = heights_at(read_canopy_points(own_scan, world.origin, size), places) - wanted
        print(
            f"  {name}: bias {away.mean():+.2f} m, mean {np.abs(away).mean():.2f} m, "
            f"95 % {np.quantile(np.abs(away), 0.95):.2f} m, of plots of 20 m: mean {plots(away, places):.2f} m"
        )


def pulses_of(path: Path) -> float:
    """First returns to the square metre of a scan, where it has any."""
    cloud = laspy.read(path)
    first = np.stack([cloud.x, cloud.y], axis=-1)[np.asarray(cloud.return_number) <= 1]
    return len(first) / len(np.unique(np.floor(first / 2.0), axis=0)) / 4.0


def heights_at(canopy: Canopy, places: Array) -> Array:
    """Heights [m] of a canopy in the cells of positions (n, 2)."""
    inverse = np.linalg.inv(canopy.world_from_cell[:, :2])
    row, column = np.rint(inverse @ (places.T - canopy.world_from_cell[:, 2:])).astype(int)
    shape = canopy.heights.shape
    return np.asarray(canopy.heights[row.clip(0, shape[0] - 1), column.clip(0, shape[1] - 1)], np.float64)


def plots(away: Array, places: Array) -> float:
    """Mean over squares of 20 m of the size of the mean difference [m]."""
    _, number = np.unique(np.floor(places / 20.0), axis=0, return_inverse=True)
    return float(np.abs(np.bincount(number, away) / np.bincount(number)).mean())


PARTS: Final[dict[str, Callable[[Path], None]]] = {
    "size": measure_size, "images": measure_images, "heights": measure_heights, "trees": measure_trees,
    "stems": measure_stems,
}  # fmt: skip


def main() -> None:
    """Measure what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="default: all")
    parser.add_argument("--scan", type=Path, help="LAS or LAZ file with ground points")
    parser.add_argument("--at", type=float, nargs=2, metavar=("LATITUDE", "LONGITUDE"), help="middle of the site")
    parser.add_argument("--size", type=float, nargs=2, default=(60.0, 60.0), help="[m] of the site along x and y")
    parser.add_argument("--species", nargs="+", default=["beech", "spruce", "oak", "birch"], help="of its trees")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if options.scan is not None:
            measure_scan(Path(folder), options.scan, tuple(options.at), tuple(options.size), options.species)
        for name in options.parts or ([] if options.scan else PARTS):
            PARTS[name](Path(folder))


if __name__ == "__main__":
    main()
