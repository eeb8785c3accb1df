# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The place from above, by the package's own camera: north to the right, west up. Points find their pixel."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import CameraConfig
from fieldtruth.render.bake import BakedScene
from fieldtruth.render.camera import Camera
from fieldtruth.sense.pinhole import Pinhole, pinhole

HEIGHT: Final = 300.0
"""Height [m] of the camera above the middle of the place: a crown of 12 m at the edge leans outwards by 2 m."""
MARGIN: Final = 1.0  # [m] that is seen beyond the edge
_SAMPLES: Final = 2  # squared: rays per pixel
_DARKEST, _BRIGHTEST = 0.2, 99.8  # percentiles that become black and white, because 300 m of air are hazy
_MIDDLE: Final = 0.36  # what the median becomes, at least


@dataclass(frozen=True, kw_only=True)
class Aerial:
    """A photograph (h, w, 3) from above, and the projection that made it."""

    photo: NDArray[np.uint8]
    world_from_optical: Array
    lens: Pinhole

    def pixels(self, points_world: ArrayLike) -> Array:
        """Column and row (n, 2) at which points (n, 3) [m] of the world are seen; (0, 0) is a pixel's centre."""
        x, y, z = frames.transform(frames.inverse(self.world_from_optical), points_world).T
        return np.column_stack([self.lens.fx * x / z + self.lens.cx, self.lens.fy * y / z + self.lens.cy])


def take_aerial(baked: BakedScene, width: int) -> Aerial:
    """Photograph the whole place, ``width`` pixels along x, as many along y as its shape asks for."""
    length, breadth = (side / 2 + MARGIN for side in baked.scene.world.size)
    wide = 8 * max(1, round(width * _SAMPLES / 8))
    high = 8 * max(1, round(wide * breadth / length / 8))
    config = CameraConfig(
        width=wide,
        height=high,
        horizontal_fov_deg=2.0 * float(np.degrees(np.arctan2(length, HEIGHT))),
        vertical_fov_deg=2.0 * float(np.degrees(np.arctan2(breadth, HEIGHT))),
        far=10.0 * HEIGHT,
    )
    middle = float(np.mean(baked.scene.world.terrain.field.heights))
    world_from_optical = frames.pose((0.0, 0.0, middle + HEIGHT), (180.0, 0.0, 0.0))
    photo = _levelled(halved(Camera(config, baked, exposure=1.0).render(world_from_optical).photo, _SAMPLES))
    small = config.model_copy(update={"width": photo.shape[1], "height": photo.shape[0]})
    return Aerial(photo=photo, world_from_optical=world_from_optical, lens=pinhole(small))


def halved(image: NDArray[np.uint8], by: int = 2) -> NDArray[np.uint8]:
    """Means over squares of ``by`` x ``by`` pixels."""
    h, w = (side // by * by for side in image.shape[:2])
    squares = image[:h, :w].reshape(h // by, by, w // by, by, -1)
    means: NDArray[np.uint8] = np.rint(squares.mean(axis=(1, 3), dtype=np.float32)).astype(np.uint8)
    return means


def _levelled(photo: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Take the haze out, and brighten what lies in shadow: a forest from above is as dark as deep water."""
    dark = np.percentile(photo, _DARKEST, axis=(0, 1))
    clear = np.maximum(photo - dark, 0.0)
    clear /= max(float(np.percentile(clear, _BRIGHTEST)), 1.0)
    middle = float(np.clip(np.median(clear), 0.01, 0.99))
    gamma = float(np.clip(np.log(_MIDDLE) / np.log(middle), 0.6, 1.0))
    return (255.0 * np.clip(clear, 0.0, 1.0) ** gamma).astype(np.uint8)
