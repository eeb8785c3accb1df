# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A small sky for tests of light: one of the full size takes seconds."""

from collections.abc import Iterator

import pytest

from fieldtruth.render.sky import dome


@pytest.fixture(scope="module", autouse=True)
def small_sky() -> Iterator[None]:
    """Skies of 512 texels along each side, in the tests of this folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dome, "SIZE", 512)
        yield
