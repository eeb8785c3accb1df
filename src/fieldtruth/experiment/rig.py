# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of the robot and its sensors; defaults from the paper's Tables 1, 2 and 5."""

from typing import Annotated, Final, Literal

from pydantic import Field

from fieldtruth.experiment.camera_config import CameraConfig
from fieldtruth.experiment.fields import Boolean, Frozen, Mount, Number, Positive, Rate
from fieldtruth.experiment.lidar_config import LidarConfig

WHEELS: Final = ("front_left", "front_right", "rear_left", "rear_right")


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
