# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of the robot and its sensors; defaults from the paper's Tables 1, 2 and 5."""

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, Strict, model_validator

from fieldtruth.core import frames, lenses
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import UnknownNameError
from fieldtruth.experiment.camera_models import with_camera_model
from fieldtruth.experiment.lidar_models import with_lidar_model, with_rings

# Strict: strings and booleans are not numbers.
Number = Annotated[float, Strict()]
Integer = Annotated[int, Strict()]
Boolean = Annotated[bool, Strict()]
Positive = Annotated[Number, Field(gt=0)]
Range = Annotated[Number, Field(gt=0, le=100_000)]  # [m]; single precision resolves 1 cm there
Rate = Annotated[Number, Field(ge=0.01, le=1000)]  # [Hz]; the physics runs at 1 kHz


MOST_RINGS: Final = 256
Elevation = Annotated[Number, Field(gt=-90, lt=90)]
Turn = Annotated[Number, Field(ge=-180, le=180)]
Delay = Annotated[Integer, Field(ge=0, le=100_000_000)]
TimeField = Literal["time", "timestamp"]
_PER_RING: Final = {"min_length": 1, "max_length": MOST_RINGS}

WHEELS: Final = ("front_left", "front_right", "rear_left", "rear_right")


class Frozen(BaseModel):
    """Base of all configuration: immutable, finite numbers only, unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Mount(Frozen):
    """Pose of a frame in base_link: ``xyz`` [m]; ``rpy_deg`` roll, pitch, yaw about fixed axes [deg]."""

    xyz: tuple[Number, Number, Number]
    rpy_deg: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)

    @property
    def base_from_sensor(self) -> Array:
        """(4, 4) transform from the mounted frame to base_link."""
        return frames.pose(self.xyz, self.rpy_deg)


class TachometerConfig(Frozen):
    """Tachometers of the four wheels."""

    enabled: Boolean = True
    rate_hz: Rate = 10.0


class OdometryConfig(Frozen):
    """Wheel odometry and joint states, which the robot's driver computes from the angles of its wheels."""

    rate_hz: Rate = 50.0  # husky_control, control.yaml


class ImuConfig(Frozen):
    """Inertial measurement unit in imu_link."""

    rate_hz: Rate = 50.0
    sampling: Annotated[Literal["mean", "instant"], Field(description="mean or instant")] = "mean"
    """mean: over the interval between two readings, so that integrating gives the motion; instant: over the physics
    step that ends at the stamp, as in Gazebo."""
    mount: Mount = Mount(xyz=(0.19, 0.0, 0.149), rpy_deg=(0.0, -90.0, 180.0))


class GnssConfig(Frozen):
    """GNSS receiver; the mount is that of the antenna, GNSS_link."""

    rate_hz: Rate = 2.0
    mount: Mount = Mount(xyz=(0.10, 0.0, 0.890))


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


class LidarConfig(Frozen):
    """Rotating multi-beam LiDAR in os1_lidar; by default the paper's Ouster OS1-64."""

    enabled: Boolean = True
    model: Annotated[str, Field(description="a name from `fieldtruth list sensors`")] | None = None
    """Gives every value below that is not set, from the model's data file. None: the defaults."""
    rate_hz: Rate = 10.0
    columns: Annotated[Integer, Field(ge=8, le=4096)] = 512
    rings: Annotated[Integer, Field(ge=1, le=MOST_RINGS)] = 64
    vertical_fov_deg: Annotated[Number, Field(gt=0, lt=180)] = 45.0
    elevations_deg: (
        Annotated[
            tuple[Elevation, ...], Field(description="a list of angles between -90 and 90, one per ring", **_PER_RING)
        ]
        | None
    ) = None
    """Above the horizon, by number of the ring. None: rings are even over the field of view, ring 0 the highest."""
    azimuth_offsets_deg: (
        Annotated[
            tuple[Turn, ...], Field(description="a list of angles between -180 and 180, one per ring", **_PER_RING)
        ]
        | None
    ) = None
    """Azimuth of each ring from that of its column, clockwise seen from above. None: zero."""
    firing_offsets_ns: (
        Annotated[
            tuple[Delay, ...],
            Field(description="a list of integers from 0 to 100000000, one per ring", **_PER_RING),
        ]
        | None
    ) = None
    """Time at which each ring fires, after the first of its column; the head turns meanwhile. None: zero."""
    min_range: Annotated[Number, Field(ge=0)] = 0.3  # [m]; data sheet of the OS1
    max_range: Range = 120.0  # [m]; data sheet of the OS1
    spinning: Boolean = False
    """False: all rays are cast at the stamp, as in the paper (Gazebo). True: columns are swept over one period."""
    time_field: Annotated[TimeField, Field(description="time or timestamp")] | None = None
    """Of points of a spinning LiDAR, beside ``t`` [ns]: time [s] after the stamp, or timestamp [s], the sum of both."""
    mount: Mount = Mount(xyz=(0.09, 0.0, 0.826))

    @model_validator(mode="before")
    @classmethod
    def _completed(cls, given: Any) -> Any:
        """Take what is not given from the model and from the list of elevations."""
        if not isinstance(given, Mapping):
            return given
        try:
            return with_rings(with_lidar_model(given) if isinstance(given.get("model"), str) else given)
        except UnknownNameError as error:
            raise ValueError(str(error)) from error

    @model_validator(mode="after")
    def _valid_range(self) -> Self:
        if self.min_range >= self.max_range:
            raise ValueError(f"min_range must be below max_range {self.max_range!r}, got {self.min_range!r}")
        return self

    @model_validator(mode="after")
    def _valid_beams(self) -> Self:
        angles = self.elevations_deg
        if angles is not None and len(angles) != self.rings:
            raise ValueError(f"rings must be {len(angles)}, the number of elevations_deg, got {self.rings}")
        span = round(max(angles) - min(angles), 9) if angles else 0.0
        if angles is not None and len(angles) > 1 and span == 0:
            raise ValueError(f"elevations_deg must differ, got {len(angles)} times {angles[0]!r}")
        if span > 0 and abs(span - self.vertical_fov_deg) > 1e-6:
            raise ValueError(f"vertical_fov_deg must be {span!r}, as of elevations_deg, got {self.vertical_fov_deg!r}")
        for name in ("azimuth_offsets_deg", "firing_offsets_ns"):
            values = getattr(self, name)
            if values is not None and len(values) != self.rings:
                raise ValueError(f"{name} must have a value for each of {self.rings} rings, got {len(values)}")
        column_ns = 1e9 / self.rate_hz / self.columns
        if self.firing_offsets_ns is not None and max(self.firing_offsets_ns) >= column_ns:
            raise ValueError(
                f"firing_offsets_ns must be below the time of a column, {column_ns:.0f} ns at {self.rate_hz:g} Hz and "
                f"{self.columns} columns, got {max(self.firing_offsets_ns)}"
            )
        return self


class WheelConfig(Frozen):
    """Positions and size of the wheels (paper, Table 2)."""

    half_wheelbase: Positive = 0.256  # [m]
    half_track: Positive = 0.2854  # [m]
    axle_height: Number = 0.03282  # [m] above base_link
    radius: Positive = 0.1651  # [m] = 0.03282 + 0.13228


class Rig(Frozen):
    """The Husky with its sensors."""

    wheels: WheelConfig = WheelConfig()
    base_footprint: Mount = Mount(xyz=(0.0, 0.0, -0.13228))
    tachometers: TachometerConfig = TachometerConfig()
    odometry: OdometryConfig = OdometryConfig()
    imu: ImuConfig = ImuConfig()
    gnss: GnssConfig = GnssConfig()
    cameras: CameraConfig = CameraConfig()
    lidar: LidarConfig = LidarConfig()

    def mounts(self) -> dict[str, Mount]:
        """Every frame of the paper's Table 2 by name, relative to base_link, in the table's order."""
        w = self.wheels
        x, y, z = w.half_wheelbase, w.half_track, w.axle_height
        return {
            "GNSS_link": self.gnss.mount,
            "os1_lidar": self.lidar.mount,
            "right_camera": self.cameras.right,
            "left_camera": self.cameras.left,
            "imu_link": self.imu.mount,
            "front_right_wheel": Mount(xyz=(x, -y, z)),
            "rear_right_wheel": Mount(xyz=(-x, -y, z)),
            "front_left_wheel": Mount(xyz=(x, y, z)),
            "rear_left_wheel": Mount(xyz=(-x, y, z)),
            "base_footprint": self.base_footprint,
        }


CAMERA_FROM_OPTICAL = frames.pose((0.0, 0.0, 0.0), (0.0, 0.0, -90.0))
"""The paper's camera frames (x down, y left, z forward) from REP-103 optical frames (x right, y down, z forward)."""

OPTICAL = frames.pose((0.0, 0.0, 0.0), (-90.0, 0.0, -90.0))
"""A body frame (x forward, y left, z up) from the optical frame of a camera that looks along the body's x."""
