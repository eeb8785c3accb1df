# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Experiments by name: those of the package, in ``builtin``, and added ones.

Others are in folders ``experiments`` of FIELDTRUTH_PATH, or named by entry points of ``fieldtruth.experiments``. The
module that loads them is another, so that ``fieldtruth list`` names them without all of the configuration.
"""

from pathlib import Path
from typing import Final

from fieldtruth.core.registry import Registry
from fieldtruth.core.yaml_io import parse_mapping, read_text

LANDSCAPES: Final = ("boreal", "field_track", "orchard", "scrub", "thicket", "wet_meadow")
"""Environments beside the four of the paper; their experiments follow the paper's eight."""
EXPERIMENTS: Final[Registry[str]] = Registry(
    "experiment",
    "experiments",
    ".yaml",
    lambda _, given: read_text(Path(given)),
    Path(__file__).parent / "builtin",
    last=lambda name: name.rpartition("_")[0] in LANDSCAPES,
)


def campaign_experiments(*, every: bool) -> list[str]:
    """Return the names of the paper's experiments and of added ones, or of every one."""
    return [name for name in EXPERIMENTS if every or name.rpartition("_")[0] not in LANDSCAPES]


def list_experiments() -> dict[str, str]:
    """Name and one-line description of each experiment."""
    return {name: str(parse_mapping(text, name).get("description", "")) for name, text in EXPERIMENTS.items()}
