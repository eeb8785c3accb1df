# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One sheet that shows an environment: from above, from the robot, as a cloud, and in numbers."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress, Silent

WIDTH: Final = 2400  # [pixel]
WIDTH_IN_DOCUMENTS: Final = 1400  # [pixel]; as a JPEG it is then still sharp below 400 kB


def preview(
    environment: str,
    seed: int = 0,
    *,
    width: int = WIDTH,
    workers: int | None = None,
    progress: Progress | None = None,
) -> NDArray[np.uint8]:
    """Draw the sheet of an environment, an image (h, w, 3) in sRGB.

    It shows the place from above with the routes of its built-in experiments (paper, Figures 8 to 11), four views of
    the robot's with their tags (Figures 13 to 20), the labelled cloud along the routes (Figure 12) and the shares of
    the classes in pixels and points (Figure 21). Where no experiment drives, it looks from free places.

    Args:
        environment: a name that ``list_environments`` gives.
        seed: of everything random.
        width: of the sheet [pixel]; it is about 1.3 times as high.
        workers: threads; None takes every core that the process may use. The sheet does not depend on it.
        progress: is told what happens.

    Raises:
        UnknownNameError: there is no such environment; lists those that there are.
    """
    from fieldtruth.report.preview.content import gather
    from fieldtruth.report.preview.sheet import draw_sheet
    from fieldtruth.world.build import load_world

    workers = cpu_count() if workers is None else workers
    progress = Silent() if progress is None else progress
    with progress.stage("build the world"):
        world = load_world(environment, seed)
    found = gather(world, aerial_width=width, workers=workers, progress=progress)
    with progress.stage("lay out the sheet"):
        return draw_sheet(found, width)


__all__ = ["WIDTH", "WIDTH_IN_DOCUMENTS", "preview"]
