# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wind of an experiment, in which plants lean and sway. See docs/wind.md."""

from math import cos, radians, sin
from typing import Annotated

from pydantic import Field

from fieldtruth.experiment.fields import Frozen, Number


class WindConfig(Frozen):
    """Mean wind at a height of 10 m, and its gusts; ``wind: {speed_m_s: 8, direction_deg: 240}``."""

    speed_m_s: Annotated[Number, Field(ge=0, le=40)]
    """Mean over time; 0: no plant moves."""
    direction_deg: Annotated[Number, Field(ge=-360, le=360)] = 240.0
    """Where it blows from, clockwise from north, as meteorology has it."""
    gusts: Annotated[Number, Field(ge=0, le=0.5)] = 0.2
    """Turbulence intensity: standard deviation of the speed along the mean wind over its mean; 0: steady."""

    @property
    def text(self) -> str:
        """Speed, direction and gusts in words."""
        return f"wind of {self.speed_m_s:g} m/s from {self.direction_deg:g} deg, gusts {100 * self.gusts:g} %"

    @property
    def heading(self) -> tuple[float, float]:
        """Unit vector in which it blows, in the world: x north, y west."""
        return -cos(radians(self.direction_deg)), sin(radians(self.direction_deg))
