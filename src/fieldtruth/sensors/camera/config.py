# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of a camera."""

from typing import ClassVar, Literal, Self

from pydantic import model_validator

from fieldtruth.experiment.fields import Mount, Rate
from fieldtruth.experiment.sensor_config import FrameName, SensorName, TopicName
from fieldtruth.experiment.sensor_families import OPTICAL, Imager, ImagingConfig, LensConfig
from fieldtruth.sensors.camera.signal import CameraSignal


class CameraConfig(ImagingConfig):
    """A camera, which looks along the x axis of its frame: x forward, y left, z up (REP-103)."""

    noun: ClassVar[str] = "camera"
    models_of: ClassVar[str] = "camera"
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
