# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of a lens: a model with its coefficients, as in ROS's CameraInfo."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from fieldtruth.core import lenses
from fieldtruth.experiment.fields import Frozen, Number, Positive

LensModel = Literal["pinhole", "plumb_bob", "rational_polynomial", "equidistant", "equirectangular"]


class LensConfig(Frozen):
    """Lens of a camera: a model and coefficients as in ROS's CameraInfo, and where the image lies on them."""

    model: Annotated[LensModel, Field(description=", ".join(lenses.COEFFICIENTS))] = "pinhole"
    coefficients: Annotated[tuple[Number, ...], Field(description="the numbers that the model has")] = ()
    fx: Positive | None = None  # [pixel]; None: from the horizontal field of view
    fy: Positive | None = None  # [pixel]; None: fx if that is given, else from the vertical field of view
    cx: Number | None = None  # [pixel] from the centre of the first pixel; None: the middle of the image
    cy: Number | None = None
    image_circle_deg: Annotated[Number, Field(gt=1, le=360)] | None = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        names = lenses.COEFFICIENTS[self.model].split()
        if len(self.coefficients) != len(names):
            needed = f"{len(names)} coefficients, {', '.join(names)}" if names else "no coefficients"
            raise ValueError(f"coefficients: {self.model} has {needed}, got {len(self.coefficients)}")
        if self.fy is not None and self.fx is None:
            raise ValueError("fy needs fx")
        return self
