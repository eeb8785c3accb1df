# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The camera: photograph, labels and depth come from the same ray through each pixel's centre.

Of a real one, labels, instances and depth are those of an ideal one at the stamp; the light of the photograph is
collected while the shutter is open, behind drops and dust, with exposure and white balance from small metering images.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core import lenses, transforms
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.random import rng_of
from fieldtruth.drive.track import PoseAt, standing_at
from fieldtruth.experiment.imaging_config import Imager, ImagingConfig
from fieldtruth.kernels.camera import add_dust
from fieldtruth.kernels.camera_rays import View, label_image, trace
from fieldtruth.kernels.light import Shading
from fieldtruth.kernels.packets import LabelBuffers
from fieldtruth.kernels.photograph import (
    STRIP,
    new_framebuffer,
    offsets_of,
    render_linear,
    render_mean,
    render_points,
    render_strips,
    strips_of,
)
from fieldtruth.kernels.tone_curve import tonemap
from fieldtruth.render.bake import BakedScene
from fieldtruth.render.robot import paint_robot, with_shadow
from fieldtruth.sense.interval import Interval
from fieldtruth.sense.robot import RobotView, hide_world
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.drops import add_drops, add_streaks, drops_at, dust_of
from fieldtruth.sensors.camera.exposure import Exposure, exposure_of, metered_exposure, metering_lags, white_balance
from fieldtruth.sensors.camera.labels import LabelCamera, LabelImages
from fieldtruth.sensors.camera.photo import Developer, add_glare, illumination


@dataclass(frozen=True, kw_only=True)
class CameraImages(LabelImages):
    """Label, instance and depth images, and the photograph ``photo`` (h, w, 3), sRGB, of the same rays."""

    photo: NDArray[np.uint8]


class IdealCamera(LabelCamera):
    """A ``LabelCamera`` that also renders ideal photographs of a baked scene, whatever its configuration's signal.

    ``exposure`` is relative to that of an open meadow; None takes the exposure chosen for the world, which suits a
    camera near the ground.
    """

    def __init__(
        self, config: ImagingConfig, baked: BakedScene, *, reuse: bool = False, exposure: float | None = None
    ) -> None:
        super().__init__(config, baked.scene, reuse=reuse)
        self._shading = baked.shading._replace(hits=self._hits)
        if exposure is not None:
            self._shading = self._shading._replace(exposure=np.float32(exposure))
        buffers = new_framebuffer(config.height, config.width)
        self._framebuffer = buffers._replace(shading=buffers.shading._replace(batch=self._batch))

    def render(self, world_from_optical: Array, robot: RobotView | None = None, stamp_ns: int = 0) -> CameraImages:
        """Photograph, label, instance and depth images from a pose (4, 4), with what the view sees of the robot.

        The stamp matters where bodies move.
        """
        images = self._own_images()
        labels, interval = self._buffers(images), self._interval(world_from_optical, stamp_ns, stamp_ns)
        render_linear(self._lit(interval, stamp_ns, robot), self._framebuffer, self._view(world_from_optical), labels)
        if robot is not None:
            self._paint(robot, world_from_optical, interval, labels)
        tonemap(self._framebuffer.linear, images.photo)
        return self._decoded(images)

    def _lit(self, interval: Interval, stamp_ns: int, robot: RobotView | None = None) -> Shading:
        """Return the light, with what moves, ripples at a stamp, and the shadow of the robot."""
        shading, ripples = self._shading._replace(scene=interval.rays), self.scene.ripples
        if ripples is not None:
            shading = shading._replace(ripples=ripples.at(stamp_ns))
        return shading if robot is None else with_shadow(shading, robot)

    def _paint(self, robot: RobotView, world_from_optical: Array, interval: Interval, labels: LabelBuffers) -> None:
        """Put the robot before the world, in the light and in the labels."""
        world_from_base = world_from_optical @ robot.optical_from_base
        paint_robot(self._lit(interval, 0), robot, world_from_base, labels.depth, self._framebuffer.linear)
        hide_world(robot, labels)

    def _own_images(self) -> CameraImages:
        images = super()._own_images()
        assert isinstance(images, CameraImages)
        return images

    def _new_images(self) -> CameraImages:
        photo = np.empty((self.config.height, self.config.width, 3), np.uint8)
        return CameraImages(**vars(super()._new_images()), photo=photo)


METERING: Final = (32, 16)
"""Columns and rows of rays of a metering image, and of the points whose motion is examined."""
_SWIFT: Final = 0.95  # quantile of the motion of points
_STILL: Final = 0.05  # [pixel]; rows of an image that moves by less are read at once
_FAR: Final = 1e6  # [m], of the sky


class Light(NamedTuple):
    """Light that a camera with a signal has collected: label images at the stamp, and how it was metered.

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
        self._seed = baked.scene.world.seed if seed is None else seed
        self._developer = Developer(config, signal, self._seed)
        h, w = config.height, config.width
        self._scratch = LabelBuffers(
            np.empty((h, w), np.uint8), np.empty((h, w), np.uint32), np.empty((h, w), np.float32)
        )
        points = _grid(config)
        self._meter_points = points.astype(np.float32)
        self._meter_share = illumination(config, signal, *points)[:, None]
        self._last: tuple[int, tuple[Exposure, Array]] | None = None

    def render(self, world_from_optical: Array, robot: RobotView | None = None, stamp_ns: int = 0) -> CameraImages:
        """Photograph, label, instance and depth images from a pose (4, 4) at which the camera stands at a stamp."""
        if self.config.signal is None:
            return super().render(world_from_optical, robot, stamp_ns)
        imager = self.config.imagers()[0]
        pose = world_from_optical @ transforms.inverse(imager.base_from_optical)
        return self.capture(imager, 0, stamp_ns, standing_at(pose), robot)

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
            return Light(super().render(pose, robot, stamp_ns), None)
        metered = self.metered(stamp_ns, world_from_base)
        images = self.expose(imager, stamp_ns, world_from_base, metered[0].time_s, robot)
        if robot is not None:
            self._paint(robot, pose, self._interval(pose, stamp_ns, stamp_ns), self._buffers(images))
        return Light(self._decoded(images), metered)

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
        seed, view, weather = self._seed, imager.name, self._weather
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
            stamps = np.maximum(stamps, 0)
            poses = world_from_base(stamps) @ base_from_optical
            images = [self.metering_image(*each) for each in zip(poses, stamps.tolist(), strict=True)]
        stops = 2.0**signal.exposure_ev
        factor = stops * (metered_exposure(signal, images) if signal.exposure == "automatic" else 1.0)
        exposure = exposure_of(signal, factor * world)
        found = exposure, white_balance(signal, images, exposure.total / world)
        self._last = stamp_ns, found
        return found

    def metering_image(self, world_from_optical: Array, stamp_ns: int = 0) -> Array:
        """Metering image (n, 3): light at the world's exposure of rays that are evenly spread over the image."""
        batch, lens = self._framebuffer.shading.batch, self.intrinsics
        count = self._meter_points.shape[1]
        batch.image[:, :count] = self._meter_points
        pixel = self.config.width / METERING[0] / lens.fx
        interval = self._interval(world_from_optical, stamp_ns, stamp_ns)
        shading, view = self._lit(interval, stamp_ns), self._view(world_from_optical)
        render_points(shading, self._framebuffer.shading, view, count, pixel)
        seen = np.asarray(self._framebuffer.shading.colour[:count] * self._meter_share, np.float32)
        add_glare(seen, self._signal.glare)
        return seen.astype(np.float64)

    def expose(
        self, imager: Imager, stamp_ns: int, world_from_base: PoseAt, time_s: float, robot: RobotView | None = None
    ) -> CameraImages:
        """Fill ``linear`` with the light of an exposure around a stamp; returns the images of the pose at the stamp.

        Their photograph is not written yet. Of the robot there is its shadow.
        """

        def stamps_at(seconds: Array) -> NDArray[np.int64]:
            return np.maximum(stamp_ns + np.rint(seconds * 1e9).astype(np.int64), 0)

        def optical_at(seconds: Array) -> Array:
            poses = world_from_base(stamps_at(seconds.ravel())) @ imager.base_from_optical
            return np.ascontiguousarray(poses).reshape(*seconds.shape, 4, 4)

        read_s, pose = self._signal.readout_ms / 1e3, world_from_base(stamp_ns) @ imager.base_from_optical
        begin, end = stamps_at(np.array([-0.5, 0.5]) * (time_s + read_s)).tolist()
        interval = self._interval(pose, begin, end)
        images, view = self._own_images(), self._view(pose, float(interval.share(stamp_ns)))
        labels, shading = self._buffers(images), self._lit(interval, stamp_ns, robot)
        blurred, skewed = (self._motion(view, optical_at, stamps_at, seconds) for seconds in (time_s, read_s))
        count = int(np.clip(np.ceil(blurred), 1, self._signal.blur_samples))
        if count == 1 and skewed < _STILL:
            render_linear(shading, self._framebuffer, view, labels)
            return images
        label_image(interval.rays, self._hits, self._packet, view, self._batch, labels)
        rows = (np.arange(strips_of(self.config.height)) + 0.5) * STRIP
        read = (rows / self.config.height - 0.5) * read_s
        times = ((np.arange(count) + 0.5) / count - 0.5)[:, None] * time_s + read
        poses, shares = optical_at(times), interval.share(stamps_at(times))
        if count == 1:
            render_strips(shading, self._framebuffer, view, poses[0], shares[0], self._scratch)
        else:
            render_mean(shading, self._framebuffer, view, poses, shares, offsets_of(count))
        return images

    def _motion(
        self,
        view: View,
        optical_at: Callable[[Array], Array],
        stamps_at: Callable[[Array], NDArray[np.int64]],
        seconds: float,
    ) -> float:
        """Motion [pixel] of the image in a time around the stamp: of a few points, all but the fastest twentieth.

        It is at least that of the fastest vertex of a body in the image, and of the fastest top of a plant.
        """
        if not seconds:
            return 0.0
        around = np.array([-0.5, 0.5]) * seconds
        batch, count = self._batch, self._meter_points.shape[1]
        batch.image[:, :count] = self._meter_points
        still = self.scene.still
        trace(still.rays.alone, still.hits.geometry_top, self._packet, view, batch, count)
        rays = batch.direction[:, :count].T.astype(np.float64)
        points = view.pose[:3, 3] + rays * np.where(batch.top[:count] < 0, _FAR, batch.distance[:count])[:, None]
        seen = [
            lenses.project(self.config.projection, (points - pose[:3, 3]) @ pose[:3, :3]) for pose in optical_at(around)
        ]
        moved = np.linalg.norm(seen[1] - seen[0], axis=1)
        most = float(np.quantile(moved[np.isfinite(moved)], _SWIFT)) if np.isfinite(moved).any() else 0.0
        stamps_ns, poses = stamps_at(around), optical_at(around)
        return max([most, self._motion_of_plants(stamps_ns, poses), *self._motions_of_bodies(stamps_ns, poses)])

    def _motion_of_plants(self, stamps_ns: NDArray[np.int64], poses: Array) -> float:
        """Motion [pixel] of the fastest top of a plant in the image."""
        if self.scene.plants is None:
            return 0.0
        leaning, rows = self.scene.plants.leaning, self.scene.plants.leaning.rows
        plants, up = leaning.plants, np.array([0.0, 0.0, 1.0])
        top = (
            np.linalg.inv(plants.world_from_object[rows])
            @ np.append(plants.foot[rows] + plants.height[rows, None] * up, np.ones((len(rows), 1)), axis=1)[..., None]
        )
        tops = (leaning.at(rows, stamps_ns) @ top)[..., 0]
        return self._moved(tops, poses)

    def _motions_of_bodies(self, stamps_ns: NDArray[np.int64], poses: Array) -> Iterator[float]:
        """Yield the motion [pixel] of the fastest vertex in the image of each body that is near enough."""
        for body, _, radius in self.scene.moving:
            world_from_body = body.at(stamps_ns)
            if np.linalg.norm(world_from_body[0, :3, 3] - poses[0, :3, 3]) > self.config.far + radius:
                continue
            yield self._moved([transforms.transform(each, body.mesh.vertices) for each in world_from_body], poses)

    def _moved(self, points: Sequence[Array], poses: Array) -> float:
        """Motion [pixel] of the fastest of points (n, 3) [m] in the image, from one pose to the next."""
        begin, end = (
            lenses.project(self.config.projection, transforms.transform(transforms.inverse(pose), own))
            for own, pose in zip(points, poses, strict=True)
        )
        size = np.array([self.config.width, self.config.height])
        with np.errstate(invalid="ignore"):
            inside = ((begin >= 0) & (begin < size) & np.isfinite(end)).all(axis=1)
        return float(np.linalg.norm(end - begin, axis=1)[inside].max(initial=0.0))


def _grid(config: CameraConfig) -> Array:
    """Image points (2, n) of a metering image [pixel], the middles of equal parts of the image."""
    columns, rows = METERING
    u = (np.arange(columns) + 0.5) * config.width / columns - 0.5
    v = (np.arange(rows) + 0.5) * config.height / rows - 0.5
    return np.stack([each.ravel() for each in np.meshgrid(u, v)])
