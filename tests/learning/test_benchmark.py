# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The fixed benchmark of Reach: its list, what its tasks count, resuming, intervals, policies of users, bad input."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drive_worlds import make_world, obstacle
from scipy.stats import binomtest

import fieldtruth as ft
from fieldtruth import cli
from fieldtruth.core.errors import ConfigurationError, OutputError
from fieldtruth.learning import benchmark
from fieldtruth.learning.benchmark import BenchmarkTask, benchmark_tasks, drive_task, score
from fieldtruth.learning.config import TEST_WORLDS
from fieldtruth.learning.environment import Reach
from fieldtruth.learning.policies import policy_of

FREE = BenchmarkTask(0, "blocks", TEST_WORLDS, 0.2, (-10.0, -10.0), 0.0, (0.0, -10.0), 10.12)
BLOCKED = BenchmarkTask(1, "blocks", TEST_WORLDS, 0.5, (0.0, 0.0), 0.0, (12.0, 0.0), 15.25)
STRAIGHT, PATH = policy_of("straight"), policy_of("path")


@pytest.fixture(scope="module")
def blocks() -> Any:
    """Level ground with a wall across the straight line of ``BLOCKED``."""
    return make_world(size=(40.0, 40.0), obstacles=[obstacle("wall", "box", (1.0, 6.0, 2.0), 6.0, 0.0)])


@pytest.fixture
def here(blocks: Any, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """A list of two tasks that are driven in this process; the numbers of those that were."""
    driven: list[int] = []

    def results(groups: Sequence[Sequence[BenchmarkTask]], policy: Any, workers: int) -> Iterator[list[Any]]:
        for tasks in groups:
            env = Reach(world=blocks, observation=policy.observation)
            driven.extend(task.number for task in tasks)
            yield [drive_task(env, task, policy) for task in tasks]

    monkeypatch.setattr(benchmark, "benchmark_tasks", lambda: [FREE, BLOCKED])
    monkeypatch.setattr(benchmark, "_results", results)
    return driven


POLICIES = """
import numpy as np

def act(observation):
    return observation["state"][:2] * 0.0

act.observation = ("state", "lidar")

class Agent:
    observation = "state"

    def __init__(self):
        self.steps = 0

    def __call__(self, observation):
        self.steps += 1
        return np.array([0.5, 0.0]) * (self.steps > 5)

def broken(observation):
    raise ValueError("no such layer")

number = 3
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "agent.py"
    path.write_text(POLICIES)
    return path


def test_the_list_has_400_tasks_in_40_unseen_worlds_at_three_difficulties() -> None:
    tasks = benchmark_tasks()
    assert [task.number for task in tasks] == [*range(400)]
    worlds = Counter((task.environment, task.world) for task in tasks)
    assert len(worlds) == 40
    assert {*worlds.values()} == {10}
    assert {environment for environment, _ in worlds} < {*ft.list_environments()}
    assert min(task.world for task in tasks) >= TEST_WORLDS
    assert Counter(task.difficulty for task in tasks) == {0.2: 134, 0.5: 133, 0.8: 133}
    straight = np.array([np.subtract(task.goal, task.start) for task in tasks])
    shortest = np.array([task.shortest for task in tasks])
    assert (shortest > 0.95 * np.hypot(*straight.T) - 0.5).all()
    assert len({task.start for task in tasks}) > 390


def test_a_wall_stops_the_straight_follower_and_not_the_one_along_the_path(blocks: Any) -> None:
    found = {}
    for policy in (STRAIGHT, PATH):
        env = Reach(world=blocks, observation=policy.observation)
        found[policy.name] = [drive_task(env, task, policy) for task in (FREE, BLOCKED)]
    assert [each["success"] for each in found["straight"]] == [1.0, 0.0]
    assert [each["success"] for each in found["path"]] == [1.0, 1.0]
    assert found["straight"][1]["cause"] == "hit an obstacle"
    assert found["straight"][1]["collisions"] == 1.0
    assert found["path"][0]["spl"] > 0.95


def test_tasks_that_a_file_has_are_not_driven_again(here: list[int], tmp_path: Path) -> None:
    out = tmp_path / "straight.jsonl"
    whole = score(STRAIGHT, out)
    assert here == [0, 1]
    assert score(STRAIGHT, out) == whole
    assert here == [0, 1]
    text = out.read_text()
    out.write_text("".join(text.splitlines(keepends=True)[:-1]))  # interrupted before the last task
    assert score(STRAIGHT, out) == whole
    assert here == [0, 1, 1]
    assert out.read_text() == text
    with pytest.raises(OutputError, match="results of another policy, observation; choose another file"):
        score(PATH, out)
    assert out.read_text() == text
    assert [each["success"] for each in score(PATH, out, overwrite=True)] == [1.0, 1.0]


def test_results_of_a_file_that_was_edited_are_not_taken_and_a_policy_that_fails_loses_none(
    here: list[int], file: Path, tmp_path: Path
) -> None:
    out = tmp_path / "agent.jsonl"
    score(policy_of(f"{file}:Agent"), out)
    text = out.read_text()
    with pytest.raises(ConfigurationError, match="no such layer"):
        score(policy_of(f"{file}:broken"), out, overwrite=True)
    assert out.read_text() == text
    file.write_text(POLICIES.replace("0.5", "0.6"))
    with pytest.raises(OutputError, match="results of another file; choose"):
        score(policy_of(f"{file}:Agent"), out)
    assert out.read_text() == text


def test_a_module_is_loaded_once(tmp_path: Path) -> None:
    counted = tmp_path / "counted.py"
    counted.write_text(f"open({str(tmp_path / 'log')!r}, 'a').write('x')\n\ndef act(seen):\n    return seen\n")
    policy = policy_of(f"{counted}:act")
    assert policy.load()() is policy.load()()
    assert (tmp_path / "log").read_text() == "x"


def test_another_world_than_that_of_the_list_is_an_error(blocks: Any) -> None:
    env = Reach(world=blocks)
    with pytest.raises(ConfigurationError, match=r"has 10\.12 m instead of 11\.00 m"):
        drive_task(env, FREE._replace(shortest=11.0), STRAIGHT)


def test_the_table_counts_by_difficulty(here: list[int], tmp_path: Path) -> None:
    rows = benchmark.table(score(STRAIGHT, tmp_path / "a.jsonl")).splitlines()
    assert [row.split(" | ")[0].strip("| ") for row in rows[2:]] == ["0.2", "0.5", "all"]
    assert "| 2 | 0.50 (0.09 to 0.91) |" in rows[-1]
    assert rows[-1].endswith("1 hit an obstacle |")


@pytest.mark.parametrize(("hits", "count"), [(0, 10), (3, 10), (10, 10), (131, 400)])
def test_intervals_of_shares_are_wilsons(hits: int, count: int) -> None:
    found, expected = benchmark.share_interval(hits, count), binomtest(hits, count).proportion_ci(method="wilson")
    assert found == pytest.approx((hits / count, expected.low, expected.high), abs=1e-6)


def test_intervals_of_means_hold_the_true_one_19_times_in_20() -> None:
    samples = np.random.default_rng(0).exponential(2.0, (2000, 100))
    held = [low < 2.0 < high for _, low, high in map(benchmark.mean_interval, samples)]
    assert 0.92 < np.mean(held) < 0.96


def test_policies_of_a_file_say_what_they_observe(file: Path) -> None:
    assert policy_of(f"{file}:act").observation == ("state", "lidar")
    assert policy_of(f"{file}:act", ["elevation"]).observation == "elevation"
    agent = policy_of(f"{file}:Agent")
    assert agent.observation == "state"
    first, second = agent.load()(), agent.load()()
    assert first is not second


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["fast"], "unknown policy 'fast'"),
        (["{}/none.py:act"], "no such file"),
        (["{}/agent.py:nothing"], "has no attribute 'nothing'"),
        (["{}/agent.py:number"], "must be a function or a class, got int"),
        (["{}/agent.py:act", "--observation", "smell"], "unknown observation 'smell'"),
        (["nowhere_at_all:act"], "No module named 'nowhere_at_all'"),
        (["straight", "--worlds", "0"], "--worlds"),
        (["straight", "--out", "{}/no/folder/a.jsonl"], "cannot write"),
        (["straight", "--out", "{}/agent.py"], "has other content than results"),
        (["{}/agent.py:broken", "--out", "{}/broken.jsonl"], "ValueError: no such layer"),
    ],
)
@pytest.mark.usefixtures("here")
def test_bad_input_is_one_line(arguments: list[str], text: str, file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        raise SystemExit(cli.main(["score", *(each.replace("{}", str(file.parent)) for each in arguments)]))
    assert ended.value.code == 2
    told = capsys.readouterr().err.strip().splitlines()
    assert text in told[-1]
    assert "Traceback" not in "".join(told)


@pytest.mark.slow
def test_the_first_world_is_that_of_the_list_and_its_paths_can_be_driven(tmp_path: Path) -> None:
    """In a process of its own."""
    out = tmp_path / "path.jsonl"
    results = score(PATH, out, worlds=1)
    assert sum(each["success"] for each in results) >= 9
    assert len(out.read_text().splitlines()) == 11
    assert json.loads(out.read_text().splitlines()[0])["digest"] == benchmark.list_digest()


CLI = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs inherit that it is ignored
from fieldtruth.cli import main
if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="process groups are those of POSIX")
def test_ctrl_c_at_a_terminal_is_one_line_and_keeps_what_is_done(tmp_path: Path) -> None:
    """A terminal sends it to all processes of the group."""
    script, out = tmp_path / "cli.py", tmp_path / "straight.jsonl"
    script.write_text(CLI)
    command = [sys.executable, str(script), "score", "straight", "--worlds", "3", "--workers", "1", "--out", str(out)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)
    while not out.exists():
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.1)
    os.killpg(process.pid, signal.SIGINT)
    told = process.communicate()[1]
    assert process.returncode == 130
    assert told.splitlines()[-1] == "error: interrupted"
    assert "Traceback" not in told
    assert len(out.read_text().splitlines()) == 11
