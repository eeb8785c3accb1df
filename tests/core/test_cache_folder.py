# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The cache folder is shared by processes, bounded, and cleared; what cannot be used is made again."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fieldtruth.cli import main
from fieldtruth.core.cache import SEAL_SIZE
from fieldtruth.core.cache_folder import SIZE_VARIABLE, entries, load_or_make, size_limit
from fieldtruth.core.errors import ConfigurationError


def test_a_second_process_waits_for_what_the_first_makes(tmp_path: Path) -> None:
    path, made = tmp_path / "folder" / "value", tmp_path / "made"
    code = f"""
import time
from pathlib import Path
from fieldtruth.core.cache_folder import load_or_make

def make():
    with Path({str(made)!r}).open("a") as file:
        file.write("made ")
    time.sleep(0.5)
    return "value"

load = lambda path: path.read_bytes()[:5].decode()
print(load_or_make(Path({str(path)!r}), load, make, lambda path, value: path.write_text(value) and None))
"""
    both = [subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) for _ in range(2)]
    assert [child.communicate()[0] for child in both] == ["value\n"] * 2
    assert made.read_text() == "made "
    assert list(path.parent.iterdir()) == [path]


def test_a_cache_that_cannot_be_written_is_not_used(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    made = load_or_make(tmp_path / "file" / "value", lambda path: None, lambda: 7, lambda path, value: path.touch())
    assert made == 7


def never() -> str:
    raise AssertionError("the cache was not used")


def text(path: Path) -> str:
    return path.read_bytes()[:-SEAL_SIZE].decode()


def write(path: Path, value: str) -> None:
    path.write_text(value)


def stored(path: Path, value: str) -> Path:
    load_or_make(path, text, lambda: value, write)
    return path


@pytest.mark.parametrize("at", range(0, 36, 5))
def test_a_flipped_bit_anywhere_is_made_again(tmp_path: Path, at: int) -> None:
    path = stored(tmp_path / "value", "true")
    data = bytearray(path.read_bytes())
    data[at] ^= 16
    path.write_bytes(data)
    assert load_or_make(path, text, lambda: "again", write) == "again"
    assert load_or_make(path, text, never, write) == "again"


def test_a_file_with_the_name_of_another_is_made_again(tmp_path: Path) -> None:
    stored(tmp_path / "one", "1").rename(tmp_path / "two")
    assert load_or_make(tmp_path / "two", text, lambda: "2", write) == "2"


def test_the_least_recently_used_files_are_removed_above_the_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(SIZE_VARIABLE, "3.5e-6")  # 3500 bytes
    for k, name in enumerate("abc"):
        os.utime(stored(tmp_path / name, 1000 * name), (k, k))
    (tmp_path / "kernels" / "old").mkdir(parents=True)
    (tmp_path / "kernels" / "old" / "code").write_text("0")
    os.utime(tmp_path / "kernels" / "old", (0, 0))
    load_or_make(tmp_path / "a", text, never, write)  # now the last used
    stored(tmp_path / "d", 1000 * "d")
    assert [entry.path.name for entry in entries(tmp_path)] == ["d", "a", "c"]
    stored(tmp_path / "e", 4000 * "e")  # larger than the limit
    assert [entry.path.name for entry in entries(tmp_path)] == ["e"]


@pytest.mark.parametrize("value", ["", "much", "0", "-1", "nan"])
def test_a_wrong_limit_is_one_line(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    monkeypatch.setenv(SIZE_VARIABLE, value)
    with pytest.raises(ConfigurationError, match=f"^{SIZE_VARIABLE} must be a number of GB above 0, got '{value}'$"):
        size_limit()


def test_the_command_lists_and_clears(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv(SIZE_VARIABLE, raising=False)
    folder = tmp_path / "fieldtruth"
    for name in ("park-0-1.npz", "light-park-2.npz"):
        stored(folder / name, 2_000_000 * "x")
    (folder / "kernels" / "3").mkdir(parents=True)
    assert main(["cache"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert {line.split()[0] for line in lines[:-1]} == {"world", "light", "kernels"}
    assert lines[-1] == f"{folder}: 0.00 of 10 GB; {SIZE_VARIABLE} sets the limit in GB"
    assert main(["cache", "--clear"]) == 0
    assert capsys.readouterr().out == f"{folder}: 4 MB removed\n"
    assert entries(folder) == []
