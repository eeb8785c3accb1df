# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Output files are whole or absent, a folder has one writer, and a full disk is one clear line."""

import errno
import os
import platform
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from fieldtruth.core.errors import OutputError, UnknownNameError
from fieldtruth.core.files import atomic_output, output_errors, remove, remove_abandoned, write_atomically
from fieldtruth.core.locks import locked


def test_a_file_is_replaced_only_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_atomically(path, "old")
    with suppress(RuntimeError), atomic_output(path) as part:
        part.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_killed_process_left_is_removed_and_nothing_else(tmp_path: Path) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    path, node = tmp_path / "a.txt", platform.node()
    numbers = {"left": f"{node}.{ended.pid}", "own": f"{node}.{os.getpid()}", "elsewhere": f"other.{ended.pid}"}
    parts = {what: tmp_path / f".a.txt.{number}.part" for what, number in numbers.items()}
    for part in parts.values():
        part.write_text("half")
    remove_abandoned(path)
    assert {what for what, part in parts.items() if part.exists()} == {"own", "elsewhere"}


def test_a_folder_is_written_as_a_whole(tmp_path: Path) -> None:
    with atomic_output(tmp_path / "folder") as part:
        part.mkdir()
        (part / "x").write_text("1")
        assert not (tmp_path / "folder").exists()
    assert [p.name for p in tmp_path.rglob("*")] == ["folder", "x"]
    remove(tmp_path / "folder")
    assert not any(tmp_path.iterdir())


def test_a_second_process_cannot_lock_a_folder_until_the_first_ends(tmp_path: Path) -> None:
    hold = (
        "from pathlib import Path\n"
        "from fieldtruth.core.locks import locked\n"
        f"with locked(Path({str(tmp_path)!r})):\n"
        "    print('held', flush=True)\n"
        "    input()\n"
    )
    child = subprocess.Popen([sys.executable, "-c", hold], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert child.stdout is not None
    assert child.stdout.readline() == b"held\n"
    with (
        pytest.raises(OutputError, match=f"in use by process {child.pid} on {platform.node()}; wait until it ends"),
        locked(tmp_path),
    ):
        pass
    child.kill()
    child.communicate()
    with locked(tmp_path):
        pass
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("number", "reason"),
    [
        (errno.ENOSPC, "no space left; free some space and run the same command again"),
        (errno.EROFS, "the file system is read-only"),
        (errno.EACCES, "permission denied"),
    ],
)
def test_errors_of_the_operating_system_become_one_line(tmp_path: Path, number: int, reason: str) -> None:
    with pytest.raises(OutputError) as caught, output_errors(tmp_path / "x"):
        raise OSError(number, "raw")
    assert str(caught.value) == f"cannot write {tmp_path / 'x'}: {reason}"


def test_only_work_that_resumes_says_so(tmp_path: Path) -> None:
    for number, expected in ((errno.EDQUOT, True), (errno.EROFS, False)):
        with pytest.raises(OutputError) as caught, output_errors(tmp_path, resumes=True):
            raise OSError(number, "raw")
        assert str(caught.value).endswith("run the same command again: it resumes") is expected


WITHOUT_FLOCK = """
import errno, fcntl, sys
from pathlib import Path

def refuse(*_):
    raise OSError(errno.{error}, "flock")

fcntl.flock = refuse
from fieldtruth.core.errors import OutputError
from fieldtruth.core.locks import locked
try:
    with locked(Path(sys.argv[1])):
        print("held", flush=True)
        input()
except OutputError as error:
    print(error)
"""


@pytest.mark.parametrize("error", ["ENOSYS", "ENOLCK"])
def test_a_folder_without_flock_is_locked_by_a_file_that_a_dead_process_may_leave(tmp_path: Path, error: str) -> None:
    def start() -> subprocess.Popen[bytes]:
        code = WITHOUT_FLOCK.format(error=error)
        return subprocess.Popen(
            [sys.executable, "-c", code, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def first_line(process: subprocess.Popen[bytes]) -> str:
        assert process.stdout is not None
        return process.stdout.readline().decode().strip()

    first = start()
    assert first_line(first) == "held"
    second = start()
    assert f"{tmp_path} is in use by process {first.pid} on {platform.node()}; " in first_line(second)
    second.communicate()
    first.kill()
    first.communicate()
    assert list(tmp_path.glob(".lock*"))
    third = start()
    assert first_line(third) == "held"
    third.communicate(b"\n")
    assert not any(tmp_path.iterdir())


def test_an_unknown_name_suggests_the_closest_one_and_lists_all() -> None:
    assert str(UnknownNameError("experiment", "prak_1", ["lake_1", "park_1"])) == (
        "unknown experiment 'prak_1'; did you mean 'park_1'? Available: lake_1, park_1"
    )
    assert str(UnknownNameError("format", "zzz", ["mcap", "pcd"])) == "unknown format 'zzz'; Available: mcap, pcd"


def test_other_errors_of_the_system_pass_unchanged() -> None:
    with pytest.raises(OutputError, match=r"^cannot write there: no such device$"), output_errors(Path("there")):
        raise OSError(errno.ENODEV, "No such device", "there/file")
    with pytest.raises(ConnectionError), output_errors(Path("there")):
        raise ConnectionError(errno.ECONNRESET, "reset")
