# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shards of a campaign as array tasks of a real SLURM on the loopback interface, and by submitit's local executor."""

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Final

import pytest

from fieldtruth import cli

ROOT: Final = Path(__file__).parents[2]
CAMPAIGN: Final = """\
name: few
environments: [park]
lidar: false
cameras: false
runs: 3
routes: built-in
seconds: {uniform: [0.3, 0.6]}
"""


def documented_script() -> str:
    """The batch file of docs/cluster.md."""
    text = (ROOT / "docs" / "cluster.md").read_text(encoding="utf-8")
    found = re.search(r'```bash title="fieldtruth.sbatch"\n(.*?)```', text, flags=re.S)
    assert found is not None
    return found[1]


def test_the_documented_batch_file_has_15_lines() -> None:
    assert documented_script().count("\n") == 15


def bags(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.rglob("*.bag")}


def status(out: Path, capsys: pytest.CaptureFixture[str]) -> str:
    capsys.readouterr()
    assert cli.main(["status", str(out), "--missing", "--format", "slurm"]) == 0
    return capsys.readouterr().out.strip()


@pytest.fixture
def local(tmp_path: Path) -> dict[str, bytes]:
    """Bags of the campaign from one process."""
    (tmp_path / "campaign.yaml").write_text(CAMPAIGN)
    words = ["generate", str(tmp_path / "campaign.yaml"), "--no-estimate", "--out", str(tmp_path / "local")]
    assert cli.main(words) == 0
    return bags(tmp_path / "local")


@pytest.mark.slurm
def test_array_tasks_make_the_shards_and_the_rest_after_a_kill(
    local: dict[str, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if missing := [name for name in ("sinfo", "slurmctld", "slurmd", "munged") if shutil.which(name) is None]:
        pytest.skip(f"not installed: {', '.join(missing)} (apt-get install slurm-wlm munge)")
    if os.geteuid() != 0:
        pytest.skip("SLURM's daemons need root")
    (tmp_path / "fieldtruth.sbatch").write_text(documented_script())
    out = tmp_path / "data"
    array(tmp_path, "1-2")
    assert status(out, capsys) == "3"
    array(tmp_path, "3", kill=True)
    assert status(out, capsys) == "3"
    array(tmp_path, status(out, capsys))
    assert status(out, capsys) == ""
    assert bags(out) == local


def array(folder: Path, tasks: str, *, kill: bool = False) -> None:
    """Submit the batch file and wait for its tasks; ``kill`` ends the last one when it has begun."""
    environment = folder / "venv" / "bin"
    environment.mkdir(parents=True, exist_ok=True)
    paths = os.pathsep.join(filter(None, sys.path))
    (environment / "activate").write_text(f"export PYTHONPATH={paths}\nPATH={environment}:$PATH\n")
    (environment / "fieldtruth").write_text(f'#!/bin/sh\nexec {sys.executable} -m fieldtruth.cli "$@"\n')
    (environment / "fieldtruth").chmod(0o755)
    job = f"sbatch --wait --array={tasks} --cpus-per-task=1 --mem=100M fieldtruth.sbatch campaign.yaml data"
    if kill:
        begun = "while [ ! -e data/few_00003 ]; do sleep 0.05; done"
        job = f"{job} & {begun}; scancel --signal=KILL --full --name=fieldtruth; wait"
    done = subprocess.run(
        [str(ROOT / "tests/cluster/slurm.sh"), f"/tmp/slurm-{os.getpid()}-{time.time_ns()}", "sh", "-c", job],
        cwd=folder,
        env=os.environ | {"VENV": str(environment.parent), "SHARDS": "3"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    logs = "".join(path.read_text() for path in folder.glob("fieldtruth_*.log"))
    assert kill or done.returncode == 0, done.stdout + done.stderr + logs


@pytest.mark.slow
def test_submitit_makes_the_shards(local: dict[str, bytes], tmp_path: Path) -> None:
    submitit = pytest.importorskip("submitit")
    executor = submitit.AutoExecutor(folder=tmp_path / "logs", cluster="local")
    executor.update_parameters(timeout_min=5)
    shard = ["generate", str(tmp_path / "campaign.yaml"), "--out", str(tmp_path / "data"), "--no-estimate", "--shard"]
    jobs = executor.map_array(cli.main, [[*shard, f"{i}/3"] for i in (1, 2, 3)])
    assert [job.result() for job in jobs] == [0, 0, 0]
    assert bags(tmp_path / "data") == local
