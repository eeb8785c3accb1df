# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Episodes of any policy as data for offline learning and imitation: a data set of Minari."""

import os
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.files import output_errors, output_path, remove, replace_synced
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.learning.config import LearningConfig
from fieldtruth.learning.policies import Policy, call

_ROOT: Final = "MINARI_DATASETS_PATH"
Names = str | tuple[str, ...]


def record_episodes(
    policy: Policy,
    out: Path,
    *,
    task: str = "Reach",
    episodes: int = 100,
    seed: int = 0,
    overwrite: bool = False,
    progress: Progress | None = None,
    **arguments: Any,
) -> str:
    """Record episodes of a policy as a data set of Minari, and return its id.

    Splits share no world: the id has ``train`` or ``test``, as ``split`` among the arguments says. The data set knows
    its environment, and that of the test worlds for evaluation, unless a ``world`` is given.

    Args:
        policy: what drives; it may observe what is not recorded.
        out: a root folder of Minari's data sets (``MINARI_DATASETS_PATH``).
        task: Reach, Follow or Explore.
        episodes: their number.
        seed: of the episodes.
        overwrite: replace a data set of this id.
        progress: receives it.
        arguments: those of the environment; ``observation`` is what is recorded.

    Raises:
        ConfigurationError: Minari is not installed, the policy fails, or a value that is not allowed.
        UnknownNameError: a name that does not exist.
        OutputError: the data set exists, or cannot be written.
    """
    config = LearningConfig.of({key: value for key, value in arguments.items() if key != "world"})
    shown = config.observation if isinstance(config.observation, str) and len(config.names) == 1 else config.names
    seen = LearningConfig.of({"observation": policy.observation}).names
    minari, driver = _minari(), "".join(each if each.isalnum() else "_" for each in policy.name)
    name = f"fieldtruth/{Path(config.environment).stem}/{task.lower()}-{driver}-{config.split}-v0"
    path = output_path(out / name, overwrite=overwrite)
    both = tuple(dict.fromkeys(config.names + seen))
    env = gymnasium.make(f"fieldtruth/{task}-v0", **{**arguments, "observation": both})

    def driven() -> Iterator[Any]:
        with (progress or Silent()).stage(f"drive {episodes} episodes", float(episodes)) as advance:
            for episode in range(episodes):
                yield _drive(env, policy, shown, seed if episode == 0 else None, minari.data_collector.EpisodeBuffer)
                advance(1.0)

    with _new_root(out) as root:
        minari.create_dataset_from_buffers(
            name,
            driven(),
            env=_spec_of(env, shown, config.split),
            eval_env=_spec_of(env, shown, "test"),
            observation_space=_space_of(env, shown),
            action_space=env.action_space,
            algorithm_name=policy.name,
            description=f"{episodes} episodes of {task} in {config.environment}, {config.split}, seed {seed}",
            requirements=["fieldtruth[rl]"],
            jpeg_encoding=False,
        )
        path.parent.mkdir(parents=True, exist_ok=True)
        remove(path)
        replace_synced(root / name, path)
    return name


def _drive(env: gymnasium.Env[Any, Any], policy: Policy, shown: Names, seed: int | None, buffer: Any) -> Any:
    """Drive an episode, and return what was seen, done and got."""
    act, (seen, _) = policy.load()(), env.reset(seed=seed)
    observations, actions = [seen], list[Any]()
    rewards, ends = list[float](), list[tuple[bool, bool]]()
    while not (ends and any(ends[-1])):
        actions.append(np.asarray(call(policy, act, _part(seen, policy.observation)), np.float32))
        seen, reward, terminated, truncated, _ = env.step(actions[-1])
        observations.append(seen)
        rewards.append(float(reward))
        ends.append((terminated, truncated))
    terminations, truncations = zip(*ends, strict=True)
    columns = {name: np.stack([each[name] for each in observations]) for name in seen}
    return buffer(
        seed=seed,
        observations=_part(columns, shown),
        actions=np.stack(actions),
        rewards=rewards,
        terminations=[*terminations],
        truncations=[*truncations],
    )


def _part(observation: Mapping[str, Any], names: Names) -> Any:
    return observation[names] if isinstance(names, str) else {name: observation[name] for name in names}


def _space_of(env: gymnasium.Env[Any, Any], shown: Names) -> spaces.Space[Any]:
    assert isinstance(env.observation_space, spaces.Dict)
    found = _part(env.observation_space.spaces, shown)
    return spaces.Dict(found) if isinstance(found, dict) else found


def _spec_of(env: gymnasium.Env[Any, Any], shown: Names, split: str) -> EnvSpec | None:
    """Return how to make an environment that observes what is shown; None for a world that no name tells."""
    spec = env.spec
    if spec is None or "world" in spec.kwargs:
        return None
    return replace(spec, kwargs={**spec.kwargs, "observation": shown, "split": split}, additional_wrappers=())


def _minari() -> Any:
    """Return the library with what its files need; raises ConfigurationError if it is not installed."""
    try:
        import h5py  # noqa: F401
        import minari
    except ModuleNotFoundError as error:
        text = f"the library {error.name} is not installed; run: pip install 'fieldtruth[rl]'"
        raise ConfigurationError(text) from error
    return minari


@contextmanager
def _new_root(out: Path) -> Iterator[Path]:
    """Let Minari write below a temporary folder in ``out``, without its warnings."""
    before = os.environ.get(_ROOT)
    with output_errors(out):
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=out, prefix=".") as root, warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="minari")
            os.environ[_ROOT] = root
            try:
                yield Path(root)
            finally:
                os.environ.pop(_ROOT)
                if before is not None:
                    os.environ[_ROOT] = before
