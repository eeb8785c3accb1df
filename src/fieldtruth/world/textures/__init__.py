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
from dataclasses import dataclass, make_dataclass, replace
from functools import cache, lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.core.parallel import cpu_count, in_order
from fieldtruth.world.library import Entry, Section, validated
from fieldtruth.world.textures import plants, strewn, surfaces  # noqa: F401  (register drawings)
from fieldtruth.world.textures.canvas import DRAWINGS, finish


@dataclass(frozen=True, kw_only=True)
class Texture:
    """A drawing with its parameters, and the mean linear albedo (red, green, blue)."""

    draw: str  # name of a function in `DRAWINGS`
    albedo: tuple[float, float, float]
    parameters: Mapping[str, Any]


_FORMER: Final[Mapping[str, Entry | str]] = {
    "velvet": {"draw": "mottled", "waves": [[0.12, 2, 60, 0.5, 1]]},
    "opal_glass": {
        "draw": "mottled", "tones": [[205, 203, 194], [236, 234, 226]], "middle": 0.55, "waves": [[0.1, 2, 30, 1, 1]],
    },
    "murky_water": "water", "garden_soil": "soil", "bark_mulch": "mulch", "leaf_litter": "litter",
    "needle_litter": "needles", "trodden_earth": "path", "dry_turf": "turf_dry", "stony_soil": "soil_stony",
    "blades_over_soil": "lawn",
    **{name: name for name in ("gravel", "moss", "rough_grass", "mud", "pebbles", "scree")},
}  # fmt: skip
"""Drawings by the names that they had in files for earlier versions: parameters, or the texture that has them."""


def _texture(name: str, entry: Entry, source: str) -> Texture:
    former = _FORMER.get(str(entry.get("draw")))
    if former is not None:
        former = TEXTURES.entry(former) if isinstance(former, str) else former
        entry = {**former, **entry, "draw": former["draw"]}
    parameters = {key: value for key, value in entry.items() if key not in ("draw", "albedo")}
    values = {key: value for key, value in entry.items() if key in ("draw", "albedo")}
    texture = validated(Texture, {**values, "parameters": parameters}, source)
    if texture.draw not in DRAWINGS:
        raise ConfigurationError(f"{source}: unknown drawing {texture.draw!r}; {suggestion(texture.draw, DRAWINGS)}")
    checked = validated(_parameters(texture.draw), parameters, f"{source}: {texture.draw}")
    return replace(texture, parameters=vars(checked))


@cache
def _parameters(draw: str) -> type[Any]:
    """Dataclass of a drawing's parameters, all keywords, for their check."""
    _, *own = inspect.signature(DRAWINGS[draw]).parameters.values()
    fields = [(p.name, p.annotation) if p.default is p.empty else (p.name, p.annotation, p.default) for p in own]
    return make_dataclass(draw, fields, frozen=True, kw_only=True)


TEXTURES: Final = Section("textures", _texture)
"""Every texture; a world holds those of its materials."""


_AT_ONCE: Final = 3


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
    try:
        image = finish(DRAWINGS[texture.draw](rng, **texture.parameters), texture.albedo)
    except ConfigurationError as error:
        raise ConfigurationError(f"textures.{name}: {error}") from error
    image.flags.writeable = False
    return image


def make_textures(seed: np.random.SeedSequence, names: Iterable[str]) -> dict[str, NDArray[np.uint8]]:
    """Draw several textures, by name; some at once, each of which takes up to 0.3 GB meanwhile."""
    every = tuple(names)
    drawn = in_order(every, lambda name: make_texture(name, seed), min(cpu_count(), _AT_ONCE))
    return dict(zip(every, drawn, strict=True))
