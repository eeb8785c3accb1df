# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Compare PNG encoders on the images of a bag, and measure the conversion of its JPEGs to PNG files.

Run: python benchmarks/png_encoders.py BAG
Encoders that are not installed are skipped. To install all:
pip install pillow imagecodecs opencv-python-headless fpng deflate zlib-ng isal
"""

import argparse
import time
from collections.abc import Callable
from importlib import import_module
from io import BytesIO
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

from fieldtruth.bag.decode import depth, image, read_bag, stamp_ns
from fieldtruth.bag.reader import RawMessage, decoder, open_bag
from fieldtruth.bag.run import open_run
from fieldtruth.core.parallel import in_order
from fieldtruth.core.png import _filtered, encode_png

Encoder = Callable[[Any], Any]
SAMPLE, EVERY, WORKERS = 10, 10, 2
"""Images of each kind, of which every EVERY-th of the bag is taken; threads that convert JPEG to PNG."""


def pillow(level: int) -> Encoder:
    from PIL import Image

    def encode(pixels: NDArray[Any]) -> bytes:
        stream = BytesIO()
        Image.fromarray(pixels).save(stream, "png", compress_level=level)
        return stream.getvalue()

    return encode


def imagecodecs(function: str, level: int) -> Encoder:
    encode = getattr(import_module("imagecodecs"), function)
    return lambda pixels: encode(pixels, level=level)


def opencv(*parameters: str | int) -> Encoder:
    cv2 = import_module("cv2")
    cv2.setNumThreads(1)
    values = [getattr(cv2, each) if isinstance(each, str) else each for each in parameters]
    return lambda pixels: cv2.imencode(".png", pixels[..., ::-1] if pixels.ndim == 3 else pixels, values)[1]


def fpng() -> Encoder:
    return import_module("fpng").from_ndarray  # type: ignore[no-any-return]


def ours(module: str, function: str, level: int) -> Encoder:
    compress = getattr(import_module(module), function)
    return lambda pixels: compress(_filtered(pixels), level)


def unfiltered(level: int) -> Encoder:
    def encode(pixels: NDArray[Any]) -> bytes:
        rows = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder(">")).view(np.uint8).reshape(len(pixels), -1)
        return isal_zlib.compress(np.pad(rows, ((0, 0), (1, 0))), level)

    return encode


ENCODERS: dict[str, Callable[[], Encoder]] = {
    "fieldtruth": lambda: encode_png,
    "Sub filter, ISA-L 0": lambda: ours("isal.isal_zlib", "compress", 0),
    "Sub filter, ISA-L 2": lambda: ours("isal.isal_zlib", "compress", 2),
    "Sub filter, libdeflate 1": lambda: ours("deflate", "zlib_compress", 1),
    "Sub filter, zlib-ng 1": lambda: ours("zlib_ng.zlib_ng", "compress", 1),
    "no filter, ISA-L 1": lambda: unfiltered(1),
    "Pillow 0": lambda: pillow(0),
    "Pillow 1": lambda: pillow(1),
    "imagecodecs, libspng 0": lambda: imagecodecs("spng_encode", 0),
    "imagecodecs, libspng 1": lambda: imagecodecs("spng_encode", 1),
    "imagecodecs, libpng 1": lambda: imagecodecs("png_encode", 1),
    "OpenCV 1": lambda: opencv("IMWRITE_PNG_COMPRESSION", 1),
    "OpenCV, run lengths": lambda: opencv("IMWRITE_PNG_STRATEGY", "IMWRITE_PNG_STRATEGY_RLE"),
    "fpng": fpng,
}


def sample(bag: Path) -> dict[str, list[NDArray[Any]]]:
    def some(topic: str, read: Callable[[Any], NDArray[Any]]) -> list[NDArray[Any]]:
        with open_bag(bag) as stored:
            if topic not in stored.counts:
                return []
        readings = islice(read_bag(bag, [topic]), 0, SAMPLE * EVERY, EVERY)
        return [read(reading.message) for reading in readings]

    def millimetres(message: Any) -> NDArray[np.uint16]:
        metres = depth(message)
        return np.where(metres < 65.5, 1000 * metres, 0).astype(np.uint16)

    camera = open_run(bag).rig.imagers[0]
    readers: dict[str, Callable[[Any], NDArray[Any]]] = {"photograph": image, "tag": image, "depth": millimetres}
    found = {stream: some(camera.topic_of(stream), read) for stream, read in readers.items()}
    return {kind: images for kind, images in found.items() if images}


def measure(encode: Encoder, images: list[NDArray[Any]]) -> tuple[float, float]:
    """Return images per second of processor time, and bytes per image."""
    encode(images[0])
    start = time.thread_time()
    size = sum(len(encode(pixels)) for pixels in images)
    return len(images) / (time.thread_time() - start), size / len(images)


def from_jpeg_to_disk(bag: Path) -> tuple[int, float, float]:
    """Convert the bag's JPEGs to PNG files; return their number, seconds and processor seconds."""
    names = {imager.topic_of("photograph"): imager.name for imager in open_run(bag).rig.imagers}
    with open_bag(bag) as stored, TemporaryDirectory(dir=Path.cwd()) as folder:
        decode = decoder(stored)

        def convert(raw: RawMessage) -> None:
            message = decode(raw)
            (Path(folder) / f"{names[raw.topic]}_{stamp_ns(message.header)}.png").write_bytes(
                encode_png(image(message))
            )

        start, cpu = time.perf_counter(), time.process_time()
        photographs = stored.messages([topic for topic in names if topic in stored.counts])
        count = sum(1 for _ in in_order(photographs, convert, WORKERS))
        return count, time.perf_counter() - start, time.process_time() - cpu


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bag", type=Path)
    bag = parser.parse_args().bag
    images = sample(bag)
    height, width = next(iter(images.values()))[0].shape[:2]
    print(f"{width} x {height}: images per second of processor time, and kB per image")
    print(f"{'':<36}" + "".join(f"{kind:>12}{'kB':>8}" for kind in images))
    for name, make in ENCODERS.items():
        try:
            encode = make()
        except ImportError:
            continue
        row = ""
        for pixels in images.values():
            try:
                rate, size = measure(encode, pixels)
                row += f"{rate:>12.0f}{size / 1e3:>8.0f}"
            except AttributeError:  # fpng does not support 16 bits
                row += f"{'-':>12}{'-':>8}"
        print(f"{name:<36}{row}")
    count, seconds, cpu = from_jpeg_to_disk(bag)
    print(f"JPEG in the bag to PNG on disk, {WORKERS} threads: {count} photographs in {seconds:.2f} s, "
          f"{count / seconds:.0f} per second; {1e3 * cpu / count:.1f} ms of processor time each")  # fmt: skip


if __name__ == "__main__":
    main()
