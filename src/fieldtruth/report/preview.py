# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A sheet about an environment: aerial view with routes, camera images with labels, labelled cloud, class shares."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import AbstractPathEffect, withStroke
from numpy.typing import NDArray

from fieldtruth.core import readings, transforms
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.classes import SemanticClass
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.core.readings import Image
from fieldtruth.drive.plan import expected_path, experiments_in, pose_on_ground, poses_along
from fieldtruth.drive.traversability import Traversability
from fieldtruth.experiment.config import metres_from_route
from fieldtruth.experiment.environment_file import CENTRE, resolved
from fieldtruth.experiment.imaging_config import Imager
from fieldtruth.experiment.rig import Rig
from fieldtruth.render.bake import bake
from fieldtruth.report.drawing.cloud import Cloud, draw_cloud, looking
from fieldtruth.report.drawing.maps import Aerial, arc, distance_along, heading_of, render_aerial, sector
from fieldtruth.report.drawing.paper import Paper
from fieldtruth.report.drawing.style import (
    FONT,
    HAIRLINE,
    INK,
    MUTED,
    PIXELS,
    POINTS,
    RED,
    ROUTES,
    class_colour,
    percent,
)
from fieldtruth.report.shares import SPACING, ClassShares, count_classes
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.kind import At, Sensor, SensorWorld, standing
from fieldtruth.sensors.known import new_sensors
from fieldtruth.world.build import load_world
from fieldtruth.world.environments import FROM_FILES, list_environments
from fieldtruth.world.model import World

WIDTH: Final = 2400
"""Default width [pixel]."""
WIDTH_IN_DOCUMENTS: Final = 1400
"""Width [pixel] at which the sheet is still sharp as a JPEG below 400 kB."""
APART: Final = 12.0
"""Preferred distance [m] between two viewpoints."""
_CLEARANCE: Final = 1.0  # [m] around the robot
_INSET: Final = 0.16  # share of the world's sides
VIEWS: Final = 4
SCANS: Final = 240
"""Maximum number of scans in the cloud, evenly spread over the sample."""
FREE_VIEWPOINTS: Final = 40
"""Size of the sample in an environment without experiments."""


def most_informative(pixels: Counts, positions: Array, count: int) -> list[int]:
    """Rows of the ``count`` viewpoints whose images together show most, in ascending order.

    Greedy: each step takes the viewpoint that adds most to the sum, over the classes, of the square root of their
    accumulated share. So rare classes count, and a second similar image adds little.

    Args:
        pixels: (n, classes) pixel counts of each viewpoint's image.
        positions: (n, 2) [m]; the chosen ones are ``APART`` where possible.
        count: number of rows; fewer if there are fewer viewpoints.
    """
    share = pixels / np.maximum(pixels.sum(axis=1, keepdims=True), 1)
    chosen: list[int] = []
    while len(chosen) < min(count, len(pixels)):
        gain = np.sqrt(share[chosen].sum(axis=0) + share).sum(axis=1)
        to_chosen = np.linalg.norm(positions[:, None] - positions[chosen], axis=2).min(axis=1, initial=APART)
        gain += 10.0 * to_chosen / APART
        gain[chosen] = -1.0
        chosen.append(int(np.argmax(gain)))
    return sorted(chosen)


def free_viewpoints(world: World, rig: Rig) -> Array:
    """Random viewpoints (n, 3), x, y [m] and heading [rad], where the robot could stand, facing the middle.

    There are fewer than ``FREE_VIEWPOINTS`` if 200 draws for each are not enough.
    """
    count, rng, sides = FREE_VIEWPOINTS, np.random.default_rng([world.seed, 3]), np.array(world.size)
    xy = rng.uniform(-0.5 + _INSET, 0.5 - _INSET, (200 * count, 2)) * sides
    xy = xy[Traversability(world, rig).clearance_at(xy) > _CLEARANCE][:count]
    target = rng.uniform(-0.2, 0.2, (len(xy), 2)) * sides
    return np.column_stack([xy, np.arctan2(target[:, 1] - xy[:, 1], target[:, 0] - xy[:, 0])])


class Route(NamedTuple):
    """An experiment's waypoints and expected path, x, y [m], starting with the start."""

    name: str
    waypoints: Array  # (1 + n, 2)
    path: Array  # (m, 2)


class View(NamedTuple):
    """Images of a sheet at a viewpoint: x, y [m] and heading [rad]."""

    viewpoint: Array  # (3,)
    photo: NDArray[np.uint8]
    label: NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class SheetContent:
    """Content of a sheet. ``viewpoints`` (n, 3), x, y [m] and heading [rad], are those of the class shares."""

    world: World
    routes: tuple[Route, ...]
    viewpoints: Array
    shares: ClassShares
    aerial: Aerial
    imager: Imager | None
    """The first view of the rig, that of ``views``; None for a rig without images."""
    views: tuple[View, ...]
    cloud: Cloud
    inputs: NDArray[np.uint8] | None = None
    """The maps of a site, in the pixels of the aerial view."""


def collect_content(
    world: World,
    *,
    aerial_width: int,
    rig: Rig | None = None,
    spacing: float = SPACING,
    workers: int,
    progress: Progress,
) -> SheetContent:
    """Render and scan a world from above, along the routes of its experiments, and from the four best viewpoints.

    Args:
        world: the world; its name is the environment's.
        aerial_width: of the aerial view [pixel].
        rig: the sensors; None takes the paper's.
        spacing: distance [m] along the path between viewpoints of the sample.
        workers: threads.
        progress: receives the stages of the work.
    """
    rig, experiments = Rig() if rig is None else rig, experiments_in(world.name)
    with progress.stage("prepare the scene"):
        scene = Scene(world)
        baked = bake(scene, workers=workers)
        ideal = rig.with_each(lambda each: {"signal": None, "clock": None})
        sensors = new_sensors(SensorWorld(world, ideal, baked=baked))
    paths = [expected_path(experiment, world) for experiment in experiments]
    routes = tuple(
        Route(each.name, metres_from_route(each.route, world.origin), path[:, :2])
        for each, path in zip(experiments, paths, strict=True)
    )
    along = [poses_along(path, spacing) for path in paths]
    viewpoints = np.concatenate(along) if along else free_viewpoints(world, rig)
    poses = [pose_on_ground(world.terrain.field, viewpoint, rig) for viewpoint in viewpoints]
    with progress.stage("count classes"):
        shares = count_classes(scene, rig, poses, workers=workers)
    with progress.stage("render images"):
        aerial = render_aerial(baked, aerial_width)
        views = _views(sensors, poses, viewpoints, shares)
    with progress.stage("scan"):
        cloud = _scan(world, sensors, poses[:: max(1, -(-len(poses) // SCANS))])
    return SheetContent(
        world=world,
        routes=routes,
        viewpoints=viewpoints,
        shares=shares,
        aerial=aerial,
        imager=next(iter(rig.imagers), None),
        views=views,
        cloud=cloud,
    )


def _views(
    sensors: Mapping[str, Sensor], poses: Sequence[Array], viewpoints: Array, shares: ClassShares
) -> tuple[View, ...]:
    """Images of the first view, from where it sees most."""
    eye = next((sensor for sensor in sensors.values() if issubclass(sensor.config.gives, Image)), None)
    if eye is None:
        return ()
    output = eye.config.outputs()[0]
    rows = most_informative(shares.pixels, viewpoints[:, :2], VIEWS)
    found = (eye.read(output, At(row, 0, 0, standing(poses[row]))) for row in rows)
    return tuple(View(viewpoints[row], each.photo, each.label) for row, each in zip(rows, found, strict=True))


def _scan(world: World, sensors: Mapping[str, Sensor], poses: Sequence[Array]) -> Cloud:
    """Points inside the edges of the world, from a cloud of each sensor at each pose world_from_base (4, 4)."""
    scanners = [sensor for sensor in sensors.values() if issubclass(sensor.config.gives, readings.Cloud)]
    xyz, label = [np.zeros((0, 3))], [np.zeros(0, np.uint8)]
    for number, pose in enumerate(poses):
        for sensor in scanners:
            scan = sensor.read(sensor.config.outputs()[0], At(number, 0, 0, standing(pose)))
            points = transforms.transform(pose @ sensor.config.base_from_frames()[scan.frame], scan.xyz)
            inside = (np.abs(points[:, :2]) < np.array(world.size) / 2).all(axis=1)
            xyz.append(points[inside])
            label.append(scan.label[inside])
    return Cloud(
        xyz=np.concatenate(xyz), label=np.concatenate(label), scans=len(poses) * len(scanners), classes=world.classes
    )


# ---------------------------------------------------------------------------------------------------------------------
# Aerial view with routes and viewpoints

WAYPOINT_RADIUS: Final = 3.0
"""Radius [m] of the circles (paper, section 3)."""
_ARROW_SPACING: Final = 24.0  # [m]
_SCALE: Final = 10.0  # [m]
_FIELD_OF_VIEW: Final = 4.5  # [m] that the sectors extend


def draw_map(axes: Axes, content: SheetContent) -> None:
    """Draw on axes whose unit is the pixel of the aerial view."""
    aerial = content.aerial
    for route in content.routes:
        for waypoint in route.waypoints[1:]:
            ring = aerial.ground_pixels(arc(waypoint, WAYPOINT_RADIUS))
            axes.fill(*ring.T, facecolor=(1.0, 0.23, 0.19, 0.10), edgecolor=RED, linewidth=1.1)
    for k, route in enumerate(content.routes):
        line, colour = aerial.ground_pixels(route.path), ROUTES[k % len(ROUTES)]
        axes.plot(*line.T, color=colour, linewidth=2.0, path_effects=_halo(3.6, "white", 0.75))
        _draw_arrows(axes, line, route.path, colour)
        _draw_start(axes, line[0], route, colour, aerial)
    for number, view in enumerate(content.views, 1):
        assert content.imager is not None
        _draw_viewpoint(axes, aerial, view, number, content.imager)
    _draw_scale_and_north(axes, aerial)


def badge(axes: Axes, column: float, row: float, number: int) -> None:
    """Draw a small dark disc with a number at a pixel."""
    disc = {"boxstyle": "circle,pad=0.22", "facecolor": INK, "edgecolor": "white", "linewidth": 1.0}
    _write(axes, column, row, str(number), 7.0, color="white", va="center_baseline", bbox=disc, zorder=7)


def _halo(width: float, colour: str, alpha: float) -> list[AbstractPathEffect]:
    return [withStroke(linewidth=width, foreground=colour, alpha=alpha)]


def _write(axes: Axes, column: float, row: float, text: str, size: float, **options: Any) -> None:
    style: dict[str, Any] = {"family": FONT, "weight": "bold", "ha": "center", "va": "center"} | options
    axes.text(column, row, text, fontsize=size, **style)


def _arrow(axes: Axes, tail: Array, head: Array, **options: Any) -> None:
    style: dict[str, Any] = {"arrowstyle": "-|>", "shrinkA": 0, "shrinkB": 0} | options
    axes.annotate("", (head[0], head[1]), (tail[0], tail[1]), arrowprops=style)


def _draw_arrows(axes: Axes, line: Array, path: Array, colour: str) -> None:
    distance = distance_along(path)
    shape = "-|>,head_width=0.34,head_length=0.55"
    style = {"arrowstyle": shape, "color": colour, "linewidth": 0.0, "path_effects": _halo(1.4, "white", 1.0)}
    for row in np.searchsorted(distance, np.arange(_ARROW_SPACING / 2, distance[-1], _ARROW_SPACING)):
        _arrow(axes, line[max(row - 12, 0)], line[row], mutation_scale=13, **style)


def _draw_start(axes: Axes, start: Array, route: Route, colour: str, aerial: Aerial) -> None:
    """Draw a cross at the start and the experiment's name behind it."""
    for width, ink in ((4.4, "white"), (2.4, colour)):
        axes.plot(*start, marker="x", markersize=9, markeredgewidth=width, color=ink, zorder=5)
    ahead = route.path[min(60, len(route.path) - 1)] - route.path[0]
    back = -ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    size = np.array(aerial.photo.shape[1::-1])
    column, row = np.clip(start + back * (0.028, -0.018) * size[0], 0.03 * size, 0.97 * size)
    shape = "round,pad=0.32,rounding_size=0.6"
    plate = {"boxstyle": shape, "facecolor": "white", "edgecolor": colour, "linewidth": 1.2}
    _write(axes, column, row, route.name, 7.6, color=INK, bbox=plate, zorder=6)


def _draw_viewpoint(axes: Axes, aerial: Aerial, view: View, number: int, imager: Imager) -> None:
    x, y, heading = view.viewpoint
    seen = np.array([x, y, heading + heading_of(imager.base_from_optical)])
    fov = np.radians(imager.config.horizontal_fov_deg)
    outline = aerial.ground_pixels(sector(seen, _FIELD_OF_VIEW, fov))
    axes.fill(*outline.T, facecolor="white", alpha=0.45, linewidth=0.0, zorder=3)
    badge(axes, outline[0, 0], outline[0, 1], number)


def _draw_scale_and_north(axes: Axes, aerial: Aerial) -> None:
    """Draw a scale bar and an arrow to the north in the lower right corner."""
    ground = float(aerial.field.heights.mean())
    length = np.diff(aerial.pixels([(-_SCALE / 2, 0.0, ground), (_SCALE / 2, 0.0, ground)])[:, 0])[0]
    size = np.array(aerial.photo.shape[1::-1])
    end = size * (0.975, 0.955)
    start, text_row = end - (length, 0.0), end[1] - 0.014 * size[1]
    shadow = _halo(3.2, "black", 0.55)
    text = {"color": "white", "va": "bottom", "weight": "normal", "path_effects": _halo(1.8, "black", 0.6)}
    axes.plot(*np.array([start, end]).T, color="white", linewidth=2.0, solid_capstyle="butt", path_effects=shadow)
    _write(axes, float(start[0] + end[0]) / 2, text_row, f"{_SCALE:.0f} m", 7.4, **text)
    tail, head = start - (0.056 * size[0], 0.0), start - (0.022 * size[0], 0.0)
    _arrow(axes, tail, head, color="white", linewidth=1.6, mutation_scale=11, path_effects=shadow)
    _write(axes, float(tail[0] + head[0]) / 2, text_row, "north", 7.4, **text)


# ---------------------------------------------------------------------------------------------------------------------
# Class shares

_NAME: Final = 1.52  # [inch] for swatch and name
_VALUE: Final = 0.42  # [inch] for the number beside the longest bar
_BAR: Final = 0.092  # [inch]


def draw_shares(paper: Paper, shares: ClassShares, left: float, top: float, width: float, height: float) -> None:
    """Fill a box with a row for each class that occurs."""
    rows = list(occurring_classes(shares))
    longest = max((max(share) for _, *share in rows), default=0.0) or 1.0
    pitch = min(height / max(len(rows), 1), 0.5)
    paper.box(left + _NAME, top, 0.006, pitch * len(rows), HAIRLINE)
    for k, (row, *share) in enumerate(rows):
        middle = top + (k + 0.5) * pitch
        paper.box(left, middle - 0.085, 0.25, 0.17, class_colour(row), edgecolor=HAIRLINE, linewidth=0.6)
        paper.text(left + 0.36, middle + 0.042, row.name, 8.2)
        for value, colour, offset in zip(share, (PIXELS, POINTS), (-_BAR - 0.008, 0.008), strict=True):
            length = (width - _NAME - _VALUE) * value / longest
            end, ink = left + _NAME + length + 0.06, INK if value else MUTED
            paper.box(left + _NAME, middle + offset, length, _BAR, colour)
            paper.text(end, middle + offset + 0.077, percent(value, 1), 5.9, color=ink)


def occurring_classes(shares: ClassShares) -> Iterator[tuple[SemanticClass, float, float]]:
    """Classes with at least one pixel or point, each with its share of pixels and of points."""
    for row, pixels, points in zip(shares.classes, shares.pixel_share, shares.point_share, strict=True):
        if pixels or points:
            yield row, float(pixels), float(points)


# ---------------------------------------------------------------------------------------------------------------------
# Sheet

_SHEET: Final = 12.0  # [inch], like all lengths below
_EDGE: Final = 0.45
_INNER: Final = _SHEET - 2 * _EDGE
_MAP_TOP: Final = 1.5
_GAP: Final = 0.12
_HEADING: Final = 0.56
_CLOUD: Final = (6.75, 4.35)
_FOV_DEG: Final = 44.0
_DESCENT: Final = 0.36  # of the view of the cloud, as a share of the world's length
_OUTSIDE: Final = 2.0  # percent of the points that may be beyond each edge of the view


def draw_sheet(content: SheetContent, pixels: int) -> NDArray[np.uint8]:
    """Draw the sheet ``pixels`` wide, (h, w, 3)."""
    high, wide = content.aerial.photo.shape[:2]
    width = _INNER if content.inputs is None else (_INNER - _GAP) / 2
    aerial = width * high / wide
    column = (_INNER - 3 * _GAP) / 4
    view_height = column * 9 / 16
    views_top = _MAP_TOP + aerial + _HEADING
    cloud_top = views_top + 2 * view_height + 0.05 + _HEADING
    paper = Paper(_SHEET, cloud_top + _CLOUD[1] + _EDGE, pixels)
    _write_title(paper, content.world)
    paper.heading(_EDGE, _MAP_TOP, "Aerial view", _map_caption(content))
    draw_map(paper.image_at(content.aerial.photo, _EDGE, _MAP_TOP, width, aerial), content)
    if content.inputs is not None:
        right = _EDGE + width + _GAP
        paper.heading(right, _MAP_TOP, "Maps", "relief, areas, lines and trees as they were read")
        paper.image_at(content.inputs, right, _MAP_TOP, width, aerial)
    paper.heading(_EDGE, views_top, "Camera views", _views_caption(content))
    palette = content.world.classes.palette
    for number, view in enumerate(content.views, 1):
        left, photo = _EDGE + (number - 1) * (column + _GAP), view.photo
        axes = paper.image_at(photo, left, views_top, column, view_height)
        badge(axes, 0.058 * photo.shape[1], 0.1 * photo.shape[0], number)
        paper.image_at(palette[view.label], left, views_top + view_height + 0.05, column, view_height)
    points = f"{len(content.cloud.label):,}".replace(",", " ")
    paper.heading(_EDGE, cloud_top, "Labelled cloud", f"{content.cloud.scans} scans, {points} points")
    paper.image_at(_cloud_image(content, pixels), _EDGE, cloud_top, *_CLOUD)
    _draw_chart(paper, content, cloud_top)
    return paper.render()


def _write_title(paper: Paper, world: World) -> None:
    place = f"site about {world.origin.latitude:.6f}, {world.origin.longitude:.6f} (latitude, longitude)"
    known = {world.name: place} if CENTRE in world.layout else list_environments()
    name, _, rest = known.get(world.name, "").partition(": ")
    paper.text(_EDGE - 0.02, 0.6, world.name.replace("_", " ").capitalize(), 25, weight="bold")
    paper.text(_EDGE, 0.88, f"{name}: {rest}" if rest else name, 9.2, color=MUTED)
    triangles = sum(len(world.meshes[i.mesh].faces) for i in world.instances) / 1e6
    size = f"{world.size[0]:.0f} m x {world.size[1]:.0f} m"
    right = _SHEET - _EDGE
    paper.text(right, 0.6, f"seed {world.seed}   ·   {size}   ·   {len(world.instances)} objects", 9.2, ha="right")
    paper.text(right, 0.88, f"{triangles:.1f} million triangles in objects", 9.2, ha="right", color=MUTED)


def _map_caption(content: SheetContent) -> str:
    if not content.routes:
        return "north is right"
    names = ", ".join(f"{route.name} {distance_along(route.path)[-1]:.0f} m" for route in content.routes)
    return f"north is right; routes ({names}) start at x, waypoints are circles of {WAYPOINT_RADIUS:.0f} m radius"


def _views_caption(content: SheetContent) -> str:
    if content.imager is None:
        return "the rig has no camera"
    return f"{content.imager.name} camera: photograph and class of each pixel"


def _cloud_image(content: SheetContent, pixels: int) -> NDArray[np.uint8]:
    """The cloud seen from above the lowest corner of the world: across a lake, up a hillside."""
    field, (length, breadth) = content.world.terrain.field, content.world.size
    corners = [(i * length, j * breadth) for i in (-0.5, 0.5) for j in (-0.5, 0.5)]
    x, y = min(corners, key=lambda corner: float(field.height_at(*corner)))
    width, height = (round(side * pixels / _SHEET) for side in _CLOUD)
    towards = (-0.5 * x, -2.0 * y, -_DESCENT * length)
    pose = view_of(content.cloud.xyz[::31], towards, fov_deg=_FOV_DEG, aspect=width / height)
    return draw_cloud(content.cloud, pose, width=width, height=height, fov_deg=_FOV_DEG)


def view_of(xyz: Array, towards: Sequence[float], *, fov_deg: float, aspect: float) -> Array:
    """Pose world_from_optical (4, 4) of an upright camera whose image nearly all points fill.

    Args:
        xyz: points (n, 3) [m].
        towards: direction of view.
        fov_deg: horizontal field of view.
        aspect: width of the image divided by its height.
    """
    pose = looking(towards)
    if not len(xyz):
        return pose
    rotation, slope = pose[:3, :3], np.tan(np.radians(fov_deg) / 2)
    sides = (_OUTSIDE, 100 - _OUTSIDE)
    eye = np.mean(np.percentile(xyz, sides, axis=0), axis=0)
    for _ in range(3):
        x, y, z = ((xyz - eye) @ rotation).T
        back = float(np.percentile(np.maximum(np.abs(x) / slope, np.abs(y) * aspect / slope) - z, sides[1]))
        depth = z + back
        ahead = depth > 0.1 * back
        right, down = (float(np.mean(np.percentile(v[ahead] / depth[ahead], sides))) for v in (x, y))
        median = float(np.median(depth))
        eye = eye + rotation @ (right * median, down * median, -back)
    pose[:3, 3] = eye
    return pose


def _draw_chart(paper: Paper, content: SheetContent, top: float) -> None:
    left = _EDGE + _CLOUD[0] + 0.42
    where = "along the routes" if content.routes else "at random"
    paper.heading(left, top, "Class shares", f"from {len(content.viewpoints)} viewpoints {where}")
    for k, (name, colour) in enumerate((("pixels", PIXELS), ("points", POINTS))):
        paper.box(left + 1.52 + 0.72 * k, top + 0.035, 0.13, 0.1, colour)
        paper.text(left + 1.71 + 0.72 * k, top + 0.122, name, 7.4)
    draw_shares(paper, content.shares, left, top + 0.26, _SHEET - _EDGE - left, _CLOUD[1] - 0.26)


def preview(
    environment: str,
    seed: int = 0,
    *,
    layout: Mapping[str, Any] | None = None,
    width: int = WIDTH,
    workers: int | None = None,
    progress: Progress | None = None,
) -> NDArray[np.uint8]:
    """Draw a sheet about an environment, an image (h, w, 3) in sRGB.

    It shows the world from above with the routes of its built-in experiments (paper, Figures 8 to 11), four camera
    images with their labels (Figures 13 to 20), a labelled cloud along the routes (Figure 12), and the class shares of
    pixels and points (Figure 21). For an environment without experiments the viewpoints are random free positions.
    Beside the view of a site from above are its maps.

    Args:
        environment: a name from ``list_environments``, or the path of a site's file.
        seed: of the world.
        layout: changes to the environment's layout.
        width: of the sheet [pixel]; the height is about 1.3 times the width.
        workers: threads; None takes every available core. The sheet does not depend on it.
        progress: receives the stages of the work.

    Raises:
        UnknownNameError: the environment does not exist; lists those that do.
    """
    workers = cpu_count() if workers is None else workers
    progress = Silent() if progress is None else progress
    environment, layout = resolved(environment, layout)
    with progress.stage("build the world"):
        world = load_world(environment, seed, layout, progress=progress)
    content = collect_content(world, aerial_width=width, workers=workers, progress=progress)
    if environment in FROM_FILES:
        from fieldtruth.report.site_map import draw_inputs
        from fieldtruth.world.environments.site.inputs import inputs_of

        with progress.stage("draw the maps"):
            content = replace(content, inputs=draw_inputs(*inputs_of(layout), content.aerial))
    with progress.stage("lay out the sheet"):
        return draw_sheet(content, width)


__all__ = ["WIDTH", "WIDTH_IN_DOCUMENTS", "preview"]
