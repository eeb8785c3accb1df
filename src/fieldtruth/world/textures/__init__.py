# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tileable images of all surfaces, drawn from a seed when they are asked for.

An entry of a ``textures`` section names the function that draws the structure and tones, its parameters, and a measured
mean albedo to which the image is scaled, so that light adds up to that of a real scene. In the visible, grass has 0.05
to 0.13, bare soil 0.08 to 0.2, sand and gravel 0.2 to 0.4, concrete 0.3 to 0.4 (Oke, Boundary Layer Climates, 1987);
limestone 0.3 to 0.4 fresh and 0.2 to 0.3 weathered, granite 0.2 to 0.3, schist 0.1 to 0.2, a fifth less with lichen,
and barks, leaves and dry grass as in the ECOSTRESS spectral library 1.0. The albedo of leaves is what they scatter
back; see `Material.translucency` for the rest.
"""

import inspect
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.world.library import Entry, Section, validated
from fieldtruth.world.textures import ground, surfaces  # noqa: F401  (register drawings)
from fieldtruth.world.textures.canvas import DRAWINGS, finish


@dataclass(frozen=True, kw_only=True)
class Texture:
    """How a texture is drawn, and its mean linear albedo (red, green, blue)."""

    draw: str  # name of a function in `DRAWINGS`
    albedo: tuple[float, float, float]
    parameters: Mapping[str, Any]


def _texture(name: str, entry: Entry, source: str) -> Texture:
    parameters = {key: value for key, value in entry.items() if key not in ("draw", "albedo")}
    values = {key: value for key, value in entry.items() if key in ("draw", "albedo")}
    texture = validated(Texture, {**values, "parameters": parameters}, source)
    if texture.draw not in DRAWINGS:
        raise ConfigurationError(f"{source}: unknown drawing {texture.draw!r}; {suggestion(texture.draw, DRAWINGS)}")
    try:
        signature = inspect.signature(DRAWINGS[texture.draw])
        signature.bind_partial(None, **parameters)  # a misspelt key is also a missing one: report the cause
        signature.bind(None, **parameters)
    except TypeError as error:
        raise ConfigurationError(f"{source}: {texture.draw}: {error}") from error
    return texture


TEXTURES: Final = Section("textures", _texture)
"""Every texture; a world holds those of its materials."""


def make_texture(name: str, seed: np.random.SeedSequence) -> NDArray[np.uint8]:
    """Draw a texture: (n, n, 3) sRGB, n a power of two; u runs along axis 1, v up axis 0. The result is read-only.

    ``seed`` is common to all textures. Each derives its own from it and its name, so a new texture changes no other.
    """
    entropy = seed.entropy
    return _drawn(
        name,
        entropy if isinstance(entropy, int) else tuple(entropy or ()),
        (*seed.spawn_key, zlib.crc32(name.encode())),
    )


@lru_cache(maxsize=128)
def _drawn(name: str, entropy: int | tuple[int, ...], spawn_key: tuple[int, ...]) -> NDArray[np.uint8]:
    texture = TEXTURES[name]
    rng = np.random.default_rng(np.random.SeedSequence(entropy, spawn_key=spawn_key))
    image = finish(DRAWINGS[texture.draw](rng, **texture.parameters), texture.albedo)
    image.flags.writeable = False
    return image


def make_textures(seed: np.random.SeedSequence, names: Iterable[str]) -> dict[str, NDArray[np.uint8]]:
    """Draw several textures, by name."""
    return {name: make_texture(name, seed) for name in names}
