# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The IMUs of a rig as Kalibr's imu.yaml (its wiki, "yaml formats"), for Kalibr and SLAM that reads its files.

Kalibr refuses a noise of zero (``ConfigReader.py``, ``checkGyroStatistics``), and knows no bias instability and no
axes. So of three densities the largest is written, and where there is no random walk, one that is as large as the bias
instability: its Allan deviation K sqrt(tau / 3) meets the flat bottom B at the averaging time (N / B)^2 at which white
noise does, K = sqrt(3) B^2 / N. Where a sensor has neither, or no noise at all, ``LEAST`` is written.
"""

import math
import warnings
from typing import Any, Final

from fieldtruth.core.errors import ConfigurationError, FieldtruthWarning
from fieldtruth.core.yaml_io import write_mapping
from fieldtruth.experiment.rig import Rig
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.imu.noise import Triad
from fieldtruth.sensors.imu.signal import ImuSignal

LEAST: Final = 1e-6
"""Written instead of zero, in the unit of the key: less than any IMU has, and enough for Kalibr to divide by."""
_UNITS: Final = {
    "accelerometer_noise_density": "m/s^2/sqrt(Hz)",
    "accelerometer_random_walk": "m/s^3/sqrt(Hz)",
    "gyroscope_noise_density": "rad/s/sqrt(Hz)",
    "gyroscope_random_walk": "rad/s^2/sqrt(Hz)",
}


def imu_text(rig: Rig) -> str:
    """Return the text of imu.yaml; of a rig with several IMUs, a document of each, since Kalibr takes a file of each.

    Raises:
        ConfigurationError: the rig has no IMU that is enabled.
    """
    if not rig.imus:
        raise ConfigurationError("rig.sensors: no IMU for Kalibr: the rig has none that is enabled")
    return "---\n".join(_document(config) for config in rig.imus)


def _document(config: ImuConfig) -> str:
    comments = [f"Kalibr's imu.yaml of {config.name}, frame {config.frame}"]
    noise: dict[str, float] = {}
    for name in ("accelerometer", "gyroscope"):
        triad = Triad.of(config.signal or ImuSignal(), name)
        density, walk, bottom = (float(figure.max()) for figure in (triad.density, triad.walk, triad.bottom))
        if not walk and bottom and density:
            walk = math.sqrt(3.0) * bottom**2 / density
            comments.append(f"{name}_random_walk stands for the bias instability, {bottom:.3g}")
        noise |= {f"{name}_noise_density": density, f"{name}_random_walk": walk}
    if zeros := [key for key, value in noise.items() if value < LEAST]:
        what = f"{config.name}: {', '.join(zeros)} below {LEAST:g}, which Kalibr needs and which is written instead"
        warnings.warn(what, FieldtruthWarning, stacklevel=3)
        comments.append(what)
    data: dict[str, Any] = {"rostopic": config.topic, "update_rate": config.rate_hz}
    data |= {key: max(value, LEAST) for key, value in noise.items()}
    lines = write_mapping(data).splitlines()
    units = [f"{line}  # {_UNITS[key]}" if (key := line.split(":")[0]) in _UNITS else line for line in lines]
    return "".join(f"# {comment}\n" for comment in comments) + "\n".join(units) + "\n"
