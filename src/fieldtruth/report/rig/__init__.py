# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The rig of an experiment for readers and other tools: tree of frames, URDF, files for Kalibr, a picture."""

from collections.abc import Callable
from typing import Final

from fieldtruth.experiment.rig import Rig
from fieldtruth.report.rig.text import camchain_text, imu_text, sensor_table, tree_text, urdf_text

FORMATS: Final[dict[str, Callable[[Rig], str]]] = {
    "tree": tree_text,
    "urdf": urdf_text,
    "camchain": camchain_text,
    "imu": imu_text,
}
"""Writers of ``fieldtruth rig --to``."""

__all__ = ["FORMATS", "sensor_table"]
