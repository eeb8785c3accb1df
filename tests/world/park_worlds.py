# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parks for tests: the default one, built once per session, and variants without textures."""

import hashlib
from dataclasses import fields, is_dataclass
from functools import cache

import numpy as np
from sense_worlds import without_textures

from fieldtruth.world.build import build_world, load_world
from fieldtruth.world.model import World


@cache
def real_park() -> World:
    """The park of seed 0, from the cache that all tests share."""
    return load_world("park", 0)


@cache
def park_variant(seed: int, **changes: int) -> World:
    """A park with one individual of each kind of tree and without textures, which do not change its layout."""
    with without_textures():
        return build_world("park", seed, {"individuals": 1, **changes})


def digest(instance: object) -> str:
    """Hash of a world: names, numbers, every byte of every array."""
    sum_ = hashlib.blake2b()

    def add(value: object) -> None:
        if isinstance(value, np.ndarray):
            sum_.update(f"{value.dtype}{value.shape}".encode())
            sum_.update(np.ascontiguousarray(value).tobytes())
        elif is_dataclass(value):
            for field in fields(value):
                sum_.update(field.name.encode())
                add(getattr(value, field.name))
        elif hasattr(value, "items"):
            for key, item in value.items():
                sum_.update(str(key).encode())
                add(item)
        elif isinstance(value, tuple | list):
            sum_.update(f"({len(value)}".encode())
            for item in value:
                add(item)
        else:
            sum_.update(repr(value).encode())

    add(instance)
    return sum_.hexdigest()
