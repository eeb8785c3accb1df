# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Work in processes: all results, each once; errors and ends of processes come back; Ctrl-C leaves none behind."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fieldtruth.core.errors import ConfigurationError, OutputError
from fieldtruth.core.processes import as_done

SCRIPT = """
import os, sys, time
from fieldtruth.core.processes import as_done

def slow(k):
    time.sleep(0.01)
    return os.getpid()

if __name__ == "__main__":
    try:
        for pid in as_done(slow, [(k,) for k in range(10_000)], 2, tasks_per_process=1):
            print(pid, flush=True)
    except KeyboardInterrupt:
        sys.exit(130)
"""


def square(k: int) -> tuple[int, int]:
    """Return the square, and by which process."""
    return k * k, os.getpid()


def refuse(k: int) -> int:
    """Fail at 3."""
    if k == 3:
        raise ConfigurationError("three is not allowed")
    return k


def die(k: int) -> None:
    """End as a process does that the system kills."""
    os.kill(os.getpid(), signal.SIGKILL)


def test_each_result_comes_once_from_a_few_processes() -> None:
    found = list(as_done(square, [(k,) for k in range(9)], 2))
    assert sorted(value for value, _ in found) == [k * k for k in range(9)]
    assert len({pid for _, pid in found}) <= 2
    assert os.getpid() not in {pid for _, pid in found}


def test_a_process_ends_after_its_items() -> None:
    assert len({pid for _, pid in as_done(square, [(k,) for k in range(3)], 1, tasks_per_process=1)}) == 3


def test_errors_and_ends_of_processes_come_back() -> None:
    with pytest.raises(ConfigurationError, match="three is not allowed"):
        list(as_done(refuse, [(k,) for k in range(5)], 2))
    with pytest.raises(OutputError, match="a process was ended, perhaps for lack of memory; take fewer --workers"):
        list(as_done(die, [(0,)], 1))


def is_alive(group: int) -> bool:
    """Return whether a group of processes has any."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.slow
def test_ctrl_c_at_any_moment_ends_all_processes(tmp_path: Path) -> None:
    """Each process is replaced after one item, so that most of these come while one begins."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    for k in range(8):
        process = subprocess.Popen(
            [sys.executable, str(script)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            start_new_session=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )  # fmt: skip
        assert process.stdout is not None
        for _ in range(1 + k):
            process.stdout.readline()
        os.killpg(process.pid, signal.SIGINT)
        told = process.communicate(timeout=60)[1]
        assert (process.returncode, told) == (130, "")
        for _ in range(200):  # multiprocessing's own tracker ends a moment later
            if not is_alive(process.pid):
                break
            time.sleep(0.05)
        assert not is_alive(process.pid)
