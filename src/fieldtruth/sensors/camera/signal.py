# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of a real camera: lens, exposure, shutter, sensor, colours. See docs/camera_signal.md for the laws."""

from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from fieldtruth.core.lenses import FLAT
from fieldtruth.experiment.fields import Boolean, Integer, Number, Positive
from fieldtruth.experiment.signal_config import SignalConfig

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
    """What a real camera adds to the ideal photograph, in the order in which light passes it.

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
        """Whether photographs are those of an ideal camera."""
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
