# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Types of numbers in the configuration, the base of all its classes, and poses of frames on the robot."""

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, Strict

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array

# Strict: strings and booleans are not numbers.
Number = Annotated[float, Strict()]
Integer = Annotated[int, Strict()]
Boolean = Annotated[bool, Strict()]
Positive = Annotated[Number, Field(gt=0)]
Range = Annotated[Number, Field(gt=0, le=100_000)]  # [m]; single precision resolves 1 cm there
Rate = Annotated[Number, Field(ge=0.01, le=1000)]  # [Hz]; the physics runs at 1 kHz


class Frozen(BaseModel):
    """Base of all configuration: immutable, finite numbers only, unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with other values, which are not validated.

        Raises:
            TypeError: there is no such key; pydantic would ignore it.
        """
        if unknown := (update or {}).keys() - type(self).model_fields.keys():
            raise TypeError(f"{type(self).__name__} has no {', '.join(sorted(unknown))}")
        return super().model_copy(update=update, deep=deep)


class Mount(Frozen):
    """Pose of a frame in base_link: ``xyz`` [m]; ``rpy_deg`` roll, pitch, yaw about fixed axes [deg]."""

    xyz: tuple[Number, Number, Number]
    rpy_deg: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)

    @property
    def base_from_sensor(self) -> Array:
        """(4, 4) transform from the mounted frame to base_link."""
        return transforms.pose(self.xyz, self.rpy_deg)
