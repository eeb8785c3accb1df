# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Species by name, one data file each.

In a file, ``young`` and ``exposed`` state only what differs from ``grown``, order by order; ``stand`` is a `Stand`.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from fieldtruth.world import materials  # noqa: F401  (reads the materials and textures of added files)
from fieldtruth.world.library import Entry, Library, validated
from fieldtruth.world.plants.grass_species import GrassSpecies
from fieldtruth.world.plants.species import Species, Stand
from fieldtruth.world.plants.variation import in_stand


def _species(name: str, content: Entry, path: Path) -> Species:
    values = {"name": name, **content}
    stand = values.pop("stand", None)
    for form in ("young", "exposed"):
        if form in values:
            values[form] = _merged(values.get("grown"), values[form])
    species = validated(Species, values, str(path))
    if stand is None:
        return species
    return replace(species, stand=in_stand(species.grown, validated(Stand, stand, f"{path}: stand")))


def _merged(base: Any, changes: Any) -> Any:
    """``base`` with ``changes``: mappings key by key, lists of mappings item by item and as long as the changes."""
    if isinstance(base, Mapping) and isinstance(changes, Mapping):
        return {**base, **{key: _merged(base.get(key), value) for key, value in changes.items()}}
    if isinstance(base, list) and isinstance(changes, list) and all(isinstance(item, Mapping) for item in changes):
        return [_merged(base[k] if k < len(base) else None, item) for k, item in enumerate(changes)]
    return changes


def _grass(name: str, content: Entry, path: Path) -> GrassSpecies:
    return validated(GrassSpecies, {"name": name, **content}, str(path))


def _materials(species: Species) -> list[str | None]:
    return [species.wood, species.foliage, species.upper_wood, species.bloom]


def _grass_materials(species: GrassSpecies) -> list[str | None]:
    return [part.material for blades in species.blades for part in (blades, *blades.organs)]


TREES: Final = Library("trees", _species, _materials)
"""Trees by name."""

BUSHES: Final = Library("bushes", _species, _materials)
"""Bushes by name."""

GRASSES: Final = Library("grasses", _grass, _grass_materials)
"""Grasses and herbs by name, class high grass."""
