# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of a LiDAR, by default the paper's (Tables 1, 2 and 5), and the figures of a real one."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from fieldtruth.core.readings import Cloud
from fieldtruth.experiment.fields import Boolean, Integer, Mount, Number, Positive, Range, Rate
from fieldtruth.experiment.scanning_config import ScanningConfig
from fieldtruth.experiment.sensor_config import FrameName, Output, Section, SensorName, SignalConfig, TopicName

MOST_SUB_RAYS: Final = 15
MOST_STEPS: Final = 8
Reflectance = Annotated[Number, Field(gt=0, le=2)]
Deviation = Annotated[Number, Field(ge=0, le=10)]
Returns = Literal["strongest", "last", "two"]
SubRays = Annotated[Integer, Field(ge=1, le=MOST_SUB_RAYS)]


class LidarSignal(SignalConfig):
    """Power, noise and beam of a LiDAR.

    The signal is counted in photons, whose number varies with its own square root (Poisson), and falls with the square
    of the range (``noise``). A pulse returns if at least ``signal_at_reach`` photons are counted.
    """

    reach: Annotated[
        tuple[tuple[Reflectance, Range], ...],
        Field(max_length=MOST_STEPS, description="a list of pairs [reflectance, range in metres]"),
    ] = ()
    """Range [m] at which half of the pulses return from a matt surface of a reflectance that faces the LiDAR.

    Of several pairs the mean in logarithm counts, as all of them follow from one figure. None: every pulse returns.
    """
    signal_at_reach: Positive = 12.0
    """Photons of a pulse from the end of the reach, and the least that are taken for a return."""
    range_noise: Annotated[
        tuple[tuple[Positive, Deviation], ...],
        Field(max_length=MOST_STEPS, description="a list of pairs [signal, standard deviation in metres]"),
    ] = ()
    """Standard deviation [m] of a range by signal [photon], rising signals; between them both logarithms are linear."""
    resolution: Annotated[Number, Field(ge=0, le=10)] = 0.0
    """Step [m] of the ranges that it reports. 0: none."""
    angle_noise_deg: Annotated[Number, Field(ge=0, le=5)] = 0.0
    """Standard deviation of the angles that it reports, across and along the ring."""
    divergence_deg: Annotated[Number, Field(ge=0, le=5)] = 0.0
    """Angle in which the beam has more than half of its greatest irradiance (FWHM); used with ``sub_rays``."""
    beam_diameter: Positive = 0.01
    """[m] where the beam leaves the LiDAR; matters to single drops and flakes in the air."""
    wavelength_nm: Annotated[Number, Field(ge=400, le=2000)] = 905.0
    """Matters to light fog, and to rain above 1400."""
    sub_rays: SubRays = 1
    """Rays that stand for the width of one beam: 1, or an odd number: one in the middle and a ring around it."""
    returns: Returns = "strongest"
    """Echoes that become points: the strongest, the last, or two: the strongest and the last of the others."""
    pulse_length: Annotated[Number, Field(ge=0, le=100)] = 0.0
    """Distance [m] within which echoes of a pulse merge into one."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.sub_rays % 2 == 0:
            raise ValueError(f"sub_rays must be an odd number, got {self.sub_rays}")
        for name in ("divergence_deg", "pulse_length"):
            if self.sub_rays > 1 and getattr(self, name) == 0.0:
                raise ValueError(f"{name} must be above 0 with {self.sub_rays} sub_rays, got 0")
        signals = [signal for signal, _ in self.range_noise]
        if sorted(set(signals)) != signals:
            raise ValueError(f"range_noise must have rising signals, got {', '.join(f'{s:g}' for s in signals)}")
        if any(deviation == 0.0 for _, deviation in self.range_noise):
            raise ValueError("range_noise must have deviations above 0; leave it out for exact ranges")
        return self


TimeField = Literal["time", "timestamp"]
PointFields = Literal["ouster", "livox"]
Intensity = Literal["class", "reflectivity"]
Pattern = Literal["avia", "mid_360"]


_XYZI: Final = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")]
_RING: Final = [("ring", "<u2")]
_MAKERS: Final = {
    "ouster": [("reflectivity", "<u2"), ("ring", "|u1"), ("ambient", "<u2"), ("range", "<u4")],
    "livox": [("tag", "|u1"), ("line", "|u1"), ("timestamp", "<f8"), *_RING],
}
"""Fields instead of ``ring`` by maker: of FAST-LIO2's ``ouster_ros::Point``, and of livox_ros_driver2's PointCloud2."""
MEASURED: Final = {"true_range": "<f4", "signal": "<f4", "reflectivity": "<f4", "echo": "<u2", "mixed": "<u2"}
"""Fields of a LiDAR with a signal; the reflectivity of an Ouster is its own, in percent."""
PASSING: Final = ("passability", "force")
"""Fields of a LiDAR with ``passability``."""
_CLOCKS: Final = {"time": "<f4", "timestamp": "<f8"}


class LidarConfig(ScanningConfig):
    """Rotating multi-beam LiDAR; by default the paper's Ouster OS1-64."""

    topic_of_name: ClassVar[str] = "/{}/points"
    noun: ClassVar[str] = "LiDAR"
    bag_order: ClassVar[float] = 4
    frame_order: ClassVar[float] = 2
    sections: ClassVar[Mapping[str, Section]] = {"lidar": Section()}
    switch: ClassVar[str] = "lidar"
    datasheet: ClassVar[str] = "os1_64_gen1"
    extras: ClassVar[tuple[str, ...]] = ("parts", "passability")

    kind: Literal["lidar"] = "lidar"
    name: SensorName = "lidar"
    topic: TopicName = "/os1_cloud_node/points"
    frame: FrameName = "os1_lidar"
    mount: Mount = Mount(xyz=(0.09, 0.0, 0.826))
    rate_hz: Rate = 10.0
    time_field: Annotated[TimeField, Field(description="time or timestamp")] | None = None
    """Of points of a spinning LiDAR, beside ``t`` [ns]: time [s] after the stamp, or timestamp [s], the sum of both."""
    point_fields: Annotated[PointFields, Field(description="ouster or livox")] | None = None
    """Of the maker's driver, beside those of every cloud. ouster: reflectivity, ambient, range, and 8-bit ring; livox:
    tag, line and timestamp."""
    pattern: Annotated[Pattern, Field(description="avia or mid_360")] | None = None
    """Of a Livox, whose rays differ from scan to scan; elevations and offsets are not used. None: it turns evenly."""

    intensity: Annotated[Intensity, Field(description="class or reflectivity")] = "class"
    """Of points: the class id, as in the paper, or with a ``signal`` the reflectivity, 1 for a white surface."""
    parts: Boolean = False
    """True: points have the field ``part``, a ``PlantPart``."""
    passability: Boolean = False
    """True: points have the fields ``passability``, 0 solid to 1 free, and ``force`` [N]."""
    organised: Boolean = False
    """True: clouds have a row for each ring and a point for each column, NaN for rays without a return."""
    signal: LidarSignal | None = None

    def outputs(self) -> tuple[Output, ...]:
        """Its point clouds."""
        return (self.output(self.new_topic(self.topic, "sensor_msgs/msg/PointCloud2"), reading=Cloud),)

    def point_type(self, *, wide_ids: bool = False) -> np.dtype[np.void]:
        """Type of a point of 24 bytes: x, y, z [m] in the LiDAR's frame; intensity = label, as in the paper; ray; ids.

        That of a LiDAR that spins has ``t`` [ns], the time of its ray after the stamp. Instantaneous scans have none:
        programs scale it to 0..1 and divide by its range, which is 0 (KISS-ICP aborts). ``wide_ids``: ``instance`` has
        32 bits. ``time_field`` follows ``t``: ``time`` [s] after the stamp, or ``timestamp`` [s], the sum.
        ``point_fields`` are those of the maker's driver; PCL reads a field only if name and type are those that a
        program declares. A LiDAR with a signal has more fields.
        """
        clock, maker = self.time_field, self.point_fields
        time = [("t", "<u4"), *([(clock, _CLOCKS[clock])] if clock else [])] if self.spinning else []
        ids = [("column", "<u2"), ("label", "<u2"), ("instance", "<u4" if wide_ids else "<u2")]
        own = _MAKERS[maker] if maker else _RING
        measured = [] if self.signal is None else [each for each in MEASURED.items() if each[0] not in dict(own)]
        part = [("part", "|u1")] * self.parts
        passing = [(name, "<f4") for name in PASSING] * self.passability
        return np.dtype([*_XYZI, *time, *own, *ids, *measured, *part, *passing], align=True)

    def cloud_fields(self) -> dict[str, str]:
        """Return NumPy's type of each field of its clouds."""
        return {name: kind.str for name, (kind, *_) in (self.point_type().fields or {}).items()}

    @property
    def needs_signal_for_weather(self) -> bool:
        """Return whether it is ideal."""
        return self.signal is None

    def summary(self) -> str:
        """Return rays, field of view, range and timing."""
        timing = "columns are measured in turn over one period" if self.spinning else "all rays leave at the stamp"
        elevations = self.elevations_deg
        beams = f" (elevations {min(elevations):g} to {max(elevations):g} deg)" if elevations else ""
        field = f"360 x {self.vertical_fov_deg:g} deg{beams}" if self.pattern is None else f"pattern {self.pattern}"
        return (
            f"{self.columns} x {self.rings} rays, {field}, {self.min_range:g} to {self.max_range:g} m; {timing}; "
            "only returns are stored."
        )

    @property
    def uneven(self) -> str:
        """Name of the key because of which the rays are no even grid of angles; empty if they are one."""
        return "pattern" if self.pattern is not None else super().uneven

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
        angles, of = self.elevations_deg, f" of the model {self.model}" * (self.model is not None)
        for name in ("elevations_deg", "azimuth_offsets_deg", "firing_offsets_ns"):
            if self.pattern is not None and getattr(self, name) is not None:
                raise ValueError(f"{name} must be null with the pattern {self.pattern}")
        if angles is not None and len(angles) != self.rings:
            raise ValueError(f"rings must be {len(angles)}, the number of elevations_deg{of}, got {self.rings}")
        span = round(max(angles) - min(angles), 9) if angles else 0.0
        if angles is not None and len(angles) > 1 and span == 0:
            raise ValueError(f"elevations_deg must differ, got {len(angles)} times {angles[0]!r}")
        if span > 0 and abs(span - self.vertical_fov_deg) > 1e-6:
            raise ValueError(f"vertical_fov_deg must be {span!r}, as of elevations_deg, got {self.vertical_fov_deg!r}")
        for name in ("azimuth_offsets_deg", "firing_offsets_ns"):
            values = getattr(self, name)
            if values is not None and len(values) != self.rings:
                raise ValueError(f"{name} must have a value for each of {self.rings} rings{of}, got {len(values)}")
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
