# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The world of the small run, built once for all the validations of its copies."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from validate_bags import rewritten

from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.record.run import open_run
from fieldtruth.record.stored import RawMessage
from fieldtruth.report.progress import Silent
from fieldtruth.validate import Check, passing, validate
from fieldtruth.validate.rebuild import rebuilt
from fieldtruth.validate.subject import Place

LEAN_NS = 520_000_000


@pytest.fixture(scope="session")
def lean_run(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The beginning of the small run, 0.52 s: every topic, and quick to copy. It is a run of its own right."""

    def change(raw: RawMessage, k: int) -> RawMessage | None:
        return raw if raw.stamp_ns <= LEAN_NS else None

    shorter = with_overrides(load_experiment(small_run / "experiment.yaml"), seconds=LEAN_NS / 1e9)
    return rewritten(small_run, tmp_path_factory.mktemp("lean_run"), change, shorter)


@pytest.fixture(scope="session")
def place(small_run: Path) -> Place:
    """World and scene of park_1."""
    found, why = rebuilt(open_run(small_run), quick=False, progress=Silent())
    assert found is not None, why
    return found


@pytest.fixture
def with_world(place: Place, monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[Check]]:
    """``validate`` with the world at hand."""

    def rebuild(*args: Any, quick: bool, **kwargs: Any) -> tuple[Place | None, str]:
        return (None, "quick") if quick else (place, "")

    monkeypatch.setattr(passing, "rebuilt", rebuild)
    return validate
