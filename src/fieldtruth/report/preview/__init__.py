# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A sheet about an environment: aerial view with routes, camera images with labels, labelled cloud, class shares."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.report.preview.content import collect_content
from fieldtruth.report.preview.sheet import draw_sheet
from fieldtruth.world.build import load_world

WIDTH: Final = 2400
"""Default width [pixel]."""
WIDTH_IN_DOCUMENTS: Final = 1400
"""Width [pixel] at which the sheet is still sharp as a JPEG below 400 kB."""


def preview(
    environment: str,
    seed: int = 0,
    *,
    layout: Mapping[str, Any] | None = None,
    width: int = WIDTH,
    workers: int | None = None,
    progress: Progress | None = None,
) -> NDArray[np.uint8]:
    """Draw a sheet about an environment, an image (h, w, 3) in sRGB.

    It shows the world from above with the routes of its built-in experiments (paper, Figures 8 to 11), four camera
    images with their labels (Figures 13 to 20), a labelled cloud along the routes (Figure 12), and the class shares of
    pixels and points (Figure 21). For an environment without experiments the viewpoints are random free positions.

    Args:
        environment: a name from ``list_environments``.
        seed: of the world.
        layout: changes to the environment's layout.
        width: of the sheet [pixel]; the height is about 1.3 times the width.
        workers: threads; None takes every available core. The sheet does not depend on it.
        progress: receives the stages of the work.

    Raises:
        UnknownNameError: the environment does not exist; lists those that do.
    """
    workers = cpu_count() if workers is None else workers
    progress = Silent() if progress is None else progress
    with progress.stage("build the world"):
        world = load_world(environment, seed, layout)
    content = collect_content(world, aerial_width=width, workers=workers, progress=progress)
    with progress.stage("lay out the sheet"):
        return draw_sheet(content, width)


__all__ = ["WIDTH", "WIDTH_IN_DOCUMENTS", "preview"]
