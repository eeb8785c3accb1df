# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Inputs and exports that several tests read. Copy before changing."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
from export_bags import copied

from fieldtruth.exporters import FORMATS, export


@pytest.fixture(scope="session")
def bag(small_run: Path) -> Path:
    """Bag of the small run."""
    return small_run / "park_1.bag"


@pytest.fixture(scope="session")
def short(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Bag with the first six images of each camera."""
    path = tmp_path_factory.mktemp("short") / "a.bag"
    return copied(small_run / "park_1.bag", path, lambda topic, stamp, data: data if stamp <= 240_000_000 else None)


@pytest.fixture(scope="session")
def exported(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Export of the small run in a format, made once with two workers."""
    folder = tmp_path_factory.mktemp("exported")

    @cache
    def made(to: str) -> Path:
        return export(small_run, to, out=folder / f"park_1{FORMATS[to].suffix}", workers=2)

    return made
