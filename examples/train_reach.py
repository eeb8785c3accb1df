# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Train a policy for Reach with PPO: train_reach.py --out FOLDER.

Install it with: pip install 'fieldtruth[rl,train]' 'stable-baselines3>=2.7'
The policy sees ``state`` and the heights that the LiDAR has seen so far, and corrects a follower that drives straight
to the goal. The hardest task grows with its success. A training that was interrupted goes on; FOLDER has policy.zip,
progress.csv and curve.png. Its score on the fixed benchmark:

REACH_POLICY=FOLDER/policy.zip fieldtruth score examples/train_reach.py:Agent
"""

import argparse
import csv
import json
import os
import time
from collections import deque
from functools import cache
from pathlib import Path
from typing import Any

import gymnasium
import matplotlib as mpl
import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import SubprocVecEnv, VecMonitor

import fieldtruth.learning  # noqa: F401 (it registers the environments)
from fieldtruth.learning.policies import straight_follower

OBSERVATION = ("state", "elevation/seen")
ENVIRONMENTS = ("park", "forest", "hillside", "boreal", "scrub", "orchard", "wet_meadow", "forest_road")
SENSORS = {"lidar": {"columns": 90}}  # half of the rays that the score has, for speed; the map fills while it drives
POOLED = 4  # cells of the elevation map along each side of a feature
SCALES = np.array([20, 20, 1, 1, 1, 0.3, 0.3, 6, 6, 6, 6, 1], np.float32)  # of state
ROLLOUT = 256  # steps of each process between two updates
FIRST, STEP, WANTED = 0.5, 0.25, 0.7
"""Hardest difficulty at first, which grows by STEP when WANTED of the last episodes succeed."""


def features(observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
    """Return state, highest seen ground and share of seen cells in each block of 0.4 m, as one vector."""
    height, known = observation["elevation/seen"]
    side = height.shape[0] // POOLED
    blocks = (side, POOLED, side, POOLED)
    highest = np.where(known > 0, height, -2.0).reshape(blocks).max(axis=(1, 3))
    share = known.reshape(blocks).mean(axis=(1, 3))
    highest = np.where(share > 0, highest, 0.0)
    return np.concatenate([observation["state"] / SCALES, highest.ravel(), share.ravel()], dtype=np.float32)


def corrected(state: NDArray[Any], correction: NDArray[Any]) -> NDArray[np.float32]:
    """Return the action of the straight follower with a correction."""
    return np.asarray(np.clip(straight_follower(state) + correction, -1.0, 1.0), np.float32)


class Corrected(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Reach with ``features`` and corrections of the straight follower; tasks are at most as hard as ``hardest``."""

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self.hardest, self._rng = FIRST, np.random.default_rng()
        assert isinstance(env.observation_space, gymnasium.spaces.Dict)
        size = len(features({name: np.zeros(box.shape) for name, box in env.observation_space.spaces.items()}))  # type: ignore[arg-type]
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Begin an episode."""
        if seed is not None:
            self._rng = np.random.default_rng(seed)
        difficulty = float(self._rng.uniform(0.0, self.hardest))
        seen, info = self.env.reset(seed=seed, options={"difficulty": difficulty, **(options or {})})
        self._state = seen["state"]
        return features(seen), info

    def step(self, action: NDArray[Any]) -> Any:
        """Drive for a step of control."""
        seen, reward, terminated, truncated, info = self.env.step(corrected(self._state, action))
        self._state = seen["state"]
        if "metrics" in info:
            info["is_success"] = info["metrics"]["success"]
        return features(seen), reward, terminated, truncated, info

    def set_hardest(self, value: float) -> None:
        """Let the tasks of the next episodes be at most so hard."""
        self.hardest = value


class Agent:
    """The trained policy, as `fieldtruth score` calls it."""

    observation = OBSERVATION

    def __init__(self) -> None:
        self._model = _loaded(os.environ["REACH_POLICY"])

    def __call__(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """Return the action."""
        correction, _ = self._model.predict(features(observation), deterministic=True)
        return corrected(observation["state"], correction)


@cache
def _loaded(path: str) -> PPO:
    torch.set_num_threads(1)  # each process of the score has one core
    return PPO.load(path, device="cpu")


class Watch(BaseCallback):  # type: ignore[misc, unused-ignore]
    """Ends the training in time, makes tasks harder, saves policy and progress."""

    def __init__(self, out: Path, minutes: float, hardest: float, spent_s: float) -> None:
        super().__init__()
        self._out, self._minutes, self.hardest = out, minutes, hardest
        self._began, self._ends = time.monotonic() - spent_s, deque[tuple[float, float, float]](maxlen=200)

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if metrics := info.get("metrics"):
                self._ends.append((float(metrics["success"]), metrics["collisions"], metrics["reward"]))
        return time.monotonic() - self._began < 60 * self._minutes

    def _on_rollout_end(self) -> None:
        if len(self._ends) < 20:
            return
        success, collisions, reward = np.mean(self._ends, axis=0)
        spent = time.monotonic() - self._began
        row = [self.num_timesteps, round(spent), self.hardest, success, collisions, reward]
        with (self._out / "progress.csv").open("a", newline="") as file:
            csv.writer(file).writerow([f"{value:.4g}" if isinstance(value, float) else value for value in row])
        left = max(0.0, 60 * self._minutes - spent)
        said = f"{self.num_timesteps} steps, success {success:.2f} up to difficulty {self.hardest:.1f}"
        print(f"{said}, {left:.0f} s left", flush=True)
        if success >= WANTED and len(self._ends) == self._ends.maxlen and self.hardest < 1.0:
            self.hardest = min(1.0, self.hardest + STEP)
            self.training_env.env_method("set_hardest", self.hardest)
            self._ends.clear()
        self.model.save(self._out / "policy.part.zip")
        (self._out / "policy.part.zip").replace(self._out / "policy.zip")
        (self._out / "state.json").write_text(json.dumps({"hardest": self.hardest, "spent_s": spent}))


def _make(rank: int, seed: int) -> Any:
    def make() -> gymnasium.Env[Any, Any]:
        torch.set_num_threads(1)
        environment = ENVIRONMENTS[rank % len(ENVIRONMENTS)]
        env = Corrected(
            gymnasium.make(
                "fieldtruth/Reach-v0", environment=environment, worlds=2, observation=OBSERVATION, sensors=SENSORS
            )
        )
        env.reset(seed=seed + rank)
        return env

    return make


def draw_curve(out: Path) -> None:
    """Draw success and difficulty over steps."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    rows = np.loadtxt(out / "progress.csv", delimiter=",", ndmin=2)
    figure, axes = plt.subplots(figsize=(7, 4))
    axes.plot(rows[:, 0], rows[:, 3], label="success in the last 100 episodes")
    axes.plot(rows[:, 0], rows[:, 2], label="hardest difficulty")
    axes.set(xlabel="control steps", ylim=(0, 1.02))
    axes.legend()
    figure.savefig(out / "curve.png", dpi=120)
    plt.close(figure)


def main() -> None:
    """Train, or go on."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="folder of the results")
    parser.add_argument("--minutes", type=float, default=50.0, help="time of the training, all parts together (50)")
    parser.add_argument("--processes", type=int, default=8, help="environments beside each other (8)")
    parser.add_argument("--seed", type=int, default=0, help="of first weights and tasks (0)")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)  # the network is small
    state = {"hardest": FIRST, "spent_s": 0.0}
    if (options.out / "state.json").exists():
        state = json.loads((options.out / "state.json").read_text())
    makers = [_make(rank, options.seed) for rank in range(options.processes)]
    envs = VecMonitor(SubprocVecEnv(makers, start_method="spawn"))
    envs.env_method("set_hardest", state["hardest"])
    saved = options.out / "policy.zip"
    if saved.exists():
        model = PPO.load(saved, env=envs, device="cpu")
    else:
        net = {"net_arch": [256, 128], "log_std_init": -1.0}
        model = PPO("MlpPolicy", envs, n_steps=ROLLOUT, batch_size=256, n_epochs=5, gamma=0.99, ent_coef=0.002,
                    policy_kwargs=net, seed=options.seed, device="cpu")  # fmt: skip
        torch.nn.init.zeros_(model.policy.action_net.weight)  # begins as the straight follower
    model.set_logger(configure(None, []))
    watch = Watch(options.out, options.minutes, state["hardest"], state["spent_s"])
    model.learn(10**9, callback=watch, reset_num_timesteps=not saved.exists())
    envs.close()
    draw_curve(options.out)


if __name__ == "__main__":
    main()
