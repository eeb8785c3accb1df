# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Episodes as a data set of Minari."""

import os
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import minari
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.learning.driven import Drives, Env, Episode, part_of

_ROOT: Final = "MINARI_DATASETS_PATH"
Names = str | tuple[str, ...]


def id_of(drives: Drives) -> str:
    """Return the id of a data set, and its folder below a root."""
    environment, *others = drives.parts
    return f"fieldtruth/{environment}/{'-'.join(others)}-v0"


def write(drives: Drives, env: Env, episodes: Iterable[Episode], root: Path) -> None:
    """Write a data set below a root; it knows its environment, and that of the test worlds for evaluation.

    With a ``world`` among the arguments, it knows neither.

    Raises:
        ConfigurationError: an observation's name begins another's.
    """
    config = drives.config
    for name in config.names:
        if name.partition("/")[0] in config.names and "/" in name:  # HDF5 has groups where a name has a slash
            raise ConfigurationError(f"Minari cannot hold both {name.partition('/')[0]} and {name}; record one of them")
    shown = config.observation if isinstance(config.observation, str) and len(config.names) == 1 else config.names
    with _root(root):
        minari.create_dataset_from_buffers(
            id_of(drives),
            (_buffer(episode, shown) for episode in episodes),
            env=_spec_of(env, shown, config.split),
            eval_env=_spec_of(env, shown, "test"),
            observation_space=_space_of(env, shown),
            action_space=env.action_space,
            algorithm_name=drives.policy.name,
            description=drives.about,
            requirements=["fieldtruth[rl]"],
            jpeg_encoding=False,
        )


def _buffer(episode: Episode, shown: Names) -> Any:
    return minari.data_collector.EpisodeBuffer(
        seed=episode.seed,
        observations=part_of(episode.seen, shown),
        actions=episode.actions,
        rewards=episode.rewards,
        terminations=episode.terminated,
        truncations=episode.truncated,
    )


def _space_of(env: Env, shown: Names) -> spaces.Space[Any]:
    assert isinstance(env.observation_space, spaces.Dict)
    found = part_of(env.observation_space.spaces, shown)
    return spaces.Dict(found) if isinstance(found, dict) else found


def _spec_of(env: Env, shown: Names, split: str) -> EnvSpec | None:
    """Return how to make an environment that observes what is shown; None for a world that no name tells."""
    spec = env.spec
    if spec is None or "world" in spec.kwargs:
        return None
    return replace(spec, kwargs={**spec.kwargs, "observation": shown, "split": split}, additional_wrappers=())


@contextmanager
def _root(root: Path) -> Iterator[None]:
    """Let Minari write below a folder, without its warnings."""
    before = os.environ.get(_ROOT)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="minari")
        os.environ[_ROOT] = str(root)
        try:
            yield
        finally:
            os.environ.pop(_ROOT)
            if before is not None:
                os.environ[_ROOT] = before
