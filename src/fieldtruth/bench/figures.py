# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What the benchmark tells: each figure with its unit and the target that it is held against."""

from collections.abc import Mapping
from typing import Final, NamedTuple


class Figure(NamedTuple):
    """One measured number; ``target`` is None where nothing is promised."""

    key: str
    unit: str
    target: float | None = None
    at_least: bool = True
    """Whether more than the target is better, or less."""

    def met(self, value: float) -> bool:
        """Whether a value reaches the target; without one every value does."""
        if self.target is None:
            return True
        return value >= self.target if self.at_least else value <= self.target


FIGURES: Final = (
    Figure("lidar_mrays_per_s", "Mrays/s", 1.5),
    Figure("lidar_bare_mrays_per_s", "Mrays/s"),
    Figure("lidar_over_bare", "x", 1.4, at_least=False),
    Figure("camera_bare_mrays_per_s", "Mrays/s"),
    Figure("label_image_over_bare", "x", 1.4, at_least=False),
    Figure("realistic_image_over_bare", "x", 3.0, at_least=False),
    Figure("stereo_pairs_per_s", "pairs/s"),
    Figure("two_workers_speedup", "x", 1.8),
    Figure("drive_realtime_factor", "x", 15.0),
    Figure("world_build_s", "s", 30.0, at_least=False),
    Figure("light_bake_s", "s"),
    Figure("world_load_s", "s", 3.0, at_least=False),
    Figure("first_frame_s", "s", 10.0, at_least=False),
    Figure("peak_rss_mb", "MB", 1500.0, at_least=False),
)


RATIOS: Final = (
    Figure("forest_over_park_image", "x", 2.0, at_least=False),
    Figure("ten_times_trees", "x", 1.5, at_least=False),
)
"""What only several environments together tell."""

Everything = dict[str, dict[str, float] | float]
"""Figures by environment, and the ratios beside them."""


def table(figures: Mapping[str, float]) -> str:
    """Measured figures as lines of text: value, unit, target, and whether it is met on this machine at this hour."""
    lines = [f"{'figure':<28}{'value':>9}  {'unit':<8}{'target':>10}  met"]
    for figure in (*FIGURES, *RATIOS):
        if figure.key in figures:
            lines.append(_line(figure, figures[figure.key]))
    return "\n".join(lines)


def table_of_all(everything: Everything) -> str:
    """A table per environment, and one of the ratios."""
    ratios = {key: value for key, value in everything.items() if isinstance(value, float)}
    blocks = {name: found for name, found in everything.items() if isinstance(found, dict)}
    return "\n\n".join(
        f"{name}\n{table(found)}" for name, found in [*blocks.items(), ("all together", ratios)] if found
    )


def _line(figure: Figure, value: float) -> str:
    wanted, met = "", ""
    if figure.target is not None:
        wanted = f"{'>=' if figure.at_least else '<='} {figure.target:g}"
        met = "yes" if figure.met(value) else "no"
    shown = f"{value:.0f}" if value >= 1000 else f"{value:#.3g}"
    return f"{figure.key:<28}{shown:>9}  {figure.unit:<8}{wanted:>10}  {met}".rstrip()
