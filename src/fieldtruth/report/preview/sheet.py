# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sheet's layout: title, view from above, four views with their tags, cloud, class shares."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.experiment.rig import CameraConfig
from fieldtruth.report.drawing.cloud import draw_cloud, outlook
from fieldtruth.report.drawing.style import MUTED, NIGHT, PIXELS, POINTS
from fieldtruth.report.preview.chart import draw_shares
from fieldtruth.report.preview.content import Findings
from fieldtruth.report.preview.map import badge, draw_map
from fieldtruth.report.preview.paper import Paper
from fieldtruth.sense.label_camera import tag_image
from fieldtruth.world.environments import list_environments
from fieldtruth.world.model import World

WIDTH: Final = 12.0  # [inch]; what follows is measured so, too
_EDGE: Final = 0.45
_INNER: Final = WIDTH - 2 * _EDGE
_MAP_TOP: Final = 1.5
_GAP: Final = 0.12
_HEADING: Final = 0.56
_CLOUD: Final = (6.75, 4.35)
_FOV_DEG: Final = 44.0
_FALL: Final = 0.36  # of the look at the cloud, by the length of the place


def draw_sheet(found: Findings, pixels: int) -> NDArray[np.uint8]:
    """Lay out everything on a sheet that is ``pixels`` wide, (h, w, 3)."""
    high, wide = found.aerial.photo.shape[:2]
    aerial = _INNER * high / wide
    column = (_INNER - 3 * _GAP) / 4
    view = column * 9 / 16
    views_top = _MAP_TOP + aerial + _HEADING
    cloud_top = views_top + 2 * view + 0.05 + _HEADING
    paper = Paper(WIDTH, cloud_top + _CLOUD[1] + _EDGE, pixels)
    _write_title(paper, found.world)
    _heading(paper, _EDGE, _MAP_TOP, "From above", _legend_of_map(found))
    draw_map(paper.picture(found.aerial.photo, _EDGE, _MAP_TOP, _INNER, aerial), found, CameraConfig())
    _heading(paper, _EDGE, views_top, "From the robot", "left camera: photograph, and the class of each pixel")
    for number, shown in enumerate(found.views, 1):
        left = _EDGE + (number - 1) * (column + _GAP)
        photo = paper.picture(shown.picture.photo, left, views_top, column, view)
        badge(photo, 0.058 * shown.picture.photo.shape[1], 0.1 * shown.picture.photo.shape[0], number)
        paper.picture(tag_image(shown.picture.label), left, views_top + view + 0.05, column, view)
    points = f"{len(found.cloud.label):,}".replace(",", " ")
    _heading(paper, _EDGE, cloud_top, "Labelled cloud", f"{found.cloud.scans} scans, {points} points")
    paper.picture(_cloud(found, pixels), _EDGE, cloud_top, *_CLOUD)
    _draw_chart(paper, found, cloud_top)
    return paper.image()


def _write_title(paper: Paper, world: World) -> None:
    name, _, rest = list_environments().get(world.name, "").partition(": ")
    paper.text(_EDGE - 0.02, 0.6, world.name.replace("_", " ").capitalize(), 25, weight="bold")
    paper.text(_EDGE, 0.88, f"{name}: {rest}" if rest else name, 9.2, color=MUTED)
    triangles = sum(len(world.meshes[i.mesh].faces) for i in world.instances)
    facts = (
        f"seed {world.seed}   ·   {world.size[0]:.0f} m x {world.size[1]:.0f} m   ·   {len(world.instances)} objects"
    )
    paper.text(WIDTH - _EDGE, 0.6, facts, 9.2, ha="right")
    paper.text(WIDTH - _EDGE, 0.88, f"{triangles / 1e6:.1f} million triangles of objects", 9.2, ha="right", color=MUTED)


def _heading(paper: Paper, left: float, top: float, words: str, explanation: str) -> None:
    """Write a section's name, and what it shows, just above its upper edge."""
    width = paper.text(left, top - 0.13, words, 10.5, weight="bold")
    paper.text(left + width + 0.14, top - 0.13, explanation, 8.2, color=MUTED)


def _legend_of_map(found: Findings) -> str:
    if not found.routes:
        return "north to the right"
    way = [float(np.linalg.norm(np.diff(route.path, axis=0), axis=1).sum()) for route in found.routes]
    names = ", ".join(f"{route.name} {length:.0f} m" for route, length in zip(found.routes, way, strict=True))
    return f"north to the right; routes ({names}) start at x, way-points have a radius of 3 m"


def _cloud(found: Findings, pixels: int) -> NDArray[np.uint8]:
    """The cloud as seen from above the lowest corner: over a lake, up a hillside."""
    field, (length, breadth) = found.world.terrain.field, found.world.size
    corners = [(i * length, j * breadth) for i in (-0.5, 0.5) for j in (-0.5, 0.5)]
    x, y = min(corners, key=lambda corner: float(field.height_at(*corner)))
    width, height = (round(side * pixels / WIDTH) for side in _CLOUD)
    pose = outlook(
        found.cloud.xyz[::31], (-0.5 * x, -2.0 * y, -_FALL * length), fov_deg=_FOV_DEG, aspect=width / height
    )
    return draw_cloud(found.cloud, pose, width=width, height=height, fov_deg=_FOV_DEG, background=NIGHT)


def _draw_chart(paper: Paper, found: Findings, top: float) -> None:
    left = _EDGE + _CLOUD[0] + 0.42
    where = "the routes" if found.routes else "free places"
    _heading(paper, left, top, "Class shares", f"in {len(found.stations)} poses on {where}")
    for k, (words, ink) in enumerate((("pixels", PIXELS), ("points", POINTS))):
        paper.box(left + 1.52 + 0.72 * k, top + 0.035, 0.13, 0.1, ink)
        paper.text(left + 1.71 + 0.72 * k, top + 0.122, words, 7.4)
    draw_shares(paper, found.shares, left, top + 0.26, WIDTH - _EDGE - left, _CLOUD[1] - 0.26)
