# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of LiDAR and cameras: PointCloud2, CompressedImage, Image and CameraInfo."""

from typing import Any, Final, Protocol

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__CameraInfo as CameraInfo
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__CompressedImage as CompressedImage
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__Image as Image
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__PointCloud2 as PointCloud2
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__PointField as PointField
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__RegionOfInterest as RegionOfInterest

from fieldtruth.bag import types as ros
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import PALETTE
from fieldtruth.experiment.camera_config import CameraConfig, Imager
from fieldtruth.experiment.lidar_config import Intensity, PointFields, TimeField

_XYZI: Final = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")]
_RING: Final = [("ring", "<u2")]
_MAKERS: Final = {
    "ouster": [("reflectivity", "<u2"), ("ring", "|u1"), ("ambient", "<u2"), ("range", "<u4")],
    "livox": [("tag", "|u1"), ("line", "|u1"), ("timestamp", "<f8"), *_RING],
}
"""Fields instead of ``ring`` by maker: of FAST-LIO2's ``ouster_ros::Point``, and of livox_ros_driver2's PointCloud2."""

_MEASURED: Final = [
    ("true_range", "<f4"),
    ("signal", "<f4"),
    ("reflectivity", "<f4"),
    ("echo", "<u2"),
    ("mixed", "<u2"),
]
"""Fields of a LiDAR with a signal; the reflectivity of an Ouster is its own, in percent."""

_CLOCKS: Final = {"time": "<f4", "timestamp": "<f8"}
_DATATYPES: Final = {
    "<f4": PointField.FLOAT32,
    "<f8": PointField.FLOAT64,
    "<u4": PointField.UINT32,
    "<u2": PointField.UINT16,
    "|u1": PointField.UINT8,
}


class Scan(Protocol):
    """Result of a LiDAR, a row per return (n): ``xyz`` (n, 3) [m] in os1_lidar, ``t_ns`` after the stamp."""

    @property
    def xyz(self) -> NDArray[np.float32]: ...  # noqa: D102
    @property
    def label(self) -> NDArray[np.uint8]: ...  # noqa: D102
    @property
    def instance(self) -> NDArray[np.uint32]: ...  # noqa: D102
    @property
    def ring(self) -> NDArray[np.uint16]: ...  # noqa: D102
    @property
    def column(self) -> NDArray[np.uint16]: ...  # noqa: D102
    @property
    def t_ns(self) -> NDArray[np.uint32]: ...  # noqa: D102


def point_type(
    *,
    spinning: bool,
    wide_ids: bool,
    clock: TimeField | None = None,
    maker: PointFields | None = None,
    measured: bool = False,
) -> np.dtype[np.void]:
    """Type of a point of 24 bytes: x, y, z [m] in os1_lidar; intensity = label, as the paper's reflectivity; ray; ids.

    With ``spinning`` it has ``t`` [ns], the time of its ray after the stamp. Instantaneous scans have none: programs
    scale it to 0..1 and divide by its range, which is 0 (KISS-ICP aborts). ``wide_ids``: ``instance`` has 32 bits.
    ``clock`` follows ``t``: ``time`` [s] after the stamp, or ``timestamp`` [s], the sum. ``maker``: fields of its
    driver; PCL reads a field only if name and type are those that a program declares. ``measured``: those of a signal.
    """
    time = [("t", "<u4"), *([(clock, _CLOCKS[clock])] if clock else [])] if spinning else []
    ids = [("column", "<u2"), ("label", "<u2"), ("instance", "<u4" if wide_ids else "<u2")]
    own = _MAKERS[maker] if maker else _RING
    added = [field for field in _MEASURED if field[0] not in dict(own)] if measured else []
    return np.dtype([*_XYZI, *time, *own, *ids, *added], align=True)


def point_cloud(
    seq: int,
    stamp_ns: int,
    scan: Scan,
    *,
    frame: str = "os1_lidar",
    spinning: bool,
    wide_ids: bool = False,
    clock: TimeField | None = None,
    maker: PointFields | None = None,
    intensity: Intensity = "class",
    grid: tuple[int, int] | None = None,
) -> bytes:
    """Serialise sensor_msgs/PointCloud2 of the returns, in the order of the scan; with ``t`` if the LiDAR spins.

    A scan with ``true_range``, ``signal``, ``reflectivity``, ``echo`` and ``mixed`` has them as fields. An Ouster's
    ``reflectivity`` is that in percent, at most 255, or without it the label; its ``range`` [mm] is that of the point,
    and its ``ambient`` zero. With ``grid``, (rings, columns), the cloud is organised: a row for each ring, NaN as the
    coordinates of rays without a return, zero in their other fields but ring and column. A Livox's ``line`` is the
    ring, its ``timestamp`` [ns] the time of the ray, and its ``tag`` zero: a sure return.
    """
    measured = {name: values for name, _ in _MEASURED if (values := getattr(scan, name, None)) is not None}
    kind = point_type(spinning=spinning, wide_ids=wide_ids, clock=clock, maker=maker, measured=bool(measured))
    points = np.zeros(len(scan.xyz), kind)
    points["x"], points["y"], points["z"] = scan.xyz.T
    points["intensity"] = measured["reflectivity"] if intensity == "reflectivity" else scan.label
    for name, values in measured.items():
        points[name] = values
    if spinning:
        points["t"] = scan.t_ns
    if spinning and clock:
        points[clock] = (scan.t_ns.astype(np.int64) + (stamp_ns if clock == "timestamp" else 0)) / 1e9
    points["ring"], points["column"] = scan.ring, scan.column
    points["label"], points["instance"] = scan.label, scan.instance
    if maker == "ouster":
        points["reflectivity"] = np.minimum(np.rint(100.0 * measured["reflectivity"]), 255) if measured else scan.label
        points["range"] = np.rint(1000.0 * np.linalg.norm(scan.xyz.astype(np.float64), axis=1))
    if maker == "livox":
        points["line"], points["timestamp"] = scan.ring, stamp_ns + scan.t_ns.astype(np.int64)
    rows = points[None] if grid is None else _organised(points, *grid)
    message = PointCloud2(
        ros.header(seq, stamp_ns, frame),
        height=rows.shape[0],
        width=rows.shape[1],
        fields=[
            PointField(name, offset, _DATATYPES[base.str], 1)
            for name, (base, offset, *_) in (kind.fields or {}).items()
        ],
        is_bigendian=False,
        point_step=kind.itemsize,
        row_step=rows.shape[1] * kind.itemsize,
        data=rows.reshape(-1).view(np.uint8),
        is_dense=grid is None,
    )
    return ros.serialize(message, "sensor_msgs/msg/PointCloud2")


def _organised(points: NDArray[np.void], rings: int, columns: int) -> NDArray[np.void]:
    """Spread points over all rays, (rings, columns)."""
    spread = np.zeros((rings, columns), points.dtype)
    for axis in "xyz":
        spread[axis] = np.nan
    spread["ring"], spread["column"] = np.arange(rings)[:, None], np.arange(columns)
    spread[points["ring"], points["column"]] = points
    return spread


def photograph(seq: int, stamp_ns: int, frame: str, photo: NDArray[np.uint8], quality: int) -> bytes:
    """Serialise sensor_msgs/CompressedImage of a photograph (h, w, 3) RGB."""
    data = np.frombuffer(photograph_jpeg(photo, quality), np.uint8)
    message = CompressedImage(ros.header(seq, stamp_ns, frame), "jpeg", data)
    return ros.serialize(message, "sensor_msgs/msg/CompressedImage")


def photograph_jpeg(photo: NDArray[np.uint8], quality: int) -> bytes:
    """Encode (h, w, 3) RGB as JPEG with the full resolution of chroma (4:4:4), because PNGs are exported from it.

    At quality 92, photographs of park and forest take 476 and 596 kB and 3.9 and 4.5 ms; 4:2:0 at quality 90, as ROS's
    own publisher has it, takes 336 and 403 kB and 2.4 and 2.7 ms, with 3.3 dB less PSNR (33.4 and 31.8 dB).
    """
    jpeg: bytes = simplejpeg.encode_jpeg(np.ascontiguousarray(photo), quality, "RGB", "444")
    return jpeg


def tag(seq: int, stamp_ns: int, frame: str, label: NDArray[np.uint8]) -> bytes:
    """Serialise sensor_msgs/Image, rgb8: the flat colour of each label of (h, w)."""
    height, width = label.shape
    head = ros.header(seq, stamp_ns, frame)
    flat = np.take(PALETTE, label, axis=0)  # five times as fast as PALETTE[label], which holds the GIL
    message = Image(head, height, width, "rgb8", 0, 3 * width, flat.reshape(-1))
    return ros.serialize(message, "sensor_msgs/msg/Image")


def depth(seq: int, stamp_ns: int, frame: str, metres: NDArray[np.float32]) -> bytes:
    """Serialise sensor_msgs/Image, 32FC1 (REP-118): depth (h, w) [m] along the optical axis; 0 becomes infinite."""
    far = np.where(metres > 0.0, metres, np.float32(np.inf)).astype("<f4", copy=False)
    return _image(seq, stamp_ns, frame, "32FC1", far)


def instances(seq: int, stamp_ns: int, frame: str, instance: NDArray[np.uint32], *, wide_ids: bool = False) -> bytes:
    """Serialise sensor_msgs/Image of instance ids (h, w) as in the cloud's ``instance``; 0 for sky.

    It is 16UC1, with ``wide_ids`` 32SC1; ROS has no unsigned encoding of 32 bits.
    """
    encoding, kind = ("32SC1", "<i4") if wide_ids else ("16UC1", "<u2")
    return _image(seq, stamp_ns, frame, encoding, instance.astype(kind))


def _image(seq: int, stamp_ns: int, frame: str, encoding: str, pixels: NDArray[Any]) -> bytes:
    height, width = pixels.shape
    head = ros.header(seq, stamp_ns, frame)
    data = np.ascontiguousarray(pixels).reshape(-1).view(np.uint8)
    message = Image(head, height, width, encoding, 0, pixels.itemsize * width, data)
    return ros.serialize(message, "sensor_msgs/msg/Image")


def camera_matrix(config: CameraConfig) -> Array:
    """Return K (3, 3) [pixel]. ROS counts from the centre of the first pixel, so the principal point is (w - 1) / 2.

    A panorama has no K: zeros, by which ROS says that a camera is not calibrated.
    """
    lens = config.projection
    if lens.model == "equirectangular":
        return np.zeros((3, 3))
    return np.array([[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]])


def distortion(config: CameraConfig) -> tuple[str, Array]:
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
