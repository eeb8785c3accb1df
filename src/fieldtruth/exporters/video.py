# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export a run as a video (MP4, H.264): photograph, tags, depth and cloud side by side.

Frames are shown at the times of their stamps after the first. PyAV encodes them, because it brings FFmpeg with it, and
takes the time of each frame; the number of its threads is fixed, as x264's bytes depend on it.
"""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Final

import av
import numpy as np
from av.video.reformatter import ColorPrimaries, ColorRange, Colorspace, ColorTrc

from fieldtruth.bag.run import Run
from fieldtruth.core.arrays import Counts
from fieldtruth.core.errors import OutputError
from fieldtruth.exporters import Options
from fieldtruth.exporters.video_frames import VideoFrames

_ENCODER: Final = "libx264"
_TICKS: Final = 90_000
"""Per second, of MP4's stamps."""
_QUALITY: Final = {"crf": "23", "preset": "medium", "threads": "2", "x264-params": "mbtree=0"}
"""With AVX-512, x264 with its tree of macroblocks gives other bytes each time, for the same frames."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the file ``target``.

    Raises:
        BagError: the run has no photographs, or is damaged.
        OutputError: PyAV was built without x264.
    """
    if _ENCODER not in av.codecs_available:
        raise OutputError(f"PyAV is here without {_ENCODER}; run: pip install --force-reinstall 'fieldtruth[video]'")
    (run,) = runs
    frames = VideoFrames(run)
    ticks, lasts, rate = times(frames.stamps_ns)
    with av.open(str(target), "w", format="mp4") as file:
        stream = file.add_stream(_ENCODER, rate=rate, options=_QUALITY)
        stream.time_base = stream.codec_context.time_base = Fraction(1, _TICKS)
        height, width = frames.draw(0).shape[:2]
        stream.height, stream.width, stream.pix_fmt = height, width, "yuv420p"
        context = stream.codec_context  # said, as players guess by the size: these are what most take without it
        context.colorspace, context.color_range = Colorspace.SMPTE170M, ColorRange.MPEG
        context.color_primaries, context.color_trc = ColorPrimaries.SMPTE170M, ColorTrc.SMPTE170M
        rows = range(len(frames))
        for row, drawn in zip(rows, options.each("write the video", run, rows, frames.draw), strict=True):
            frame = av.VideoFrame.from_ndarray(drawn, format="rgb24")
            frame = frame.reformat(
                format="yuv420p", dst_colorspace=Colorspace.SMPTE170M, dst_color_range=ColorRange.MPEG
            )
            frame.pts, frame.duration, frame.time_base = int(ticks[row]), int(lasts[row]), Fraction(1, _TICKS)
            file.mux(stream.encode(frame))
        file.mux(stream.encode())


def times(stamps_ns: Counts) -> tuple[Counts, Counts, Fraction]:
    """Return when each frame begins and how long it lasts (n,) [1/90000 s], and the usual rate [Hz] of the frames."""
    steps = np.diff(stamps_ns)
    usual = int(np.median(steps)) if len(steps) else 10**9
    ticks = np.rint((stamps_ns - stamps_ns[0]) * (_TICKS / 1e9)).astype(np.int64)
    lasts = np.diff(ticks, append=ticks[-1] + round(usual * (_TICKS / 1e9)))
    return ticks, lasts, Fraction(10**9, usual).limit_denominator(1000)
