# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Frames of videos: photograph, tags, depth and cloud of a stamp side by side, as far as they are recorded.

A frame is an image of the first camera of the rig. Beside it is the last scan of the first LiDAR that began at its
stamp or before, from behind and above the robot, in the colours of the classes, with the boxes of what moved then.
"""

import math
from functools import cached_property
from itertools import combinations
from typing import Final

import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pillow
from PIL import ImageDraw, ImageFont

from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError
from fieldtruth.bag.readings import Readings, finite_rows, labels_of
from fieldtruth.bag.run import Run
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.exporters.frames import first_views
from fieldtruth.report.drawing.cloud import Cloud as DrawnCloud
from fieldtruth.report.drawing.cloud import draw_cloud, looking
from fieldtruth.report.drawing.images import downscaled
from fieldtruth.report.drawing.style import NIGHT

_DEPTHS: Final = (0.5, 100.0)
"""[m] of the first and the last colour; between, colours follow the logarithm."""
_EYE: Final = (-7.0, 0.0, 4.5)
"""[m] of the view of clouds from base_link, in an upright frame that turns with the robot."""
_TOWARDS: Final = (13.0, 0.0, -4.5)
_FOV_DEG: Final = 75.0
_NEAR: Final = 0.5  # [m]
_LINE: Final = 20
"""Height [pixel] of the line of text."""
_EDGES: Final = [(a, b) for a, b in combinations(range(8), 2) if (a ^ b).bit_count() == 1]
"""Rows of the corners of a box that its edges join."""


class VideoFrames:
    """Frames of the video of a run by index; may be drawn by several threads.

    Args:
        run: of which photographs are required.
        widest: largest width [pixel] of a photograph in a frame.

    Raises:
        BagError: the run has no photographs, or is damaged.
    """

    def __init__(self, run: Run, *, widest: int = 960) -> None:
        if not (views := first_views(run)):
            raise BagError(f"the rig of {run.bag} has no camera, and frames of a video are photographs")
        view = views[0]
        run.require(view.topics["photo"])
        parts = [part for part in view.recorded(run.counts) if part in ("photo", "label", "depth")]
        self.run, self._widest, self._images = run, widest, run.readings(view.name, parts)
        if not len(self._images):
            raise BagError(f"{run.bag} has no frame: no stamp is common to {', '.join(view.topics[p] for p in parts)}")
        self.stamps_ns = self._images.stamps_ns
        """(n,) [ns]."""
        sensors = run.of(Cloud) if run.has_poses and table.TF_STATIC in run.counts else []
        self._scans = _with_classes(run, sensors[0].name) if sensors else None
        if self._scans is not None:
            self._base_from_sensor, self._trajectory = run.calibration.base_from(sensors[0].name), run.trajectory
            run.movers  # noqa: B018  # read once, not by each thread

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @cached_property
    def _shape(self) -> tuple[int, int]:
        """Height and width of the first photograph."""
        height, width = self._images.read(0, ["photo"]).photo.shape[:2]
        return height, width

    def draw(self, row: int) -> NDArray[np.uint8]:
        """Return a frame (h, w, 3) RGB; both sides are even, and the same for all frames.

        Raises:
            BagError: a photograph has another size than the first, or the bag is damaged.
        """
        image = self._images.read(row)
        if image.photo.shape[:2] != self._shape:
            raise BagError(f"the photograph at {image.stamp_ns} ns of {self.run.bag} has another size than the first")
        panels = self._of_image(image)
        text = f"{self.run.name}   {image.stamp_ns / 1e9:.3f} s"
        if self._scans is not None:
            begin, end = self._trajectory.stamps_ns[[0, -1]]
            scan = int(np.searchsorted(self._scans.stamps_ns, image.stamp_ns, side="right")) - 1
            if scan >= 0 and not begin <= self._scans.stamps_ns[scan] <= end:
                scan = -1  # nothing says where the robot was
            panels.append(self._of_cloud(scan, *panels[0].shape[:2]))
            text += f"   scan {self._scans.stamps_ns[scan] / 1e9:.3f} s" * (scan >= 0)
        rows = [panels] if len(panels) < 4 else [panels[:2], panels[2:]]
        return _with_text(np.vstack([np.hstack(each) for each in rows]), text)

    def _of_image(self, image: Image) -> list[NDArray[np.uint8]]:
        assert image.photo is not None
        step = -(-image.photo.shape[1] // self._widest)
        panels = [downscaled(image.photo, step)]
        height, width = panels[0].shape[:2]
        if image.label is not None:
            tags = image.label[::step, ::step][:height, :width]
            panels.append(self.run.classes.palette[tags])
        if image.depth is not None:
            panels.append(depth_colours(image.depth[::step, ::step][:height, :width]))
        return panels

    def _of_cloud(self, scan: int, height: int, width: int) -> NDArray[np.uint8]:
        """Panel of a scan; of none an empty one."""
        if scan < 0:
            return np.full((height, width, 3), NIGHT, np.uint8)
        assert self._scans is not None
        cloud: Cloud = self._scans.read(scan)
        world_from_base = self._trajectory.world_from_base(cloud.stamp_ns)
        world_from_eye = _eye(world_from_base)
        xyz = transforms.transform(world_from_base @ self._base_from_sensor, cloud.xyz.astype(np.float64))
        drawn = DrawnCloud(xyz=xyz, label=cloud.label, scans=1, classes=self.run.classes)
        panel = draw_cloud(drawn, world_from_eye, width=width, height=height, fov_deg=_FOV_DEG)
        movers, lines = self.run.movers, []
        for number, state in movers.at(cloud.stamp_ns).items():
            mover = movers.by_id[number]
            if mover.is_moving(state):
                corners = transforms.transform(transforms.inverse(world_from_eye) @ state.pose, mover.corners)
                lines += [corners[[a, b]] for a, b in _EDGES if (corners[[a, b], 2] > _NEAR).all()]
        return _with_lines(panel, lines)


def _with_classes(run: Run, name: str) -> Readings | None:
    """Return the clouds of a sensor, unless the first one, of a bag from elsewhere, has no classes."""
    clouds = run.readings(name, labelled=False)
    if not len(clouds):
        return None
    rows = finite_rows(clouds.message(0))
    try:
        labels_of(rows, run.classes)
    except BagError:
        return None
    return run.readings(name)


def depth_colours(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Colours (h, w, 3) of depth (h, w) [m], red near and blue far by its logarithm; the sky is black."""
    near, far = np.log(_DEPTHS)
    known = np.isfinite(depth) & (depth > 0.0)
    share = (np.log(np.where(known, depth, 1.0)) - near) / (far - near)
    colours = matplotlib.colormaps["turbo_r"](np.clip(share, 0.0, 1.0), bytes=True)[..., :3]
    return np.asarray(colours * known[..., None], np.uint8)


def _eye(world_from_base: Array) -> Array:
    """Pose (4, 4) of the view of clouds, which is upright."""
    turn = math.degrees(math.atan2(world_from_base[1, 0], world_from_base[0, 0]))
    upright = transforms.pose(world_from_base[:3, 3], (0.0, 0.0, turn))
    view = looking(_TOWARDS)
    view[:3, 3] = _EYE
    return upright @ view


def _with_lines(panel: NDArray[np.uint8], lines: list[Array]) -> NDArray[np.uint8]:
    """Draw lines, two points (2, 3) [m] in the frame of the view each, in white."""
    if not lines:
        return panel
    drawn = Pillow.fromarray(panel)
    draw, (height, width) = ImageDraw.Draw(drawn), panel.shape[:2]
    focal = width / 2 / math.tan(math.radians(_FOV_DEG) / 2)
    for line in lines:
        ends = focal * line[:, :2] / line[:, 2:] + (width / 2 - 0.5, height / 2 - 0.5)
        draw.line([tuple(end) for end in ends.tolist()], fill=(255, 255, 255))
    return np.asarray(drawn)


def _with_text(picture: NDArray[np.uint8], text: str) -> NDArray[np.uint8]:
    """Add a line of text below a picture, and make both sides even."""
    height, width = picture.shape[:2]
    whole = Pillow.new("RGB", (width + width % 2, height + _LINE + height % 2), NIGHT)
    whole.paste(Pillow.fromarray(picture))
    ImageDraw.Draw(whole).text((6, height + 3), text, fill=(220, 224, 230), font=ImageFont.load_default(13))
    return np.asarray(whole)
