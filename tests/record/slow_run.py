# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Run the pipeline with the fakes, slowly, in a process that a test can stop: FOLDER SECONDS PAUSE."""

import signal
import sys
from pathlib import Path

import pytest
from record_fakes import FakeCamera, make_experiment, use_fakes

from fieldtruth import pipeline

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs inherit that it is ignored
    out, seconds, FakeCamera.pause = Path(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])
    use_fakes(pytest.MonkeyPatch())
    pipeline.generate(make_experiment(seconds), out, workers=2)
