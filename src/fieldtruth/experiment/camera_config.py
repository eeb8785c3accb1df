# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of the cameras and their lenses; defaults from the paper's Tables 1, 2 and 5."""

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from fieldtruth.core import frames, lenses
from fieldtruth.experiment.camera_models import with_camera_model
from fieldtruth.experiment.fields import Boolean, Frozen, Integer, Mount, Number, Positive, Range, Rate

CAMERA_FROM_OPTICAL = frames.pose((0.0, 0.0, 0.0), (0.0, 0.0, -90.0))
"""The paper's camera frames (x down, y left, z forward) from REP-103 optical frames (x right, y down, z forward)."""

OPTICAL = frames.pose((0.0, 0.0, 0.0), (-90.0, 0.0, -90.0))
"""A body frame (x forward, y left, z up) from the optical frame of a camera that looks along the body's x."""

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


class CameraConfig(Frozen):
    """Stereo pair of identical cameras (ZED-2). Mounts are the paper's frames: z forward, x down, y left."""

    enabled: Boolean = True
    model: Annotated[str, Field(description="a camera of docs/cameras.md")] | None = None
    """Its data are the defaults of the other keys."""
    rate_hz: Rate = 25.0
    width: Annotated[Integer, Field(ge=8, le=8192, multiple_of=8)] = 1280  # [pixel]
    height: Annotated[Integer, Field(ge=8, le=8192, multiple_of=8)] = 720  # [pixel]
    horizontal_fov_deg: Annotated[Number, Field(gt=1, le=360)] = 69.0
    vertical_fov_deg: Annotated[Number, Field(gt=1, le=360)] = 42.0
    lens: LensConfig = LensConfig()
    far: Range = 2000.0  # [m]; beyond it is sky
    jpeg_quality: Annotated[Integer, Field(ge=1, le=100)] = 92
    depth: Boolean = False
    instances: Boolean = False
    left: Mount = Mount(xyz=(0.15, 0.06, 0.720), rpy_deg=(0.0, 90.0, 0.0))
    right: Mount = Mount(xyz=(0.15, -0.06, 0.720), rpy_deg=(0.0, 90.0, 0.0))

    @model_validator(mode="before")
    @classmethod
    def _of_model(cls, values: Any) -> Any:
        return with_camera_model(values) if isinstance(values, dict) else values

    @model_validator(mode="after")
    def _visible(self) -> Self:
        flat, lens = self.lens.model in lenses.FLAT, self.lens
        for key, most in (("horizontal_fov_deg", 360.0), ("vertical_fov_deg", 180.0)):
            value = getattr(self, key)
            if lens.fx is None and flat and value >= 170.0:
                raise ValueError(f"{key} must be below 170 with the lens {lens.model}, got {value!r}")
            if lens.fx is None and lens.model == "equirectangular" and value > most:
                raise ValueError(f"{key} must be at most {most:g} with the lens equirectangular, got {value!r}")
        if lens.model in ("pinhole", "equirectangular"):
            return self
        seen = np.degrees(lenses.greatest_angle(lens.model, lens.coefficients))
        for key in ("horizontal_fov_deg", "vertical_fov_deg"):
            if lens.fx is None and getattr(self, key) / 2.0 > seen:
                raise ValueError(f"{key}: lens.coefficients can be inverted up to {seen:.2f} deg from the axis only")
        u, v = np.arange(self.width), np.arange(self.height)
        border = np.concatenate([[u, 0 * u], [u, 0 * u + v[-1]], [0 * v, v], [0 * v + u[-1], v]], axis=1)
        whole = self.projection._replace(circle=np.pi)
        lost = np.isnan(lenses.directions(whole, *border)[:, 0]).any()
        if lost and 2.0 * seen < min(360.0, lens.image_circle_deg or 360.0):
            raise ValueError(
                f"lens.coefficients: the distortion is not monotonic within the image: it can be inverted up to "
                f"{seen:.2f} deg from the axis; a smaller lens.image_circle_deg would cut the image there"
            )
        return self

    @model_validator(mode="after")
    def _rectified(self) -> Self:
        left_from_right = frames.inverse(self.left.base_from_sensor) @ self.right.base_from_sensor
        x, y, z = left_from_right[:3, 3]
        # CameraInfo describes only a baseline along the image rows; y points left in the paper's frames.
        if not np.allclose(left_from_right[:3, :3], np.eye(3), atol=1e-9) or abs(x) > 1e-9 or abs(z) > 1e-9 or y >= 0:
            raise ValueError(
                "left and right must have the same orientation, with right beside left along the image rows"
            )
        return self

    @property
    def baseline(self) -> float:
        """Distance between the cameras [m]."""
        return float(np.linalg.norm(np.subtract(self.left.xyz, self.right.xyz)))

    @property
    def projection(self) -> lenses.Lens:
        """The lens. Fields of view end at the outer borders of the outermost pixels."""
        lens = self.lens
        fx, fy = (
            float(side / 2.0 / lenses.image_height(lens.model, lens.coefficients, np.radians(angle) / 2.0))
            for side, angle in ((self.width, self.horizontal_fov_deg), (self.height, self.vertical_fov_deg))
        )
        if lens.fx is not None:
            fx, fy = lens.fx, lens.fx if lens.fy is None else lens.fy
        return lenses.Lens(
            model=lens.model,
            fx=fx,
            fy=fy,
            cx=self.width / 2.0 - 0.5 if lens.cx is None else lens.cx,
            cy=self.height / 2.0 - 0.5 if lens.cy is None else lens.cy,
            coefficients=lens.coefficients,
            circle=np.pi if lens.image_circle_deg is None else float(np.radians(lens.image_circle_deg / 2.0)),
        )
