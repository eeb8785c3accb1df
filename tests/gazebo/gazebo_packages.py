# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The exported packages of the environments, kept in GZ_WORK until the code that writes them changes."""

import shutil
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

from filelock import FileLock
from gazebo_run import WORK

import fieldtruth.gazebo
from fieldtruth.core.cache import cache_key
from fieldtruth.gazebo import DEFAULT_LAYOUT, write_gazebo
from fieldtruth.world.build import load_world
from fieldtruth.world.model import World

ENVIRONMENTS: Final = ("park", "lake", "forest", "hillside")


@dataclass(frozen=True)
class Package:
    """A package for Gazebo 11 and the world that it was written from."""

    folder: Path
    world: World

    def world_file(self, *, plain: bool = False) -> Path:
        """The world file, or that of its plain twin."""
        return self.folder / "worlds" / f"{self.world.name}{'_plain' if plain else ''}.world"


@cache
def package(environment: str) -> Package:
    """Package of an environment with the land beyond its edge."""
    world = load_world(environment, 0, DEFAULT_LAYOUT)
    texts = {str(path): path.read_bytes() for path in sorted(Path(fieldtruth.gazebo.__file__).parent.rglob("*.jinja"))}
    key = cache_key(["fieldtruth.gazebo", "fieldtruth.world.build"], environment, texts)
    folder = WORK / "packages" / f"{environment}_{key[:12]}"
    folder.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(f"{folder}.lock"):
        if not folder.exists():
            for old in folder.parent.glob(f"{environment}_*"):
                if old.is_dir():
                    shutil.rmtree(old)
            write_gazebo(world, folder)
    return Package(folder, world)
