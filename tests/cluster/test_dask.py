# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs on a real scheduler with worker processes: the bytes of a local run, whatever happens to the processes."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from record_fakes import make_experiment, use_fakes
from small_park import in_small_park, small_park

pytest.importorskip("distributed")

from dask.config import set as dask_config
from dask_processes import Processes, processes, wait_until
from fake_worker import opened_runs

from fieldtruth import cli
from fieldtruth.campaign.config import Campaign
from fieldtruth.campaign.task import Options, generate_campaign
from fieldtruth.cluster import cluster_engine
from fieldtruth.core.errors import ClusterError, FieldtruthWarning, RouteError
from fieldtruth.pipeline import generate, generate_by
from fieldtruth.sense.leaning import LEAN_KNOT_NS
from fieldtruth.simulation.company import Company

pytestmark = pytest.mark.slow
SECONDS = 6.0
SLOW = {"FAKE_PAUSE": "0.02"}  # a slice takes a second


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[Processes]:
    with processes(tmp_path / "dask") as started:
        yield started


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Bag of a local run."""
    with pytest.MonkeyPatch.context() as patch:
        use_fakes(patch)
        return generate(make_experiment(SECONDS), tmp_path_factory.mktemp("local"), workers=1).read_bytes()


def run(dask: Processes, out: Path) -> bytes:
    with cluster_engine(dask.file) as engine:
        return generate_by(engine, make_experiment(SECONDS), out, workers=1).read_bytes()


@contextmanager
def running(dask: Processes, out: Path, until: str = "??????.bag") -> Iterator[Future[bytes]]:
    """Yield a run in another thread, once there is a file in the folder of slices, by default the first slice."""
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(run, dask, out)
        wait_until(lambda: list(out.glob(f"tiny/.slices/*/{until}")) or future.done())
        assert not future.done(), future.result()
        yield future


def test_bytes_are_those_of_a_local_run(dask: Processes, whole: bytes, tmp_path: Path) -> None:
    dask.scheduler()
    for _ in range(2):
        dask.worker()
    assert run(dask, tmp_path / "cluster") == whole
    files = sorted(path.name for path in (tmp_path / "cluster" / "tiny").iterdir())
    assert files == ["DATASET.md", "SHA256SUMS", "experiment.yaml", "made_by.json", "tiny.bag"]


def test_the_command_makes_a_run_in_processes_of_this_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    command = ["generate", "park_1", "--seconds", "2", "--no-cameras", "--out"]
    with monkeypatch.context() as patch:
        use_fakes(patch)
        assert cli.main([*command, str(tmp_path / "local")]) == 0
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    with dask_config({"distributed.worker.preload": [str(Path(__file__).with_name("fake_worker.py"))]}):
        assert cli.main([*command, str(tmp_path / "cluster"), "--local-cluster", "2"]) == 0
    name = "park_1/park_1.bag"
    assert (tmp_path / "cluster" / name).read_bytes() == (tmp_path / "local" / name).read_bytes()


def test_actors_and_plants_that_yield_move_on_workers_as_here(tmp_path: Path) -> None:
    """The robot begins in high grass."""
    experiment = in_small_park(
        seconds=0.4,
        rig={"sensors": [{"kind": "imu"}, {"kind": "gnss"}, {"kind": "lidar", "columns": 64, "rings": 16}]},
        route={"metres": {"start": [-5.5, 9.0], "waypoints": [[-1.5, 9.0]]}},
        actors={"anna": {"kind": "person"}},
        plants={"yielding": True},
        ground={"ruts": True},
    )
    company = Company(experiment, small_park)
    company.drive()
    (leans,) = company.leans
    assert np.abs(leans(leans.rows, np.array([4 * LEAN_KNOT_NS]))).max() > 0.5
    bag = generate(experiment, tmp_path / "local", workers=1)
    with cluster_engine(processes=2) as engine:
        assert generate_by(engine, experiment, tmp_path / "cluster").read_bytes() == bag.read_bytes()


def test_slices_come_through_the_scheduler_where_there_is_no_shared_folder(
    dask: Processes, whole: bytes, tmp_path: Path
) -> None:
    out = tmp_path / "cluster"
    out.mkdir()
    hidden = ["unshare", "--mount", "sh", "-c", f'mount -t tmpfs none "{out}" && exec "$@"', "sh"]
    if (
        shutil.which("unshare") is None
        or subprocess.run([*hidden, "true"], check=False, capture_output=True).returncode
    ):
        pytest.skip("no mount namespaces here")
    dask.scheduler()
    for _ in range(2):
        dask.worker(prefix=hidden)
    assert run(dask, out) == whole
    assert not list((tmp_path / "dask").rglob("*.bag"))


def test_a_killed_worker_costs_only_its_running_slice(dask: Processes, whole: bytes, tmp_path: Path) -> None:
    dask.scheduler()
    workers = [dask.worker(SLOW) for _ in range(2)]
    wait_until(lambda: count_workers(dask) == 2)
    with running(dask, tmp_path / "cluster") as future:
        workers[0].kill()
        assert future.result() == whole


def test_a_worker_that_comes_late_is_used(dask: Processes, whole: bytes, tmp_path: Path) -> None:
    dask.scheduler()
    dask.worker(SLOW | {"FAKE_GATE": str(tmp_path / "gate")})
    with running(dask, tmp_path / "cluster", until=".*.token") as future:
        dask.worker(SLOW)
        wait_until(lambda: count_workers(dask) == 2)
        (tmp_path / "gate").touch()
        assert future.result() == whole
    assert on_workers(dask, opened_runs) == [1, 1]


def test_a_lost_scheduler_is_one_line_and_the_same_command_resumes(
    dask: Processes, whole: bytes, tmp_path: Path
) -> None:
    out = tmp_path / "cluster"
    scheduler = dask.scheduler()
    dask.worker(SLOW)
    with running(dask, out) as future:
        scheduler.kill()
        with pytest.raises(ClusterError, match="connection to the scheduler was lost; finished slices are kept"):
            future.result()
    assert not (out / "tiny" / "tiny.bag").exists()
    kept = sorted(out.glob("tiny/.slices/*/*.bag"))
    assert kept
    dask.scheduler()
    dask.worker()
    assert run(dask, out) == whole


def test_another_version_is_refused_before_work_starts(dask: Processes, tmp_path: Path) -> None:
    dask.scheduler()
    dask.worker({"FAKE_VERSION": "0.0.7"})
    with pytest.raises(ClusterError, match=r"worker tcp://\S+ differs from this machine: fieldtruth 0\.0\.7 instead"):
        run(dask, tmp_path / "cluster")
    assert not (tmp_path / "cluster").exists()


def test_a_late_worker_with_other_worlds_gets_no_slices(dask: Processes, whole: bytes, tmp_path: Path) -> None:
    dask.scheduler()
    dask.worker(SLOW | {"FAKE_GATE": str(tmp_path / "gate")})
    with running(dask, tmp_path / "cluster", until=".*.token") as future:
        other = dask.worker({"FAKE_OBJECTS": "6"})
        wait_until(lambda: count_workers(dask) == 2)
        (tmp_path / "gate").touch()
        with pytest.warns(FieldtruthWarning, match=r"worker tcp://\S+ has other code, libraries or worlds"):
            assert future.result() == whole
    assert other.wait(30) == 0


def test_an_error_of_the_drive_keeps_its_type(dask: Processes, tmp_path: Path) -> None:
    dask.scheduler()
    dask.worker({"FAKE_ERROR": "waypoint 3 is in a tree"})
    with pytest.raises(RouteError, match=r"^waypoint 3 is in a tree$"):
        run(dask, tmp_path / "cluster")
    assert not (tmp_path / "cluster").exists()


def test_runs_of_a_campaign_are_made_side_by_side(dask: Processes, tmp_path: Path) -> None:
    experiments = tuple(make_experiment(2.0, seed=k, name=f"run_{k}") for k in range(4))
    campaign, said = Campaign(name="few", experiments=experiments), list[str]()
    with pytest.MonkeyPatch.context() as patch:
        use_fakes(patch)
        generate_campaign(campaign, tmp_path / "local", Options(workers=1, measure=False), say=said.append)
    dask.scheduler()
    workers = [dask.worker(SLOW) for _ in range(2)]
    wait_until(lambda: count_workers(dask) == 2)
    out = tmp_path / "cluster"
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(campaign_on_cluster, dask, campaign, out)
        wait_until(lambda: len(list(out.glob("*/.slices/*/.*.token"))) == 2 or future.done())
        workers[0].kill()
        assert future.result() == ["done"] * 4
    for experiment in experiments:
        name = f"{experiment.name}/{experiment.name}.bag"
        assert (out / name).read_bytes() == (tmp_path / "local" / name).read_bytes()


def campaign_on_cluster(dask: Processes, campaign: Campaign, out: Path) -> list[str]:
    """Make a campaign, two runs at once; returns the states of its runs."""
    with cluster_engine(dask.file) as engine:
        assert engine.runs_at_once() == 2
        options = Options(jobs=2, workers=1, measure=False, generate=partial(generate_by, engine))
        states = generate_campaign(campaign, out, options, say=lambda line: None)
    return [state.kind.value for state in states]


def count_workers(dask: Processes) -> int:
    return len(on_workers(dask, os.getpid))


def on_workers(dask: Processes, function: Callable[[], int]) -> list[int]:
    """Call a function on all workers."""
    from distributed import Client

    with Client(scheduler_file=str(dask.file), set_as_default=False) as client:
        return list(client.run(function).values())
