# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Intrinsics of the pinhole camera."""

from fieldtruth.experiment.sensor_families import ImagingConfig
from fieldtruth.kernels.camera_rays import Pinhole


def pinhole(config: ImagingConfig) -> Pinhole:
    """Intrinsics of a camera, whatever its lens: ``lenses.Lens`` states what they mean for each model."""
    lens = config.projection
    return Pinhole(lens.fx, lens.fy, lens.cx, lens.cy)
