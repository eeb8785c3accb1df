# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Train a policy for Reach with PPO: train_reach.py --out FOLDER.

Install it with: pip install 'fieldtruth[rl,train]' 'stable-baselines3>=2.7'
The policy sees ``state`` and the heights that the LiDAR has seen so far. It corrects a reactive follower, which drives
where the ground is free of steps, as near to the goal's direction as that is (after the vector field histogram of
Borenstein and Koren 1991). An interrupted training goes on; FOLDER has policy.zip, progress.csv and curve.png. Scores
on the fixed benchmark, of the policy and of the follower alone:

REACH_POLICY=FOLDER/policy.zip fieldtruth score examples/train_reach.py:Agent
fieldtruth score examples/train_reach.py:Reactive
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
from scipy.ndimage import maximum_filter, minimum_filter
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import SubprocVecEnv, VecMonitor

import fieldtruth.learning  # noqa: F401 (it registers the environments)

OBSERVATION = ("state", "elevation/seen")
ENVIRONMENTS = ("park", "forest", "hillside", "boreal", "scrub", "orchard", "wet_meadow", "forest_road")
SENSORS = {"lidar": {"columns": 90}}  # half of the rays that the score has, for speed; the map fills while it drives
SCALES = np.array([20, 20, 1, 1, 1, 0.3, 0.3, 6, 6, 6, 6, 1], np.float32)  # of state
STEPS = (0.15, 0.3, 0.6)  # [m] height of a step between neighbouring cells; the reactive follower avoids the second
NEAREST, FARTHEST, HALF_WIDTH = 0.3, 3.2, 0.45  # [m]
AHEAD = 2.5  # [m] that should be free
CELLS = 3.15 - 0.1 * np.arange(64)  # [m] ahead, and to the left, of the rows and columns of the map
DIRECTIONS = np.radians(np.linspace(-120.0, 120.0, 25))
ALONG = np.cos(DIRECTIONS)[:, None, None] * CELLS[:, None] + np.sin(DIRECTIONS)[:, None, None] * CELLS
ACROSS = np.cos(DIRECTIONS)[:, None, None] * CELLS - np.sin(DIRECTIONS)[:, None, None] * CELLS[:, None]
ROLLOUT = 256  # steps of each process between two updates


def free_ahead(seen: NDArray[Any]) -> NDArray[Any]:
    """Return how far (3, directions) [m] the robot can drive in each direction before each height of step."""
    height, known = seen
    low = minimum_filter(np.where(known > 0, height, np.inf), 3)
    high = maximum_filter(np.where(known > 0, height, -np.inf), 3)
    found = []
    for step in STEPS:
        blocked = high - low > step
        along, across = ALONG[:, blocked], np.abs(ACROSS[:, blocked])
        inside = (across < HALF_WIDTH) & (along > NEAREST)
        found.append(np.where(inside, along, FARTHEST).min(axis=1, initial=FARTHEST))
    return np.array(found)


def reactive(state: NDArray[Any], free: NDArray[Any]) -> NDArray[np.float32]:
    """Return the action that drives towards the goal where it is free, slower where something is near."""
    ahead, left = state[:2]
    goal, wanted = np.arctan2(left, ahead), min(np.hypot(ahead, left), AHEAD)
    away = np.abs((DIRECTIONS - goal + np.pi) % (2 * np.pi) - np.pi)
    chosen = int(np.argmin(away + 1.5 * np.maximum(0.0, wanted - free) + 0.3 * np.abs(DIRECTIONS)))
    angle = DIRECTIONS[chosen]
    if abs(goal) > DIRECTIONS[-1] or (free[chosen] >= wanted and away[chosen] < np.radians(6.0)):
        angle = goal
    speed = 0.8 * max(0.0, 1.0 - abs(angle)) * np.clip(free[len(free) // 2] / 1.5, 0.15, 1.0)
    return np.array([speed, np.clip(1.2 * angle, -1.0, 1.0)], np.float32)


def seen_by(observation: dict[str, NDArray[Any]]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the policy's features, and the action of the reactive follower."""
    free, known = free_ahead(observation["elevation/seen"]), observation["elevation/seen"][1].mean()
    features = np.concatenate([observation["state"] / SCALES, free.ravel() / FARTHEST, [known]], dtype=np.float32)
    action = reactive(observation["state"], free[1])
    return np.append(features, action), action


def corrected(action: NDArray[np.float32], correction: NDArray[Any]) -> NDArray[np.float32]:
    """Return an action with a correction, within the limits."""
    return np.asarray(np.clip(action + correction, -1.0, 1.0), np.float32)


class Corrected(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Reach with the features as observation, and corrections of the reactive follower as actions."""

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        assert isinstance(env.observation_space, gymnasium.spaces.Dict)
        nothing = {name: np.zeros(box.shape or ()) for name, box in env.observation_space.spaces.items()}
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, seen_by(nothing)[0].shape, np.float32)

    def reset(self, **options: Any) -> Any:
        """Begin an episode."""
        observation, info = self.env.reset(**options)
        features, self._action = seen_by(observation)
        return features, info

    def step(self, action: NDArray[Any]) -> Any:
        """Drive for a step of control."""
        observation, *others = self.env.step(corrected(self._action, action))
        features, self._action = seen_by(observation)
        return features, *others


class Reactive:
    """The reactive follower, as `fieldtruth score` calls it."""

    observation = OBSERVATION

    def __call__(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """Return the action."""
        return seen_by(observation)[1]


class Agent:
    """The trained policy, as `fieldtruth score` calls it."""

    observation = OBSERVATION

    def __init__(self) -> None:
        self._model = _loaded(os.environ["REACH_POLICY"])

    def __call__(self, observation: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """Return the action."""
        features, action = seen_by(observation)
        correction, _ = self._model.predict(features, deterministic=True)
        return corrected(action, correction)


@cache
def _loaded(path: str) -> PPO:
    torch.set_num_threads(1)  # each process of the score has one core
    return PPO.load(path, device="cpu")


class Progress:
    """Saves the policy, and says how it does in the last 100 episodes."""

    def __init__(self, out: Path, minutes: float, processes: int) -> None:
        self._out, self._state = out, {"spent_s": 0.0, "steps": 0, "processes": processes}
        if (out / "state.json").exists():
            self._state = json.loads((out / "state.json").read_text())
        self._began = time.monotonic() - self._state["spent_s"]
        self._seconds, self._ends = 60.0 * minutes, deque[tuple[float, float, float]](maxlen=100)

    @property
    def share(self) -> float:
        """Share of the time that is spent."""
        return (time.monotonic() - self._began) / self._seconds

    def see(self, infos: list[dict[str, Any]]) -> None:
        """Take note of a step of all environments."""
        self._state["steps"] += len(infos)
        for info in infos:
            if metrics := info.get("metrics"):
                self._ends.append((float(metrics["success"]), metrics["collisions"], metrics["reward"]))

    def save(self, model: PPO) -> None:
        """Save, and print a line."""
        model.save(self._out / "policy.part.zip")
        (self._out / "policy.part.zip").replace(self._out / "policy.zip")
        self._state["spent_s"] = time.monotonic() - self._began
        (self._out / "state.json").write_text(json.dumps(self._state))
        success, collisions, reward = np.mean(self._ends, axis=0) if self._ends else (np.nan,) * 3
        row = [self._state["steps"], round(self._state["spent_s"]), success, collisions, reward]
        with (self._out / "progress.csv").open("a", newline="") as file:
            csv.writer(file).writerow([f"{value:.4g}" if isinstance(value, float) else value for value in row])
        left = max(0.0, self._seconds - self._state["spent_s"])
        print(f"{row[0]} steps, success {success:.2f}, reward {reward:.1f}, {left:.0f} s left", flush=True)


class _Watch(BaseCallback):  # type: ignore[misc, unused-ignore]
    """Ends PPO in time."""

    def __init__(self, progress: Progress) -> None:
        super().__init__()
        self._progress = progress

    def _on_step(self) -> bool:
        self._progress.see(self.locals["infos"])
        return self._progress.share < 1.0

    def _on_rollout_end(self) -> None:
        self._progress.save(self.model)


def _make(rank: int, seed: int) -> Any:
    def make() -> gymnasium.Env[Any, Any]:
        torch.set_num_threads(1)
        own: dict[str, Any] = {"environment": ENVIRONMENTS[rank % len(ENVIRONMENTS)], "worlds": 2, "sensors": SENSORS}
        env = Corrected(gymnasium.make("fieldtruth/Reach-v0", observation=OBSERVATION, **own))
        env.reset(seed=seed + rank)
        return env

    return make


def draw_curve(out: Path) -> None:
    """Draw success over steps."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    rows = np.loadtxt(out / "progress.csv", delimiter=",", ndmin=2)
    figure, axes = plt.subplots(figsize=(7, 4))
    axes.plot(rows[:, 0], rows[:, 2])
    axes.set(xlabel="control steps", ylabel="success in the last 100 episodes", ylim=(0, 1.02))
    figure.savefig(out / "curve.png", dpi=120)
    plt.close(figure)


def minutes(text: str) -> float:
    """Return a time of the command line."""
    if not 0.0 < (value := float(text)) < float("inf"):
        raise argparse.ArgumentTypeError(f"must be above 0, got {text}")
    return value


def count(text: str) -> int:
    """Return a number of the command line."""
    if not 1 <= (value := int(text)) <= 64:
        raise argparse.ArgumentTypeError(f"must be from 1 to 64, got {text}")
    return value


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="folder of the results")
    parser.add_argument("--minutes", type=minutes, default=50.0, help="time of the training, all parts together (50)")
    parser.add_argument("--processes", type=count, default=8, metavar="N", help="environments (8)")
    parser.add_argument("--seed", type=int, default=0, help="of first weights and tasks (0)")
    options = parser.parse_args()
    try:
        options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(f"--out {options.out}: {error.strerror}")
    state = options.out / "state.json"
    if state.exists() and (known := json.loads(state.read_text())["processes"]) != options.processes:
        parser.error(f"{options.out} was begun with --processes {known}, got {options.processes}")
    return options


def main() -> None:
    """Train, or go on."""
    options = _options()
    torch.set_num_threads(1)  # the network is small
    makers = [_make(rank, options.seed) for rank in range(options.processes)]
    envs = VecMonitor(SubprocVecEnv(makers, start_method="spawn"))
    saved, progress = options.out / "policy.zip", Progress(options.out, options.minutes, options.processes)
    if saved.exists():
        model = PPO.load(saved, env=envs, device="cpu")
    else:
        net = {"net_arch": [128, 64], "log_std_init": -1.5}
        model = PPO("MlpPolicy", envs, n_steps=ROLLOUT, batch_size=256, n_epochs=8, gamma=0.99, ent_coef=0.0,
                    learning_rate=3e-4, policy_kwargs=net, seed=options.seed, device="cpu")  # fmt: skip
        torch.nn.init.zeros_(model.policy.action_net.weight)  # begins as the reactive follower
    model.set_logger(configure(None, []))
    model.learn(10**9, callback=_Watch(progress))
    progress.save(model)
    envs.close()
    draw_curve(options.out)


if __name__ == "__main__":
    main()
