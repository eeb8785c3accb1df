# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The camera as a kind of sensor: images of its view, or of both views of a pair, and their messages."""

from collections.abc import Iterable
from functools import cached_property
from typing import Any

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__CameraInfo as CameraInfo
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__CompressedImage as CompressedImage
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__Image as ImageMessage
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__RegionOfInterest as RegionOfInterest

from fieldtruth.bag import messages as ros
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.classes import CLASSES, ClassTable
from fieldtruth.core.lenses import directions
from fieldtruth.core.readings import Ids, Image
from fieldtruth.drive.track import PoseAt, standing_at
from fieldtruth.experiment.imaging_config import Imager, ImagingConfig
from fieldtruth.experiment.sensor_config import Output
from fieldtruth.sense.robot import RobotView, part_table, robot_view
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera, tag_image
from fieldtruth.sensors.camera.sensing import Camera, CameraImages, IdealCamera, Light
from fieldtruth.sensors.kind import At, Rays, Sensor, SensorWorld

_STEP = transforms.pose((0.01, 0.0, 0.04), (0.0, 0.5, 0.0))
"""From an optical frame to that of the next image: 1 m/s and 12 deg/s at 25 Hz."""


def pixel_directions(config: CameraConfig) -> Float32Array:
    """Unit directions (h, w, 3) through the pixel centres in the optical frame.

    Pixels for which the lens has no ray get the optical axis, because bare Embree traces rows and columns.
    """
    u, v = np.arange(config.width), np.arange(config.height)[:, None]
    found = np.asarray(directions(config.projection, u, v), np.float32)
    return np.where(np.isnan(found), np.array([0.0, 0.0, 1.0], np.float32), found)


def photograph(seq: int, stamp_ns: int, frame: str, photo: NDArray[np.uint8], config: CameraConfig) -> bytes:
    """Serialise sensor_msgs/CompressedImage of a photograph (h, w, 3) RGB."""
    data = np.frombuffer(camera_jpeg(photo, config), np.uint8)
    message = CompressedImage(ros.header(seq, stamp_ns, frame), "jpeg", data)
    return ros.serialize(message, "sensor_msgs/msg/CompressedImage")


def camera_jpeg(photo: NDArray[np.uint8], config: CameraConfig) -> bytes:
    """Encode (h, w, 3) RGB as JPEG with the quality of a camera and of its signal."""
    signal = config.signal
    if signal is None:
        return photograph_jpeg(photo, config.jpeg_quality)
    return photograph_jpeg(photo, signal.jpeg_quality or config.jpeg_quality, signal.jpeg_chroma)


def photograph_jpeg(photo: NDArray[np.uint8], quality: int, chroma: str = "444") -> bytes:
    """Encode (h, w, 3) RGB as JPEG, by default with the full resolution of chroma, as PNGs are exported from it.

    At quality 92, photographs of park and forest take 476 and 596 kB and 3.9 and 4.5 ms; 4:2:0 at quality 90, as ROS's
    own publisher has it, takes 336 and 403 kB and 2.4 and 2.7 ms, with 3.3 dB less PSNR (33.4 and 31.8 dB).
    """
    jpeg: bytes = simplejpeg.encode_jpeg(np.ascontiguousarray(photo), quality, "RGB", chroma)
    return jpeg


def tag(seq: int, stamp_ns: int, frame: str, label: NDArray[np.uint8], classes: ClassTable = CLASSES) -> bytes:
    """Serialise sensor_msgs/Image, rgb8: the flat colour of each label of (h, w)."""
    height, width = label.shape
    head = ros.header(seq, stamp_ns, frame)
    message = ImageMessage(head, height, width, "rgb8", 0, 3 * width, tag_image(label, classes).reshape(-1))
    return ros.serialize(message, "sensor_msgs/msg/Image")


def depth(seq: int, stamp_ns: int, frame: str, metres: NDArray[np.float32]) -> bytes:
    """Serialise sensor_msgs/Image, 32FC1 (REP-118): depth (h, w) [m] along the optical axis; 0 becomes infinite."""
    far = np.where(metres > 0.0, metres, np.float32(np.inf)).astype("<f4", copy=False)
    return _image(seq, stamp_ns, frame, "32FC1", far)


def instances(seq: int, stamp_ns: int, frame: str, instance: Ids, *, wide_ids: bool = False) -> bytes:
    """Serialise sensor_msgs/Image of instance ids (h, w) as in the cloud's ``instance``; 0 for sky.

    It is 16UC1, with ``wide_ids`` 32SC1; ROS has no unsigned encoding of 32 bits.
    """
    encoding, kind = ("32SC1", "<i4") if wide_ids else ("16UC1", "<u2")
    return _image(seq, stamp_ns, frame, encoding, instance.astype(kind))


def normals(seq: int, stamp_ns: int, frame: str, normal: NDArray[np.float32]) -> bytes:
    """Serialise sensor_msgs/Image, 32FC3: unit normals x, y, z (h, w, 3) in the optical frame; 0 for sky."""
    return _image(seq, stamp_ns, frame, "32FC3", normal.astype("<f4", copy=False))


def flow(seq: int, stamp_ns: int, frame: str, pixels: NDArray[np.float32]) -> bytes:
    """Serialise sensor_msgs/Image, 32FC2: motion to the right and down (h, w, 2) [pixel]; NaN where it is unseen."""
    return _image(seq, stamp_ns, frame, "32FC2", pixels.astype("<f4", copy=False))


def parts(seq: int, stamp_ns: int, frame: str, part: NDArray[np.uint8]) -> bytes:
    """Serialise sensor_msgs/Image, mono8: parts of plants (h, w)."""
    return _image(seq, stamp_ns, frame, "mono8", part)


def passability(seq: int, stamp_ns: int, frame: str, passing: NDArray[np.float32]) -> bytes:
    """Serialise sensor_msgs/Image, 32FC2: passability, 0 solid to 1 free, and force [N] (h, w, 2)."""
    return _image(seq, stamp_ns, frame, "32FC2", passing.astype("<f4", copy=False))


def _image(seq: int, stamp_ns: int, frame: str, encoding: str, pixels: NDArray[Any]) -> bytes:
    height, width = pixels.shape[:2]
    head = ros.header(seq, stamp_ns, frame)
    data = np.ascontiguousarray(pixels).reshape(-1).view(np.uint8)
    message = ImageMessage(head, height, width, encoding, 0, pixels[:1].nbytes, data)
    return ros.serialize(message, "sensor_msgs/msg/Image")


def camera_matrix(config: ImagingConfig) -> Array:
    """Return K (3, 3) [pixel]. ROS counts from the centre of the first pixel, so the principal point is (w - 1) / 2.

    A panorama has no K: zeros, by which ROS says that a camera is not calibrated.
    """
    lens = config.projection
    if lens.model == "equirectangular":
        return np.zeros((3, 3))
    return np.array([[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]])


def distortion(config: ImagingConfig) -> tuple[str, Array]:
    """Return ``distortion_model`` and D: of a pinhole ``plumb_bob`` with five zeros, of a panorama no numbers."""
    lens = config.projection
    return ("plumb_bob", np.zeros(5)) if lens.model == "pinhole" else (lens.model, np.array(lens.coefficients))


def projection_matrix(imager: Imager) -> Array:
    """Return P (3, 4) [pixel]; of a pair for points in the left optical frame: Tx of the right one is -fx * baseline.

    P describes the rectified image. The two cameras are parallel, so that removing the distortion rectifies: with R the
    identity and the focal lengths and centre of K, rectified and raw image meet in the middle.
    """
    matrix = np.hstack([camera_matrix(imager.config), np.zeros((3, 1))])
    if imager.baseline:
        matrix[0, 3] = -matrix[0, 0] * imager.baseline
    return matrix


def camera_info(seq: int, stamp_ns: int, imager: Imager) -> bytes:
    """Serialise sensor_msgs/CameraInfo. The images are those of the lens, not rectified."""
    config = imager.config
    model, coefficients = distortion(config)
    message = CameraInfo(
        ros.header(seq, stamp_ns, imager.optical_frame),
        height=config.height,
        width=config.width,
        distortion_model=model,
        D=coefficients,
        K=camera_matrix(config).ravel(),
        R=np.eye(3).ravel(),
        P=projection_matrix(imager).ravel(),
        binning_x=0,
        binning_y=0,
        roi=RegionOfInterest(0, 0, 0, 0, do_rectify=False),
    )
    return ros.serialize(message, "sensor_msgs/msg/CameraInfo")


class CameraSensor(Sensor):
    """A camera, or a stereo pair, whose views share its buffers."""

    config_type = CameraConfig
    needs_light = True
    config: CameraConfig

    def __init__(self, config: CameraConfig, sensor_world: SensorWorld) -> None:
        super().__init__(config, sensor_world)
        self._views: dict[str, Imager] = {imager.side: imager for imager in config.imagers()}

    @cached_property
    def _camera(self) -> Camera:
        made = self.sensor_world
        return Camera(self.config, made.baked, reuse=made.reuse, seed=made.seed)

    @cached_property
    def _labels(self) -> LabelCamera:
        return LabelCamera(self.config, self.sensor_world.scene, reuse=self.sensor_world.reuse)

    def truth(self, output: Output, at: At) -> Image | Light:
        """Render the images of a view; with a signal, collect the light of its photograph."""
        imager = self._views[output.part]
        if self.config.signal is None:
            pose = at.movement.pose(at.stamp_ns) @ imager.base_from_optical
            return self._image(self._camera.render(pose, self._robot(imager), at.stamp_ns), imager, at)
        return self._camera.light(imager, at.stamp_ns, _poses(at), self._robot(imager))

    def signal(self, output: Output, at: At, truth: Light) -> Image:
        """Develop the light that was collected last."""
        imager = self._views[output.part]
        return self._image(self._camera.develop(truth, imager, at.number, at.stamp_ns, _poses(at)), imager, at)

    def labels(self, output: Output, at: At) -> NDArray[np.uint8]:
        """Trace the class ids of a view, for which no light needs to be baked."""
        imager = self._views[output.part]
        pose = at.movement.pose(at.stamp_ns) @ imager.base_from_optical
        return self._labels.label(pose, self._robot(imager), at.stamp_ns).label

    def rays(self) -> Rays:
        """Rays through the pixels' centres; they give label images, photographs, normals and optical flow."""
        camera = IdealCamera(self.config, self.sensor_world.baked, reuse=True)
        geometry = LabelCamera(self.config.model_copy(update={"normals": True}), self.sensor_world.scene, reuse=True)

        def flow(pose: Array) -> object:  # from the labels that were just made from the same pose
            assert geometry.last is not None
            return geometry.flow(geometry.last, pose, pose @ _STEP)

        return Rays(
            pixel_directions(self.config),
            self.config.far,
            ({"label_image": camera.label}, {"photograph": camera.render}, {"normals": geometry.label, "flow": flow}),
        )

    def messages(self, output: Output, number: int, reading: Image) -> Iterable[bytes]:
        """Serialise calibration, photograph, tag image and what else the camera publishes."""
        config, stamp, frame = self.config, reading.header_ns, reading.frame
        assert reading.photo is not None
        assert reading.label is not None
        yield camera_info(number, stamp, self._views[output.part])
        yield photograph(number, stamp, frame, reading.photo, config)
        yield tag(number, stamp, frame, reading.label, self.sensor_world.world.classes)
        if config.depth and reading.depth is not None:
            yield depth(number, stamp, frame, reading.depth)
        if config.instances and reading.instance is not None:
            yield instances(number, stamp, frame, reading.instance, wide_ids=self.sensor_world.wide_ids)
        if config.normals and reading.normal is not None:
            yield normals(number, stamp, frame, reading.normal)
        if config.flow and reading.flow is not None:
            yield flow(number, stamp, frame, reading.flow)
        if config.parts and reading.part is not None:
            yield parts(number, stamp, frame, reading.part)
        if config.passability and reading.passability is not None:
            yield passability(number, stamp, frame, reading.passability)

    def _image(self, images: CameraImages, imager: Imager, at: At) -> Image:
        return Image(
            **at.stamps,
            frame=imager.optical_frame,
            photo=images.photo,
            label=images.label,
            depth=np.where(images.depth > 0.0, images.depth, np.float32(np.inf)),
            instance=images.instance,
            normal=images.normal if self.config.normals else None,
            flow=self._flow(images, imager, at) if self.config.flow else None,
            part=images.part if self.config.parts else None,
            passability=self._passability(images) if self.config.passability else None,
        )

    def _passability(self, images: CameraImages) -> NDArray[np.float32]:
        return self.sensor_world.passability.of(images.top, images.label)

    def _flow(self, images: CameraImages, imager: Imager, at: At) -> NDArray[np.float32]:
        """Flow to the next image of the view; unknown after the last."""
        if at.next_ns is None:
            return np.full((*images.depth.shape, 2), np.nan, np.float32)
        now, later = (at.movement.pose(stamp) @ imager.base_from_optical for stamp in (at.stamp_ns, at.next_ns))
        return self._camera.flow(images, now, later, self._robot(imager), (at.stamp_ns, at.next_ns))

    def _robot(self, imager: Imager) -> RobotView | None:
        """Return the robot as the view sees it; None if it does not."""
        parts = self.sensor_world.robot_parts
        if not parts:
            return None
        return self.sensor_world.once(("robot in", imager.name), lambda: robot_view(part_table(parts), imager))


def _poses(at: At) -> PoseAt:
    """Motion around a reading; where the robot stands it has not moved, nor did it when the light was metered."""
    return standing_at(at.movement.pose(at.stamp_ns)) if at.movement.stands else at.movement.pose
