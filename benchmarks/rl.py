# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Speed of the environments of Gymnasium on all cores, error of longer physics steps, and success by difficulty.

python benchmarks/rl.py speed [OBSERVATION ...] | reset | physics | success [EPISODES] | leak [EPISODES] |
    together [ROBOTS ...]
"""

import sys
import time
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import gymnasium
import numpy as np
from numpy.typing import NDArray

import fieldtruth.learning  # noqa: F401 (it registers the environments)
from fieldtruth.core.parallel import cpu_count
from fieldtruth.learning.parallel import parallel_env
from fieldtruth.learning.policies import path_follower, straight_follower

Policy = Callable[[NDArray[np.float32]], NDArray[np.float32]]
STEPS: Final = 400
PARTS: Final = ("state", "lidar", "elevation", "elevation/seen", "camera/label", "privileged")
"""Observations whose speed is measured."""


def episode(env: gymnasium.Env[Any, Any], policy: Policy, seed: int | None) -> dict[str, Any]:
    """Drive an episode; its metrics and cause."""
    seen, begun = env.reset(seed=seed)
    while True:
        seen, _, terminated, truncated, info = env.step(policy(seen))
        if terminated or truncated:
            return {**info["metrics"], "cause": info["cause"], "hazard": begun["hazard"]}


def _steps(observation: str, seed: int, ready: Any) -> tuple[float, float, float]:
    """Steps of control per second, with resets and without, and time [ms] of the processor for one."""
    env = gymnasium.make("fieldtruth/Reach-v0", observation=observation)
    env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    actions = rng.uniform([0.0, -0.3], [0.8, 0.3], (STEPS, 2)).astype(np.float32)
    for action in actions[:5]:
        env.step(action)
    ready.wait()
    begun, used, resets_s, resets_used = time.perf_counter(), time.process_time(), 0.0, 0.0
    for action in actions:
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            since, used_since = time.perf_counter(), time.process_time()
            env.reset()
            resets_s, resets_used = (
                resets_s + time.perf_counter() - since,
                resets_used + time.process_time() - used_since,
            )
    whole = time.perf_counter() - begun
    work = time.process_time() - used - resets_used
    return STEPS / whole, STEPS / (whole - resets_s), 1e3 * work / STEPS


def _work(observation: str, seed: int, ready: Any, rates: Any) -> None:
    rates.put(_steps(observation, seed, ready))


def speed(observations: tuple[str, ...]) -> None:
    """Speed of one process per core."""
    context, cores = get_context("spawn"), cpu_count()
    for observation in observations:
        rates, ready = context.Queue(), context.Barrier(cores)
        jobs = [context.Process(target=_work, args=(observation, k, ready, rates)) for k in range(cores)]
        for job in jobs:
            job.start()
        whole, alone, work = np.array([rates.get() for _ in jobs]).T
        print(f"{observation:15s} {alone.sum():6.0f} control steps/s in {cores} processes, {whole.sum():.0f} with "
              f"resets; {work.mean():.2f} ms of the processor each{_load()}", flush=True)  # fmt: skip
        for job in jobs:
            job.join()


def _load() -> str:
    path = Path("/proc/loadavg")
    return f" (load {path.read_text().split()[0]})" if path.exists() else ""


def resets(count: int = 20) -> None:
    """Time of a reset in a world that is loaded."""
    for task in ("Reach", "Follow", "Explore"):
        env = gymnasium.make(f"fieldtruth/{task}-v0")
        env.reset(seed=0)
        wall, cpu = [], []
        for _ in range(count):
            begun, used = time.perf_counter(), time.process_time()
            env.reset()
            wall.append(time.perf_counter() - begun)
            cpu.append(time.process_time() - used)
        print(f"{task}: reset {1e3 * np.median(wall):.0f} ms, {1e3 * np.median(cpu):.0f} ms of the processor{_load()}")


def physics(environment: str = "park") -> None:
    """Path, slip and tilt with longer steps of the physics against those with 1 ms, over 12 s of equal actions."""
    rng, runs = np.random.default_rng(1), {}
    actions = np.repeat(rng.uniform([-0.3, -0.4], [1.0, 0.4], (12, 2)), 10, axis=0).astype(np.float32)
    for physics_ms in (1, 2, 4, 5):
        env = gymnasium.make("fieldtruth/Reach-v0", environment=environment, physics_ms=physics_ms,
                             observation="privileged", difficulty=0.5)  # fmt: skip
        rows, used = [], 0.0
        for seed in range(6):
            env.reset(seed=seed)
            for action in actions:
                begun = time.process_time()
                seen, _, terminated, _, _ = env.step(action)
                used += time.process_time() - begun
                rows.append(np.full(len(seen), np.nan) if terminated else seen)
                if terminated:
                    rows += [np.full(len(seen), np.nan)] * (len(actions) - len(rows) % len(actions))
                    break
        runs[physics_ms] = np.array(rows[: 6 * len(actions)]).reshape(6, len(actions), -1), used / len(rows)
    true = runs[1][0]
    for physics_ms, (found, used) in runs.items():
        off = np.linalg.norm(found[:, -1, 12:14] - true[:, -1, 12:14], axis=1)
        tilt = np.degrees(np.hypot(*(found - true)[..., 5:7].transpose(2, 0, 1)))
        print(f"{environment}, {physics_ms} ms: {1e3 * used:.2f} ms of the processor per step; path off by "
              f"{100 * np.nanmedian(off):.1f} cm (most {100 * np.nanmax(off):.1f}); tilt {np.nanmean(tilt):.3f} deg "
              f"(99 %: {np.nanquantile(tilt, 0.99):.2f}); "
              f"slip {np.nanmedian(np.abs(found - true)[..., 11]):.4f}")  # fmt: skip


def success(episodes: int = 20, environment: str = "park") -> None:
    """Success of the straight follower and of one along the planner's path by difficulty."""
    for difficulty in (0.0, 0.25, 0.5, 0.75, 1.0):
        for policy, name in ((straight_follower, "straight"), (path_follower, "path")):
            env = gymnasium.make("fieldtruth/Reach-v0", environment=environment, difficulty=difficulty,
                                 observation="privileged")  # fmt: skip
            found = [episode(env, policy, 0 if k == 0 else None) for k in range(episodes)]
            causes = [each["cause"] for each in found]
            mean = {key: np.mean([each[key] for each in found]) for key in ("success", "spl", "seconds", "hazard")}
            print(f"{environment} {difficulty:.2f} {name:9s} success {mean['success']:.2f}, SPL {mean['spl']:.2f}, "
                  f"{mean['seconds']:.0f} s, hazard {mean['hazard']:.2f}; "
                  + ", ".join(f"{causes.count(c)} {c}" for c in dict.fromkeys(causes)), flush=True)  # fmt: skip


def leak(episodes: int = 1000) -> None:
    """Memory of a process over episodes of a few steps."""
    env = gymnasium.make("fieldtruth/Reach-v0", observation=("state", "elevation", "lidar"))
    env.reset(seed=0)
    for k in range(episodes + 1):
        env.reset()
        for _ in range(3):
            env.step(env.action_space.sample())
        if k % max(episodes // 10, 1) == 0:
            print(f"{k} episodes: {_megabytes():.1f} MB", flush=True)


def together(robots: int, steps: int = STEPS) -> None:
    """Speed of several robots in one park in one process, while all of them drive."""
    env = parallel_env(robots)
    env.reset(seed=0)
    rng, resets_ms, wall, used = np.random.default_rng(0), list[float](), 0.0, 0.0
    for k in range(steps):
        if len(env.agents) < robots or k % 100 == 0:
            begun = time.perf_counter()
            env.reset()
            resets_ms.append(1e3 * (time.perf_counter() - begun))
        actions = {name: rng.uniform([0.0, -0.3], [0.8, 0.3]).astype(np.float32) for name in env.agents}
        begun, used_before = time.perf_counter(), time.process_time()
        env.step(actions)
        wall, used = wall + time.perf_counter() - begun, used + time.process_time() - used_before
    print(f"{robots} robots: {steps / wall:.0f} control steps/s of all, {1e3 * used / steps:.1f} ms of the processor "
          f"each; reset {np.median(resets_ms):.0f} ms; {_megabytes():.0f} MB{_load()}", flush=True)  # fmt: skip


def _megabytes() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


def main() -> None:
    """Measure what the arguments say."""
    what, *rest = sys.argv[1:] or ["speed"]
    match what:
        case "speed":
            speed(tuple(rest) or PARTS)
        case "reset":
            resets()
        case "physics":
            physics(*rest)
        case "success":
            success(int(rest[0]) if rest else 20, *rest[1:])
        case "together":
            for robots in rest or ("2", "4", "8"):
                together(int(robots))
        case _:
            leak(int(rest[0]) if rest else 1000)


if __name__ == "__main__":
    main()
