# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of a camera and of a stereo pair, and figures of a real one: lens, exposure, shutter, sensor, colours.

See docs/camera_signal.md for the laws.
"""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from fieldtruth.core import transforms
from fieldtruth.core.lenses import FLAT
from fieldtruth.experiment.fields import Boolean, Integer, Mount, Number, Positive, Rate, part
from fieldtruth.experiment.imaging_config import OPTICAL, Imager, ImagingConfig, LensConfig
from fieldtruth.experiment.sensor_config import FrameName, Section, SensorName, SignalConfig, TopicName

CAMERA_FROM_OPTICAL = transforms.pose((0.0, 0.0, 0.0), (0.0, 0.0, -90.0))
"""The paper's camera frames (x down, y left, z forward) from REP-103 optical frames (x right, y down, z forward)."""
Mosaic = Literal["none", "mono", "rggb", "grbg", "gbrg", "bggr"]
Response = Literal["filmic", "srgb", "linear"]
ColourMatrix = tuple[Number, Number, Number, Number, Number, Number, Number, Number, Number]
IDENTITY: Final = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
Channels = tuple[Positive, Positive, Positive]
_Share = Annotated[Number, Field(ge=0, lt=1)]
_Decibels = Annotated[Number, Field(ge=0, le=60)]
_Milliseconds = Annotated[Number, Field(ge=0, le=1000)]
_Pixels = Annotated[Number, Field(ge=-10, le=10)]
_Blur = Annotated[Number, Field(ge=0, le=10)]
_Seconds = Annotated[Number, Field(ge=0, le=60)]
_Stops = Annotated[Number, Field(ge=-10, le=10)]
_WHITE: Final = 1e-3  # by which the sum of a row of a colour matrix may differ from 1
_IN_ELECTRONS: Final = ("photon_noise", "read_noise_e", "dsnu_e")


class CameraSignal(SignalConfig):
    """Effects of a real camera on the ideal photograph, in the order in which light passes it.

    Labels, instances and depth remain those of the pose at the stamp. Values without a unit are shares.
    """

    # Lens
    vignetting_power: Annotated[Number, Field(ge=0, le=8)] = 0.0
    """n of the illumination cos(theta)^n at an angle theta from the axis; 4 of a thin lens without vignetting of its
    own (the cos^4 law)."""
    vignetting_polynomial: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    """a, b, c of the factor 1 + a r^2 + b r^4 + c r^6, r = 1 at the corner (Goldman, PAMI 32, 2010)."""
    glare: _Share = 0.0
    """Share of the image's mean light that lens and housing spread evenly over it (veiling glare, ISO 9358)."""
    bloom: _Share = 0.0
    """Share of the light that lens and housing scatter around its image: half of it with the standard deviation
    ``bloom_px``, half with four times that, as its tail."""
    bloom_px: Annotated[Number, Field(ge=4, le=400)] = 40.0
    chromatic_px: tuple[_Pixels, _Pixels] = (0.0, 0.0)
    """Lateral chromatic aberration: how much farther out than green the image's corners are in red and in blue."""
    fringe_px: tuple[_Blur, _Blur] = (0.0, 0.0)
    """Axial chromatic aberration: standard deviations [pixel] of further blur of red and of blue, which are in focus at
    other distances than green: purple fringes at edges before the sky."""
    lens_drops: Annotated[Integer, Field(ge=0, le=500)] = 0
    """Drops of water on the glass before the lens; each slides slowly, and is replaced after a while."""
    lens_dust: Annotated[Integer, Field(ge=0, le=500)] = 0
    """Specks of dust there: soft dark spots, the same in all photographs of a view."""
    lens_blur_px: _Blur = 0.0  # standard deviation of the point spread [pixel]

    # Exposure
    exposure: Literal["fixed", "automatic"] = "fixed"
    exposure_ev: _Stops = 0.0
    """Stops above the ideal exposure of the world (fixed), or above what metering asks for (automatic)."""
    exposure_time_ms: _Milliseconds = 0.0
    """Time of the ideal exposure of an open meadow, with the gain ``gain_db``; 0: without duration."""
    max_exposure_time_ms: Positive = 1000.0
    """Longer times become gain instead."""
    gain_db: _Decibels = 0.0
    max_gain_db: _Decibels = 60.0
    metering_target: Annotated[Number, Field(gt=0, lt=1)] = 0.45
    """Mean luminance of the metering images after the response curve, 1 is white."""
    metering_time_s: _Seconds = 0.0
    """Time constant with which automatic exposure follows the light."""
    metering_delay_s: _Seconds = 0.0

    # Shutter
    readout_ms: _Milliseconds = 0.0
    """Time between the first and one past the last row of a rolling shutter; 0: a global one."""
    blur_samples: Annotated[Integer, Field(ge=1, le=256)] = 8
    """Most sub-frames that are averaged over the exposure time, one for each pixel of motion."""

    # Sensor, in the terms of EMVA Standard 1288, release 4.0
    mosaic: Mosaic = "none"
    """Order of the colour filters in the upper left 2 x 2 pixels; mono: no filters and a grey photograph; none: three
    values in each pixel."""
    responsivity: Channels = (1.0, 1.0, 1.0)
    """Signal of red, green and blue in daylight: gains of ``1 / responsivity`` make it white, and amplify noise."""
    photon_noise: Boolean = False
    full_well_e: Positive | None = None  # saturation capacity [electrons] at 0 dB
    read_noise_e: Annotated[Number, Field(ge=0)] = 0.0  # temporal dark noise [electrons]
    prnu: _Share = 0.0
    """Photo-response nonuniformity: standard deviation of the pixels' sensitivities, fixed for a camera."""
    dsnu_e: Annotated[Number, Field(ge=0)] = 0.0
    """Dark signal nonuniformity [electrons], fixed for a camera."""
    bits: Annotated[Integer, Field(ge=4, le=16)] | None = None  # of the raw values; None: not quantised
    black_level: Annotated[Integer, Field(ge=0, le=8192)] = 0  # raw value without light

    # Colours
    white_balance_k: Annotated[Number, Field(ge=4000, le=25_000)] | None = None
    """Colour temperature [K] of the daylight that the camera makes white; the scene's is 6504. None: the scene's."""
    white_balance_gains: Channels = (1.0, 1.0, 1.0)
    gray_world: Annotated[Number, Field(ge=0, le=1)] = 0.0
    """Strength of automatic white balance that takes the mean of the metering images for grey (Buchsbaum 1980)."""
    colour_matrix: ColourMatrix = IDENTITY
    """From white balanced to linear sRGB, row by row; each row has the sum 1, so that grey stays grey. Where it is not
    that of the sensor, colours are off."""
    response: Response = "filmic"
    """From light to photograph: the ideal camera's filmic curve, sRGB's (IEC 61966-2-1), or none."""

    contrast: Annotated[Number, Field(ge=0, le=0.5)] = 0.0
    """By how much the response curve is steeper at medium grey; it is flatter at black and white instead."""

    # Image processor and file
    sharpening: Annotated[Number, Field(ge=0, le=5)] = 0.0
    """Amount of an unsharp mask: this times what the luminance of the photograph differs from its blurred copy."""
    sharpening_px: Annotated[Number, Field(gt=0, le=10)] = 1.0
    """Standard deviation of the blur of that mask."""
    jpeg_quality: Annotated[Integer, Field(ge=1, le=100)] | None = None
    """None: the camera's."""
    jpeg_chroma: Literal["444", "422", "420"] = "444"
    """Subsampling of colour in the file: 420 has a quarter of the pixels' colours, 444 all."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        needs = [key for key in _IN_ELECTRONS if getattr(self, key)]
        if self.full_well_e is None and needs:
            raise ValueError(f"full_well_e is required with {', '.join(needs)}")
        if self.bits is None and self.black_level:
            raise ValueError("bits is required with black_level")
        if self.bits is not None and self.black_level >= 2**self.bits // 2:
            raise ValueError(
                f"black_level must be below half of the range of bits: {self.bits}, got {self.black_level}"
            )
        if any(abs(sum(self.colour_matrix[row : row + 3]) - 1.0) > _WHITE for row in (0, 3, 6)):
            raise ValueError(f"colour_matrix must have rows with the sum 1, got {list(self.colour_matrix)}")
        if self.max_gain_db < self.gain_db:
            raise ValueError(f"max_gain_db must be at least gain_db, {self.gain_db:g}, got {self.max_gain_db:g}")
        return self

    def problem_with(self, lens: str) -> str | None:
        """Return why the signal cannot be had through a lens of a model."""
        if self.vignetting_power and lens not in FLAT:
            return f"signal.vignetting_power must be 0 with the lens {lens}: vignetting_polynomial describes it"
        return None

    @property
    def is_ideal(self) -> bool:
        """Return whether photographs are those of an ideal camera."""
        return self == CameraSignal()

    @property
    def early_s(self) -> float:
        """Greatest time [s] before the stamp from which a photograph depends on the motion."""
        return self.late_s + self.metering_delay_s + 10.0 * self.metering_time_s

    @property
    def late_s(self) -> float:
        """Greatest time [s] after the stamp at which a photograph still sees light."""
        time_ms = self.max_exposure_time_ms if self.exposure_time_ms else 0.0
        return (self.readout_ms + time_ms) / 2000.0


class CameraConfig(ImagingConfig):
    """A camera, which looks along the x axis of its frame: x forward, y left, z up (REP-103)."""

    noun: ClassVar[str] = "camera"
    bag_order: ClassVar[float] = 5
    frame_order: ClassVar[float] = 3
    needs_mount: ClassVar[bool] = True
    switch: ClassVar[str] = "cameras"

    datasheet: ClassVar[str] = "zed_2"

    kind: Literal["camera"] = "camera"
    name: SensorName = "camera"
    topic: TopicName = "/camera"
    frame: FrameName = "camera_link"
    mount: Mount = Mount(xyz=(0.0, 0.0, 0.0))
    rate_hz: Rate = 25.0
    signal: CameraSignal | None = None

    @model_validator(mode="after")
    def _possible_signal(self) -> Self:
        if problem := self.signal and self.signal.problem_with(self.lens.model):
            raise ValueError(problem)
        return self

    def imagers(self) -> "tuple[Imager, ...]":
        """Its views: one of a camera, two of a pair."""
        return (Imager(self.name, self, self.frame, self.mount, OPTICAL, self.topic),)

    def summary(self) -> str:
        """Return size, fields of view, encoding and lens."""
        angles = self.horizontal_fov_deg, self.vertical_fov_deg
        if self.lens.fx is not None:
            angles = self.fields_of_view
        whose = "Its" if len(self.imagers()) == 1 else "Their"
        lens = "" if self.lens == LensConfig() else f" {whose} lens is `{self.lens.model}`; CameraInfo describes it."
        return (
            f"{self.width} x {self.height}, {angles[0]:g} x {angles[1]:g} deg{self.beside}. "
            f"Photographs are JPEG (quality {self.jpeg_quality}); tag, depth and instance images are lossless.{lens}"
        )

    @property
    def beside(self) -> str:
        """Phrase about what it has beside one view; empty of a single camera."""
        return ""

    @property
    def late_s(self) -> float:
        """Until the last row is exposed, if it has a signal."""
        return 0.0 if self.signal is None else self.signal.late_s

    @property
    def early_s(self) -> float:
        """From the oldest metering image, if it has a signal."""
        return 0.0 if self.signal is None else self.signal.early_s


SIDES: Final[tuple[Literal["left", "right"], ...]] = ("left", "right")


class StereoConfig(CameraConfig):
    """Two identical cameras side by side; by default the paper's ZED 2.

    Instead of mount and baseline, ``left`` and ``right`` can give the poses of the cameras, whose frames then are the
    paper's: x down, y left, z forward.
    """

    also: ClassVar = ("left", "right")
    family: ClassVar[str] = "camera"
    noun: ClassVar[str] = "stereo camera"
    needs_mount: ClassVar[bool] = False
    sections: ClassVar[Mapping[str, Section]] = {"cameras": Section()}

    kind: Literal["stereo"] = "stereo"  # type: ignore[assignment]
    name: SensorName = "stereo"
    topic: TopicName = "/stereo/camera"
    mount: Mount = Mount(xyz=(0.15, 0.0, 0.72), rpy_deg=(0.0, 90.0, 0.0))
    """Pose of the point midway between the cameras."""
    frame: Annotated[
        str,
        Field(
            pattern=r"^([A-Za-z][A-Za-z0-9_]{0,50})?\{side\}[A-Za-z0-9_]{0,50}$",
            description="the name of a frame with {side}",
        ),
    ] = "{side}_camera"
    """Of both cameras; ``{side}`` stands for left and right."""
    forward: Annotated[Literal["x", "z"], Field(description="x or z")] = "z"
    """Axis of the cameras' frames along which they look; y is to the left. A pair with a name of its own has x."""
    baseline: Positive = 0.12  # [m]

    @model_validator(mode="before")
    @classmethod
    def _of_sides(cls, given: Any) -> Any:
        """Take mount and baseline from ``left`` and ``right``, if these are given."""
        if not isinstance(given, Mapping) or not {"left", "right"} & given.keys():
            return given
        own = cls.model_validate({key: given[key] for key in ("mount", "baseline") if key in given})
        left, right = (part(Mount, given.get(side, getattr(own, side)), side) for side in SIDES)
        return {key: value for key, value in given.items() if key not in SIDES} | _between(left, right)

    @classmethod
    def of_name(cls, name: str) -> dict[str, Any]:
        """Topic and frames that a pair has by its name."""
        return {"topic": f"/{name}", "frame": f"{name}_{{side}}_link", "forward": "x"}

    @property
    def left(self) -> Mount:
        """Mount of the left camera."""
        return self._beside(0.5)

    @property
    def right(self) -> Mount:
        """Mount of the right camera."""
        return self._beside(-0.5)

    @property
    def beside(self) -> str:
        """Phrase about the baseline."""
        return f", baseline {self.baseline:g} m"

    def figures(self) -> str:
        """Return size, fields of view, lens and baseline."""
        return f"{super().figures()}{self.beside}"

    def _beside(self, share: float) -> Mount:
        x, y, z = transforms.transform(self.mount.base_from_sensor, [(0.0, share * self.baseline, 0.0)])[0].tolist()
        return Mount(xyz=(x, y, z), rpy_deg=self.mount.rpy_deg)

    def imagers(self) -> tuple[Imager, ...]:
        """Left and right view: left and right of the paper's pair, NAME_left and NAME_right of others."""
        prefix = "" if self.name == type(self).model_fields["name"].default else f"{self.name}_"
        turn = CAMERA_FROM_OPTICAL if self.forward == "z" else OPTICAL
        return tuple(
            Imager(
                name=prefix + side,
                config=self,
                frame=self.frame.replace("{side}", side),
                mount=mount,
                frame_from_optical=turn,
                topic=f"{self.topic}/{side}",
                side=side,
                baseline=baseline,
            )
            for side, mount, baseline in zip(SIDES, (self.left, self.right), (0.0, self.baseline), strict=True)
        )


def _between(left: Mount, right: Mount) -> dict[str, Any]:
    left_from_right = transforms.inverse(left.base_from_sensor) @ right.base_from_sensor
    x, y, z = left_from_right[:3, 3]
    # CameraInfo describes only a baseline along the image rows; y points left.
    if not np.allclose(left_from_right[:3, :3], np.eye(3), atol=1e-9) or abs(x) > 1e-9 or abs(z) > 1e-9 or y >= 0:
        raise ValueError("left and right must have the same orientation, with right beside left along the image rows")
    baseline = float(np.linalg.norm(np.subtract(left.xyz, right.xyz)))
    x, y, z = ((a + b) / 2 for a, b in zip(left.xyz, right.xyz, strict=True))
    return {"mount": Mount(xyz=(x, y, z), rpy_deg=left.rpy_deg), "baseline": baseline, "forward": "z"}
