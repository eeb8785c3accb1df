# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Faults, each caused for real in a process of its own: the same bytes afterwards, or one line and no bag."""

import errno
import fcntl
import os
import platform
import random
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple, NoReturn

import pytest
from record_fakes import FakeCamera, FakeEngine, make_experiment, use_fakes

from fieldtruth.campaign.config import Campaign
from fieldtruth.campaign.draw import draw
from fieldtruth.campaign.state import MANIFEST, Kind, state_of
from fieldtruth.campaign.task import Options, generate_campaign
from fieldtruth.cli import main
from fieldtruth.experiment.files import dump_experiment
from fieldtruth.pipeline import generate_by

pytestmark = pytest.mark.slow

SECONDS = 3.2
FILES = ["DATASET.md", "SHA256SUMS", "experiment.yaml", "made_by.json", "tiny.bag"]
ROOT = os.geteuid() == 0
Content = dict[str, str]
"""Digest of each file by its name."""


@pytest.fixture(autouse=True)
def _fakes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    use_fakes(monkeypatch)
    monkeypatch.setattr(FakeCamera, "pause", 0.001)
    (tmp_path / "tiny.yaml").write_text(dump_experiment(make_experiment(SECONDS)))
    monkeypatch.setenv("TINY", str(tmp_path / "tiny.yaml"))


def content(out: Path) -> Content:
    """Every file of the run, hidden ones too."""
    return digests(out / "tiny")


def digests(folder: Path) -> Content:
    return {str(p.relative_to(folder)): sha256(p.read_bytes()).hexdigest() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Content:
    """The run without a fault."""
    out = tmp_path_factory.mktemp("whole")
    generate_by(FakeEngine(), make_experiment(SECONDS), out, workers=1)
    assert sorted(content(out)) == FILES
    return content(out)


class Child(NamedTuple):
    """A process that runs the command line on the experiment."""

    pid: int
    stderr: int

    def end(self) -> tuple[int, list[str]]:
        """Wait for its end; exit code, negative for a signal, and what it printed to stderr but title and progress."""
        with os.fdopen(self.stderr) as stream:
            lines = stream.read().splitlines()
        code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        said = [line for line in lines if not line.endswith(" s") and " s left" not in line]
        return code, [line for line in said if not line.startswith(f"tiny: {SECONDS:g} s with ")]


def start(out: Path, prepare: Callable[[], object] = lambda: None) -> Child:
    """Start a run in a new process, which calls ``prepare`` first."""

    def command() -> int:
        prepare()
        sys.argv = ["fieldtruth", "generate", os.environ["TINY"], "--out", str(out), "--workers", "2"]
        return main()

    return start_function(command)


def start_function(work: Callable[[], int]) -> Child:
    """Start a new process that ends with what ``work`` returns."""
    reader, writer = os.pipe()
    pid = os.fork()
    if pid == 0:
        code = 99
        try:
            os.dup2(writer, 2)
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w", buffering=1)
            signal.signal(signal.SIGINT, signal.default_int_handler)
            code = work()
        finally:
            os._exit(code)
    os.close(writer)
    return Child(pid, reader)


def run(out: Path, prepare: Callable[[], object] = lambda: None) -> tuple[int, list[str]]:
    return start(out, prepare).end()


def no_bag(out: Path) -> bool:
    return not (out / "tiny" / "tiny.bag").exists()


def test_kills_at_twenty_random_moments(whole: Content, tmp_path: Path) -> None:
    moments, kills, finished = random.Random(5), 0, 0
    begin = time.monotonic()
    assert run(tmp_path / "first")[0] == 0
    duration = time.monotonic() - begin
    while kills < 20 or not finished:
        out = tmp_path / f"run_{finished}"
        child = start(out)
        time.sleep(moments.uniform(0.0, duration))
        os.kill(child.pid, signal.SIGKILL)
        code, _ = child.end()
        if code == -signal.SIGKILL:
            kills += 1
            if kills % 5 == 0:  # without a kill, so that short runs end, too
                code, _ = run(out)
        if not no_bag(out):
            assert {name: data for name, data in content(out).items() if name in FILES} == whole
        if code == 0:
            assert content(out) == whole
            finished += 1
    assert kills >= 20


def test_kills_of_a_campaign(tmp_path: Path) -> None:
    campaign = Campaign(name="c", experiments=tuple(make_experiment(1.2, seed=k, name=f"r{k}") for k in range(3)))

    def make(out: Path) -> int:
        generate_campaign(campaign, out, Options(measure=False, workers=2), say=lambda line: None)
        return 0

    def files(out: Path) -> Content:
        return {name: d for name, d in digests(out).items() if not name.endswith(MANIFEST)}  # it has the time taken

    begin = time.monotonic()
    make(tmp_path / "whole")
    duration, moments, kills, finished = time.monotonic() - begin, random.Random(7), 0, 0
    while kills < 6 or not finished:
        out = tmp_path / f"killed_{finished}"
        child = start_function(partial(make, out))
        time.sleep(moments.uniform(0.0, 0.8) * duration)
        os.kill(child.pid, signal.SIGKILL)
        code, _ = child.end()
        if code == -signal.SIGKILL:
            kills += 1
            if kills % 3 == 0:  # without a kill, so that a machine that has become slow ends, too
                code = start_function(partial(make, out)).end()[0]
        if code == 0:
            states = [state_of(run, out, checksums=True) for run in draw(campaign)]
            assert [state.kind for state in states] == [Kind.DONE] * 3
            assert files(out) == files(tmp_path / "whole")
            finished += 1


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A tmpfs of 300 kB; the bag has more."""
    disk = tmp_path / "disk"
    disk.mkdir()
    if not ROOT or subprocess.run(["mount", "-t", "tmpfs", "-o", "size=300k", "tmpfs", disk], check=False).returncode:
        pytest.skip("mounting is not allowed here")
    yield disk
    subprocess.run(["umount", "-l", disk], check=True)


def remount(disk: Path, option: str) -> None:
    subprocess.run(["mount", "-o", f"remount,{option}", disk], check=True)


def test_a_full_disk(whole: Content, small_disk: Path) -> None:
    for size in ("300k", "500k", "700k"):
        remount(small_disk, f"size={size}")
        code, lines = run(small_disk / "data")
        assert code == 2, (size, lines)
        (line,) = lines
        assert line.startswith(f"error: cannot write {small_disk}")
        assert line.endswith(": no space left; free some space and run the same command again: it resumes")
        assert no_bag(small_disk / "data")
    remount(small_disk, "size=64m")
    assert run(small_disk / "data") == (0, [])
    assert content(small_disk / "data") == whole


@pytest.mark.parametrize("size", [1_000, 50_000, 300_000, 700_000])
def test_a_limit_of_the_file_size(whole: Content, tmp_path: Path, size: int) -> None:
    out = tmp_path / "data"
    code, lines = run(out, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)))
    assert code == 2
    (line,) = lines
    assert line.startswith(f"error: cannot write {out}")
    assert line.endswith(": the file system allows no file of this size")
    assert no_bag(out)
    assert run(out) == (0, [])
    assert content(out) == whole


def test_a_read_only_folder(small_disk: Path) -> None:
    (small_disk / "data" / "tiny").mkdir(parents=True)
    remount(small_disk, "ro")
    for out in (small_disk / "data", small_disk / "new"):
        assert run(out) == (2, [f"error: cannot write {out / 'tiny'}: the file system is read-only"])


def test_a_second_process_is_told_who_holds_the_folder(whole: Content, tmp_path: Path) -> None:
    def slowly() -> None:
        FakeCamera.pause = 0.01

    first = start(tmp_path / "data", slowly)
    while not (tmp_path / "data" / "tiny" / ".lock.owner").exists():
        time.sleep(0.005)
    code, (line,) = run(tmp_path / "data")
    assert code == 2
    owner = f"process {first.pid} on {platform.node()}"
    assert line == f"error: {tmp_path / 'data' / 'tiny'} is in use by {owner}; wait until it ends, or stop it"
    assert first.end() == (0, [])
    assert content(tmp_path / "data") == whole


@pytest.mark.parametrize("gap", [0.0, 0.0003, 0.003, 0.03, 0.3])
def test_ctrl_c_twice(whole: Content, tmp_path: Path, gap: float) -> None:
    out = tmp_path / "data"

    def slowly() -> None:
        FakeCamera.pause = 0.05

    child = start(out, slowly)
    while not list(out.glob("tiny/.slices/*/whole.bag")):
        time.sleep(0.005)
    for _ in range(2):
        os.kill(child.pid, signal.SIGINT)
        time.sleep(gap)
    code, lines = child.end()
    assert code == 130
    (line,) = lines
    assert line.startswith("error: interrupted; the finished part is kept, resume with: fieldtruth generate ")
    assert no_bag(out)
    assert run(out) == (0, [])
    assert content(out) == whole


def test_an_exception_of_a_worker(whole: Content, tmp_path: Path) -> None:
    def breaking() -> None:
        FakeCamera.render = fail  # type: ignore[assignment, method-assign]

    def fail(self: FakeCamera, world_from_optical: object, robot: object, stamp_ns: int) -> NoReturn:
        raise MemoryError("out of memory")

    code, (line,) = run(tmp_path / "data", breaking)
    assert code == 2
    assert re.match(r"error: between \d+(\.\d)? and \d+(\.\d)? s of the recording: MemoryError", line)
    assert " s of the recording: MemoryError: out of memory (test_faults.py, line " in line
    assert no_bag(tmp_path / "data")
    assert run(tmp_path / "data") == (0, [])
    assert content(tmp_path / "data") == whole


def test_a_clock_that_jumps(whole: Content, tmp_path: Path) -> None:
    def jumping() -> None:
        years = random.Random(1)
        time.time = lambda: years.uniform(-3e9, 3e9)
        time.time_ns = lambda: int(time.time() * 1e9)

    assert run(tmp_path / "data", jumping) == (0, [])
    assert content(tmp_path / "data") == whole


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.ENOLCK, errno.ENOTSUP])
def test_a_folder_without_flock(whole: Content, tmp_path: Path, number: int) -> None:
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    def without_flock() -> None:
        fcntl.flock = refuse

    def slowly() -> None:
        without_flock()
        FakeCamera.pause = 0.05

    out = tmp_path / "data"
    killed = start(out, slowly)
    while not list(out.glob("tiny/.slices/*/whole.bag")):
        time.sleep(0.002)
    code, (line,) = run(out, without_flock)
    assert code == 2
    assert f"is in use by process {killed.pid} on " in line
    os.kill(killed.pid, signal.SIGKILL)
    killed.end()
    assert run(out, without_flock) == (0, [])
    assert content(out) == whole
