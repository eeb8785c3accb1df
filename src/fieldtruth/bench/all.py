# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Every environment, each in a process of its own, so that the memory of one is not counted for the next."""

import json
import subprocess
import sys

from fieldtruth.bench.figures import Everything
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.drive.expected_path import experiments_in
from fieldtruth.world.environments import ENVIRONMENTS

ONE = (
    "import json, sys; from fieldtruth.bench import run, settings_of; print(json.dumps(run(settings_of(sys.argv[1]))))"
)
RATIOS = """
import json, sys
from fieldtruth.bench.scaling import measure_ratios
from fieldtruth.core.progress import Silent
print(json.dumps(measure_ratios(sys.argv[1:], Silent())))
"""


def run_all(progress: Progress | None = None) -> Everything:
    """Figures by environment, for those in which a built-in experiment drives, and then those of ``RATIOS``."""
    progress = Silent() if progress is None else progress
    names = [name for name in ENVIRONMENTS if experiments_in(name)]
    everything: Everything = {}
    for name in names:
        with progress.stage(f"measure {name}"):
            everything[name] = measured(ONE, name)
    with progress.stage("compare trees"):
        everything.update(measured(RATIOS, *names))
    return everything


def measured(code: str, *arguments: str) -> dict[str, float]:
    """Run code that prints one JSON object in a new Python process, and return that object."""
    ended = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)
    if ended.returncode:
        reason = (ended.stderr.strip().splitlines() or ["no reason given"])[-1]
        raise FieldtruthError(f"measuring {', '.join(arguments)} failed: {reason}")
    found: dict[str, float] = json.loads(ended.stdout)
    return found
