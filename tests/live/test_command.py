# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The command: bad input is one line and exit code 2, and the first line says who can reach it."""

import re
import socket
import sys
from pathlib import Path

import pytest
from small_park import in_small_park

from fieldtruth.cli import main
from fieldtruth.experiment.files import dump_experiment

pytestmark = pytest.mark.usefixtures("small_sky")


@pytest.fixture
def small(tmp_path: Path) -> str:
    path = tmp_path / "small.yaml"
    path.write_text(dump_experiment(in_small_park()), "utf-8")
    return str(path)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ([], "give one of --ros2, --ros1, --foxglove and --rerun"),
        (["--ros1", "--ros2"], "not allowed with argument"),
        (["--foxglove", "--rate", "-1"], "--rate must be from 0 to 1000, got -1"),
        (["--foxglove", "--rate", "nan"], "--rate must be from 0 to 1000, got nan"),
        (["--foxglove", "--rate", "fast"], "--rate must be a number, got 'fast'"),
        (["--foxglove", "--host", "localhost"], "--host must be an IPv4 address of this machine, got 'localhost'"),
        (["--foxglove", "--port", "65536"], "--port must be from 1 to 65535, got 65536"),
        (["--foxglove", "--port", "0"], "--port must be an integer of at least 1, got '0'"),
        (["--foxglove", "--seconds", "-1"], "seconds"),
        (["--foxglove", "--seconds", "nan"], "seconds"),
        (["--foxglove", "--light", "disco"], "disco"),
        (["--ros3"], "unknown option '--ros3'"),
    ],
)
def test_bad_options_are_one_line(
    arguments: list[str], reason: str, small: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["live", small, *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert re.fullmatch(r"error: [^\n]+\n", err)
    assert reason in err


def test_unknown_experiments_and_frames_are_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["live", "parc_1", "--foxglove"]) == 2
    assert "did you mean 'park_1'?" in capsys.readouterr().err
    path = tmp_path / "frames.yaml"
    path.write_text(dump_experiment(in_small_park(route=None, frames={"count": 2})), "utf-8")
    assert main(["live", str(path), "--foxglove"]) == 2
    assert "separate frames; live needs a route or a track file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "library", "reason"),
    [
        ("--ros2", "cyclonedds.core", "cyclonedds is not installed; run: pip install 'fieldtruth[live]'"),
        ("--foxglove", "foxglove", "foxglove-sdk is not installed; run: pip install 'fieldtruth[live]'"),
        ("--ros1", "rosgraph", "rospy is not installed for this Python"),
    ],
)
def test_a_missing_library_is_one_line(
    option: str,
    library: str,
    reason: str,
    small: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    assert main(["live", small, option]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert reason in err


def test_a_port_that_is_taken_and_a_run_to_the_end(small: str, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("foxglove")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert main(["live", small, "--foxglove", "--port", port]) == 2
        assert f"cannot listen on port {port} of 127.0.0.1" in capsys.readouterr().err
    run = ["live", small, "--foxglove", "--port", port, "--no-cameras", "--seconds", "0.5", "--rate", "0"]
    assert main(run) == 0
    first, last = capsys.readouterr().out.splitlines()
    assert first == f"small at ws://127.0.0.1:{port}, for this machine only; Ctrl-C ends it"
    assert re.fullmatch(r"ended: 0\.5 s simulated, \d+\.\d\d of real time, follower", last)
