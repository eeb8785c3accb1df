# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Real runs in processes side by side: the bytes of one process, also after kills at random moments."""

import os
import random
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from small_park import in_small_park

from fieldtruth.bag.provenance import sha256_of
from fieldtruth.bag.run import open_run
from fieldtruth.campaign import jobs, task
from fieldtruth.campaign.config import Campaign
from fieldtruth.campaign.draw import PlannedRun, draw
from fieldtruth.campaign.estimate import estimate
from fieldtruth.campaign.files import dump_campaign, load_campaign, with_changes
from fieldtruth.campaign.state import Failure, Kind, Manifest, failure_of, state_of
from fieldtruth.campaign.task import Options, generate_campaign
from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.core.locks import LOCK_OWNER
from fieldtruth.core.progress import Silent
from fieldtruth.experiment.rig import paper_rig
from fieldtruth.pipeline import generate
from fieldtruth.sensors.camera.config import StereoConfig


def park(seconds: float, count: int = 2) -> Campaign:
    """Runs of a small park without cameras."""
    rig = paper_rig(cameras=StereoConfig(enabled=False))
    experiments = [in_small_park(name=f"p{k}", seconds=seconds - 0.1 * k, rig=rig) for k in range(count)]
    return Campaign(name="parks", experiments=tuple(experiments))


def with_tiny_cameras(campaign: Campaign) -> Campaign:
    return campaign.model_copy(update={"switches": {"cameras": True}, "rigs": {"cameras": {"width": 64, "height": 48}}})


def files(out: Path) -> dict[str, str]:
    """Digests of all files of the runs but the manifests, which have times in them."""
    found = (p for p in out.rglob("*") if p.is_file() and p.name != "manifest.json")
    return {str(p.relative_to(out)): sha256_of(p) for p in found}


@pytest.mark.parametrize("parallel", [False, True], ids=["one by one", "in a process"])
def test_warnings_are_one_line_and_name_their_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], parallel: bool
) -> None:
    """Both runs say the same words, which nothing takes for a repetition."""

    def warn(run: PlannedRun, *args: Any, **options: Any) -> Failure:
        warnings.warn("no trail\n  here", FieldtruthWarning, stacklevel=1)
        return failure_of(run.experiment, "", final=True)

    runs = draw(park(0.5))
    if parallel:
        channel = Mock(recv=Mock(side_effect=[*runs, EOFError]))  # then the parent has ended
        monkeypatch.setattr(jobs, "run_one", warn)
        monkeypatch.setattr(signal, "signal", lambda *args: None)
        jobs._work(channel, tmp_path, 1, False)
    else:
        monkeypatch.setattr(task, "run_one", warn)
        generate_campaign(park(0.5), tmp_path, Options(measure=False), say=lambda line: None)
    printed = capsys.readouterr().err.splitlines()
    assert printed == [f"warning: {run.name}: no trail here" for run in runs]


@pytest.mark.slow
def test_two_jobs_make_two_runs(tmp_path: Path) -> None:
    said: list[str] = []
    states = generate_campaign(park(0.6), tmp_path, Options(jobs=2, measure=False), say=said.append)
    assert [state.kind for state in states] == [Kind.DONE, Kind.DONE]
    assert sorted(line.split(":")[1].strip() for line in said[1:-1]) == ["p0", "p1"]
    assert [open_run(tmp_path / name).counts["/os1_cloud_node/points"] for name in ("p0", "p1")] == [6, 5]


@pytest.mark.slow
def test_a_killed_job_costs_its_run_only(tmp_path: Path) -> None:
    runs = draw(park(0.5, 3))
    ended = jobs.make_runs(runs, tmp_path, jobs=1, workers=1)
    outcomes = [next(ended)[1]]
    owner = tmp_path / "p1" / LOCK_OWNER
    while not owner.exists():  # until the second run has begun
        time.sleep(0.001)
    os.kill(int(owner.read_text().split()[1]), signal.SIGKILL)
    outcomes += [outcome for _, outcome in ended]
    assert [type(outcome) for outcome in outcomes] == [Manifest, Failure, Manifest]
    assert "its process ended early (signal 9, perhaps for lack of memory" in str(outcomes[1])
    state = state_of(runs[1], tmp_path)
    assert (state.kind, state.is_left) == (Kind.FAILED, True)


def start(campaign: Path, out: Path) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "fieldtruth.cli", "generate", str(campaign), "--out", str(out)]
    command += ["--jobs", "2", "--no-estimate"]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )


@pytest.mark.slow
def test_kills_at_random_moments_leave_the_bytes_of_an_undisturbed_campaign(tmp_path: Path) -> None:
    file = tmp_path / "campaign.yaml"
    file.write_text(dump_campaign(with_tiny_cameras(park(0.8, 2))))
    whole = start(file, tmp_path / "whole")
    begun = time.monotonic()
    assert whole.wait() == 0, whole.communicate()[0]
    took = time.monotonic() - begun
    rng = random.Random(11)
    for k in range(3):  # each way to end it once
        process = start(file, tmp_path / "out")
        time.sleep(rng.uniform(0.05, 0.6) * took)
        if k == 0:  # the parent alone: its jobs end with it
            os.kill(process.pid, signal.SIGKILL)
        elif k == 1:
            os.killpg(process.pid, signal.SIGKILL)
        else:  # Ctrl-C
            os.killpg(process.pid, signal.SIGINT)
        text, _ = process.communicate()  # until the last job has ended
        if k == 2 and process.returncode != 0:
            assert process.returncode == 130
            assert text.count("error:") == 1, text
            assert "Traceback" not in text
        states = [state_of(run, tmp_path / "out") for run in draw(load_campaign(file))]
        assert {state.kind for state in states} <= {Kind.DONE, Kind.MISSING}
    last = start(file, tmp_path / "out")
    assert last.wait() == 0, last.communicate()[0]
    assert files(tmp_path / "out") == files(tmp_path / "whole")
    alone = generate(draw(load_campaign(file))[1].experiment, tmp_path / "alone", workers=1)
    assert sha256_of(tmp_path / "out" / "p1" / "p1.bag") == sha256_of(alone)


@pytest.mark.slow
def test_an_estimate_of_bytes_is_near_the_truth(tmp_path: Path) -> None:
    planned = with_changes(park(3.0), seconds=2.0)
    runs = draw(planned)
    expected = estimate(runs, tmp_path / "out", jobs=1, workers=1, progress=Silent())
    assert list((tmp_path / "out").glob("*")) == []  # there is no such folder if the figures were cached
    states = generate_campaign(planned, tmp_path / "out", Options(workers=1, measure=False), say=lambda _: None)
    size = sum(state.manifest.bytes for state in states if state.manifest is not None)
    assert expected.bytes == pytest.approx(size, rel=0.1)
    assert expected.time_s > 0
    assert 2e8 < expected.memory < 3e9
    assert expected.unknown == 0
