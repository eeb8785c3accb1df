# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The paper on which preview sheets and pictures of rigs are drawn, by matplotlib."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from fieldtruth.report.drawing.style import FONT, INK, MUTED


class Paper:
    """A white sheet of ``width`` x ``height`` [inch], drawn ``pixels`` wide; positions are from its upper left corner.

    It uses matplotlib's figure without pyplot, so that no global state changes, and the font of matplotlib.
    """

    def __init__(self, width: float, height: float, pixels: int) -> None:
        self.width, self.height = width, height
        self.figure = Figure(figsize=(width, height), dpi=pixels / width, facecolor="white")
        self._canvas = FigureCanvasAgg(self.figure)

    def axes(self, left: float, top: float, width: float, height: float) -> Axes:
        """Add an empty drawing area whose upper left corner is at ``left``, ``top``."""
        box = (left / self.width, 1.0 - (top + height) / self.height, width / self.width, height / self.height)
        axes = self.figure.add_axes(box)
        axes.set_axis_off()
        return axes

    def image_at(self, image: NDArray[np.uint8], left: float, top: float, width: float, height: float) -> Axes:
        """Draw an image (h, w, 3) into a box; the unit of the axes is its pixel, (0, 0) is the centre of the first."""
        axes = self.axes(left, top, width, height)
        axes.imshow(image, aspect="auto", interpolation="antialiased")
        axes.set_autoscale_on(False)
        return axes

    def text(self, left: float, baseline: float, content: str, size: float = 8.0, **options: Any) -> float:
        """Write text of ``size`` [point] with options of matplotlib's text; return its width [inch]."""
        style: dict[str, Any] = {"color": INK, "family": FONT, "va": "baseline"} | options
        written = self.figure.text(left / self.width, 1.0 - baseline / self.height, content, fontsize=size, **style)
        renderer = self._canvas.get_renderer()  # type: ignore[no-untyped-call]
        return float(written.get_window_extent(renderer).width / self.figure.dpi)

    def heading(self, left: float, top: float, title: str, caption: str) -> None:
        """Write a title and a caption beside it, above what begins at ``top``."""
        width = self.text(left, top - 0.13, title, 10.5, weight="bold")
        self.text(left + width + 0.14, top - 0.13, caption, 8.2, color=MUTED)

    def box(self, left: float, top: float, width: float, height: float, colour: str, **options: Any) -> None:
        """Draw a filled rectangle with options of matplotlib's Rectangle."""
        corner = (left / self.width, 1.0 - (top + height) / self.height)
        size = (width / self.width, height / self.height)
        style: dict[str, Any] = {"facecolor": colour, "linewidth": 0.0} | options
        self.figure.add_artist(Rectangle(corner, *size, transform=self.figure.transFigure, **style))

    def render(self) -> NDArray[np.uint8]:
        """Return the sheet as an image (h, w, 3)."""
        self._canvas.draw()  # type: ignore[no-untyped-call]
        return np.ascontiguousarray(np.asarray(self._canvas.buffer_rgba())[..., :3])  # type: ignore[no-untyped-call]
