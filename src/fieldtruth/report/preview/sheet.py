# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Layout of a preview sheet: title, aerial view, camera images with labels, cloud, class shares."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.report.drawing.cloud import draw_cloud, looking
from fieldtruth.report.drawing.maps import distance_along
from fieldtruth.report.drawing.style import MUTED, PIXELS, POINTS
from fieldtruth.report.preview.chart import draw_shares
from fieldtruth.report.preview.content import SheetContent
from fieldtruth.report.preview.map import WAYPOINT_RADIUS, badge, draw_map
from fieldtruth.report.preview.paper import Paper
from fieldtruth.sensors.camera.labels import tag_image
from fieldtruth.world.environments import list_environments
from fieldtruth.world.model import World

WIDTH: Final = 12.0  # [inch], like all lengths below
_EDGE: Final = 0.45
_INNER: Final = WIDTH - 2 * _EDGE
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
    aerial = _INNER * high / wide
    column = (_INNER - 3 * _GAP) / 4
    view_height = column * 9 / 16
    views_top = _MAP_TOP + aerial + _HEADING
    cloud_top = views_top + 2 * view_height + 0.05 + _HEADING
    paper = Paper(WIDTH, cloud_top + _CLOUD[1] + _EDGE, pixels)
    _write_title(paper, content.world)
    _write_heading(paper, _EDGE, _MAP_TOP, "Aerial view", _map_caption(content))
    draw_map(paper.image_at(content.aerial.photo, _EDGE, _MAP_TOP, _INNER, aerial), content)
    _write_heading(paper, _EDGE, views_top, "Camera views", _views_caption(content))
    for number, view in enumerate(content.views, 1):
        left, photo = _EDGE + (number - 1) * (column + _GAP), view.images.photo
        axes = paper.image_at(photo, left, views_top, column, view_height)
        badge(axes, 0.058 * photo.shape[1], 0.1 * photo.shape[0], number)
        paper.image_at(tag_image(view.images.label), left, views_top + view_height + 0.05, column, view_height)
    points = f"{len(content.cloud.label):,}".replace(",", " ")
    _write_heading(paper, _EDGE, cloud_top, "Labelled cloud", f"{content.cloud.scans} scans, {points} points")
    paper.image_at(_cloud_image(content, pixels), _EDGE, cloud_top, *_CLOUD)
    _draw_chart(paper, content, cloud_top)
    return paper.render()


def _write_title(paper: Paper, world: World) -> None:
    name, _, rest = list_environments().get(world.name, "").partition(": ")
    paper.text(_EDGE - 0.02, 0.6, world.name.replace("_", " ").capitalize(), 25, weight="bold")
    paper.text(_EDGE, 0.88, f"{name}: {rest}" if rest else name, 9.2, color=MUTED)
    triangles = sum(len(world.meshes[i.mesh].faces) for i in world.instances) / 1e6
    size = f"{world.size[0]:.0f} m x {world.size[1]:.0f} m"
    right = WIDTH - _EDGE
    paper.text(right, 0.6, f"seed {world.seed}   ·   {size}   ·   {len(world.instances)} objects", 9.2, ha="right")
    paper.text(right, 0.88, f"{triangles:.1f} million triangles in objects", 9.2, ha="right", color=MUTED)


def _write_heading(paper: Paper, left: float, top: float, title: str, caption: str) -> None:
    width = paper.text(left, top - 0.13, title, 10.5, weight="bold")
    paper.text(left + width + 0.14, top - 0.13, caption, 8.2, color=MUTED)


def _map_caption(content: SheetContent) -> str:
    if not content.routes:
        return "north is right"
    names = ", ".join(f"{route.name} {distance_along(route.path)[-1]:.0f} m" for route in content.routes)
    return f"north is right; routes ({names}) start at x, waypoints are circles of {WAYPOINT_RADIUS:.0f} m radius"


def _views_caption(content: SheetContent) -> str:
    if content.camera is None:
        return "the rig has no camera"
    return f"{content.camera.name} camera: photograph and class of each pixel"


def _cloud_image(content: SheetContent, pixels: int) -> NDArray[np.uint8]:
    """The cloud seen from above the lowest corner of the world: across a lake, up a hillside."""
    field, (length, breadth) = content.world.terrain.field, content.world.size
    corners = [(i * length, j * breadth) for i in (-0.5, 0.5) for j in (-0.5, 0.5)]
    x, y = min(corners, key=lambda corner: float(field.height_at(*corner)))
    width, height = (round(side * pixels / WIDTH) for side in _CLOUD)
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
    _write_heading(paper, left, top, "Class shares", f"from {len(content.viewpoints)} viewpoints {where}")
    for k, (name, colour) in enumerate((("pixels", PIXELS), ("points", POINTS))):
        paper.box(left + 1.52 + 0.72 * k, top + 0.035, 0.13, 0.1, colour)
        paper.text(left + 1.71 + 0.72 * k, top + 0.122, name, 7.4)
    draw_shares(paper, content.shares, left, top + 0.26, WIDTH - _EDGE - left, _CLOUD[1] - 0.26)
