# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Seasons: what a built world looks like in spring, autumn or winter, after drought, and below snow.

Environments build the world of summer; `change.in_season` turns it into that of another season by the table of changes
of materials here (``seasons`` sections of the data files). Positions, stems and ground stay the same in all seasons.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np
from pydantic import Field

from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.world.library import Entry, Section, validated
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Material
from fieldtruth.world.textures import TEXTURES

Rgb = tuple[float, float, float]
Share = Annotated[float, Field(ge=0, le=1)]
Part = tuple[Annotated[float, Field(gt=0)], Share, Share, Share]
SUMMER: Final = "summer"
LUSH, DRY = "lush", "dry"
"""Columns of the table that are no seasons: the colours that ``drought`` mixes in."""
USUAL: Final = 0.5
"""``drought`` of a world whose colours it does not change."""


@dataclass(frozen=True, kw_only=True)
class Change:
    """Change of a material in a season, relative to summer."""

    kept: Share = 1.0  # share of the leaves or blades that are still there
    kept_young: Share | None = None  # the same on young trees
    colours: tuple[Part, ...] = ()  # share, and mean linear albedo; each leaf has one of them
    low: Annotated[float, Field(gt=0, le=1)] = 1.0  # height of withered blades, relative
    translucency: Share | None = None
    covered: Share = 0.0  # share of this ground below trees that fallen leaves cover


Row = Mapping[str, Change]
"""Changes of one material by season."""


def _row(name: str, entry: Entry, source: str) -> Row:
    if name not in MATERIALS:
        raise ConfigurationError(f"{source}: unknown material {name!r}; {suggestion(name, list(MATERIALS))}")
    row = {season: validated(Change, values, f"{source}.{season}") for season, values in entry.items()}
    for season in {LUSH, DRY} & row.keys():
        if not row[season].colours:
            raise ConfigurationError(f"{source}.{season}: colours is missing")
    return row


SEASONAL: Final = Section("seasons", _row)
"""Changes by material and season. What is not named stays as in summer."""


def seasons() -> tuple[str, ...]:
    """Names of all seasons: the usual four, and those that added files name."""
    named = [season for row in SEASONAL.values() for season in row]
    return tuple(s for s in dict.fromkeys(("spring", SUMMER, "autumn", "winter", *named)) if s not in (LUSH, DRY))


def changes(season: str, drought: float = USUAL) -> dict[str, Change]:
    """Changes of all materials in a season after a drought, from 0 (lush) over 0.5 (none) to 1 (dry)."""
    found = {}
    for name, row in SEASONAL.items():
        change = row.get(season, Change())
        grass = row.get(DRY if drought > USUAL else LUSH)
        if grass is not None and drought != USUAL:
            change = _mixed(change, MATERIALS[name], grass, abs(2 * drought - 1))
        if change != Change():
            found[name] = change
    return found


def _mixed(change: Change, material: Material, other: Change, share: float) -> Change:
    """``change`` with colours of which a ``share`` is that of another change."""
    goal = np.average([c[1:] for c in other.colours], axis=0, weights=[c[0] for c in other.colours])
    own = change.colours or ((1.0, *albedo(material)),)
    mixed = [(c[0], *((1 - share) * np.array(c[1:]) + share * goal).tolist()) for c in own]
    return Change(**{**vars(change), "colours": tuple(mixed)})


def albedo(material: Material) -> Rgb:
    """Mean linear albedo of a material."""
    r, g, b = np.array(TEXTURES[material.texture].albedo) * material.tint
    return float(r), float(g), float(b)


def tinted(material: Material, colour: Rgb) -> Material:
    """The material with another mean linear albedo, of the same class."""
    r, g, b = np.array(colour) / TEXTURES[material.texture].albedo
    return Material(**{**vars(material), "tint": (float(r), float(g), float(b))})
