# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Curves over time as SVG paths, with ticks and the values behind them."""

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.report.drawing.text import fixed
from fieldtruth.report.page import series
from fieldtruth.report.page.decimate import Line
from fieldtruth.report.page.series import Lines

WIDTH: Final = 1000.0
HEIGHT: Final = 100.0
"""Size of a plot in its own units; the page stretches it."""
_DIGITS: Final = 5
"""Significant digits of the values."""
_MARGIN: Final = 0.06


class _Kind(NamedTuple):
    title: str
    unit: str
    whose: str
    """What is measured; of one of several sensors, its name replaces this."""
    note: str
    least_span: float
    """Smallest span of the axis, so that nearly constant values do not look like noise."""


_KINDS: Final = {
    series.SPEED: _Kind("Speed", "m/s", "base_link", "ground truth", 0.1),
    series.TILT: _Kind("Roll and pitch", "°", "base_link", "ground truth; pitch is positive downhill", 2.0),
    series.HEADING: _Kind("Heading", "°", "", "yaw, ground truth; 0 is north, west is positive", 5.0),
    series.HEIGHT: _Kind("Height", "m", "base_link", "ground truth", 0.5),
    series.TURNING: _Kind("Angular velocity", "rad/s", "the IMU", "in its own frame", 0.1),
    series.ACCELERATION: _Kind("Acceleration", "m/s²", "the IMU", "in its own frame, including gravity", 1.0),
    series.WHEELS: _Kind("Wheel speed", "rad/s", "the four tachometers", "", 0.5),
    series.GNSS: _Kind("GNSS", "m", "", "from the first fix", 0.5),
}


class Tick(NamedTuple):
    """A grid line at ``at`` percent from the left or the top, and its label."""

    at: float
    text: str


class Channel(NamedTuple):
    """A line of a curve: its SVG path, and its lowest and highest value."""

    name: str
    path: str
    lowest: str
    highest: str


class Curve(NamedTuple):
    """A plot."""

    key: str
    title: str
    unit: str
    note: str
    channels: tuple[Channel, ...]
    ticks: tuple[Tick, ...]


def draw_curves(lines: Lines, start_ns: int, end_ns: int) -> tuple[Curve, ...]:
    """Draw all curves with readings, in a fixed order, over the same time."""
    return tuple(
        _curve(key, lines[key], start_ns, max(end_ns - start_ns, 1))
        for key in _in_order(lines)
        if any(len(line.values) for line in lines.get(key, {}).values())
    )


def time_ticks(duration_s: float) -> tuple[Tick, ...]:
    """Ticks of the time axis [s from the start]."""
    if duration_s <= 0.0:
        return (Tick(0.0, "0"),)
    step, values = _steps(0.0, duration_s, 8)
    return tuple(Tick(round(100 * t / duration_s, 3), _plain(t, step)) for t in values)


def curve_values(lines: Lines, start_ns: int) -> dict[str, Any]:
    """Times [ms from the start] and values of each channel by curve, for the reader who points at a curve.

    They are readings from the bag; nothing is averaged.
    """
    return {
        key: [
            [
                [round((stamp - start_ns) / 1e6) for stamp in line.stamps_ns.tolist()],
                [float(f"{value:.{_DIGITS}g}") for value in line.values],
            ]
            for line in lines[key].values()
            if len(line.values)
        ]
        for key in _in_order(lines)
    }


def _in_order(lines: Lines) -> list[str]:
    """Keys of the curves, kind by kind."""
    return sorted(lines, key=lambda key: list(_KINDS).index(key.partition(" of ")[0]))


def _curve(key: str, channels: Mapping[str, Line], start_ns: int, span_ns: int) -> Curve:
    name, _, sensor = key.partition(" of ")
    kind = _KINDS[name]
    filled = {name: line for name, line in channels.items() if len(line.values)}
    low = min(float(line.values.min()) for line in filled.values())
    high = max(float(line.values.max()) for line in filled.values())
    middle, span = (low + high) / 2, max(high - low, kind.least_span) * (1 + 2 * _MARGIN)
    low, high = middle - span / 2, middle + span / 2
    step, values = _steps(low, high, 5)
    drawn = tuple(
        Channel(name, _path(line, start_ns, span_ns, low, high), *(_plain(float(v), step / 100) for v in ends))
        for name, line in filled.items()
        for ends in [(line.values.min(), line.values.max())]
    )
    ticks = tuple(Tick(round(100 * (high - v) / span, 2), _plain(v, step)) for v in values)
    whose = sensor or kind.whose
    note = ", ".join(filter(None, (f"of {whose}" if whose else "", kind.note)))
    return Curve(key, kind.title, kind.unit, note, drawn, ticks)


def _path(line: Line, start_ns: int, span_ns: int, low: float, high: float) -> str:
    x = np.clip(WIDTH * (line.stamps_ns - start_ns) / span_ns, 0.0, WIDTH)
    y = HEIGHT * (high - line.values) / (high - low)
    if len(x) == 1:
        x, y = np.array([0.0, WIDTH]), y.repeat(2)
    return "M" + "L".join(f"{a:.1f},{b:.2f}" for a, b in zip(x, y, strict=True))


def _steps(low: float, high: float, about: int) -> tuple[float, list[float]]:
    """A round distance, and its multiples between two values, approximately so many."""
    raw = (high - low) / about
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= raw * 0.999)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return step, [k * step for k in range(first, last + 1)]


def _plain(value: float, step: float) -> str:
    return fixed(value, max(0, -math.floor(math.log10(step) + 1e-9)))
