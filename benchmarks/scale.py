# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cost of a million labelled stereo pairs on 2, 64 and 1,000 cores, from figures that are measured here.

Run: python benchmarks/scale.py [--figures FILE]. It measures for about ten minutes, writes the figures to FILE as JSON,
or reads them from there if it exists, and prints the arithmetic of docs/scale.md. Worlds and kernels must be cached.

Work is measured as processor time of one core, which other load hardly changes; only efficiency and the scheduler's
overhead are times on the clock, and need a quiet machine.
"""

import argparse
import json
import time
import uuid
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from distributed import Future

from fieldtruth.bag.provenance import sha256_of
from fieldtruth.bag.writer import GrowingBag
from fieldtruth.cluster import cluster_engine
from fieldtruth.cluster.engine import ClusterSlices
from fieldtruth.cluster.worker import Order
from fieldtruth.core.progress import Silent
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.pipeline import PreparedHere, prepare
from fieldtruth.record.slices import SLICE_NS
from fieldtruth.render.bake import bake
from fieldtruth.sense.scene import Scene
from fieldtruth.simulation.stepped import Simulation
from fieldtruth.world.build import build_world, world_of

ENVIRONMENTS = ("park", "lake", "forest", "hillside")
PAIRS = 1_000_000
PAIRS_PER_S = 25
RUN_S = 60.0
CORES = (2, 64, 1000)
TASKS = 10_000
DRIVE_S, SLICES = 20.0, (30, 31, 90, 91, 150, 151)  # with two and with three pairs in turns

Figures = dict[str, float]


def cpu_s(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def of_environment(name: str) -> Figures:
    """Processor time [s] of the parts of a run, and bytes, from slices of the first experiment at full size."""
    experiment = with_overrides(load_experiment(f"{name}_1"), seconds=DRIVE_S)
    ready: list[PreparedHere] = []
    figures = {"build_s": cpu_s(lambda: build_world(experiment.environment, experiment.seed, experiment.layout))}
    load_and_drive_s = cpu_s(lambda: ready.append(prepare(Simulation(experiment), Silent())))
    load_s = cpu_s(lambda: world_of(experiment))
    figures |= {"load_s": load_s, "drive_s_per_s": (load_and_drive_s - load_s) / DRIVE_S}
    with TemporaryDirectory() as folder:
        path = Path(folder) / ready[0].key
        path.mkdir()
        with TemporaryDirectory() as empty:
            bake_s = cpu_s(lambda: bake(Scene(ready[0].world), experiment.light, folder=Path(empty)))
        figures["light_s"] = bake_s
        slices = ready[0].slices(path)
        slices.make_one(0)  # buffers and kernels
        figures["slice_s"] = sum(cpu_s(partial(slices.make_one, k)) for k in SLICES) / len(SLICES)
        size = sum(slices.path(k).stat().st_size for k in SLICES)
        figures["slice_bytes"] = size / len(SLICES)
        figures["join_s"] = join_s(ready[0], path)
    return figures


def join_s(run: PreparedHere, path: Path) -> float:
    """Processor time [s] of joining a slice: seal, copy, journal, and the checksum of the whole."""
    slices, whole = run.slices(path), path / "whole.bag"

    def join() -> None:
        with GrowingBag(whole, slices.topics) as bag:
            for k in SLICES:
                assert slices.is_intact(k)
                bag.add(slices.path(k))
        sha256_of(whole)

    return cpu_s(join) / len(SLICES)


def nothing(k: int) -> None:
    """An empty slice."""


class EmptySlices(ClusterSlices):
    """Slices that are empty tasks, to measure what the client and the scheduler need for one."""

    def _submit(self, k: int) -> Future:
        return self._client.submit(nothing, k, key=f"nothing-{uuid.uuid4().hex}")

    def _keep(self, k: int, future: Future) -> bool:
        return bool(future.status == "finished")


def task_ms() -> float:
    """Time [ms] of an empty slice on two workers, by the same client as real ones."""
    with cluster_engine(processes=2) as engine, TemporaryDirectory() as folder:
        order = Order("", "", folder, "token", 0)
        slices = EmptySlices(engine.client, order, None, [], TASKS * SLICE_NS)
        start = time.perf_counter()
        assert sum(1 for _ in slices.made(1, lambda seconds: None)) == TASKS
        return 1e3 * (time.perf_counter() - start) / TASKS


def efficiency() -> Figures:
    """Time of the same slices by one and by two workers of a local cluster, park_1 with all sensors."""
    experiment, took = with_overrides(load_experiment("park_1"), seconds=12.0), {}
    for workers in (1, 2):
        with cluster_engine(processes=workers) as engine, TemporaryDirectory() as folder:
            prepared = engine(Simulation(experiment), Silent())
            path = Path(folder) / prepared.key
            path.mkdir()
            slices = prepared.slices(path)
            made = slices.made(1, lambda seconds: None)
            for _ in range(workers):
                next(made)  # each worker loads the world and its light
            start = time.perf_counter()
            count = sum(1 for _ in made)
            took[workers] = (time.perf_counter() - start) / count
    return {"one_worker_s": took[1], "two_workers_s": took[2]}


def measure() -> dict[str, Figures]:
    """Measure all."""
    found = {name: of_environment(name) for name in ENVIRONMENTS}
    return found | {"cluster": efficiency() | {"task_ms": task_ms()}}


class Cost(NamedTuple):
    """Cost of ``PAIRS`` pairs in equal parts of the environments: runs of ``RUN_S``, each in its own world."""

    slices: float
    runs: float
    slices_h: float
    runs_h: float
    bytes: float
    join_h: float
    scheduler_h: float

    def wall_h(self, cores: int, efficiency: float) -> float:
        """Time on the clock: what divides, or what does not, whichever is longer."""
        return max((self.slices_h + self.runs_h) / cores / efficiency, self.join_h, self.scheduler_h)


def cost(figures: dict[str, Figures]) -> Cost:
    """Add up."""
    simulated_s = PAIRS / PAIRS_PER_S
    slices, runs = simulated_s * 1e9 / SLICE_NS, simulated_s / RUN_S

    def mean(name: str) -> float:
        return sum(figures[environment][name] for environment in ENVIRONMENTS) / len(ENVIRONMENTS)

    run_s = mean("build_s") + mean("light_s") + mean("drive_s_per_s") * RUN_S
    return Cost(
        slices=slices,
        runs=runs,
        slices_h=slices * mean("slice_s") / 3600,
        runs_h=runs * run_s / 3600,
        bytes=slices * mean("slice_bytes"),
        join_h=slices * mean("join_s") / 3600,
        scheduler_h=slices * figures["cluster"]["task_ms"] / 3.6e6,
    )


def report(figures: dict[str, Figures]) -> str:
    """Figures and arithmetic as Markdown."""
    rows = {
        "world, built [s]": ("build_s", 1.0),
        "world, from the cache [s]": ("load_s", 1.0),
        "light, baked [s]": ("light_s", 1.0),
        "drive [s per simulated s]": ("drive_s_per_s", 1.0),
        "slice [s]": ("slice_s", 1.0),
        "slice [MB]": ("slice_bytes", 1e-6),
        "joining a slice [s]": ("join_s", 1.0),
    }
    lines = [f"| core time of | {' | '.join(ENVIRONMENTS)} |", "|---" * (1 + len(ENVIRONMENTS)) + "|"]
    for title, (key, scale) in rows.items():
        lines.append(f"| {title} | {' | '.join(f'{scale * figures[name][key]:.3g}' for name in ENVIRONMENTS)} |")
    cluster, total = figures["cluster"], cost(figures)
    speedup = cluster["one_worker_s"] / cluster["two_workers_s"]
    lines += [
        "",
        f"An empty task: {cluster['task_ms']:.2f} ms ({TASKS} tasks). Two workers: {speedup:.2f} times one.",
        "",
        f"{PAIRS} pairs are {total.slices:.0f} slices in {total.runs:.0f} runs:",
        f"slices {total.slices_h:.0f} core-h, worlds, light and drives {total.runs_h:.0f} core-h, "
        f"{total.bytes / 1e12:.2f} TB;",
        f"not divided: joining {total.join_h:.1f} h, scheduler {total.scheduler_h:.2f} h",
        "",
        "| cores | wall time [h] |",
        "|---|---|",
        *(f"| {cores} | {total.wall_h(cores, speedup / 2):.1f} |" for cores in CORES),
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figures", type=Path, metavar="FILE", default=Path("scale.json"))
    path = parser.parse_args().figures
    if not path.exists():
        path.write_text(json.dumps(measure(), indent=1) + "\n")
    print(report(json.loads(path.read_text())))


if __name__ == "__main__":
    main()
