# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot and its sensors as numbers: frames (paper, Table 2), rates, resolutions and fields of view (Tables 1 and 5)."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from fieldtruth import frames

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Rate = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]  # [Hz]; the physics runs at 1 kHz


class Frozen(BaseModel):
    """Base of all configuration: immutable, and a key that it does not know is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Mount(Frozen):
    """Pose of a frame in base_link: ``xyz`` [m]; ``rpy_deg`` roll, pitch, yaw about fixed axes [deg]."""

    xyz: tuple[float, float, float]
    rpy_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def base_from_sensor(self) -> frames.Array:
        """(4, 4) transform from the mounted frame to base_link."""
        return frames.pose(self.xyz, self.rpy_deg)


class TachometerConfig(Frozen):
    """Tachometers of the four wheels."""

    rate_hz: Rate = 10.0


class ImuConfig(Frozen):
    """Inertial measurement unit in imu_link."""

    rate_hz: Rate = 50.0
    mount: Mount = Mount(xyz=(0.19, 0.0, 0.149), rpy_deg=(0.0, -90.0, 180.0))


class GnssConfig(Frozen):
    """GNSS receiver; the mount is the antenna's, GNSS_link."""

    rate_hz: Rate = 2.0
    mount: Mount = Mount(xyz=(0.10, 0.0, 0.890))


class CameraConfig(Frozen):
    """Stereo pair of equal pinhole cameras (ZED-2). The mounts are the paper's frames: z forward, x down, y left."""

    enabled: bool = True
    rate_hz: Rate = 25.0
    width: Annotated[int, Field(ge=8, le=8192, multiple_of=8)] = 1280  # [pixel]
    height: Annotated[int, Field(ge=8, le=8192, multiple_of=8)] = 720  # [pixel]
    horizontal_fov_deg: Annotated[float, Field(gt=1, lt=170)] = 69.0
    vertical_fov_deg: Annotated[float, Field(gt=1, lt=170)] = 42.0
    far: Positive = 2000.0  # [m]; farther is sky
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 90
    left: Mount = Mount(xyz=(0.15, 0.06, 0.720), rpy_deg=(0.0, 90.0, 0.0))
    right: Mount = Mount(xyz=(0.15, -0.06, 0.720), rpy_deg=(0.0, 90.0, 0.0))


class LidarConfig(Frozen):
    """Rotating multi-beam LiDAR (Ouster OS1-64) in os1_lidar."""

    enabled: bool = True
    rate_hz: Rate = 10.0
    columns: Annotated[int, Field(ge=8, le=4096)] = 512
    rings: Annotated[int, Field(ge=1, le=256)] = 64
    vertical_fov_deg: Annotated[float, Field(gt=0, lt=180)] = 45.0
    min_range: Annotated[float, Field(ge=0)] = 0.3  # [m]; data sheet of the OS1
    max_range: Positive = 120.0  # [m]; data sheet of the OS1
    spinning: bool = False
    """False: all rays leave at the stamp, as in the paper (Gazebo). True: columns are swept over one period."""
    mount: Mount = Mount(xyz=(0.09, 0.0, 0.826))


class WheelConfig(Frozen):
    """Places and size of the wheels (paper, Table 2)."""

    half_wheelbase: Positive = 0.256  # [m]
    half_track: Positive = 0.2854  # [m]
    axle_height: float = 0.03282  # [m] above base_link
    radius: Positive = 0.1651  # [m] = 0.03282 + 0.13228


class Rig(Frozen):
    """The Husky and everything it carries."""

    wheels: WheelConfig = WheelConfig()
    base_footprint: Mount = Mount(xyz=(0.0, 0.0, -0.13228))
    tachometers: TachometerConfig = TachometerConfig()
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
