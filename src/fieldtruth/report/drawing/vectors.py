# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Colours of normals and of optical flow."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

_LARGE: Final = 0.98  # quantile of the lengths of flow that is drawn in full colour


def normal_colours(normal: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Colours (h, w, 3) of unit normals (h, w, 3): red grows with x, green with y, blue with z; the sky is black."""
    colours = np.rint((normal + 1.0) * 127.5)
    colours[~normal.any(axis=-1)] = 0.0
    return np.asarray(colours, np.uint8)


def flow_colours(flow: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Colours (h, w, 3) of flow (h, w, 2): the hue is its direction, the saturation its length; black where unknown."""
    length = np.hypot(flow[..., 0], flow[..., 1])
    known = np.isfinite(length)
    most = float(np.quantile(length[known], _LARGE)) if known.any() else 0.0
    saturation = np.clip(np.nan_to_num(length) / max(most, 1e-6), 0.0, 1.0)[..., None]
    turn = np.nan_to_num(np.arctan2(flow[..., 1], flow[..., 0]))[..., None] * (3.0 / np.pi)
    pure = np.clip(np.abs((turn + np.array([0.0, 4.0, 2.0])) % 6.0 - 3.0) - 1.0, 0.0, 1.0)
    return np.asarray(np.rint(255.0 * known[..., None] * (1.0 - saturation * (1.0 - pure))), np.uint8)
