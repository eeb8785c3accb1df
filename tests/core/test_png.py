# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""PNG files read by two independent decoders, Pillow and pypng (strict), and the layout of their chunks."""

import struct
import zlib
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from typing import Any

import numpy as np
import png
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from PIL import Image

from fieldtruth.core.classes import PALETTE
from fieldtruth.core.errors import OutputError
from fieldtruth.core.png import encode_png

RNG = np.random.default_rng(0)


def with_pillow(data: bytes) -> NDArray[Any]:
    with Image.open(BytesIO(data)) as image:
        image.verify()
    return np.asarray(Image.open(BytesIO(data)))


def with_pypng(data: bytes) -> NDArray[Any]:
    width, height, rows, info = png.Reader(bytes=data).read()
    dtype = np.uint16 if info["bitdepth"] == 16 else np.uint8
    values = np.vstack([np.asarray(row, dtype) for row in rows])
    return values.reshape((height, width, 3) if info["planes"] == 3 else (height, width))


def noise(shape: tuple[int, ...], dtype: type[np.unsignedinteger[Any]]) -> NDArray[Any]:
    return RNG.integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True)


@pytest.mark.parametrize("decode", [with_pillow, with_pypng])
@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (2, 2), (37, 53), (184, 320)])
def test_every_pixel_round_trips(decode: Any, size: tuple[int, int]) -> None:
    colours, grey, wide = noise((*size, 3), np.uint8), noise(size, np.uint8), noise(size, np.uint16)
    for image in (colours, grey, wide, np.zeros_like(colours), np.full_like(wide, 65535), PALETTE[grey % 16]):
        back = decode(encode_png(image))
        assert back.shape == image.shape
        assert back.dtype == image.dtype
        assert np.array_equal(back, image)


def test_known_row_and_column_round_trip() -> None:
    row = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [1, 2, 3]]], np.uint8)
    deep = np.array([[0, 1], [256, 65535]], np.uint16)
    with Image.open(BytesIO(encode_png(row))) as image:
        assert [image.getpixel((x, 0)) for x in range(4)] == [(255, 0, 0), (0, 255, 0), (0, 0, 255), (1, 2, 3)]
    with Image.open(BytesIO(encode_png(deep))) as image:
        assert [[image.getpixel((x, y)) for x in range(2)] for y in range(2)] == [[0, 1], [256, 65535]]


@pytest.mark.parametrize("decode", [with_pillow, with_pypng])
@pytest.mark.parametrize("colours", [2, 16, 17, 256])
@pytest.mark.parametrize("size", [(1, 1), (4, 7), (37, 54)])
def test_palette_images_decode_to_the_palettes_colours(decode: Any, colours: int, size: tuple[int, int]) -> None:
    palette = noise((colours, 3), np.uint8)
    indices = RNG.integers(0, colours, size, np.uint8)
    data = encode_png(indices, palette=palette)
    with Image.open(BytesIO(data)) as image:
        assert np.array_equal(np.asarray(image.convert("RGB")), palette[indices])
    if decode is with_pypng:
        assert png.Reader(bytes=data).read()[3]["bitdepth"] == (4 if colours <= 16 else 8)
    assert np.array_equal(decode(data), indices)


@pytest.mark.parametrize("cut", [np.s_[::-1, ::2], np.s_[3:9, 5:6], np.s_[..., ::-1]])
def test_non_contiguous_views_round_trip(cut: Any) -> None:
    image = noise((20, 30, 3), np.uint8)[cut]
    assert np.array_equal(with_pillow(encode_png(image)), image)


def test_either_byte_order_round_trips() -> None:
    image = noise((5, 7), np.uint16)
    assert encode_png(image.astype(">u2")) == encode_png(image)


@settings(max_examples=50, deadline=None)
@given(hnp.arrays(np.uint16, hnp.array_shapes(min_dims=2, max_dims=2, max_side=6), elements=st.integers(0, 65535)))
def test_any_small_depth_image_round_trips(image: NDArray[np.uint16]) -> None:
    assert np.array_equal(with_pypng(encode_png(image)), image)


def test_chunks_have_the_layout_of_the_standard() -> None:
    data, at, chunks = encode_png(noise((7, 5, 3), np.uint8)), 8, []
    assert data[:8] == bytes([137, 80, 78, 71, 13, 10, 26, 10])
    while at < len(data):
        (size,) = struct.unpack_from(">L", data, at)
        name, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + size]
        assert struct.unpack_from(">L", data, at + 8 + size) == (zlib.crc32(name + body),)
        chunks.append((name, body))
        at += 12 + size
    assert [name for name, _ in chunks] == [b"IHDR", b"IDAT", b"IEND"]
    assert chunks[0][1] == bytes([0, 0, 0, 5, 0, 0, 0, 7, 8, 2, 0, 0, 0])
    inflate = zlib.decompressobj()
    rows = inflate.decompress(chunks[1][1])
    assert inflate.eof
    assert not inflate.unused_data  # strict readers count bytes behind the stream as damage
    assert len(rows) == 7 * (1 + 3 * 5)
    assert chunks[2][1] == b""


def test_flat_colours_compress_well() -> None:
    stripes = PALETTE[np.arange(720)[:, None] // 60 % 16 * np.ones(1280, int)]
    assert len(encode_png(stripes)) < stripes.nbytes / 100


def test_threads_make_the_same_bytes() -> None:
    images = [noise((90, 160, 3), np.uint8) // 16 for _ in range(16)]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(encode_png, images)) == [encode_png(image) for image in images]


def test_image_without_pixels_is_an_error() -> None:
    with pytest.raises(OutputError, match="0 x 4 pixels"):
        encode_png(np.zeros((4, 0, 3), np.uint8))


@pytest.mark.parametrize("image", [np.zeros((2, 2, 4), np.uint8), np.zeros((2, 2, 3), np.uint32), np.zeros((2, 2))])
def test_other_arrays_are_refused(image: Any) -> None:
    with pytest.raises(ValueError, match="must be"):
        encode_png(image)
