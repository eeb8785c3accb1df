# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Soil under the wheels of a driving robot: its parameters, and what it does to each contact in each step.

The ground types are mixed by the weights that the renderer mixes their colours by; across the edges of trails and of
their borders they change within a tyre's width, so that no force jumps. What is mixed is the result of the law, not its
parameters, as stiffness with different exponents has no mean. Stones that rise above the soil by more than ``PRESSED``
bear the wheel as rock; smaller ones are pressed into it.

Sources of the parameters, seen as tables in open sources unless "quoted from memory":

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
from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.drive.ground import bearing_field
from fieldtruth.drive.track import STEP_S
from fieldtruth.experiment.robot_config import WheelConfig
from fieldtruth.kernels.soil import Grid, Tyre, Wheels, step_soil
from fieldtruth.world.model import Raster, World

HARD: Final = 1e11
"""k_phi [N/m^3] of ground that does not yield: a wheel of the robot sinks by 0.01 mm."""
PRESSED: Final = 0.02  # [m]
UNNAMED: Final = "trodden_earth"
"""The ground type of materials that name none."""
_NO_STONES: Final = Raster(values=np.zeros((2, 2), np.float32), spacing=1.0, x0=0.0, y0=0.0)


@dataclass(frozen=True)
class Soil:
    """Parameters of a soil: pressure over sinkage (Bekker), strength (Mohr-Coulomb), shear (Janosi-Hanamoto)."""

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


class SoilContact:
    """The soil of a world, without stones until a part is entered; call it before every step of the physics.

    ``state`` (n, 3) is what it remembers of the wheels from one step to the next.

    Args:
        world: supplies ground types and trails.
        wheels: supplies the size of the tyres.
        replaced: soils, by name, that replace those of ground types of the world.

    Raises:
        ConfigurationError: a name in ``replaced`` that is no ground type of the world, or no soil.
    """

    def __init__(self, world: World, wheels: WheelConfig, replaced: Mapping[str, str]) -> None:
        self._soils = soil_rows((*_soil_names(world, replaced), "rock"))
        terrain = world.terrain
        self._cover = _grid(terrain.cover), _grid(terrain.trail_distance)
        self._stones = _grid(_NO_STONES)
        self._border_width = terrain.border_width
        self._tyre: Tyre = (wheels.width, 2 * wheels.radius, wheels.tyre_stiffness)
        self.state = np.zeros((len(wheels.names), 3))

    def enter(self, part: World) -> None:
        """Find the stones of the part of the world in which the wheels are from now on."""
        self._stones = _grid(_stones(part))

    def __call__(self, wheels: Wheels) -> None:
        """Set friction, drag, torque and sinkage of the wheels for the next step."""
        ground = *self._cover, self._stones, self._border_width
        step_soil(self._soils, ground, self._tyre, wheels, self.state, STEP_S)


def _soil_names(world: World, replaced: Mapping[str, str]) -> tuple[str, ...]:
    """Name of the soil of each material of the cover, of the trail and of its border."""
    terrain = world.terrain
    names = (*terrain.ground_materials, terrain.trail_material, terrain.border_material)
    types = [world.materials[name].ground_type or UNNAMED if name in world.materials else UNNAMED for name in names]
    for ground_type, soil in replaced.items():
        if ground_type not in types:
            hint = suggestion(ground_type, sorted(set(types)))
            raise ConfigurationError(f"soil: {world.name} has no ground type {ground_type!r}; {hint}")
        if soil not in SOILS:
            raise ConfigurationError(f"soil.{ground_type}: unknown soil {soil!r}; {suggestion(soil, SOILS)}")
    return tuple(replaced.get(name, name) for name in types)


def _stones(world: World) -> Raster:
    """1 where a stone bears the wheels, 0 on the soil."""
    bearing, soil = bearing_field(world), world.terrain.field
    if bearing is soil:
        return _NO_STONES
    x, y = (
        start + bearing.spacing * np.arange(count)
        for start, count in zip((bearing.x0, bearing.y0), bearing.heights.shape, strict=True)
    )
    high = np.stack([row > soil.height_at(at, y) + PRESSED for at, row in zip(x, bearing.heights, strict=True)])
    return Raster(values=high.astype(np.float32), spacing=bearing.spacing, x0=bearing.x0, y0=bearing.y0)


def _grid(raster: Raster) -> Grid:
    values = raster.values if raster.values.ndim == 3 else raster.values[..., None]
    return np.ascontiguousarray(values), raster.x0, raster.y0, 1 / raster.spacing
