# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The GNSS receiver as a kind of sensor, and its message, NavSatFix.

Covariances of ideal readings are all zero. ROS reads zeros as "unknown", so a filter must be given its own.
"""

import struct
from collections.abc import Iterable
from typing import Any, Final

import numpy as np
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__NavSatFix as NavSatFix
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__NavSatStatus as NavSatStatus

from fieldtruth.bag import messages as ros
from fieldtruth.core.readings import Fix
from fieldtruth.drive.track import Track
from fieldtruth.experiment.sensor_config import Output
from fieldtruth.sensors.gnss.config import SERVICE, GnssConfig
from fieldtruth.sensors.gnss.sensing import GnssErrors, GnssFixes, GnssReadings, GnssTruth
from fieldtruth.sensors.kind import At, MotionSensor, Movement

FIX: Final = int(NavSatStatus.STATUS_FIX)


def navsat(k: Any, reading: Fix, service: int = SERVICE["gps"]) -> list[bytes]:
    """Serialise sensor_msgs/NavSatFix of the antenna: latitude and longitude [deg], ellipsoidal height [m]."""
    count, known = np.size(k), reading.covariance.any(axis=(-2, -1))
    return ros.serialized(
        count,
        *ros.header_fields(k, reading.header_ns, reading.frame),
        np.asarray(reading.status, np.int8),
        struct.pack("<H", service),
        reading.geodetic,
        reading.covariance,
        np.where(known, NavSatFix.COVARIANCE_TYPE_KNOWN, NavSatFix.COVARIANCE_TYPE_UNKNOWN).astype(np.uint8),
    )


class Gnss(MotionSensor):
    """A GNSS receiver."""

    config_type = GnssConfig
    config: GnssConfig

    def begin(self) -> tuple[GnssTruth, GnssErrors | None]:
        """Return the true positions and the errors of a real receiver, which go on as the motion grows."""
        config, seed, origin = self.config, self.sensor_world.seed, self.sensor_world.world.origin
        errors = None if config.signal is None else GnssErrors(config, config.signal, seed, origin)
        return GnssTruth(config, origin), errors

    def extend(self, memory: tuple[GnssTruth, GnssErrors | None], track: Track) -> tuple[GnssReadings, GnssReadings]:
        """Return the true positions of the antenna, and what the receiver measures of satellites above the scene."""
        truth, errors = memory
        true, signal = truth.extend(track.motion), self.config.signal
        scene = self.sensor_world.scene if signal is not None and signal.obstacles else None
        return true, true if errors is None else errors.extend(true, scene)

    def reading(self, output: Output, at: At, series: GnssReadings) -> Fix:
        """Return true or measured positions."""
        k, fixes = at.number, series.fixes
        stamps = {**at.stamps, "frame": self.config.frame}
        if fixes is None:
            covariance, status = np.zeros((*np.shape(k), 3, 3)), np.full(np.shape(k), FIX)[()]
            return Fix(**stamps, geodetic=series.geodetic[k], covariance=covariance, status=status)
        return Fix(**stamps, geodetic=fixes.geodetic[k], covariance=fixes.covariance[k], status=fixes.status[k])

    def facts(self, movement: Movement) -> list[str]:
        """State what the receiver has measured, unless it is ideal."""
        fixes = self.series(movement)[1].fixes
        return [] if fixes is None else [_line(self.config.name, fixes)]

    def messages(self, output: Output, number: Any, reading: Fix) -> Iterable[bytes]:
        """Serialise sensor_msgs/NavSatFix."""
        signal = None if output.ideal else self.config.signal
        return navsat(number, reading) if signal is None else navsat(number, reading, signal.service)


def _line(name: str, fixes: GnssFixes) -> str:
    if not len(fixes.status):
        return f"- GNSS receiver `{name}`: no reading was due."
    found, middle = fixes.status >= 0, int(np.median(fixes.satellites))
    line = f"- GNSS receiver `{name}`: {fixes.satellites.min()} to {fixes.satellites.max()} satellites, median {middle}"
    if not found.any():
        return f"{line}, and no fix."
    reach = np.sqrt(fixes.covariance[found, 0, 0] + fixes.covariance[found, 1, 1])
    shares = [f"{100.0 * share:.1f} % {what}" for share, what in (
        (1.0 - found.mean(), "without a fix"), (np.mean(fixes.state == 1), "RTK float"),
        (np.mean(fixes.state == 2), "RTK fixed"),
    ) if share > 0.0]  # fmt: skip
    dilution = f"median HDOP {np.median(fixes.dop[found, 1]):.2f} and horizontal standard deviation"
    return f"{line}; {dilution} {np.median(reach):.3g} m{''.join(f'; {each}' for each in shares)}."
