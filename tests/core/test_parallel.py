# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Peak memory of a process: its own, not that of the process that started it."""

import subprocess
import sys

import numpy as np

from fieldtruth.core.parallel import peak_memory


def test_peak_memory_is_of_this_process_and_not_of_the_one_that_started_it() -> None:
    held = np.ones(50_000_000)
    of_this = peak_memory()
    assert of_this is not None
    assert of_this > held.nbytes
    code = "from fieldtruth.core.parallel import peak_memory; held = bytearray(60_000_000); print(peak_memory())"
    of_child = int(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
    assert 6e7 < of_child < 2e8
