# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The former name of ``Scene.cast``."""

import warnings

import numpy as np
from numpy.typing import ArrayLike

from fieldtruth.kernels.cast import Hits
from fieldtruth.sense.scene import Scene


def cast_rays(scene: Scene, origins: ArrayLike, directions: ArrayLike, max_range: float = np.inf) -> Hits:
    """Call ``Scene.cast``, which replaces this function."""
    warnings.warn("cast_rays(scene, ...) is now scene.cast(...)", DeprecationWarning, stacklevel=2)
    return scene.cast(origins, directions, max_range)
