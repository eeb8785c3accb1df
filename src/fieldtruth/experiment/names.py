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

_PAPER: Final = Path(__file__).parent / "builtin"
_FURTHER: Final = (_PAPER / "landscapes", _PAPER / "living")
"""Folders of the built-in experiments that are not the paper's: of other environments, and with actors."""
EXPERIMENTS: Final[Registry[str]] = Registry(
    "experiment",
    "experiments",
    ".yaml",
    lambda _, given: read_text(Path(given)),
    (_PAPER, *_FURTHER),
)


def campaign_experiments(*, every: bool) -> list[str]:
    """Return the names of the paper's experiments and of added ones, or of every one."""
    further = () if every else {path.stem for folder in _FURTHER for path in folder.glob("*.yaml")}
    return [name for name in EXPERIMENTS if name not in further]


def list_experiments() -> dict[str, str]:
    """Name and one-line description of each experiment."""
    return {name: str(parse_mapping(text, name).get("description", "")) for name, text in EXPERIMENTS.items()}
