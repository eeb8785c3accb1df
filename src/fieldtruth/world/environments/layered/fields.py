# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Values of an environment's fields and rules, on grids and at positions.

A field with noise, a distance or a blur is drawn once on the grid of the relief, from a seed of its own name, and
interpolated; all others are computed where they are asked for.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from zlib import crc32

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter, map_coordinates
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.world.environments.layered.expressions import Constant, Drawn, Expression
from fieldtruth.world.grids import Line, Trail, fractal_noise, make_raster
from fieldtruth.world.model import Instance, Mesh, Raster, water_at
from fieldtruth.world.placement import FarSwarm
from fieldtruth.world.relief import Axes, eroded
from fieldtruth.world.stand import Stand

FAR = 1e3
"""Distance [m] where there is nothing of a kind."""


def rng_of(seed: int, name: str) -> np.random.Generator:
    """Generator of a layer or a field: it does not depend on the others."""
    return np.random.default_rng([seed, crc32(name.encode())])


@dataclass
class Fields:
    """Fields of a world that is being built."""

    rules: Mapping[str, Expression]
    parameters: Mapping[str, float]
    seed: int
    size: tuple[float, float]
    nodes: Axes
    """Axes [m] of the relief's grid."""
    trails: Sequence[Trail]
    corridors: Sequence[Line]
    lines: Mapping[str, Line]
    height: Array | None = None
    """Height [m] at the nodes."""
    crowns: dict[str, Raster] = field(default_factory=dict)
    """Share of crowns at the nodes, of all and of some objects, once these are placed."""
    water: float | Raster | None = None
    """Height [m] of the water."""
    meshes: dict[str, list[Mesh]] = field(default_factory=dict)
    """Individuals of the groups that are grown."""
    surroundings: Raster | None = None
    """Height [m] of the finest grid about the world, if there is one."""
    land: Callable[[Array, Array], Array] | None = None
    """Height [m] of the land at x, y [m] as the grids about the world have it."""
    near: dict[str, Callable[[Array], Array]] = field(default_factory=dict)
    """Distance [m], (n,), of positions (n, 2) to the objects of layers that are placed."""
    placed: dict[str, Sequence[Instance]] = field(default_factory=dict)
    """Objects of those layers."""
    ground: Callable[[Array], Array] | None = None
    """Height [m], (n,), of the ground at positions (n, 2), also beyond the edge."""
    far: list[FarSwarm] = field(default_factory=list)
    """Objects of layers that are beyond the edge."""
    stand: Stand | None = None
    """Light that the trees of a closed stand leave."""
    _drawn: dict[str, Raster] = field(default_factory=dict)
    _routed: tuple[Array | None, Raster] | None = None
    """Height, and the drained area that follows from it."""
    _far: dict[tuple[int, int], dict[str, Array]] = field(default_factory=dict)
    """Distances from trails, corridors and lines on grids from edge to edge, by their shape: they take longest."""

    def at(self, rule: Expression, xy: Array) -> Array:
        """Values (n,) of a rule at positions (n, 2)."""
        return self._values(rule, xy, {}, {})

    def on(self, rule: Expression, axes: Axes) -> Array:
        """Values (nx, ny) of a rule at the nodes of axes [m] from edge to edge."""
        return self.over(axes)(rule)

    def over(self, axes: Axes, drawn: Drawn = MappingProxyType({})) -> Callable[[Expression], Array]:
        """Return a function that has the values (nx, ny) of rules at the nodes of axes [m], computing a field once."""
        xy, shape = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2), (len(axes[0]), len(axes[1]))
        known = self._far.setdefault(shape, {})
        cache = dict(known)

        def values(rule: Expression) -> Array:
            found = self._values(rule, xy, drawn, cache).reshape(shape)
            known.update(
                {k: each for k, each in cache.items() if k in ("trail", "left", "corridor") or k in self.lines}
            )
            return found

        return values

    def draw(self, rule: Expression, name: str) -> Array:
        """Values (nx, ny) of a rule at the relief's nodes; ``name`` is that of which its noise has the seed."""
        shape, spacing, rng = (len(self.nodes[0]), len(self.nodes[1])), self.spacing, rng_of(self.seed, name)

        def grid(values: Array) -> Array:
            return values.reshape(shape) if np.size(values) > 1 else np.full(shape, float(values))

        def noise(wavelength: float, octaves: float = 3.0, gain: float = 0.5) -> Array:
            own = {"wavelength": float(wavelength), "octaves": int(octaves), "gain": float(gain)}
            return fractal_noise(*self.nodes, rng=rng, **own).reshape(-1)  # type: ignore[arg-type]

        def distance(values: Array) -> Array:
            return border_distance(grid(values) > 0, spacing).reshape(-1)

        def blur(values: Array, length: Array) -> Array:
            mean = gaussian_filter(grid(values), float(np.max(length)) / spacing, mode="nearest")
            return np.asarray(mean).reshape(-1)

        def points(per_ha: Array) -> Array:
            count = round(float(np.max(per_ha)) * float(np.prod(self.size)) / 1e4)
            centres = rng.uniform(-0.5, 0.5, (count, 2)) * self.size
            xy = np.stack(np.meshgrid(*self.nodes, indexing="ij"), axis=-1).reshape(-1, 2)
            return np.asarray(cKDTree(centres).query(xy)[0]) if count > 0 else np.full(len(xy), FAR)

        def uphill(values: Array, length: Array) -> Array:
            return self._uphill(grid(values), float(np.max(length)) / spacing).reshape(-1)

        drawn: Drawn = {"noise": noise, "distance": distance, "blur": blur, "points": points, "uphill": uphill}
        return self.over(self.nodes, drawn)(rule)

    def about(self, nodes: Axes) -> "Fields":
        """Return the fields of another grid, on which nothing is drawn yet."""
        own = {**self.parameters, "spacing": float(nodes[0][1] - nodes[0][0])}
        return replace(self, parameters=own, nodes=nodes, near={}, _drawn={}, _far={})

    def constant(self, rule: Constant) -> float:
        """Value of a rule of parameters."""
        return float(self.at(rule, np.zeros((1, 2)))[0])

    def anywhere(self, name: str, xy: Array) -> Array:
        """Values (n,) of a parameter, or of the distance to a layer's objects, also beyond the edge."""
        if name in self.parameters:
            return np.full(len(xy), self.parameters[name])
        return self.near[name](xy) if name in self.near else np.full(len(xy), FAR)

    def forget(self) -> None:
        """Draw all fields anew where they are asked for: the relief that some follow from has changed."""
        self._drawn.clear()

    @property
    def spacing(self) -> float:
        """Spacing [m] of the relief's nodes."""
        return float(self.nodes[0][1] - self.nodes[0][0])

    def _values(self, rule: Expression, xy: Array, drawn: Drawn, cache: dict[str, Array]) -> Array:
        """Values (n,) of a rule; ``cache`` has those of fields that are known, and gets others."""

        def lookup(name: str) -> Array:
            if name not in cache:
                cache[name] = self._known(name, xy, lookup)
            return cache[name]

        values = np.broadcast_to(rule.values(lookup, drawn), (len(xy),)).astype(np.float64)
        check_finite(rule, values, xy)
        return values

    def _known(self, name: str, xy: Array, lookup: Callable[[str], Array]) -> Array:
        if name in self.parameters:
            return self.anywhere(name, xy)
        x, y = xy.T
        match name:
            case "x" | "y":
                return np.asarray(x if name == "x" else y)
            case "edge":
                return np.asarray(np.min(np.array(self.size) / 2 - np.abs(xy), axis=1))
            case "trail":
                return _least([each.line.distance(xy) - each.width / 2 for each in self.trails], len(xy))
            case "left":
                return self.trails[0].line.left(xy) if self.trails else np.full(len(xy), FAR)
            case "corridor":
                return _least([line.distance(xy) for line in self.corridors], len(xy))
            case "height":
                return self._raster("height", self.height).at(x, y)
            case "slope":
                raster, step = self._raster("height", self.height), 0.25
                along = (raster.at(x + step, y) - raster.at(x - step, y)) / (2 * step)
                across = (raster.at(x, y + step) - raster.at(x, y - step)) / (2 * step)
                return np.asarray(np.degrees(np.arctan(np.hypot(along, across))))
            case "drained":
                return np.asarray(np.exp(self._drained().at(x, y)))
            case "crown" | "crown_needles" | "crown_leaves":
                return self.crowns[name].at(x, y) if name in self.crowns else np.zeros(len(xy))
            case "above_water":
                above = self._raster("height", self.height).at(x, y) - water_at(self.water, x, y)
                return np.asarray(np.minimum(above, FAR))
        if name in self.lines:
            return self.lines[name].distance(xy)
        if name not in self.rules:
            return self.anywhere(name, xy)
        rule = self.rules[name]
        if not rule.drawn:
            return np.broadcast_to(rule.values(lookup), (len(xy),))
        if name not in self._drawn:
            self._drawn[name] = self._raster(name, self.draw(rule, f"fields.{name}"))
        return self._drawn[name].at(x, y)

    def _uphill(self, values: Array, nodes: float) -> Array:
        """Values (nx, ny) as many ``nodes`` up the slope of the relief, which is smoothed over half of that."""
        assert self.height is not None
        up = np.array(np.gradient(gaussian_filter(self.height, nodes / 2.0, mode="nearest")))
        up *= nodes / np.maximum(np.hypot(*up), 1e-12)
        return np.asarray(map_coordinates(values, np.indices(values.shape) + up, order=1, mode="nearest"))

    def _drained(self) -> Raster:
        """Logarithm of the area [m^2] that drains through each node, on the grid about the world if there is one."""
        ground = self.surroundings or self._raster("height", self.height)
        if self._routed is None or self._routed[0] is not self.height:
            area = eroded(ground.values.astype(np.float64), ground.spacing, strength=0.0, creep=0.0, steps=0).drained
            self._routed = self.height, replace(ground, values=np.log(area).astype(np.float32))
        return self._routed[1]

    def _raster(self, name: str, values: Array | None) -> Raster:
        if values is None:
            raise AssertionError(f"{name} is asked for before it is known")
        return make_raster(values, self.spacing, *self.nodes)


def border_distance(inside: Mask, spacing: float) -> Array:
    """Distance [m] (nx, ny) to the border of a mask, positive inside, smooth over the grid's steps."""
    if inside.all() or not inside.any():
        return np.full(inside.shape, FAR if inside.all() else -FAR)
    into, out = distance_transform_edt(inside), distance_transform_edt(~inside)
    return np.asarray(gaussian_filter(np.where(inside, into - 0.5, 0.5 - out), 2.5, mode="nearest") * spacing)


def check_finite(rule: Expression, values: Array, xy: Array) -> None:
    """Check that the values (n,) of a rule at positions (n, 2) are numbers; raises ConfigurationError."""
    if not np.isfinite(values).all():
        x, y = xy[int(np.argmin(np.isfinite(values)))]
        raise ConfigurationError(f"the rule {rule.text!r} must be finite, got none at x {x:.1f} m, y {y:.1f} m")


def _least(distances: Sequence[Array], count: int) -> Array:
    return np.asarray(np.min(distances, axis=0)) if distances else np.full(count, FAR)
