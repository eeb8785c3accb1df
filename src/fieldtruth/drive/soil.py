# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Soil under the wheels of a driving robot: its parameters, and what it does to each contact in each step.

The ground types are mixed by the weights that the renderer mixes their colours by; across the edges of trails and of
their borders they change within a tyre's width, so that no force jumps. What is mixed is the result of the law, not its
parameters, as stiffness with different exponents has no mean. Stones that rise above the soil by more than ``PRESSED``
bear the wheel as rock; smaller ones are pressed into it.

Parameters of the soils are in ``soils.yaml``, with their sources.
"""

from collections.abc import Mapping
from dataclasses import astuple, dataclass
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.core.yaml_io import package_data
from fieldtruth.drive.ground import bearing_field
from fieldtruth.drive.track import STEP_S
from fieldtruth.experiment.robot_config import GRAVITY, RobotConfig, WheelConfig
from fieldtruth.kernels.ruts import NO_RUTS
from fieldtruth.kernels.soil import Grid, Ground, Mixture, Tyre, Wheels, mix_ruts, sinkage, step_soil
from fieldtruth.world.model import Raster, World

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
    name: Soil(*row) for name, row in package_data("fieldtruth.drive", "soils.yaml").items()
}
"""By ground type."""


def soil_rows(ground_types: tuple[str, ...]) -> Array:
    """Parameters (n, 7) of ground types, in the order of ``Soil``'s fields."""
    return np.array([astuple(SOILS[name]) for name in ground_types])


class SoilContact:
    """The soil of a world, without stones until a part is entered; call it before every step of the physics.

    ``state`` (n, 3) is what it remembers of the wheels from one step to the next, ``ruts`` are what was pressed before.

    Args:
        world: supplies ground types and trails.
        wheels: supplies the size of the tyres.
        replaced: soils, by name, that replace those of ground types of the world.
        step_s: step of the physics [s].

    Raises:
        ConfigurationError: a name in ``replaced`` that is no ground type of the world, or no soil.
    """

    def __init__(self, world: World, wheels: WheelConfig, replaced: Mapping[str, str], step_s: float = STEP_S) -> None:
        self._soils = soil_rows((*_soil_names(world, replaced), "rock"))
        terrain = world.terrain
        cover, trails = _grid(terrain.cover), _grid(terrain.other_ground)
        self._ground: Ground = cover, trails, _grid(_NO_STONES), terrain.border_width
        self._tyre: Tyre = (wheels.width, 2 * wheels.radius, wheels.tyre_stiffness)
        self.step_s, self._weights = step_s, np.empty(len(self._soils))
        self.state, self.ruts = np.zeros((len(wheels.names), 3)), NO_RUTS

    @property
    def mixture(self) -> Mixture:
        """Soils where the wheels are."""
        return Mixture(self._soils, self._ground, self.ruts, self._tyre, self._weights)

    def enter(self, part: World) -> None:
        """Find the stones of the part of the world in which the wheels are from now on."""
        cover, trails, _, border_width = self._ground
        self._ground = cover, trails, _grid(_stones(part)), border_width

    def __call__(self, wheels: Wheels) -> None:
        """Set friction, drag, torque and sinkage of the wheels for the next step."""
        step_soil(self.mixture, wheels, self.state, self.step_s)


def sinkage_at(world: World, wheels: WheelConfig, load: float, x: Array, y: Array) -> Array:
    """Return how deep [m] a standing wheel that carries ``load`` [N] sinks at x, y [m] of any shape, without stones."""
    terrain, tyre = world.terrain, (wheels.width, 2 * wheels.radius, wheels.tyre_stiffness)
    depths = np.array([sinkage(load, tyre, row) for row in soil_rows(_soil_names(world, {}))])
    count, weights = len(terrain.ground_materials), terrain.cover.at(x, y).reshape(*np.shape(x), -1)
    mixed = weights @ depths[:count] / np.maximum(weights.sum(axis=-1), 1e-6)
    return np.asarray(np.where(terrain.other_ground.at(x, y) < 0, depths[count], mixed))


class RutSoil:
    """What a wheel of a robot leaves in the soil of a world, without stones: see ``sense.ruts.Soil``.

    Args:
        world: supplies ground types and trails.
        robot: supplies the size of the tyres; each carries an equal share of the weight, without that on a caster.
        replaced: soils, by name, that replace those of ground types of the world.

    Raises:
        ConfigurationError: as ``SoilContact``.
    """

    def __init__(self, world: World, robot: RobotConfig, replaced: Mapping[str, str]) -> None:
        terrain, wheels = world.terrain, robot.wheels
        tyre = wheels.width, 2 * wheels.radius, wheels.tyre_stiffness
        load = robot.mass * GRAVITY * (1.0 - robot.caster_share) / len(wheels.names)
        soils = soil_rows((*_soil_names(world, replaced), "rock"))
        self._values = np.array([(sinkage(load, tyre, row), row[4]) for row in soils])
        self._ground = _grid(terrain.cover), _grid(terrain.other_ground), _grid(_NO_STONES), terrain.border_width

    def __call__(self, x: Array, y: Array) -> Array:
        """Sinkage [m] at rest, and tangent of the friction angle (n, 2), at x, y (n,) [m]."""
        found = np.empty((len(x), 2))
        mix_ruts(self._ground, self._values, x, y, found)
        return found


def _soil_names(world: World, replaced: Mapping[str, str]) -> tuple[str, ...]:
    """Name of the soil of each material of the cover, of the trail and of its border."""
    terrain = world.terrain
    names = (*terrain.ground_materials, *(terrain.trail_materials or ("", "")))
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
