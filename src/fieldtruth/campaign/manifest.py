# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What is recorded beside each run of a campaign: a manifest of the finished one, or the reason of a failure.

The manifest is written last, so a run without one is not done.
"""

import hashlib
import json
from pathlib import Path
from typing import Annotated, Final, Self

from pydantic import Field, ValidationError

import fieldtruth
from fieldtruth.core.files import output_errors, write_atomically
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.fields import Frozen

MANIFEST: Final = "manifest.json"
FAILURE: Final = "failure.json"

Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class _Record(Frozen):
    fieldtruth: str
    """Version that wrote it."""
    experiment: Digest
    """Digest of the experiment; see ``digest_of``."""

    def write(self, path: Path) -> None:
        """Write the record atomically; folders are made."""
        with output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(path, json.dumps(self.model_dump(), indent=1) + "\n")

    @classmethod
    def read(cls, path: Path) -> Self | None:
        """Read a record; None if it is missing or damaged."""
        try:
            return cls.model_validate_json(path.read_bytes())
        except (OSError, ValidationError):
            return None


class Manifest(_Record):
    """A finished run."""

    bag: str
    """Name of the bag."""
    bytes: int
    sha256: Digest
    messages: dict[str, int]
    """Number by topic."""
    simulated_s: float
    took_s: float
    """Time [s] of the process that finished the run; what interrupted ones did before is not in it."""
    world_s: float = 0.0
    """Of it, time [s] for the world and its light, which later runs in the same light find in the cache."""


class Failure(_Record):
    """A run that ended with an error."""

    reason: str
    final: bool
    """Whether the same version would fail again, as where no route is found."""


def digest_of(experiment: Experiment) -> str:
    """SHA-256 of the values of an experiment."""
    return hashlib.sha256(json.dumps(experiment.model_dump(mode="json"), sort_keys=True).encode()).hexdigest()


def failure_of(experiment: Experiment, reason: str, *, final: bool) -> Failure:
    """Record of a failure with the installed version."""
    line = " ".join(reason.split())
    return Failure(fieldtruth=fieldtruth.__version__, experiment=digest_of(experiment), reason=line, final=final)
