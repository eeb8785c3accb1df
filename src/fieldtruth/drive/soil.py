# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Mechanical parameters of the soil of each ground type.

Sources, seen as tables in open sources unless "quoted from memory":

- [W] Wong, Theory of Ground Vehicles, 4th edition 2008, table of terrain values: k_c, k_phi, n, c, phi. Shear
  deformation modulus K: 25 mm in dry sand; 6 mm in clay of the greatest density, 10 mm in firm sand (from memory).
- [A] the same, average coefficients of road adhesion, peak / sliding: dry asphalt and concrete 0.80-0.90 / 0.75,
  gravel 0.60 / 0.55, dry earth road 0.68 / 0.65.
- [N] Noon, Engineering Analysis of Vehicular Accidents, 1994, tyres of cars: gravel and dirt road 0.35, loose moist
  dirt 0.60-0.65, wet grass 0.20. Lugs also shear the turf itself: dragged sideways through dry sod, a car met more than
  its weight (Stonex 1960).
- [C] Carvill, Mechanical Engineer's Data Handbook, 1993, rolling resistance of pneumatic tyres: worn asphalt 0.02, new
  gravel 0.01, loose worn gravel 0.04, medium hard soil 0.08, sand 0.1-0.2. Moyer: packed gravel 0.012, wet loose gravel
  0.06. McKibben and Davidson 1939: bluegrass sod 0.058, loose sand 0.39 (from memory).
- [B] Brixius 1987 (ASABE D497; from memory): gross traction on firm soil rises by 6.6 of the load per unit of slip.
  Tyres on roads: about 20. Trodden earth, packed gravel, stony soil and sod lie between.

No terrain values are published for ground that a light robot hardly marks. There k_phi with n = 1 follows from [C], as
resistance and sinkage depend on each other, and K from [B]: traction rises by (friction) l / (2 K) of the load per unit
of slip, with l = 48 mm, the tyre's patch on hard ground. These rows say "from c_rr".
"""

from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array

HARD: Final = 1e11
"""k_phi [N/m^3] of ground that does not yield: a wheel of the robot sinks by 0.01 mm."""


@dataclass(frozen=True)
class Soil:
    """What a wheel meets: pressure over sinkage (Bekker), strength (Mohr-Coulomb), shear (Janosi-Hanamoto)."""

    k_c: float  # [N/m^(n+1)], Bekker's cohesive modulus
    k_phi: float  # [N/m^(n+2)], Bekker's frictional modulus
    n: float  # Bekker's exponent of sinkage
    cohesion: float  # [Pa]
    friction: float  # tangent of the friction angle; on hard ground the peak coefficient of adhesion
    shear: float  # K [m], shear deformation modulus
    rolling: float  # resistance over load of what is no compaction: tyre, blades of grass, stones that turn


SOILS: Final[Mapping[str, Soil]] = {
    "paving": Soil(0.0, HARD, 1.0, 0.0, 0.80, 0.0010, 0.020),  # [A] dry concrete, [C] worn asphalt
    "rock": Soil(0.0, HARD, 1.0, 0.0, 0.75, 0.0010, 0.020),  # [A] dry concrete, sliding: dusty and uneven
    "gravel": Soil(0.0, 8e8, 1.0, 0.0, 0.60, 0.0012, 0.020),  # packed path; [A] gravel, from c_rr 0.04
    "trodden_earth": Soil(0.0, 8e8, 1.0, 0.0, 0.68, 0.0012, 0.020),  # [A] dry earth road, from c_rr 0.04
    "stony_soil": Soil(0.0, 4e8, 1.0, 0.0, 0.65, 0.0015, 0.025),  # firm mountain trail; [A] gravel and earth
    "lawn": Soil(0.0, 2e8, 1.0, 0.0, 0.60, 0.0020, 0.030),  # dry; [N] dirt, from c_rr 0.058 of sod
    "dry_turf": Soil(0.0, 2e8, 1.0, 0.0, 0.60, 0.0020, 0.030),  # as lawn
    "dry_grass": Soil(0.0, 2e8, 1.0, 0.0, 0.60, 0.0020, 0.030),  # as lawn
    "meadow": Soil(0.0, 8e7, 1.0, 0.0, 0.55, 0.0025, 0.035),  # long grass on soft soil, from c_rr 0.08
    "earth": Soil(60.0, 5.88e6, 1.01, 3100.0, 0.573, 0.010, 0.020),  # [W] Grenville loam, phi 29.8 deg
    "forest_floor": Soil(0.0, 2e7, 1.0, 0.0, 0.50, 0.006, 0.030),  # needles and leaves on mineral soil; assumed
    "leaf_litter": Soil(0.0, 2e7, 1.0, 0.0, 0.50, 0.006, 0.030),  # as the forest's floor
    "moss": Soil(0.0, 1.5e7, 1.0, 0.0, 0.50, 0.010, 0.030),  # on mineral soil; assumed
    "mulch": Soil(0.0, 1e7, 1.0, 0.0, 0.50, 0.012, 0.030),  # loose bark; assumed
    "mud": Soil(13.19e3, 692.15e3, 0.5, 4140.0, 0.231, 0.010, 0.020),  # [W] clayey soil, 38 % water, phi 13 deg
    "pebbles": Soil(102e3, 5301e3, 0.79, 1300.0, 0.603, 0.012, 0.030),  # [W] LETE sand, phi 31.1 deg
    "scree": Soil(102e3, 5301e3, 0.79, 0.0, 0.60, 0.016, 0.040),  # the same without cohesion; [A] gravel, loose
    "sand": Soil(990.0, 1528.43e3, 1.1, 1040.0, 0.532, 0.025, 0.020),  # [W] dry sand, phi 28 deg
}
"""By ground type."""


def soil_rows(ground_types: tuple[str, ...]) -> Array:
    """Parameters (n, 7) of ground types, in the order of ``Soil``'s fields."""
    return np.array([astuple(SOILS[name]) for name in ground_types])
