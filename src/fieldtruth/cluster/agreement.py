# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What client and workers must have in common, so that their slices have the same bytes."""

import platform
from collections.abc import Mapping
from typing import Final

import fieldtruth
from fieldtruth.bag.provenance import LIBRARIES, this_process
from fieldtruth.experiment.sensor_config import load_added_kinds
from fieldtruth.record.slices import slices_key

Facts = Mapping[str, str]

_KEY: Final = "key of the code"


def facts() -> Facts:
    """Versions of this process, and the key of its code with all kinds of sensors; see ``slices_key``."""
    load_added_kinds()
    shared = {name: this_process()[name] for name in ("Python", *LIBRARIES)}
    own = {"fieldtruth": fieldtruth.__version__, "processor": platform.machine()}
    return own | shared | {_KEY: slices_key()}


def difference(there: Facts, here: Facts) -> str:
    """Say in what a worker differs from the client; empty if it does not."""
    different = [f"{name} {there.get(name)} instead of {here[name]}" for name in here if there.get(name) != here[name]]
    if len(different) > 1:  # the key follows from the versions
        different = [text for text in different if not text.startswith(_KEY)]
    return ", ".join(different)
