# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Run the pipeline with the fakes, slowly, in a process that a test can stop: FOLDER SECONDS PAUSE."""

import signal
import sys
from pathlib import Path

from record_fakes import FakeCamera, FakeEngine, make_experiment

from fieldtruth.pipeline import generate_by

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs inherit that it is ignored
    out, seconds, FakeCamera.pause = Path(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])
    generate_by(FakeEngine(), make_experiment(seconds), out, workers=2)
