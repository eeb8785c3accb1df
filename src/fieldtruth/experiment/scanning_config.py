# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of sensors whose readings are clouds of points: LiDARs, and kinds of other packages."""

from typing import Annotated, Any, ClassVar, Final

import numpy as np
from pydantic import Field

from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Cloud, Reading
from fieldtruth.experiment.fields import Boolean, Integer, Number, Range
from fieldtruth.experiment.sensor_config import MountedConfig

MOST_RINGS: Final = 256


Elevation = Annotated[Number, Field(gt=-90, lt=90)]


Turn = Annotated[Number, Field(ge=-180, le=180)]


Delay = Annotated[Integer, Field(ge=0, le=100_000_000)]


_EVEN: Final = 1e-6  # [deg] of which the steps between beams may differ


_PER_RING: Final = {"min_length": 1, "max_length": MOST_RINGS}


class ScanningConfig(MountedConfig):
    """A sensor that measures ranges along rays, in ``rings`` and ``columns``, from the origin of its frame.

    The frame is x forward, y left, z up.
    """

    gives: ClassVar[type[Reading]] = Cloud

    columns: Annotated[Integer, Field(ge=8, le=8192)] = 512
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

    @property
    def ring_elevations(self) -> Array:
        """Angles (rings,) [rad] of the beams above the horizon.

        Without ``elevations_deg`` ring 0 is the highest beam, the last ring the lowest; they span the vertical field of
        view, both ends included (+22.5 and -22.5 deg).
        """
        if self.elevations_deg is not None:
            return np.radians(np.array(self.elevations_deg, np.float64))
        half = np.radians(self.vertical_fov_deg) / 2.0
        return np.linspace(half, -half, self.rings) if self.rings > 1 else np.zeros(1)

    def measured(self, message: Any, points: Any) -> dict[str, Any]:
        """Return rays and frame by a cloud."""
        values: dict[str, Any] = {"frame": str(message.header.frame_id)} if message.header.frame_id else {}
        if message.height > 1:
            values |= {"rings": int(message.height), "columns": int(message.width)}
        for key, field in (("rings", "ring"), ("columns", "column")):
            if len(points) and field in points.dtype.names:
                values[key] = int(points[field].max()) + 1
        return values

    def figures(self) -> str:
        """Return rays, elevations and range."""
        angles, many = np.degrees(self.ring_elevations), "s" * (self.rings != 1)
        beams = f"{self.rings} ring{many} x {self.columns} columns, {angles.min():.4g} to {angles.max():.4g} deg"
        return f"{beams}, {self.min_range:g} to {self.max_range:g} m{', spinning' * self.spinning}"

    @property
    def unfit_for_frames(self) -> tuple[str, str] | None:
        """``spinning``."""
        return ("spinning", "the robot stands still") if self.spinning else None

    @property
    def uneven(self) -> str:
        """Name of the key because of which the rays are no even grid of angles; empty if they are one."""
        steps = np.diff(self.elevations_deg or ())
        if steps.size and np.ptp(steps) > _EVEN:
            return "elevations_deg"
        return "azimuth_offsets_deg" if any(self.azimuth_offsets_deg or ()) else ""
