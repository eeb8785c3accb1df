# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of sensors whose readings are images: cameras, and kinds of other packages; their lens and views."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from fieldtruth.core import lenses, transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Image, Reading
from fieldtruth.experiment.fields import Boolean, Frozen, Integer, Mount, Number, Positive, Range
from fieldtruth.experiment.image_topics import EXTRAS, IMAGES, STREAMS, image_topic
from fieldtruth.experiment.sensor_config import MountedConfig, Output

OPTICAL = transforms.pose((0.0, 0.0, 0.0), (-90.0, 0.0, -90.0))
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


class ImagingConfig(MountedConfig):
    """A sensor that takes images through a lens, of one view or several."""

    gives: ClassVar[type[Reading]] = Image
    extras: ClassVar[tuple[str, ...]] = EXTRAS

    width: Annotated[Integer, Field(ge=2, le=8192)] = 1280  # [pixel]
    height: Annotated[Integer, Field(ge=2, le=8192)] = 720  # [pixel]
    horizontal_fov_deg: Annotated[Number, Field(gt=1, le=360)] = 69.0
    vertical_fov_deg: Annotated[Number, Field(gt=1, le=360)] = 42.0
    lens: LensConfig = LensConfig()
    far: Range = 2000.0  # [m]; beyond it is sky
    jpeg_quality: Annotated[Integer, Field(ge=1, le=100)] = 92
    depth: Boolean = False
    instances: Boolean = False
    normals: Boolean = False
    flow: Boolean = False
    parts: Boolean = False
    passability: Boolean = False

    @classmethod
    def completed(cls, given: dict[str, Any], figures: Mapping[str, Any]) -> dict[str, Any]:
        """Add the figures of the model, and to a panorama without fields of view those of the whole sphere."""
        values = super().completed(given, figures)
        lens = values.get("lens")
        model = lens.get("model") if isinstance(lens, Mapping) else getattr(lens, "model", None)
        whole = {"horizontal_fov_deg": 360.0, "vertical_fov_deg": 180.0} if model == "equirectangular" else {}
        return whole | values

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

    def imagers(self) -> "tuple[Imager, ...]":
        """Return its views: one, or two of a pair."""
        raise NotImplementedError

    def measured(self, message: Any, points: Any) -> dict[str, Any]:
        """Return the size of its images by a CameraInfo."""
        return {"width": int(message.width), "height": int(message.height)} if message.width > 0 else {}

    def figures(self) -> str:
        """Return size, fields of view and lens."""
        across, down = self.fields_of_view
        view = f"{across:.4g} x {down:.4g} deg, " if np.isfinite([across, down]).all() else ""
        return f"{self.width} x {self.height} pixels, {view}{self.lens.model}"

    def outputs(self) -> tuple[Output, ...]:
        """Calibration and images of each view."""
        return tuple(
            self.output(
                *(self.new_topic(topic, STREAMS[stream][1]) for stream, topic in imager.topics.items()),
                part=imager.side,
                frame=imager.optical_frame,
            )._replace(
                reading=Image,
                fields={
                    part: self.new_topic(imager.topic_of(stream), STREAMS[stream][1]) for part, stream in IMAGES.items()
                },
                label=imager.name,
                info=imager.topic_of("camera_info"),
            )
            for imager in self.imagers()
        )

    def frames(self) -> dict[str, Mount]:
        """Frames of the views, right before left as in the paper's Table 2."""
        return {imager.frame: imager.mount for imager in reversed(self.imagers())}

    def optical_frames(self) -> dict[str, tuple[str, Array]]:
        """Frames of the images: parent and (4, 4) ``parent_from_optical`` by name."""
        return {each.optical_frame: (each.frame, each.frame_from_optical) for each in self.imagers()}

    @property
    def fields_of_view(self) -> tuple[float, float]:
        """Horizontal and vertical angle [deg] of the image; NaN where the lens does not reach its border."""
        return lenses.fields_of_view(self.projection, self.width, self.height)

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

    @property
    def unfit_for_frames(self) -> tuple[str, str] | None:
        """``flow``."""
        return ("flow", "no frame follows another") if self.flow else None

    @property
    def needs_next(self) -> bool:
        """True if it has optical flow."""
        return self.flow


class Imager(NamedTuple):
    """One view of a camera: that of a single camera, or the left or right one of a pair."""

    name: str
    """Unique in a rig: of the paper's pair left and right."""
    config: ImagingConfig
    frame: str
    mount: Mount
    frame_from_optical: Array
    """(4, 4) of the REP-103 optical frame in ``frame``."""
    topic: str
    side: Literal["", "left", "right"] = ""
    """Of a pair."""
    baseline: float = 0.0
    """Distance [m] from the left camera of the pair; 0 but for the right one."""

    @property
    def optical_frame(self) -> str:
        """Frame of the images (REP-103: x right, y down, z forward)."""
        return f"{self.frame}_optical"

    @property
    def base_from_optical(self) -> Array:
        """(4, 4)."""
        return self.mount.base_from_sensor @ self.frame_from_optical

    @property
    def base_from_view(self) -> Array:
        """(4, 4) of the view's body frame (REP-103: x ahead, y left, z up), along whichever axis the mount looks."""
        return self.base_from_optical @ transforms.inverse(OPTICAL)

    @property
    def topics(self) -> dict[str, str]:
        """Topic by stream, in the order of the messages."""
        wanted = (key for key in STREAMS if key not in EXTRAS or getattr(self.config, key))
        return {key: self.topic_of(key) for key in wanted}

    def topic_of(self, stream: str) -> str:
        """Topic of a stream, one of ``STREAMS``, whether or not it is published."""
        return image_topic(self.topic, stream)
