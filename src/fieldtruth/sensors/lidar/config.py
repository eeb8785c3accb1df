# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of the LiDAR; defaults from the paper's Tables 1, 2 and 5."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import Field, model_validator

from fieldtruth.experiment.fields import Boolean, Integer, Mount, Number, Range, Rate
from fieldtruth.experiment.sensor_config import FrameName, MountedConfig, Section, SensorName, TopicName
from fieldtruth.experiment.topic import Output
from fieldtruth.sensors.lidar.signal import LidarSignal

MOST_RINGS: Final = 256
Elevation = Annotated[Number, Field(gt=-90, lt=90)]
Turn = Annotated[Number, Field(ge=-180, le=180)]
Delay = Annotated[Integer, Field(ge=0, le=100_000_000)]
TimeField = Literal["time", "timestamp"]
PointFields = Literal["ouster", "livox"]
Intensity = Literal["class", "reflectivity"]
Pattern = Literal["avia", "mid_360"]
_PER_RING: Final = {"min_length": 1, "max_length": MOST_RINGS}


class LidarConfig(MountedConfig):
    """Rotating multi-beam LiDAR; by default the paper's Ouster OS1-64."""

    bag_order: ClassVar[float] = 4
    frame_order: ClassVar[float] = 2
    sections: ClassVar[Mapping[str, Section]] = {"lidar": Section()}
    switch: ClassVar[str] = "lidar"
    datasheet: ClassVar[str] = "os1_64_gen1"

    kind: Literal["lidar"] = "lidar"
    name: SensorName = "lidar"
    topic: TopicName = "/os1_cloud_node/points"
    frame: FrameName = "os1_lidar"
    mount: Mount = Mount(xyz=(0.09, 0.0, 0.826))
    rate_hz: Rate = 10.0
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
    time_field: Annotated[TimeField, Field(description="time or timestamp")] | None = None
    """Of points of a spinning LiDAR, beside ``t`` [ns]: time [s] after the stamp, or timestamp [s], the sum of both."""
    point_fields: Annotated[PointFields, Field(description="ouster or livox")] | None = None
    """Of the maker's driver, beside those of every cloud. ouster: reflectivity, ambient, range, and 8-bit ring; livox:
    tag, line and timestamp."""
    pattern: Annotated[Pattern, Field(description="avia or mid_360")] | None = None
    """Of a Livox, whose rays differ from scan to scan; elevations and offsets are not used. None: it turns evenly."""

    intensity: Annotated[Intensity, Field(description="class or reflectivity")] = "class"
    """Of points: the class id, as in the paper, or with a ``signal`` the reflectivity, 1 for a white surface."""
    organised: Boolean = False
    """True: clouds have a row for each ring and a point for each column, NaN for rays without a return."""
    signal: LidarSignal | None = None

    @classmethod
    def of_name(cls, name: str) -> dict[str, Any]:
        """Topic and frame that a LiDAR has by its name."""
        return {**super().of_name(name), "topic": f"/{name}/points"}

    def outputs(self) -> tuple[Output, ...]:
        """Its point clouds."""
        return (self.output(self.new_topic(self.topic, "sensor_msgs/msg/PointCloud2")),)

    @property
    def sweep_s(self) -> float:
        """One turn, if it spins."""
        return 1.0 / self.rate_hz if self.spinning else 0.0

    @classmethod
    def completed(cls, given: dict[str, Any], figures: Mapping[str, Any]) -> dict[str, Any]:
        """Add the figures of the model, and what follows from the time between firings and from the elevations."""
        values = super().completed(given, {"spinning": True, **figures} if figures else {})
        cycle_ns, rate = figures.get("firing_cycle_ns"), values.get("rate_hz")
        if cycle_ns is not None and values.get("columns") is None and isinstance(rate, int | float) and rate > 0:
            values["columns"] = round(1e9 / rate / cycle_ns)
        return _of_elevations(values.get("elevations_deg")) | values

    @model_validator(mode="after")
    def _valid_range(self) -> Self:
        if self.min_range >= self.max_range:
            raise ValueError(f"min_range must be below max_range {self.max_range!r}, got {self.min_range!r}")
        return self

    @model_validator(mode="after")
    def _valid_signal(self) -> Self:
        if self.intensity == "reflectivity" and self.signal is None:
            raise ValueError("intensity must be class without a signal, got reflectivity; set signal: datasheet")
        if self.organised and self.signal is not None and self.signal.returns == "two":
            raise ValueError("organised must be false with two returns: a cloud of columns has one point per ray")
        return self

    @model_validator(mode="after")
    def _valid_beams(self) -> Self:
        angles = self.elevations_deg
        for name in ("elevations_deg", "azimuth_offsets_deg", "firing_offsets_ns"):
            if self.pattern is not None and getattr(self, name) is not None:
                raise ValueError(f"{name} must be null with the pattern {self.pattern}")
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


def _of_elevations(angles: Any) -> dict[str, Any]:
    """Number of the elevations, and the angle that they span [deg]; nothing of what is no list of elevations."""
    if not isinstance(angles, list | tuple) or not all(_is_elevation(angle) for angle in angles):
        return {}  # the field reports it
    rings = {"rings": len(angles)} if angles else {}
    span = round(float(max(angles) - min(angles)), 9) if angles else 0.0
    return rings | ({"vertical_fov_deg": span} if len(set(angles)) > 1 else {})


def _is_elevation(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and -90 < value < 90
