# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of the clock of a sensor, whose time the headers of its messages have."""

from typing import Annotated

from pydantic import Field

from fieldtruth.experiment.fields import Frozen, Number


class ClockConfig(Frozen):
    """The clock shows ``t + offset_s + drift_ppm 1e-6 t + jitter`` at the simulated time t."""

    offset_s: Annotated[Number, Field(ge=-3600, le=3600)] = 0.0
    drift_ppm: Annotated[Number, Field(ge=-10_000, le=10_000)] = 0.0
    jitter_s: Annotated[Number, Field(ge=0, le=1)] = 0.0
    """Standard deviation [s] of the normal error that each stamp has of its own."""
    drop_share: Annotated[Number, Field(ge=0, le=0.9)] = 0.0
    """Share of the readings that are lost at random, each with this probability."""

    @property
    def may_lose(self) -> bool:
        """Whether readings can be missing: lost ones, and those at which the clock shows 0 or less."""
        return self.drop_share > 0.0 or self.offset_s < 0.0 or self.jitter_s > 0.0
