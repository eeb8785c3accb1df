# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Columns of an inventory of trees: their usual names in English, German and French, their units and numbers."""

import re
import unicodedata
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import UnknownNameError
from fieldtruth.maps.units import METRES

_NAMES: Final = {
    "longitude": "lon long longitude lng laenge laengengrad geograenge geolaenge",
    "latitude": "lat latitude breite breitengrad geobreite",
    "place": "geopoint2d geopoint geolocation",  # "latitude, longitude" in one cell
    "east": "east easting x xcoord coordx xkoord xkoordinate utmx xutm pointx ost ostwert rechtswert est e",
    "north": "north northing y ycoord coordy ykoord ykoordinate utmy yutm pointy nord nordwert hochwert n",
    "height": "height treeheight totalheight h ht hoehe baumhoehe hauteur hauteurtotale hauteurarbre htot",
    "diameter": "diameter dbh treedbh d stemdiameter trunkdiameter diameteratbreastheight bhd d13 stammdurchmesser"
    " brusthoehendurchmesser durchmesser diametre diam diametretronc dhp",
    "girth": "girth circumference trunkcircumference stemcircumference gbh umfang stammumfang stammumf stammumfg"
    " circonference circonferencetronc circ",
    "crown_radius": "crownradius kronenradius kroneradius rayoncouronne rayonhouppier",
    "crown_diameter": "crowndiameter crownwidth crown canopydiameter crownspread spread kronendurchmesser krone"
    " kronedurch kronenbreite diametrecouronne diametrehouppier envergure",
    "species": "species speciesname scientificname latinname botanicalname taxon spp spclatin spccommon baumart"
    " artbot art artlatein botname essence espece nomlatin nomscientifique libellefrancais",
    "genus": "genus gattung gattungbot genre",
}
"""Quantity: names of its columns, without accents, spaces and signs; earlier names are taken first."""


def _plain(name: str) -> str:
    """A column's name without accents and signs, in small letters, with a blank between words."""
    for umlaut, letters in (("ä", "ae"), ("ö", "oe"), ("ü", "ue")):
        name = name.lower().replace(umlaut, letters)
    ascii_ = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    return re.sub(r"[^a-z0-9]+", " ", ascii_).strip()


def split_unit(name: str) -> tuple[str, float | None]:
    """A column's plain name without its unit, and the metres of that unit."""
    words = _plain(re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)).split()
    if len(words) > 1 and words[-1] in METRES:
        return "".join(words[:-1]), METRES[words[-1]]
    return "".join(words), None


def found_columns(path: Path, columns: Sequence[str], given: dict[str, str]) -> dict[str, str]:
    """Names of columns by quantity: those given, and those with usual names."""
    for quantity, name in given.items():
        if quantity not in _NAMES:
            raise UnknownNameError("quantity", quantity, _NAMES, str(path))
        if name not in columns:
            raise UnknownNameError("column", name, columns, str(path))
    found = dict(given)
    plain: dict[str, str] = {}
    for name in columns:
        plain.setdefault(split_unit(name)[0], name)
    for quantity, names in _NAMES.items():
        usual = next((plain[each] for each in names.split() if each in plain), None)
        if usual is not None and usual not in given.values():
            found.setdefault(quantity, usual)
    return found


def numbers(values: Sequence[Any]) -> tuple[Array, list[int]]:
    """Numbers (n,) of cells, NaN where it is empty, and the rows of those that are neither numbers nor empty."""
    if isinstance(values, np.ndarray) and values.dtype.kind in "fiub":
        return values.astype(np.float64), []
    found, wrong = np.full(len(values), np.nan), []
    for k, value in enumerate(values):
        text = "" if value is None else str(value).replace("\N{NO-BREAK SPACE}", "").replace(" ", "")
        if text.lower() in ("", "na", "nan", "null", "none", "-"):
            continue
        decimal, other = (".", ",") if text.rfind(".") > text.rfind(",") else (",", ".")  # the later of both
        text = text.replace(other, "")
        text = text.replace(decimal, "." if text.count(decimal) == 1 else "")
        try:
            found[k] = float(text)
        except ValueError:
            wrong.append(k)
    return found, wrong
