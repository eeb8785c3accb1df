# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A camera as its configuration says: ideal, or with the signal of a real one.

Labels, instances and depth are those of an ideal one at the stamp.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core import lenses, transforms
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.random import rng_of
from fieldtruth.experiment.sensor_families import Imager
from fieldtruth.kernels.camera import add_dust
from fieldtruth.kernels.camera_rays import View, label_image, trace
from fieldtruth.kernels.packets import LabelBuffers
from fieldtruth.kernels.photograph import (
    STRIP,
    offsets_of,
    render_linear,
    render_mean,
    render_points,
    render_strips,
    strips_of,
)
from fieldtruth.render.bake import BakedScene
from fieldtruth.sense.robot import RobotView
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.exposure import Exposure, exposure_of, metered_exposure, metering_lags, white_balance
from fieldtruth.sensors.camera.lens_effects import add_glare, illumination
from fieldtruth.sensors.camera.on_glass import add_drops, drops_at, dust_of
from fieldtruth.sensors.camera.photo import Developer
from fieldtruth.sensors.camera.sensing import CameraImages, IdealCamera
from fieldtruth.sensors.camera.streaks import add_streaks

PoseAt = Callable[[int | NDArray[np.int64]], Array]
"""``world_from_base`` (4, 4) at a stamp [ns], or (n, 4, 4) at n."""

METERING: Final = (32, 16)
"""Columns and rows of rays of a metering image, and of the points whose motion is examined."""
_SWIFT: Final = 0.95  # quantile of the motion of points
_STILL: Final = 0.05  # [pixel]; rows of an image that moves by less are read at once
_FAR: Final = 1e6  # [m], of the sky


class Light(NamedTuple):
    """What a camera with a signal develops: label images at the stamp, and how the light was metered.

    The light itself is in a buffer of the camera. Without metering, the images have their photograph already.
    """

    images: CameraImages
    metered: tuple[Exposure, Array] | None


class Camera(IdealCamera):
    """A camera of a baked scene, whose photographs are as its configuration says. Use one per thread.

    Without a ``signal`` it is ideal. With one, rows are exposed around the stamp: the middle of the exposure of the
    image's middle row is at the stamp. A photograph depends on its number, the view's name, the seed, and poses; not on
    photographs before it.

    Args:
        config: with or without a signal.
        baked: the scene with its light.
        reuse: whether each call overwrites the arrays that the previous one returned.
        exposure: relative to that of an open meadow; None takes the exposure chosen for the world.
        seed: of the noise; None takes that of the world.
    """

    def __init__(
        self,
        config: CameraConfig,
        baked: BakedScene,
        *,
        reuse: bool = False,
        exposure: float | None = None,
        seed: int | None = None,
    ) -> None:
        super().__init__(config, baked, reuse=reuse, exposure=exposure)
        signal = config.signal
        if signal is None:
            return
        self._signal, self._weather = signal, baked.weather
        self._developer = Developer(config, signal, baked.scene.world.seed if seed is None else seed)
        h, w = config.height, config.width
        self._scratch = LabelBuffers(
            np.empty((h, w), np.uint8), np.empty((h, w), np.uint32), np.empty((h, w), np.float32)
        )
        points = _grid(config)
        self._meter_points = points.astype(np.float32)
        self._meter_share = illumination(config, signal, *points)[:, None]
        self._last: tuple[int, tuple[Exposure, Array]] | None = None

    def render(self, world_from_optical: Array, robot: RobotView | None = None) -> CameraImages:
        """Photograph, label, instance and depth images from a pose (4, 4) at which the camera stands at time 0."""
        if self.config.signal is None:
            return super().render(world_from_optical, robot)
        imager = self.config.imagers()[0]
        pose = world_from_optical @ transforms.inverse(imager.base_from_optical)
        return self.capture(imager, 0, 0, standing_at(pose), robot)

    def capture(
        self, imager: Imager, number: int, stamp_ns: int, world_from_base: PoseAt, robot: RobotView | None = None
    ) -> CameraImages:
        """Photograph ``number`` of a view at a stamp, with the label, instance and depth images of the pose there.

        What the view sees of the robot moves with it, and is not blurred.
        """
        light = self.light(imager, stamp_ns, world_from_base, robot)
        return self.develop(light, imager, number, stamp_ns, world_from_base)

    def light(self, imager: Imager, stamp_ns: int, world_from_base: PoseAt, robot: RobotView | None = None) -> Light:
        """Collect the light of a photograph, and the images of the pose at its stamp."""
        pose = world_from_base(stamp_ns) @ imager.base_from_optical
        if self.config.signal is None or self._signal.is_ideal:
            return Light(super().render(pose, robot), None)
        metered = self.metered(stamp_ns, world_from_base)
        images = self.expose(imager, stamp_ns, world_from_base, metered[0].time_s)
        if robot is not None:
            self._paint(robot, pose, self._buffers(images))
        return Light(images, metered)

    def develop(
        self, light: Light, imager: Imager, number: int, stamp_ns: int, world_from_base: PoseAt
    ) -> CameraImages:
        """Make photograph ``number`` of a view of the light that was collected last."""
        images, metered = light
        if metered is None:
            return images
        exposure, balance = metered
        self._in_front(imager, number, stamp_ns, world_from_base, exposure.time_s)
        factor = exposure.total / float(self._shading.exposure)
        raw, sensor = self._developer.raw(self._framebuffer.linear, imager.name, number, factor, exposure.gain)
        self._developer.photograph(raw, sensor, balance, images.photo)
        return images

    def _in_front(self, imager: Imager, number: int, stamp_ns: int, world_from_base: PoseAt, time_s: float) -> None:
        """Draw what falls before the camera while the shutter is open, and what is on its glass."""
        linear, signal, shape = self._framebuffer.linear, self._signal, (self.config.height, self.config.width)
        seed, view, weather = self.scene.world.seed, imager.name, self._weather
        if weather.rain_mm_h or weather.snow_mm_h:
            stamps = stamp_ns + np.rint(np.array([-0.5, 0.0, 0.5]) * time_s * 1e9).astype(np.int64)
            poses = world_from_base(np.maximum(stamps, 0)) @ imager.base_from_optical
            rng = rng_of(seed, view, "falling", number)
            add_streaks(linear, self._shading, weather, self.config.projection, poses, time_s, rng)
        add_drops(linear, drops_at(seed, view, signal.lens_drops, stamp_ns / 1e9, shape))
        add_dust(linear, dust_of(seed, view, signal.lens_dust, shape))

    @property
    def linear(self) -> Float32Array:
        """Light (h, w, 3) of the last photograph at the world's exposure, in a buffer that the next one overwrites."""
        return self._framebuffer.linear

    def metered(self, stamp_ns: int, world_from_base: PoseAt) -> tuple[Exposure, Array]:
        """Exposure and gains (3,) for white balance of the photograph at a stamp, from metering images before it.

        Both views of a pair have those of the first one.
        """
        if self._last is not None and self._last[0] == stamp_ns:
            return self._last[1]
        signal, world, images = self._signal, float(self._shading.exposure), list[Array]()
        if signal.exposure == "automatic" or signal.gray_world:
            stamps = stamp_ns - np.rint(metering_lags(signal) * 1e9).astype(np.int64)
            base_from_optical = self.config.imagers()[0].base_from_optical
            images = [self.metering_image(pose @ base_from_optical) for pose in world_from_base(np.maximum(stamps, 0))]
        stops = 2.0**signal.exposure_ev
        factor = stops * (metered_exposure(signal, images) if signal.exposure == "automatic" else 1.0)
        exposure = exposure_of(signal, factor * world)
        found = exposure, white_balance(signal, images, exposure.total / world)
        self._last = stamp_ns, found
        return found

    def metering_image(self, world_from_optical: Array) -> Array:
        """Metering image (n, 3): light at the world's exposure of rays that are evenly spread over the image."""
        batch, lens = self._framebuffer.shading.batch, self.pinhole
        count = self._meter_points.shape[1]
        batch.image[:, :count] = self._meter_points
        pixel = self.config.width / METERING[0] / lens.fx
        render_points(self._shading, self._framebuffer.shading, self._view(world_from_optical), count, pixel)
        seen = np.asarray(self._framebuffer.shading.colour[:count] * self._meter_share, np.float32)
        add_glare(seen, self._signal.glare)
        return seen.astype(np.float64)

    def expose(self, imager: Imager, stamp_ns: int, world_from_base: PoseAt, time_s: float) -> CameraImages:
        """Fill ``linear`` with the light of an exposure around a stamp; returns the images of the pose at the stamp.

        Their photograph is not written yet.
        """

        def optical_at(seconds: Array) -> Array:
            stamps = np.maximum(stamp_ns + np.rint(seconds.ravel() * 1e9).astype(np.int64), 0)
            poses = world_from_base(stamps) @ imager.base_from_optical
            return np.ascontiguousarray(poses).reshape(*seconds.shape, 4, 4)

        read_s = self._signal.readout_ms / 1e3
        images, view = self._own_images(), self._view(world_from_base(stamp_ns) @ imager.base_from_optical)
        labels = self._buffers(images)
        blurred, skewed = (self._motion(view, optical_at, seconds) for seconds in (time_s, read_s))
        count = int(np.clip(np.ceil(blurred), 1, self._signal.blur_samples))
        if count == 1 and skewed < _STILL:
            render_linear(self._shading, self._framebuffer, view, labels)
            return images
        label_image(self.scene.rays.handle, self.scene.hits, self._packet, view, self._batch, labels)
        rows = (np.arange(strips_of(self.config.height)) + 0.5) * STRIP
        read = (rows / self.config.height - 0.5) * read_s
        times = ((np.arange(count) + 0.5) / count - 0.5)[:, None] * time_s + read
        if count == 1:
            render_strips(self._shading, self._framebuffer, view, optical_at(times[0]), self._scratch)
        else:
            render_mean(self._shading, self._framebuffer, view, optical_at(times), offsets_of(count))
        return images

    def _motion(self, view: View, optical_at: Callable[[Array], Array], seconds: float) -> float:
        """Motion [pixel] of the image in a time around the stamp: of a few points, all but the fastest twentieth."""
        if not seconds:
            return 0.0
        batch, count = self._batch, self._meter_points.shape[1]
        batch.image[:, :count] = self._meter_points
        trace(self.scene.rays.handle, self.scene.hits.geometry_top, self._packet, view, batch, count)
        rays = batch.direction[:, :count].T.astype(np.float64)
        points = view.pose[:3, 3] + rays * np.where(batch.top[:count] < 0, _FAR, batch.distance[:count])[:, None]
        seen = [
            lenses.project(self.config.projection, (points - pose[:3, 3]) @ pose[:3, :3])
            for pose in optical_at(np.array([-0.5, 0.5]) * seconds)
        ]
        moved = np.linalg.norm(seen[1] - seen[0], axis=1)
        return float(np.quantile(moved[np.isfinite(moved)], _SWIFT)) if np.isfinite(moved).any() else 0.0


def _grid(config: CameraConfig) -> Array:
    """Image points (2, n) of a metering image [pixel], the middles of equal parts of the image."""
    columns, rows = METERING
    u = (np.arange(columns) + 0.5) * config.width / columns - 0.5
    v = (np.arange(rows) + 0.5) * config.height / rows - 0.5
    return np.stack([each.ravel() for each in np.meshgrid(u, v)])


def standing_at(pose: Array) -> PoseAt:
    """Return the motion of a base that stands at a pose (4, 4)."""
    return lambda stamps: np.tile(pose, (len(stamps), 1, 1)) if isinstance(stamps, np.ndarray) else pose
