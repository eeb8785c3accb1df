# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of a stereo pair; by default the paper's ZED 2."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from pydantic import Field, model_validator

from fieldtruth.core import transforms
from fieldtruth.experiment.fields import Mount, Positive
from fieldtruth.experiment.sensor_config import Section, SensorName, TopicName, part
from fieldtruth.experiment.sensor_families import CAMERA_FROM_OPTICAL, OPTICAL, Imager
from fieldtruth.sensors.camera.config import CameraConfig

SIDES: Final[tuple[Literal["left", "right"], ...]] = ("left", "right")


class StereoConfig(CameraConfig):
    """Two identical cameras side by side; by default the paper's ZED 2.

    Instead of mount and baseline, ``left`` and ``right`` can give the poses of the cameras, whose frames then are the
    paper's: x down, y left, z forward.
    """

    also: ClassVar = ("left", "right")
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
