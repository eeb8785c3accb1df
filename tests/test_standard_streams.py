# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Standard output that is closed, full or of another encoding changes no exit code of finished work."""

import os
import subprocess
import sys
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

import pytest

FULL = "error: cannot write to standard output: no space left on device\n"
TO_FILE = ["rig", "park_1", "--to", "urdf", "--out", "数据.urdf"]
RESULTS = [
    ["list"],
    pytest.param(["rig", "park_1", "--to", "urdf"], marks=pytest.mark.slow),
    pytest.param(["status", "."], marks=pytest.mark.slow),
]


@pytest.fixture(autouse=True)
def _campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "campaign.yaml").write_text(
        "name: tiny\nenvironments: park\nroutes: {random: {length_m: 90}}\nruns: 2\n"
    )


def ended(
    argv: list[str], *, out: str = "", err: str = "", variables: Mapping[str, str] | None = None
) -> tuple[int, bytes, bytes]:
    """Run a command with its streams in a full device, a pipe without a reader or closed; read those that are free."""
    with ExitStack() as stack:

        def stream(kind: str) -> int:
            if not kind:
                return subprocess.PIPE
            if kind == "gone":
                reader, writer = os.pipe()
                os.close(reader)
            else:
                writer = os.open(kind, os.O_WRONLY)
            stack.callback(os.close, writer)
            return writer

        done = subprocess.run(
            [sys.executable, "-m", "fieldtruth.cli", *argv],
            stdout=stream(out),
            stderr=stream(err),
            env=os.environ | dict(variables or {}),
            check=False,
        )
    return done.returncode, done.stdout or b"", done.stderr or b""


@pytest.mark.parametrize("argv", RESULTS, ids=" ".join)
def test_a_reader_that_goes_away_is_no_error_and_a_full_device_is_one(argv: list[str]) -> None:
    code, printed, errors = ended(argv)
    assert (code, errors) == (0, b"")
    assert printed
    assert ended(argv, out="gone") == (0, b"", b"")
    assert ended(argv, out="/dev/full") == (2, b"", FULL.encode())


@pytest.mark.parametrize(
    ("out", "err"),
    [
        pytest.param("gone", "gone", marks=pytest.mark.slow),
        ("gone", "/dev/full"),
        pytest.param("/dev/full", "gone", marks=pytest.mark.slow),
        pytest.param("/dev/full", "/dev/full", marks=pytest.mark.slow),
        ("/dev/full", ""),
    ],
)
def test_a_file_that_is_written_is_success(out: str, err: str, tmp_path: Path) -> None:
    code, _, errors = ended(TO_FILE, out=out, err=err, variables={"PYTHONIOENCODING": "cp1252"})
    assert code == 0
    assert (tmp_path / "数据.urdf").read_text(encoding="utf-8").startswith("<?xml")
    assert errors.decode() == ("" if err or out != "/dev/full" else FULL.replace("error", "warning"))


def test_an_error_has_its_code_where_nobody_reads_it() -> None:
    assert ended(["status", "no_such"], out="gone", err="gone")[0] == 2


def test_letters_that_the_encoding_lacks_are_replaced() -> None:
    code, printed, errors = ended(TO_FILE, variables={"PYTHONIOENCODING": "cp1252"})
    assert (code, errors) == (0, b"")
    assert printed.startswith(b"??.urdf: ")
    code, _, errors = ended(["validate", "数据"], variables={"PYTHONIOENCODING": "ascii"})
    assert (code, errors.count(b"\n")) == (2, 1)
    assert errors.startswith(b"error: ?? does not exist")


def test_progress_that_nobody_reads_stops_no_work() -> None:
    code = (
        "import sys; from fieldtruth.cli.terminal import standard_streams, print_line\n"
        "from fieldtruth.core.progress import show_progress\n"
        "with standard_streams():\n"
        "    for _ in range(3):\n"
        "        with show_progress() as progress, progress.stage('work') as advance:\n"
        "            advance(1.0)\n"
        "    print_line('done'); print_line('数' * 100000)\n"
    )
    for shell in ('"$0" -c "$1" 2>&1 | (exec <&-)', '"$0" -c "$1" >/dev/full 2>&1', '"$0" -c "$1" >&- 2>&-'):
        script = f"set -o pipefail; {shell}"
        assert subprocess.run(["bash", "-c", script, sys.executable, code], check=False).returncode == 0, shell
