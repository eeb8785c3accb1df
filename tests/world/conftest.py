# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shared fixtures of the tests of worlds."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from sense_worlds import without_textures

from fieldtruth.world import library


@pytest.fixture(scope="session", autouse=True)
def _package_files_are_read_once() -> Iterator[None]:
    """The package's own files, which do not change, stay in memory when a test adds another: to parse them is slow."""
    real = library._document
    of_package = cache(real.__wrapped__)

    def document(path: Path) -> Any:
        return of_package(path) if library.FOLDER in path.parents else real(path)

    document.cache_clear = real.cache_clear  # type: ignore[attr-defined]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(library, "_document", document)
        yield


@pytest.fixture(scope="module")
def untextured() -> Iterator[None]:
    """Worlds are built without textures, which change neither layout nor labels."""
    with without_textures():
        yield
