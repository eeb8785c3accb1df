# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels are read from the cache folder only if they are intact and for the same types."""

import threading
from pathlib import Path
from typing import Any

import pytest
from filelock import FileLock
from numba.core.errors import TypingError

from fieldtruth.kernels import compile as kernels


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A module with one function to compile."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "twice_in_a_file.py").write_text("def twice(x):\n    return x + x\n")
    monkeypatch.syspath_prepend(tmp_path)
    import twice_in_a_file  # type: ignore[import-not-found]

    kernels._folder.cache_clear()
    return twice_in_a_file


def files(tmp_path: Path) -> list[Path]:
    return sorted(path for path in (tmp_path / "cache").rglob("*") if path.is_file())


def call(source: Any, value: object) -> tuple[object, int]:
    """Result of a newly compiled or read kernel, and 1 if its code was read."""
    compiled = kernels.kernel(source.twice)
    return compiled(value), sum(compiled.stats.cache_hits.values())


def test_damaged_code_and_code_for_other_types_are_compiled_again(source: Any, tmp_path: Path) -> None:
    assert call(source, 21) == (42, 0)
    assert call(source, 21) == (42, 1)
    (whole,) = files(tmp_path)
    data = whole.read_bytes()
    for damaged in (b"", data[:1000], data[:500] + b"?" + data[501:], bytes(len(data)), data[:-1]):
        whole.write_bytes(damaged)
        assert call(source, 21) == (42, 0)
        assert call(source, 21) == (42, 1)
    assert call(source, 0.5) == (1.0, 0)
    other = next(path for path in files(tmp_path) if path != whole)
    other.write_bytes(whole.read_bytes())
    assert call(source, 0.5) == (1.0, 0)
    assert call(source, 0.5) == (1.0, 1)


def test_without_a_writable_folder_kernels_are_compiled_in_each_process(source: Any, tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("a file, not a folder")
    assert call(source, 21) == (42, 0)


def locked(tmp_path: Path) -> list[Path]:
    return [path for path in files(tmp_path) if path.suffix == ".lock"]


def test_a_kernel_that_another_process_compiles_is_waited_for(source: Any, tmp_path: Path) -> None:
    assert call(source, 21) == (42, 0)
    (whole,) = files(tmp_path)
    data, found = whole.read_bytes(), list[tuple[object, int]]()
    whole.unlink()
    with FileLock(whole.with_suffix(".lock"), thread_local=False) as other:
        waiting = threading.Thread(target=lambda: found.append(call(source, 21)))
        waiting.start()
        waiting.join(0.5)
        assert waiting.is_alive()
        whole.write_bytes(data)
        other.release()
        waiting.join(60.0)
    assert found == [(42, 1)]


def test_a_kernel_that_cannot_be_compiled_is_not_waited_for(source: Any, tmp_path: Path) -> None:
    for _ in range(2):
        with pytest.raises(TypingError):
            kernels.kernel(source.twice)(None)
        assert not locked(tmp_path)


def test_a_constant_argument_compiles_no_version_of_its_own(source: Any, tmp_path: Path) -> None:
    twice = kernels.kernel(source.twice)

    @kernels.kernel
    def many(x: int) -> int:
        return twice(1) + twice(2) + twice(x)  # type: ignore[no-any-return]

    assert many(3) == 12
    assert len(twice.signatures) == 1
