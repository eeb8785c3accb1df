# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clouds and images as other programs write them: their values are those that were meant, or one line says why not."""

import io
import random
import struct
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image as Pictures
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__CompressedImage as CompressedImage
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__Image as Image
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__PointCloud2 as PointCloud2
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__PointField as PointField

from fieldtruth.bag import decode as read
from fieldtruth.bag import messages as ros
from fieldtruth.bag.file import BagError

HEAD: Final = ros.header(0, 5, "sensor")
TRUE: Final = np.array(
    [(k + 0.5, -2.0 * k, 0.25, 300 + k, k) for k in range(6)],
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("label", "<u2"), ("ring", "u1")],
)
"""Six points."""
DATATYPES: Final = {"f4": 7, "f8": 8, "u2": 4, "u1": 2, "i4": 5}


def bytes_of(array: NDArray[Any]) -> NDArray[np.uint8]:
    return np.frombuffer(array.tobytes(), np.uint8)


def cloud(points: NDArray[np.void] = TRUE, **changes: Any) -> Any:
    """Return the points as a cloud of one row, with changes."""
    fields = [
        PointField(name, offset, DATATYPES[dtype.newbyteorder("=").str[1:]], 1)
        for name, (dtype, offset, *_) in (points.dtype.fields or {}).items()
    ]
    step, size = points.dtype.itemsize, len(points)
    message = PointCloud2(HEAD, 1, size, fields, False, step, step * size, bytes_of(points), True)
    return replace(message, **changes)


def swapped(points: NDArray[Any]) -> NDArray[Any]:
    return points.astype(points.dtype.newbyteorder(">"))


def padded(points: NDArray[np.void], rows: int, gap: int, *, last: bool = True) -> NDArray[np.uint8]:
    """Return the bytes of an organised cloud with bytes between its rows."""
    used = bytes_of(points).reshape(rows, -1)
    data = np.pad(used, ((0, 0), (0, gap)), constant_values=99).reshape(-1)
    return data if last else data[:-gap]


def fields_of(**changes: Any) -> list[Any]:
    return [replace(field, **changes) for field in cloud().fields]


WIDE: Final = np.zeros(6, [("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("label", "<u2"), ("ring", "u1")])
for name in TRUE.dtype.names or ():
    WIDE[name] = TRUE[name]
STEP: Final = TRUE.dtype.itemsize

UNDERSTOOD: Final[dict[str, Any]] = {
    "as usual": cloud(),
    "big-endian": cloud(is_bigendian=True, data=bytes_of(swapped(TRUE))),
    "big-endian in padded rows": cloud(
        is_bigendian=True, height=2, width=3, row_step=3 * STEP + 7, data=padded(swapped(TRUE), 2, 7)
    ),
    "double precision": cloud(WIDE),
    "big-endian double precision": cloud(WIDE, is_bigendian=True, data=bytes_of(swapped(WIDE))),
    "row_step 0": cloud(row_step=0),
    "row_step of the whole cloud": cloud(height=2, width=3, row_step=6 * STEP),
    "row_step of a point": cloud(height=2, width=3, row_step=STEP),
    "padded rows": cloud(height=3, width=2, row_step=2 * STEP + 5, data=padded(TRUE, 3, 5)),
    "padded rows but the last": cloud(height=3, width=2, row_step=2 * STEP + 5, data=padded(TRUE, 3, 5, last=False)),
    "count 0": cloud(fields=fields_of(count=0)),
    "a field twice": cloud(fields=[*cloud().fields, cloud().fields[-1]]),
    "padding with names": cloud(fields=[*cloud().fields, PointField("_", 4, 2, 3), PointField("_", 8, 2, 3)]),
    "no name": cloud(fields=[*cloud().fields, PointField("", 4, 2, 1), PointField("", 8, 77, 1)]),
    "other order of fields": cloud(fields=cloud().fields[::-1]),
    "fields that overlap": cloud(fields=[*cloud().fields, PointField("rgb", 0, 7, 1), PointField("rgba", 0, 6, 1)]),
}


@pytest.mark.parametrize("message", UNDERSTOOD.values(), ids=UNDERSTOOD)
def test_points_are_those_that_were_meant(message: Any) -> None:
    found = read.points(message)
    assert len(found) == len(TRUE)
    for name in TRUE.dtype.names or ():
        assert found.dtype[name].isnative
        assert (found[name] == TRUE[name]).all()


def test_fields_of_several_values_are_kept() -> None:
    found = read.points(cloud(fields=[*cloud().fields, PointField("xyz", 0, 7, 3)]))
    assert found["xyz"].tolist() == np.stack([TRUE["x"], TRUE["y"], TRUE["z"]], axis=1).tolist()


@pytest.mark.parametrize("changes", [{"width": 0}, {"width": 0, "point_step": 0, "row_step": 0}, {"height": 0}])
def test_an_empty_cloud_has_its_fields(changes: dict[str, Any]) -> None:
    found = read.points(cloud(data=np.zeros(0, np.uint8), **changes))
    assert found.shape == (0,)
    assert found.dtype.names == TRUE.dtype.names


CONTRADICTIONS: Final[list[tuple[Any, str]]] = [
    (cloud(width=7), "7 x 1 points of 15 bytes do not fit 90 bytes with a row_step of 90"),
    (cloud(data=bytes_of(TRUE)[:-1]), "do not fit 89 bytes"),
    (cloud(height=0), "6 x 0 points of 15 bytes do not fit 90 bytes"),
    (cloud(point_step=0), "6 x 1 points of 0 bytes do not fit 90 bytes"),
    (cloud(point_step=14), "field 'ring' ends behind the point_step of 14 bytes"),
    (cloud(width=2**32 - 1, height=2**32 - 1), "do not fit 90 bytes"),
    (cloud(fields=fields_of(datatype=9)), "datatype of field 'x' must be 1 to 8, got 9"),
    (cloud(fields=fields_of(datatype=0)), "datatype of field 'x' must be 1 to 8, got 0"),
    (cloud(fields=fields_of(datatype=5)), "field 'x' must be float32 or float64, got i4"),
    (cloud(fields=fields_of(count=2)), "field 'x' must have one value per point, got a count of 2"),
    (cloud(fields=fields_of(offset=12)), "field 'x' ends behind the point_step of 15 bytes"),
    (cloud(fields=[*cloud().fields, PointField("g", 0, 1, 2**32 - 1)]), "field 'g' ends behind the point_step"),
    (cloud(fields=[*cloud().fields, PointField("label", 0, 4, 1)]), "has two different fields 'label'"),
]


@pytest.mark.parametrize(("message", "line"), CONTRADICTIONS)
def test_contradictions_of_a_cloud_are_one_line(message: Any, line: str) -> None:
    with pytest.raises(BagError) as error:
        read.points(message)
    assert line in str(error.value)
    assert "with the stamp 5 ns" in str(error.value)
    assert "\n" not in str(error.value)


# ---------------------------------------------------------------------------------------------------------------------

COLOURS: Final = np.arange(24, dtype=np.uint8).reshape(2, 4, 3) * 9
"""(h, w, 3) RGB."""
GREY: Final = COLOURS[..., 0]
ALPHA: Final = np.concatenate([COLOURS, np.full((2, 4, 1), 7, np.uint8)], axis=2)
METRES: Final = np.array([[0.5, 1.25, np.inf, 7.0], [3.0, 4.0, 5.0, 60.0]], np.float32)
IDS: Final = np.array([[0, 1, 2, 300], [4, 5, 6, 65535]], np.uint16)


def picture(encoding: str, pixels: NDArray[Any], *, big: bool = False, gap: int = 0, **changes: Any) -> Any:
    """Return an image whose rows have ``gap`` bytes between them."""
    height, width = pixels.shape[:2]
    stored = pixels.astype(pixels.dtype.newbyteorder(">" if big else "<"))
    rows = np.pad(bytes_of(stored).reshape(height, -1), ((0, 0), (0, gap)), constant_values=99)
    return replace(Image(HEAD, height, width, encoding, big, rows.shape[1], rows.reshape(-1)), **changes)


def sixteen(pixels: NDArray[Any]) -> NDArray[np.uint16]:
    return pixels.astype(np.uint16) * 256 + 200


def packed(pixels: NDArray[Any] | Any, kind: str, form: str, before: bytes = b"", **options: Any) -> Any:
    stream = io.BytesIO()
    (Pictures.fromarray(pixels) if isinstance(pixels, np.ndarray) else pixels).save(stream, kind, **options)
    return CompressedImage(HEAD, form, np.frombuffer(before + stream.getvalue(), np.uint8))


PALETTE: Final = Pictures.fromarray(np.stack([GREY] * 3, axis=2)).quantize(8)
PHOTOS: Final[dict[str, tuple[Any, NDArray[Any]]]] = {
    "rgb8": (picture("rgb8", COLOURS), COLOURS),
    "rgb8 in padded rows": (picture("rgb8", COLOURS, gap=5), COLOURS),
    "rgb8 with step 0": (picture("rgb8", COLOURS, step=0), COLOURS),
    "rgb8 with the step of the whole": (picture("rgb8", COLOURS, step=24), COLOURS),
    "rgb8 called big-endian": (picture("rgb8", COLOURS, is_bigendian=1), COLOURS),
    "a space behind": (picture("rgb8 ", COLOURS), COLOURS),
    "bgr8": (picture("bgr8", COLOURS[..., ::-1]), COLOURS),
    "8UC3": (picture("8UC3", COLOURS[..., ::-1], gap=1), COLOURS),
    "rgba8": (picture("rgba8", ALPHA), COLOURS),
    "bgra8": (picture("bgra8", ALPHA[..., [2, 1, 0, 3]]), COLOURS),
    "8UC4": (picture("8UC4", ALPHA[..., [2, 1, 0, 3]]), COLOURS),
    "mono8": (picture("mono8", GREY, gap=3), np.stack([GREY] * 3, axis=2)),
    "8UC1": (picture("8UC1", GREY), np.stack([GREY] * 3, axis=2)),
    "mono16": (picture("mono16", sixteen(GREY)), np.stack([GREY] * 3, axis=2)),
    "mono16 big-endian": (picture("mono16", sixteen(GREY), big=True, gap=2), np.stack([GREY] * 3, axis=2)),
    "rgb16 big-endian": (picture("rgb16", sixteen(COLOURS), big=True), COLOURS),
    "bgra16": (picture("bgra16", sixteen(ALPHA[..., [2, 1, 0, 3]])), COLOURS),
    "PNG": (packed(COLOURS, "PNG", "png"), COLOURS),
    "PNG with alpha": (packed(ALPHA, "PNG", "rgba8; png compressed bgra8"), COLOURS),
    "PNG called JPEG": (packed(COLOURS, "PNG", "rgb8; jpeg compressed bgr8"), COLOURS),
    "PNG in grey": (packed(GREY, "PNG", "mono8; png compressed "), np.stack([GREY] * 3, axis=2)),
    "PNG of 16 bits": (packed(sixteen(GREY), "PNG", "mono16; png compressed "), np.stack([GREY] * 3, axis=2)),
    "PNG with a palette": (packed(PALETTE, "PNG", "png"), np.asarray(PALETTE.convert("RGB"))),
    "TIFF": (packed(COLOURS, "TIFF", "rgb8; tiff compressed "), COLOURS),
}


@pytest.mark.parametrize(("message", "expected"), PHOTOS.values(), ids=PHOTOS)
def test_colours_are_those_that_were_meant(message: Any, expected: NDArray[Any]) -> None:
    found = read.image(message)
    assert found.dtype == np.uint8
    assert found.tolist() == expected.tolist()


def test_a_grey_jpeg_has_three_equal_channels() -> None:
    smooth = np.full((16, 16), 90, np.uint8)
    found = read.image(packed(smooth, "JPEG", "mono8; jpeg compressed "))
    assert found.shape == (16, 16, 3)
    assert np.abs(found.astype(int) - 90).max() <= 1


QUANTISED: Final = struct.pack("<iff", 0, 100.0, 5.0)
DEPTHS: Final[dict[str, tuple[Any, NDArray[Any]]]] = {
    "32FC1": (picture("32FC1", METRES), METRES),
    "32FC1 big-endian in padded rows": (picture("32FC1", METRES, big=True, gap=3), METRES),
    "64FC1": (picture("64FC1", METRES.astype(float), step=0), METRES),
    "16UC1": (picture("16UC1", np.array([[0, 1500]], np.uint16)), np.array([[np.nan, 1.5]], np.float32)),
    "16UC1 big-endian": (picture("16UC1", np.array([[1, 60000]], np.uint16), big=True), np.array([[0.001, 60]], "f4")),
    "PNG": (packed(np.array([[0, 1500]], np.uint16), "PNG", "16UC1; png compressed "), np.array([[np.nan, 1.5]])),
    "compressedDepth": (
        packed(np.array([[0, 1500]], np.uint16), "PNG", "16UC1; compressedDepth png", bytes(12)),
        np.array([[np.nan, 1.5]]),
    ),
    "compressedDepth of inverse depth": (
        packed(np.array([[0, 55, 7]], np.uint16), "PNG", "32FC1; compressedDepth png", QUANTISED),
        np.array([[np.nan, 2.0, 50.0]]),
    ),
}


@pytest.mark.parametrize(("message", "expected"), DEPTHS.values(), ids=DEPTHS)
def test_depths_are_those_that_were_meant(message: Any, expected: NDArray[Any]) -> None:
    found = read.depth(message)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, expected.astype(np.float32))


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        (picture("16UC1", IDS, big=True, gap=2), IDS),
        (picture("mono16", IDS), IDS),
        (picture("8UC1", (IDS % 256).astype(np.uint8)), IDS % 256),
        (picture("32SC1", IDS.astype(np.int32) * 9, big=True), IDS.astype(np.uint32) * 9),
    ],
)
def test_ids_are_those_that_were_meant(message: Any, expected: NDArray[Any]) -> None:
    assert read.instances(message).tolist() == expected.tolist()


def test_normals_and_flow_of_another_byte_order() -> None:
    xyz = np.linspace(-1.0, 1.0, 24, dtype=np.float32).reshape(2, 4, 3)
    assert (read.normals(picture("32FC3", xyz, big=True, gap=1)) == xyz).all()
    assert (read.flow(picture("32FC2", xyz[..., :2], big=True)) == xyz[..., :2]).all()


BAD_IMAGES: Final[list[tuple[Callable[[Any], Any], Any, str]]] = [
    (read.image, picture("bayer_rggb8", GREY), "its encoding must be one of rgb8, "),
    (read.image, picture("yuv422", COLOURS), "got 'yuv422'"),
    (read.image, picture("", COLOURS), "got ''"),
    (read.image, picture("rgb8", COLOURS, width=5), "of 5 x 2 rgb8 with a step of 12 holds 24 bytes"),
    (read.image, picture("rgb8", COLOURS, data=np.zeros(0, np.uint8)), "holds 0 bytes"),
    (read.image, picture("rgb8", COLOURS, height=0), "of 4 x 0 rgb8 with a step of 12 holds 24 bytes"),
    (read.image, picture("rgb8", COLOURS[:, :0]), "of 0 x 2 rgb8"),
    (read.image, picture("rgb8", COLOURS, width=2**32 - 1, height=2**32 - 1), "holds 24 bytes"),
    (read.image, CompressedImage(HEAD, "h264", np.arange(99, dtype=np.uint8)), "cannot be read as JPEG, PNG or TIFF"),
    (read.image, CompressedImage(HEAD, "jpeg", np.zeros(0, np.uint8)), "cannot be read as JPEG, PNG or TIFF"),
    (read.image, replace(PHOTOS["PNG"][0], data=PHOTOS["PNG"][0].data[:50]), "('png') cannot be read as "),
    (read.image, CompressedImage(HEAD, "jpeg", np.array([255, 216, 1, 2], np.uint8)), "('jpeg') cannot be read as "),
    (read.depth, picture("rgb8", COLOURS), "must be 32FC1 or 64FC1 or 16UC1 or mono16, got 'rgb8'"),
    (read.depth, PHOTOS["PNG"][0], "must have 16 bits"),
    (read.depth, CompressedImage(HEAD, "32FC1; compressedDepth rvl", np.arange(9, dtype=np.uint8)), "cannot be read"),
    (read.instances, PHOTOS["PNG"][0], "got 'CompressedImage png'"),
    (read.instances, picture("32SC1", -IDS.astype(np.int32)), "an id must not be negative, got -65535"),
]


@pytest.mark.parametrize(("function", "message", "line"), BAD_IMAGES)
def test_an_image_that_cannot_be_read_is_one_line(function: Callable[[Any], Any], message: Any, line: str) -> None:
    with pytest.raises(BagError) as error:
        function(message)
    assert line in str(error.value)
    assert "with the stamp 5 ns" in str(error.value)
    assert "\n" not in str(error.value)


# ---------------------------------------------------------------------------------------------------------------------

NUMBERS: Final = [0, 1, 2, 3, 4, 6, 8, 14, 15, 16, 45, 90, 255, 2**16, 2**31 - 1, 2**31, 2**32 - 1]


def changed(message: Any, rng: random.Random) -> Any:
    """Return a message with one to three header fields of another value."""
    for _ in range(rng.randint(1, 3)):
        name = rng.choice([name for name in message.__dataclass_fields__ if name not in ("header", "__msgtype__")])
        value = getattr(message, name)
        if isinstance(value, np.ndarray):
            value = rng.choice([value[: rng.randint(0, len(value))], np.append(value, value), value[::-1].copy()])
        elif isinstance(value, list):
            value = [changed(each, rng) if rng.random() < 0.4 else each for each in value]
            value = rng.choice([value, value + value[:1], value[1:], []])
        elif isinstance(value, str):
            value = rng.choice(["x", "", "_", "label", "mono8", "bgr8", "32FC1", "16UC1", "png", "\n", "ä"])
        else:
            value = rng.choice([False, True]) if isinstance(value, bool) else rng.choice(NUMBERS) % 2**32
        message = replace(message, **{name: value})
    return message


def understood_or_refused(function: Callable[[Any], Any], message: Any) -> Any:
    """Return what the function makes of a message, None where it refuses it."""
    try:
        return function(message)
    except BagError as error:
        if "\n" in str(error):
            raise AssertionError(f"more than a line: {error}") from error
        return None


SEEDS: Final = list(UNDERSTOOD.values())
IMAGES: Final = [message for message, _ in (*PHOTOS.values(), *DEPTHS.values())]


@pytest.mark.parametrize("seed", range(4))
def test_any_cloud_is_understood_or_refused_in_one_line(seed: int) -> None:
    rng, understood = random.Random(seed), 0
    for _ in range(1500):
        message = changed(rng.choice(SEEDS), rng)
        if (found := understood_or_refused(read.points, message)) is not None:
            assert len(found) == message.width * message.height
            assert all(found.dtype[name].isnative for name in found.dtype.names or ())
            understood += 1
    assert 100 < understood < 1400


@pytest.mark.parametrize("function", [read.image, read.depth, read.instances, read.normals, read.flow])
def test_any_image_is_understood_or_refused_in_one_line(function: Callable[[Any], Any]) -> None:
    rng, understood = random.Random(1), 0
    for _ in range(1500):
        message = changed(rng.choice(IMAGES), rng)
        if (found := understood_or_refused(function, message)) is not None:
            assert found.size
            if hasattr(message, "encoding"):
                assert found.shape[:2] == (message.height, message.width)
            understood += 1
    assert understood < 1400
