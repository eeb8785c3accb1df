# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export a run as an animated WebP, which pages show like an image: the frames of its video, fewer and smaller."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image

from fieldtruth.bag.run import Run
from fieldtruth.exporters import Options
from fieldtruth.exporters.video_frames import VideoFrames

_STEP_NS: Final = 190_000_000
"""Least time [ns] between two frames: 5 Hz."""
_WIDEST: Final = 360
"""Largest width [pixel] of a photograph."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the file ``target``.

    Raises:
        BagError: the run has no photographs, or is damaged.
    """
    (run,) = runs
    frames, rows = VideoFrames(run, widest=_WIDEST), [0]
    for row, stamp in enumerate(frames.stamps_ns.tolist()):
        if stamp >= frames.stamps_ns[rows[-1]] + _STEP_NS:
            rows.append(row)

    first, *others = options.each("write the animation", run, rows, lambda row: Image.fromarray(frames.draw(row)))
    begins = np.rint((frames.stamps_ns[rows] - frames.stamps_ns[0]) / 1e6).astype(int)
    lasts = np.diff(begins, append=begins[-1] + (begins[-1] - begins[-2] if len(begins) > 1 else 1000))
    first.save(
        target,
        "WEBP",
        save_all=True,
        append_images=others,
        duration=lasts.tolist(),
        loop=0,
        quality=50,
        method=4,
    )
