# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Names of array types; docstrings of functions state the shapes."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]
Counts = NDArray[np.int64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
