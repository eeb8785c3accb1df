# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A campaign from beginning to end with fake sensors: what is made, recorded, resumed, left and refused."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from record_fakes import SMALL, make_experiment, make_track, use_fakes

from fieldtruth import cli
from fieldtruth.bag.decode import count_messages
from fieldtruth.campaign import estimate
from fieldtruth.campaign.config import Campaign
from fieldtruth.campaign.draw import Shard
from fieldtruth.campaign.estimate import Figures
from fieldtruth.campaign.files import load_campaign
from fieldtruth.campaign.state import MANIFEST, Manifest, State, digest_of
from fieldtruth.campaign.task import Options, generate_campaign, run_campaign
from fieldtruth.core.errors import OutputError, RouteError
from fieldtruth.core.locks import locked
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.pipeline import generate
from fieldtruth.world.model import World

NAMES = ("a", "b", "c")
QUICK = Options(workers=1, measure=False)


@pytest.fixture(autouse=True)
def _fakes(monkeypatch: pytest.MonkeyPatch) -> None:
    use_fakes(monkeypatch)


def campaign(**values: Any) -> Campaign:
    experiments = [make_experiment(0.1, seed=k, rig=SMALL, name=name) for k, name in enumerate(NAMES)]
    return Campaign(name="few", experiments=tuple(experiments), **values)


def run(planned: Campaign, out: Path, options: Options = QUICK) -> tuple[dict[str, State], list[str]]:
    said: list[str] = []
    states = generate_campaign(planned, out, options, say=said.append)
    return {state.run.name: state for state in states}, said


def kinds(states: dict[str, State]) -> list[str]:
    return [state.kind.value for state in states.values()]


def bags(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in out.rglob("*.bag")}


def count_calls(monkeypatch: pytest.MonkeyPatch, fail: Callable[[Experiment], BaseException | None]) -> list[str]:
    """Names of the experiments that are driven; the drive raises what ``fail`` returns."""
    calls: list[str] = []

    def drive(world: World, experiment: Experiment, _: object) -> Track:
        calls.append(experiment.name)
        error = fail(experiment)
        if error is not None:
            raise error
        return make_track(world, experiment)

    monkeypatch.setattr("fieldtruth.simulation.motion.plan_and_drive", drive)
    return calls


def test_each_run_is_that_of_generate_with_a_manifest(tmp_path: Path) -> None:
    states, said = run(campaign(split={"train": 0.7, "test": 0.3}), tmp_path / "out")
    assert kinds(states) == ["done"] * 3
    assert {name.split("/")[0] for name in states} == {"train", "test"}
    for name, state in states.items():
        folder = tmp_path / "out" / name
        alone = generate(state.run.experiment, tmp_path / "alone", workers=1)
        bag = folder / alone.name
        assert bag.read_bytes() == alone.read_bytes()
        stored = json.loads((folder / MANIFEST).read_text())
        assert stored["sha256"] == hashlib.sha256(alone.read_bytes()).hexdigest()
        assert stored["bytes"] == len(alone.read_bytes())
        assert stored["messages"] == dict(count_messages(alone))
        assert stored["simulated_s"] == pytest.approx(0.1)
        assert stored["experiment"] == digest_of(state.run.experiment)
    assert said[0] == f"{tmp_path / 'out'}: 0 of 3 done, 3 missing"
    assert said[-1] == f"{tmp_path / 'out'}: 3 of 3 done"


def test_the_same_command_makes_only_the_rest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = count_calls(monkeypatch, lambda e: KeyboardInterrupt() if e.name == "b" else None)
    with pytest.raises(KeyboardInterrupt):
        run(campaign(), tmp_path)
    assert calls == ["a", "b"]
    calls = count_calls(monkeypatch, lambda _: None)
    states, _ = run(campaign(), tmp_path)
    assert calls == ["b", "c"]
    assert kinds(states) == ["done"] * 3
    run(campaign(), tmp_path)
    assert calls == ["b", "c"]


def test_a_failure_is_recorded_and_stops_no_other_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    errors = {"a": RouteError("no free\nroute"), "b": ZeroDivisionError("x")}
    calls = count_calls(monkeypatch, lambda e: errors.get(e.name))
    states, said = run(campaign(), tmp_path)
    assert kinds(states) == ["failed", "failed", "done"]
    assert [states["a"].reason, states["b"].reason] == ["no free route", "ZeroDivisionError: x"]
    assert next(line for line in said if "failed:" in line).startswith("1 of 3: a failed: no free route")
    errors.clear()
    states, _ = run(campaign(), tmp_path)
    assert calls == ["a", "b", "c", "b"], "a would fail again"
    assert kinds(states) == ["failed", "done", "done"]
    assert not (tmp_path / "b" / "failure.json").exists()
    monkeypatch.setattr("fieldtruth.__version__", "0.1.1")
    states, _ = run(campaign(), tmp_path)
    assert kinds(states) == ["done"] * 3, "another version tries again"


def test_a_full_disk_stops_the_campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = count_calls(monkeypatch, lambda _: OutputError("cannot write x: no space left"))
    with pytest.raises(OutputError, match="no space left"):
        run(campaign(), tmp_path)
    assert calls == ["a"]
    assert not list(tmp_path.rglob("failure.json"))


def test_what_a_kill_leaves_beside_a_finished_bag_is_removed(tmp_path: Path) -> None:
    run(campaign(), tmp_path)
    whole = sorted(path.name for path in (tmp_path / "a").rglob("*"))
    (tmp_path / "a" / MANIFEST).unlink()
    for left in (".slices/key/000000.bag", f".{MANIFEST}.host.1.part", ".lock.owner", "..lock.owner.host.1.part"):
        (tmp_path / "a" / left).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "a" / left).write_bytes(b"x")
    states, _ = run(campaign(), tmp_path)
    assert kinds(states) == ["done"] * 3
    assert sorted(path.name for path in (tmp_path / "a").rglob("*")) == whole


def test_broken_runs_are_reported_and_made_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(campaign(), tmp_path)
    whole = bags(tmp_path)
    (tmp_path / "a" / "a.bag").write_bytes(whole["a.bag"][:-10])
    (tmp_path / "b" / "b.bag").write_bytes(bytes(len(whole["b.bag"])))
    (tmp_path / "c" / MANIFEST).write_text("{")
    assert cli.main(["status", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{tmp_path}: 0 of 3 done, 3 broken")
    assert [line.split(":")[0] for line in lines[1:]] == ["  broken   a", "  broken   b", "  broken   c"]
    states, _ = run(campaign(), tmp_path)
    assert kinds(states) == ["done"] * 3
    assert bags(tmp_path) == whole
    (tmp_path / "a" / "a.bag").unlink()
    states, _ = run(campaign(), tmp_path)
    assert kinds(states) == ["done"] * 3
    assert bags(tmp_path) == whole


def test_a_changed_byte_is_found_by_the_checksum(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(campaign(), tmp_path)
    bag = tmp_path / "c" / "c.bag"
    data = bytearray(bag.read_bytes())
    data[len(data) // 3] ^= 1
    bag.write_bytes(data)
    cli.main(["status", str(tmp_path)])
    assert "3 of 3 done" in capsys.readouterr().out
    cli.main(["status", str(tmp_path), "--checksums", "--missing", "--format", "lines"])
    assert capsys.readouterr().out == "c\n"


def test_a_finished_bag_without_a_manifest_gets_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(campaign(), tmp_path)
    (tmp_path / "a" / MANIFEST).unlink()
    calls = count_calls(monkeypatch, lambda _: None)
    states, _ = run(campaign(), tmp_path)
    assert calls == []
    assert kinds(states) == ["done"] * 3


def test_a_run_of_another_process_is_left_to_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "b").mkdir()
    with locked(tmp_path / "b"):
        states, _ = run(campaign(), tmp_path)
        assert kinds(states) == ["done", "running", "done"]
        cli.main(["status", str(tmp_path), "--missing", "--format", "lines"])
        assert capsys.readouterr().out == "\n"
    cli.main(["status", str(tmp_path), "--missing", "--format", "slurm"])
    assert capsys.readouterr().out == "2\n"


def test_shards_make_all_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    planned = campaign()
    _, said = run(planned, tmp_path, QUICK._replace(shard=Shard(2, 3)))
    assert said[-1].endswith("1 of 1 done")
    cli.main(["status", str(tmp_path), "--missing", "--format", "slurm"])
    assert capsys.readouterr().out == "1,3\n"
    cli.main(["status", str(tmp_path), "--missing", "--format", "json"])
    assert [state["run"] for state in json.loads(capsys.readouterr().out)] == ["a", "c"]
    for part in (1, 3):
        run(planned, tmp_path, QUICK._replace(shard=Shard(part, 3)))
    cli.main(["status", str(tmp_path)])
    assert capsys.readouterr().out.startswith(f"{tmp_path}: 3 of 3 done; ")


def test_another_campaign_is_refused_and_a_longer_one_continues(tmp_path: Path) -> None:
    values: dict[str, Any] = {"name": "d", "environments": ["park"], "seeds": {"integers": [0, 9]}, "seconds": 0.1}
    values |= {"cameras": False, "lidar": False}
    run(Campaign(runs=2, **values), tmp_path)
    before = bags(tmp_path)
    with pytest.raises(
        OutputError, match=r"holds another campaign \(different: seed\); choose another --out, or replace"
    ):
        run(Campaign(runs=2, seed=1, **values), tmp_path)
    with pytest.raises(OutputError, match="holds another campaign"):
        run(Campaign(runs=1, **values), tmp_path)
    states, _ = run(Campaign(runs=3, **values), tmp_path)
    assert len(states) == 3
    assert {name: bags(tmp_path)[name] for name in before} == before
    states, _ = run(Campaign(runs=2, seed=1, **values), tmp_path, QUICK._replace(overwrite=True))
    assert kinds(states) == ["done"] * 2


def test_an_unreadable_stored_campaign_is_refused(tmp_path: Path) -> None:
    (tmp_path / "campaign.yaml").write_text("name: [")
    with pytest.raises(OutputError, match=r"holds another campaign \(its campaign.yaml cannot be read: "):
        run(campaign(), tmp_path)


def test_a_disk_that_cannot_hold_it_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    figures = Figures(
        world_s=1, fixed_s=1, drive_s_per_s=0, sense_s_per_s=1, bytes_once=0, bytes_per_s=10e9, memory=10**6
    )
    monkeypatch.setattr(estimate, "figures_of", lambda *_: figures)
    monkeypatch.setattr(estimate, "free_bytes", lambda _: 2e9)
    calls = count_calls(monkeypatch, lambda _: None)
    with pytest.raises(
        OutputError, match=r"needs about 3\.0 GB, but 2\.0 GB are free; free some space, choose another"
    ):
        run(campaign(), tmp_path, Options(workers=1))
    assert calls == []


def test_the_stored_campaign_is_enough(tmp_path: Path) -> None:
    run(campaign(seconds=0.05, lidar=False), tmp_path)
    stored = load_campaign(tmp_path / "campaign.yaml")
    assert stored == campaign(seconds=0.05, lidar=False)
    states, _ = run(stored, tmp_path)
    assert kinds(states) == ["done"] * 3
    manifest = Manifest.read(tmp_path / "a" / MANIFEST)
    assert manifest is not None
    assert manifest.simulated_s == pytest.approx(0.05)


def test_exit_code_is_1_if_a_run_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    count_calls(monkeypatch, lambda e: RouteError("blocked") if e.name == "lake_2" else None)
    command = ["generate", "all", "--seconds", "0.05", "--no-cameras", "--out", str(tmp_path), "--no-estimate"]
    assert cli.main(command) == 1
    assert "lake_2 failed: blocked" in capsys.readouterr().out
    assert cli.main(["status", str(tmp_path)]) == 0
    assert "7 of 8 done, 1 failed" in capsys.readouterr().out


def test_a_campaign_from_python_is_that_of_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    states = run_campaign(campaign(), tmp_path / "python")
    assert [state.kind for state in states] == ["done"] * 3
    assert capsys.readouterr().out == ""
    run(campaign(), tmp_path / "options")
    assert bags(tmp_path / "python") == bags(tmp_path / "options")
    assert len(run_campaign(campaign(), tmp_path / "shard", shard=(1, 3))) == 1
    with pytest.raises(OutputError, match="it must be a folder"):
        run_campaign(campaign(), "")
