# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The ray-tracing scene that all sensors share: the world in Embree, the classes of its hits, and rays of a user.

A ray that enters the box of an instance is transformed into its frame and starts at the top of its hierarchy. Below a
canopy it would do so at every tree whose crown is above it, so that meshes such as trees are two instances, trunk and
crown, if the two boxes enclose less air than one. Rays of ``cast`` are packed as they come, without a pose each; blocks
of them are traced side by side by threads.
"""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core.arrays import Array, Float32Array, Index, Mask
from fieldtruth.core.classes import GROUND_ID, Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.parallel import cpu_count, in_order
from fieldtruth.kernels.cast import FIRST, OBJECT, Bundle, CastTable, Hits, block_rays, trace_rays
from fieldtruth.kernels.packets import CLEAR, MISS, SOLID, THIN, Grid, HitTable, Packet, aligned, new_packet
from fieldtruth.sense.embree import Engine, RayScene
from fieldtruth.sense.interval import STILL, Interval, Moving, Traced, interval_of
from fieldtruth.sense.leaning import WHOLE, Leaning, TracedPlants
from fieldtruth.sense.limbs import pieces_of
from fieldtruth.sense.moving import MovingBody, check_bodies
from fieldtruth.sense.ruts import TracedRuts, ground_tiles
from fieldtruth.world.model import Heightfield, Mesh, Raster, World

BLOCK: Final = 1 << 16
"""Rays that a thread traces at once."""
_GAIN: Final = 0.85
"""Share of the area of the whole mesh's box below which the boxes of two parts are worth a second instance."""
_NO_TINT: Final = (1.0, 1.0, 1.0)
_NO_PLANTS: Final[TracedPlants | None] = None
_NO_RUTS: Final[TracedRuts | None] = None


class TopLevel(NamedTuple):
    """A geometry at the top level of the Embree scene: terrain (mesh None), or a mesh at a pose."""

    mesh: Mesh | None
    world_from_object: Array
    object_id: int
    tint: tuple[float, float, float]  # colour factors


class PartCodes(NamedTuple):
    """Hits that have a code instead of a class, and the class and ``PlantPart`` (256,) of each code.

    So the same rays in the same packets find both. Codes without a part are the classes themselves.
    """

    hits: HitTable
    label: NDArray[np.uint8]
    part: NDArray[np.uint8]

    def decode(self, codes: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the parts of codes of any shape, which are overwritten by their classes."""
        part = np.take(self.part, codes)
        codes[...] = np.take(self.label, codes)
        return part


def by_top(hits: HitTable) -> HitTable:
    """Return a table with the row of a top-level geometry and 1 more, instead of its instance id."""
    return hits._replace(top_object=np.arange(1, len(hits.top_object) + 1, dtype=np.uint32))


class Scene:
    """A world in the ray tracer. Threads may share it: it does not change after construction.

    ``rays`` is the Embree scene, in which an object is one geometry or two; ``hits`` gives the row of ``top_levels``
    that a geometry belongs to, and class and instance id of a hit.

    Bodies that move have rows in all tables, after those of what stands still, but no geometry in ``rays``; plants that
    lean, and ground with ruts, have their rows, but no geometry in ``rays`` either. Sensors ask ``interval`` for where
    these are. ``still`` is the scene without bodies, lean and ruts; ``cast`` and ``occluded`` see it alone.

    Raises:
        ConfigurationError: the world is of another type, or a body has a mesh that it cannot have.
    """

    def __init__(self, world: World, moving: Moving = STILL) -> None:
        given_world(world, None)
        self.world = world
        self.engine = Engine()
        self.meshes = [*world.meshes.values(), *([world.backdrop] if world.backdrop is not None else [])]
        self.top_levels = list(_top_levels(world))
        self._parts = {mesh.name: [self.mesh_rays(mesh, part) for part in parts_of(mesh)] for mesh in self.meshes}
        self.ruts = _NO_RUTS
        self.rays, geometry_top = self._standing(len(moving.bodies))
        self.hits = _hit_table(world, self.meshes, self.top_levels, geometry_top)
        self.still, self.moving, self.plants = self, list[Traced](), _NO_PLANTS
        self.ripples = None if moving.leaning is None else moving.leaning.ripples
        leaning = moving.leaning if moving.leaning is not None and len(moving.leaning.rows) else None
        moving = replace(moving, leaning=leaning, ruts=moving.ruts if world.terrain.visible else None)
        if not moving:
            return
        self.still = copy(self)
        self.still.still = self.still
        first, plants, remaining = len(moving.bodies), list[int](), dict[int, list[RayScene]]()
        if leaning is not None:
            plants, remaining = self._lean(leaning, first)
        if moving.ruts is not None:
            self.ruts = TracedRuts(moving.ruts, self.engine, first + len(plants))
        if leaning is not None or moving.ruts is not None:
            self.rays, geometry_top = self._standing(first + len(plants), remaining)
            geometry_top[first : first + len(plants)] = plants
        self._add(moving.bodies, geometry_top)

    @property
    def moves(self) -> bool:
        """Return whether anything moves, so that readings depend on their stamps."""
        return bool(self.moving) or self.plants is not None or self.ruts is not None

    def _standing(
        self, first: int, remaining: Mapping[int, Sequence[RayScene]] | None = None
    ) -> tuple[RayScene, list[int]]:
        """Build the Embree scene of what stands still, and return the top-level geometry of each number.

        The first numbers are those of bodies, and then of plants. ``remaining`` has what remains of top-level
        geometries of which a part leans.
        """
        rays, remaining = RayScene(self.engine, first), remaining or {}
        masks = {mesh.name: _mask(self.world, mesh) for mesh in self.meshes}
        geometry_top = [len(self.top_levels) + row for row in range(first)]
        for row, (mesh, pose, *_) in enumerate(self.top_levels):
            if mesh is None:
                if self.world.terrain.visible:
                    nodes = terrain_nodes(self.world.terrain.surface)
                    if self.ruts is None:
                        rays.add_grid(nodes)
                    else:
                        rays.add_grids(ground_tiles(self.ruts.ruts, nodes)[None])
                    geometry_top.append(row)
                continue
            for part in remaining.get(row, self._parts[mesh.name]):
                rays.add_instance(part, pose, mask=masks[mesh.name])
                geometry_top.append(row)
        return rays.commit(), geometry_top

    def _lean(self, leaning: Leaning, first: int) -> tuple[list[int], dict[int, list[RayScene]]]:
        """Trace plants that lean, of numbers from ``first`` on; return their top-level geometries, and what remains."""
        pieces, made = dict[str, Index](), dict[tuple[str, int], list[RayScene]]()

        def parts(mesh: str, bunch: int) -> list[RayScene]:
            """Return the Embree scenes of a plant, of a bunch of its stems, or of its trunk or some of its limbs."""
            if bunch == WHOLE:
                return self._parts[mesh]
            if mesh not in pieces:
                pieces[mesh] = pieces_of(self.world.meshes[mesh])
            if (mesh, bunch) not in made:
                made[mesh, bunch] = [self.mesh_rays(self.world.meshes[mesh], pieces[mesh] == bunch)]
            return made[mesh, bunch]

        self.plants = TracedPlants(leaning, parts, first)
        table, own = leaning.plants, np.zeros(len(leaning.plants.top), np.bool_)
        own[leaning.rows] = True
        remaining: dict[int, list[RayScene]] = {int(top): [] for top in table.top[own]}
        partly = ~own & np.isin(table.top, table.top[own])
        for row in np.flatnonzero(partly).tolist():
            remaining[int(table.top[row])] += parts(str(table.mesh[row]), int(table.bunch[row]))
        return table.top[self.plants.rows].tolist(), remaining

    def _add(self, bodies: Sequence[MovingBody], geometry_top: list[int]) -> None:
        """Add rows for bodies to the tables, and build the Embree scenes of their meshes."""
        check_bodies(bodies, self.world, self.meshes)
        own, known = {body.mesh.name: body.mesh for body in bodies}, {mesh.name for mesh in self.meshes}
        self.meshes = [*self.meshes, *(mesh for name, mesh in own.items() if name not in known)]
        tops = [TopLevel(each.mesh, np.eye(4), each.object_id, each.tint) for each in bodies]
        self.top_levels = [*self.top_levels, *tops]
        self.hits = _hit_table(self.world, self.meshes, self.top_levels, geometry_top)
        scenes = {name: self.mesh_rays(mesh) for name, mesh in own.items()}
        radius = {name: float(np.linalg.norm(mesh.vertices, axis=1).max()) for name, mesh in own.items()}
        self.moving = [Traced(each, scenes[each.mesh.name], radius[each.mesh.name]) for each in bodies]

    def interval(self, begin_ns: int, end_ns: int, centre: Array, reach: float) -> Interval:
        """Return bodies within a reach [m] of a position (3,), plants and ruts, from one stamp [ns] to another.

        Raises:
            ConfigurationError: anything moves, and the interval is too long.
        """
        if not self.moves:
            return Interval(self.rays.alone, begin_ns, 0)
        span, near = (begin_ns, end_ns), (centre, reach)
        return interval_of(self.rays, self.moving, self.plants, self.ruts, span, near)

    @property
    def materials(self) -> tuple[str, ...]:
        """Names of the world's materials, by ``Hits.material``."""
        return tuple(self.world.materials)

    def cast(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        max_range: float = np.inf,
        *,
        min_range: float = 0.0,
        water: bool = True,
        workers: int | None = None,
    ) -> Hits:
        """Return the first surface that each ray hits.

        Args:
            origins: (n, 3) [m] in the world frame, or (3,) of all rays; float32 is traced without a copy.
            directions: (n, 3) in the world frame, or (3,) of all rays; of any length above 0, which changes nothing.
            max_range: farther surfaces are not hit [m].
            min_range: nearer surfaces are not hit [m]; above 0, a ray that leaves a surface does not hit it again.
            water: whether water is hit; otherwise rays go straight through.
            workers: threads, by default one per core.

        Raises:
            ValueError: a direction without length, a number that is not finite, or shapes that do not fit.
        """
        bundle = bundle_of(origins, directions, "directions", min_range, max_range, water)
        still = self.still
        scene, hits, table, count = still.rays.handle, still.hits, still._cast_table, _count(bundle)
        out = Hits(
            np.empty(count, np.float32),
            np.empty((count, 3), bundle.origins.dtype),
            np.empty((count, 3), np.float32),
            np.empty(count, np.uint8),
            np.empty(count, np.uint32),
            np.empty(count, np.int16),
        )
        _in_blocks(bundle, workers, lambda packet, span: int(trace_rays(scene, hits, table, packet, bundle, span, out)))
        return out

    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike | None = None,
        max_range: float = np.inf,
        *,
        targets: ArrayLike | None = None,
        min_range: float = 0.0,
        water: bool = True,
        workers: int | None = None,
    ) -> Mask:
        """Mask of the rays (n,) that something blocks: along ``directions`` up to ``max_range``, or before ``targets``.

        It is faster than ``cast``, because any hit will do. Arguments are those of ``cast``, and:

        Args:
            origins: see ``cast``.
            directions: see ``cast``.
            max_range: see ``cast``.
            targets: (n, 3) [m] in the world frame, or (3,) of all rays, instead of directions. What is in the last
                millimetre before a target does not hide it: it may be on a surface.
            min_range: see ``cast``.
            water: see ``cast``.
            workers: see ``cast``.

        Raises:
            ValueError: as ``cast``; not exactly one of directions and targets.
        """
        if (directions is None) == (targets is None):
            raise ValueError("occluded needs directions or targets, one of the two")
        if targets is not None:
            bundle = bundle_of(origins, targets, "targets", min_range, max_range, water)
        else:
            bundle = bundle_of(origins, np.asarray(directions), "directions", min_range, max_range, water)
        scene, out = self.still.rays.handle, np.empty(_count(bundle), np.bool_)
        _in_blocks(bundle, workers, lambda packet, span: int(block_rays(scene, packet, bundle, span, out)))
        return out

    @cached_property
    def part_codes(self) -> PartCodes:
        """Codes of what sensors with ``parts`` hit.

        Raises:
            ConfigurationError: a user's own classes leave too few ids for codes.
        """
        label = self.hits.face_label
        part = np.concatenate([*(mesh.face_parts for mesh in self.meshes), np.zeros(0, np.uint8)])
        pairs = np.stack([label[part > 0], part[part > 0]])
        own = np.unique(pairs[0].astype(np.int64) << 8 | pairs[1])
        free = np.setdiff1d(np.arange(len(Label), 256), [row.label for row in self.world.classes.coloured])
        if len(free) < len(own):
            raise ConfigurationError(f"parts need {len(own)} ids that no class has, and {len(free)} are free")
        codes, codes_label, codes_part = label.copy(), np.arange(256, dtype=np.uint8), np.zeros(256, np.uint8)
        found = free[: len(own)]
        codes[part > 0] = found[np.searchsorted(own, pairs[0].astype(np.int64) << 8 | pairs[1])]
        codes_label[found], codes_part[found] = own >> 8, own & 255
        return PartCodes(self.hits._replace(face_label=codes), codes_label, codes_part)

    @cached_property
    def owners(self) -> NDArray[np.uint32]:
        """Instance ids by the row of ``top_levels`` and 1 more; that of 0 is 0."""
        return np.concatenate([np.zeros(1, np.uint32), self.hits.top_object])

    @cached_property
    def _cast_table(self) -> CastTable:
        return _make_cast_table(self.world, self.meshes, [top.world_from_object for top in self.top_levels], self.hits)

    def mesh_rays(self, mesh: Mesh, part: Mask | None = None) -> RayScene:
        """Build the Embree scene of a mesh in its own frame, of all faces or of a part (f,) of them."""
        scene, vertices = RayScene(self.engine), mesh.vertices
        faces = mesh.faces.astype(np.uint32)
        if part is not None:
            used, row = np.unique(faces[part], return_inverse=True)
            faces[part], faces[~part], vertices = row.reshape(-1, 3), MISS, vertices[used]
        scene.add_mesh(vertices, faces)
        return scene.commit()


def given_world(world: World | None, scene: Scene | None) -> World | None:
    """Return the world that a caller gives, also as a scene of it; None if neither is given.

    Raises:
        ConfigurationError: of another type, or the scene is of another world.
    """
    for name, given, kind in (("world", world, World), ("scene", scene, Scene)):
        if given is not None and not isinstance(given, kind):
            raise ConfigurationError(f"{name} must be a {kind.__name__}, got {given!r}; see load_world")
    if world is not None and scene is not None and scene.world is not world:
        raise ConfigurationError(f"scene must be of the given world {world.name}, got one of {scene.world.name}")
    return world if scene is None else scene.world


def _top_levels(world: World) -> Iterator[TopLevel]:
    for mesh in (None, *([world.backdrop] if world.backdrop is not None else [])):
        yield TopLevel(mesh, np.eye(4), GROUND_ID, _NO_TINT)
    for instance in world.instances:
        yield TopLevel(world.meshes[instance.mesh], instance.world_from_object, instance.object_id, instance.tint)
    for swarm in world.swarms:
        meshes = [world.meshes[name] for name in swarm.meshes]
        for row, pose, tint in zip(swarm.mesh.tolist(), swarm.world_from_object, swarm.tint.tolist(), strict=True):
            yield TopLevel(meshes[row], pose, swarm.object_id, tint)


def _mask(world: World, mesh: Mesh) -> int:
    if any(world.materials[name].mirror > 0 for name in mesh.materials):
        return CLEAR
    return SOLID if mesh.axis is None else THIN


def parts_of(mesh: Mesh) -> list[Mask]:
    """Return the faces (f,) of each part: all in one, or those below and those above the best height in two.

    The chance that a ray hits a box is proportional to the box's area; the best height is where the sum is least.
    """
    corners = mesh.vertices[mesh.faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.argsort(low[:, 2] + high[:, 2], kind="stable")
    low, high = low[order], high[order]
    below = _area(np.maximum.accumulate(high) - np.minimum.accumulate(low))
    above = _area(np.maximum.accumulate(high[::-1]) - np.minimum.accumulate(low[::-1]))[::-1]
    if len(order) < 2 or (below[:-1] + above[1:]).min() > _GAIN * below[-1]:
        return [np.ones(len(order), np.bool_)]
    lower = np.zeros(len(order), np.bool_)
    lower[order[: int(np.argmin(below[:-1] + above[1:])) + 1]] = True
    return [lower, ~lower]


def _area(size: Array) -> Array:
    """Half the area (n,) of boxes of a size (n, 3)."""
    return np.asarray((size * np.roll(size, 1, axis=1)).sum(axis=1))


def _hit_table(world: World, meshes: list[Mesh], top_levels: list[TopLevel], geometry_top: list[int]) -> HitTable:
    """Concatenate classes and instance ids into tables that kernels index."""
    labels = {name: int(material.label) for name, material in world.materials.items()}
    rows = {mesh.name: row for row, mesh in enumerate(meshes)}
    face_labels = [np.array([labels[n] for n in m.materials], np.uint8)[m.material] for m in meshes]
    return HitTable(
        geometry_top=np.array(geometry_top, np.int32),
        top_object=np.array([top.object_id for top in top_levels], np.uint32),
        top_mesh=np.array([-1 if top.mesh is None else rows[top.mesh.name] for top in top_levels], np.int32),
        mesh_face=np.cumsum([0, *(len(m.faces) for m in meshes)])[:-1].astype(np.int64),
        face_label=np.concatenate([*face_labels, np.zeros(0, np.uint8)]),
        trail_distance=grid_of(world.terrain.trail_distance),
    )


def terrain_nodes(field: Heightfield) -> Float32Array:
    """Nodes (nx, ny, 3) [m] of a heightfield."""
    nx, ny = field.heights.shape
    nodes = np.empty((nx, ny, 3), np.float32)
    nodes[..., 0] = (field.x0 + field.spacing * np.arange(nx))[:, None]
    nodes[..., 1] = field.y0 + field.spacing * np.arange(ny)
    nodes[..., 2] = field.heights
    return nodes


def grid_of(raster: Raster | Heightfield) -> Grid:
    """Convert a raster of one channel, or heights, to the form that kernels take."""
    values = raster.heights if isinstance(raster, Heightfield) else raster.values
    return Grid(np.ascontiguousarray(values, np.float32), raster.x0, raster.y0, 1.0 / raster.spacing)


def _make_cast_table(world: World, meshes: list[Mesh], poses: list[NDArray[np.float64]], hits: HitTable) -> CastTable:
    """Return what hits are looked up in; ``poses`` (4, 4) are those of the top-level geometries of ``hits``."""
    rows = {name: row for row, name in enumerate(world.materials)}
    faces = [np.array([rows[n] for n in m.materials], np.int16)[m.material] for m in meshes]
    terrain = world.terrain
    ground = [rows[name] for name in (*terrain.ground_materials, *terrain.trail_materials)]
    cover = np.ascontiguousarray(terrain.cover.values, np.float32)
    rotations = aligned(16 * len(poses)).reshape(-1, 16)
    rotations[:, :9] = np.array([pose[:3, :3].ravel() for pose in poses])
    words = rotations.view(np.uint32)
    words[:, OBJECT] = hits.top_object
    words[:, FIRST] = np.array([*hits.mesh_face, 0])[hits.top_mesh]  # the terrain's row is -1
    return CastTable(
        tops=rotations,
        words=words,
        face_material=np.concatenate([*faces, np.zeros(1, np.int16)]),
        label=np.array([int(material.label) for material in world.materials.values()], np.uint8),
        cover=cover,
        ground=np.array(ground if terrain.trail_material else [*ground, -1, -1], np.int16),
        grid=Grid(cover[..., 0], terrain.cover.x0, terrain.cover.y0, 1.0 / terrain.cover.spacing),
        border_width=terrain.border_width,
    )


def bundle_of(
    origins: ArrayLike, ahead: ArrayLike, kind: Literal["directions", "targets"], near: float, far: float, water: bool
) -> Bundle:
    """Check the shapes of rays, and bring origins and directions, or targets, to one type of numbers.

    Raises:
        ValueError: shapes that do not fit, or limits that are no range.
    """
    given = {"origins": np.asarray(origins), kind: np.asarray(ahead)}
    single = all(array.dtype == np.float32 for array in given.values())
    for name, array in given.items():
        if array.ndim not in (1, 2) or array.shape[-1] != 3:
            raise ValueError(f"{name} must have the shape (n, 3) or (3,), got {array.shape}")
    kind_of_number: Any = np.float32 if single else np.float64
    starts, ends = (np.ascontiguousarray(np.atleast_2d(array), kind_of_number) for array in given.values())
    if given["origins"].ndim == given[kind].ndim == 2 and len(starts) != len(ends):
        raise ValueError(f"origins and {kind} must be equally many, got {len(starts)} and {len(ends)}")
    if not 0.0 <= near <= far:
        raise ValueError(f"min_range must be at least 0 and at most max_range, got {near} and {far}")
    steps = [int(array.ndim == 2) for array in given.values()]
    mask = MISS if water else SOLID | THIN
    return Bundle(starts, steps[0], ends, steps[1], kind == "targets", float(near), float(far), mask)


def _count(bundle: Bundle) -> int:
    """Return the number of rays."""
    starts, ends = len(bundle.origins), len(bundle.ahead)
    return ends if bundle.ahead_step else starts


def _in_blocks(bundle: Bundle, workers: int | None, work: Callable[[Packet, tuple[int, int]], int]) -> None:
    """Trace blocks of rays, each from a first to a last row.

    Raises:
        ValueError: ``work`` returned the row of an invalid ray, instead of -1.
    """
    count = _count(bundle)
    spans = [(first, min(first + BLOCK, count)) for first in range(0, count, BLOCK)]
    threads = min(workers or cpu_count(), len(spans))

    def trace(span: tuple[int, int]) -> int:
        return work(new_packet(coherent=False), span)

    for bad in in_order(spans, trace, threads) if threads > 1 else map(trace, spans):
        if bad >= 0:
            raise ValueError(_problem(bundle, bad, count))


def cast_rays(scene: Scene, origins: ArrayLike, directions: ArrayLike, max_range: float = np.inf) -> Hits:
    """Call ``Scene.cast``, which replaces this function."""
    warnings.warn("cast_rays(scene, ...) is now scene.cast(...)", DeprecationWarning, stacklevel=2)
    return scene.cast(origins, directions, max_range)


def _problem(bundle: Bundle, row: int, count: int) -> str:
    """State what is wrong with a ray."""
    where = f"; row {row} is" if count > 1 else ", got" if bundle.targets else ""
    origin, ahead = bundle.origins[row * bundle.origin_step], bundle.ahead[row * bundle.ahead_step]
    with np.errstate(over="ignore"):
        if not np.isfinite(origin.astype(np.float32)).all():
            return f"origins must be finite{where or ', got'} {origin.tolist()}"
    if bundle.targets:
        return f"targets must be finite{where} {ahead.tolist()}"
    return "directions must be finite and longer than 0" + (f"{where} {ahead.tolist()}" if where else "")
