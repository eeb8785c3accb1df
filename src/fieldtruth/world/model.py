# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The data of a world: terrain, shared meshes, objects that are instances of them, swarms, materials.

A triangle's class is its material's; the terrain's class follows from the signed distance to the nearest trail's edge.

``World.from_meshes`` makes a world of triangles of a user's own meshes with class, name and colour, which are checked.
Meshes and scenes of trimesh are known by their attributes; the library itself is not needed.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property
from itertools import count
from numbers import Real
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import CLASSES, GROUND_ID, OF_ACTORS, OF_MAPS, ClassTable, Label, SemanticClass, as_key
from fieldtruth.core.errors import ConfigurationError, UnknownNameError, nearest_first
from fieldtruth.core.geodesy import PAPER_ORIGIN, Origin
from fieldtruth.world.classes import with_own

ROBOT_ID: Final = 0
"""Instance id of the robot. Pixels without an object, of the sky, have it too: they differ in the class."""
FALLEN: Final = "fallen_leaves"
"""Kind of the swarm of leaves that fell; material of the ground where they lie close."""
LITTER: Final = "litter"
"""Kind of the swarms of what lies loose on the ground."""
LOOSE: Final = frozenset({LITTER, FALLEN})
"""Kinds of swarms that bear no wheel, though their class is the ground's."""
WIDE_IDS: Final = 1 << 16
"""Instance ids from here on do not fit into 16 bits."""


@dataclass(frozen=True, kw_only=True)
class Material:
    """Appearance and class of a surface.

    ``texture`` names an image in ``World.textures``; its mean colour is multiplied by ``tint`` (linear, 1 = unchanged).
    """

    name: str
    label: int
    texture: str
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    translucency: float = 0.0
    """Share of the light from behind that is transmitted (leaves: about 0.4)."""
    gloss: float = 0.0
    """Strength of the highlight, 0 (matt) to 1 (wet or lacquered)."""
    mirror: float = 0.0
    """Reflectance of a slightly rippled surface at normal incidence (water: 0.02); 0 turns reflections off."""
    furrows: float = 0.0
    """Depth [m] of black below white parts of the texture, by which photographs tilt the surface's normals."""
    weathering: float = 0.0
    """Moss, crusts and soil that photographs add to wood and rock, 0 (none) to 1 (in a damp forest)."""
    patches: float = 0.0
    """Relative brightness of the patches, tens of metres wide, that photographs add to distant land."""
    steep: str = ""
    """Texture that photographs show where distant land is steeper than about 37 deg; empty for none."""
    repeat: float = 1.0
    """Length [m] of the ground that one repeat of the texture covers; meshes have uv coordinates instead."""
    relief: float = 0.0
    """Height [m] of the texture's highest above its lowest parts, on the ground, if the texture has heights."""
    ground_type: str = ""
    """Ground type, a name in ``materials.GROUND_TYPES``; empty for anything else."""
    reflectance: float | None = None
    """Of a LiDAR's light; None for that of its ground type, texture or class."""

    @property
    def images(self) -> tuple[str, ...]:
        """Names of its textures."""
        return (self.texture, self.steep) if self.steep else (self.texture,)


@dataclass(frozen=True, kw_only=True)
class Collider:
    """An upright primitive, or a convex body, that replaces a mesh in the physics, in the object's frame.

    ``size`` [m] is (radius, height) of a cylinder or (length, width, height) of a box; ``position``: base centre.
    """

    shape: Literal["cylinder", "box"]
    size: tuple[float, ...]
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_deg: float = 0.0
    points: tuple[tuple[float, float, float], ...] = ()
    """Corners [m] of a convex body, whose bounding box the other values are; empty for a primitive."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Mesh:
    """Triangles in the object's frame: origin on the ground below the middle, z up, x forward (furniture faces +x).

    ``vertices`` (v, 3) float32 [m]; ``normals`` (v, 3) float32 of unit length; ``uv`` (v, 2) float32 in repeats of the
    texture; ``faces`` (f, 3) int32; ``material`` (f,) int32, a row of ``materials``. Meshes reach below z = 0 into
    the soil, so that objects do not float on a slope. ``footprint`` [m] is the radius about the origin that is kept
    free of other objects.
    """

    name: str
    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    uv: NDArray[np.float32]
    faces: NDArray[np.int32]
    material: NDArray[np.int32]
    materials: tuple[str, ...]
    colliders: tuple[Collider, ...] = ()
    footprint: float = 0.5
    species: tuple[str, ...] = ()
    """Names of the species, or of the rock type, that it was made from; empty for furniture."""
    passable: bool = False
    """True: a robot passes through it, whatever its class; it has no colliders."""
    axis: NDArray[np.float32] | None = None
    """Of a wire: points (k, 4) of its centre line, x, y, z and radius [m]; None for anything else."""
    tufts: NDArray[np.float32] | None = None
    """Of tufts and clumps: x, y of each tuft's middle, its height [m] and its row of ``species`` (k, 4); else None."""
    part: NDArray[np.uint8] | None = None
    """``PlantPart`` (f,) of each face; None for what is no plant."""
    limb: NDArray[np.int16] | None = None
    """Of trees: row (f,) of ``joints`` of the limb that each face is on, -1 for the trunk; None for anything else."""
    joints: NDArray[np.float32] | None = None
    """Of trees: where each limb leaves the trunk's axis (l, 3) [m]; else None."""

    @property
    def face_parts(self) -> NDArray[np.uint8]:
        """``PlantPart`` (f,) of each face, 0 for what is no plant."""
        return np.zeros(len(self.faces), np.uint8) if self.part is None else self.part

    @property
    def face_limbs(self) -> NDArray[np.int16]:
        """Row (f,) of ``joints`` of each face's limb, -1 for none."""
        return np.full(len(self.faces), -1, np.int16) if self.limb is None else self.limb


def make_mesh(
    name: str,
    vertices: ArrayLike,
    normals: ArrayLike,
    uv: ArrayLike,
    faces: ArrayLike,
    materials: Sequence[str],
    rows: ArrayLike | None = None,
    **others: Any,
) -> Mesh:
    """Mesh of numbers of any precision, in arrays of any shape; ``rows`` (f,) of ``materials`` by face, default 0."""
    triangles = np.asarray(faces, np.int32).reshape(-1, 3)
    return Mesh(
        name=name,
        vertices=np.asarray(vertices, np.float32).reshape(-1, 3),
        normals=np.asarray(normals, np.float32).reshape(-1, 3),
        uv=np.asarray(uv, np.float32).reshape(-1, 2),
        faces=triangles,
        material=np.zeros(len(triangles), np.int32) if rows is None else np.asarray(rows, np.int32),
        materials=tuple(materials),
        **others,
    )


def merge_meshes(name: str, parts: Sequence[Mesh], *, footprint: float) -> Mesh:
    """Merge meshes of one frame; equal materials and species are named once, colliders keep their order."""
    names = tuple(dict.fromkeys(n for part in parts for n in part.materials))
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    rows = [np.array([names.index(n) for n in part.materials], np.int32)[part.material] for part in parts]
    species = tuple(dict.fromkeys(s for part in parts for s in part.species))
    return Mesh(
        name=name,
        vertices=np.concatenate([part.vertices for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        uv=np.concatenate([part.uv for part in parts]),
        faces=np.concatenate([part.faces + np.int32(o) for part, o in zip(parts, offsets, strict=True)]),
        material=np.concatenate(rows),
        materials=names,
        colliders=tuple(c for part in parts for c in part.colliders),
        footprint=footprint,
        species=species,
        tufts=_merged_tufts(parts, species),
        part=np.concatenate([p.face_parts for p in parts]) if any(p.part is not None for p in parts) else None,
        **_merged_limbs(parts),
    )


def _merged_limbs(parts: Sequence[Mesh]) -> dict[str, Any]:
    """Limbs and joints of meshes of one frame; nothing without any."""
    if all(part.joints is None for part in parts):
        return {}
    joints = [np.zeros((0, 3), np.float32) if part.joints is None else part.joints for part in parts]
    first = np.cumsum([0, *(len(own) for own in joints)])
    limbs = [np.where(p.face_limbs < 0, -1, p.face_limbs + k) for p, k in zip(parts, first, strict=False)]
    return {"limb": np.concatenate(limbs).astype(np.int16), "joints": np.concatenate(joints)}


def _merged_tufts(parts: Sequence[Mesh], species: tuple[str, ...]) -> NDArray[np.float32] | None:
    """Tufts of meshes of one frame, with their rows of the ``species`` of all; None without any."""
    found = list[NDArray[np.float32]]()
    for part in parts:
        if part.tufts is not None:
            rows = np.array([species.index(name) for name in part.species])[part.tufts[:, 3].astype(np.intp)]
            found.append(np.column_stack([part.tufts[:, :3], rows]).astype(np.float32))
    return np.concatenate(found) if found else None


@dataclass(frozen=True, kw_only=True)
class Instance:
    """An object: a mesh at a pose. ``object_id`` is its row in /gazebo/model_states and the cloud's ``instance``."""

    name: str
    kind: str
    mesh: str
    object_id: int
    world_from_object: NDArray[np.float64]  # (4, 4), rotation times a uniform scale, and translation [m]
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class Swarm:
    """Many objects of a kind under one instance id and without colliders: tufts of grass, pebbles, distant trees."""

    name: str
    kind: str
    object_id: int
    meshes: tuple[str, ...]
    mesh: NDArray[np.int32]  # (n,) row of ``meshes``
    world_from_object: NDArray[np.float64]  # (n, 4, 4), rotation times a uniform scale, and translation [m]
    tint: NDArray[np.float32]  # (n, 3)


@dataclass(frozen=True, kw_only=True)
class Heightfield:
    """A regular grid of heights: ``heights[i, j]`` [m] is at x = x0 + i * spacing, y = y0 + j * spacing.

    Each cell is two triangles, divided from (i, j) to (i + 1, j + 1).
    """

    heights: NDArray[np.float32]  # (nx, ny)
    spacing: float  # [m]
    x0: float
    y0: float

    def height_at(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Height [m] of the triangles at world x, y [m] (any shape); outside the grid that of its edge."""
        i, j, fu, fv = _cell(self, self.heights.shape, x, y)
        h = self.heights  # picked before it is widened: a copy of two million nodes costs more than the lookup
        h00, h11 = h[i, j].astype(np.float64), h[i + 1, j + 1].astype(np.float64)
        corner = np.where(fu >= fv, h[i + 1, j], h[i, j + 1]).astype(np.float64)
        first, second = np.where(fu >= fv, fu, fv), np.where(fu >= fv, fv, fu)
        return np.asarray(h00 + first * (corner - h00) + second * (h11 - corner))

    def slope_at(self, x: ArrayLike, y: ArrayLike, step: float = 0.25) -> tuple[Array, Array]:
        """Slopes [rise over run] along x and along y, by central differences over ``step`` [m] to either side."""
        x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
        along_x = (self.height_at(x + step, y) - self.height_at(x - step, y)) / (2 * step)
        along_y = (self.height_at(x, y + step) - self.height_at(x, y - step)) / (2 * step)
        return along_x, along_y


@dataclass(frozen=True, kw_only=True)
class Raster:
    """Values at the nodes of a regular grid over the world, (nx, ny) or (nx, ny, channels), with bilinear lookup."""

    values: NDArray[np.float32]
    spacing: float  # [m]
    x0: float
    y0: float

    def at(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Bilinear value at world x, y [m]; outside the grid that of its edge."""
        i, j, fu, fv = _cell(self, self.values.shape, x, y)
        if self.values.ndim == 3:
            fu, fv = fu[..., None], fv[..., None]
        g = self.values  # weights are float64, so is the sum
        low = g[i, j] * (1 - fv) + g[i, j + 1] * fv
        high = g[i + 1, j] * (1 - fv) + g[i + 1, j + 1] * fv
        return np.asarray(low * (1 - fu) + high * fu)


def _cell(
    grid: Heightfield | Raster, shape: tuple[int, ...], x: ArrayLike, y: ArrayLike
) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
    """Row and column of the cells that hold positions, or of those at the edge, and the shares of a cell beyond."""
    u = np.clip((np.asarray(x, np.float64) - grid.x0) / grid.spacing, 0, shape[0] - 1)
    v = np.clip((np.asarray(y, np.float64) - grid.y0) / grid.spacing, 0, shape[1] - 1)
    i, j = np.minimum(u.astype(int), shape[0] - 2), np.minimum(v.astype(int), shape[1] - 2)
    return i, j, u - i, v - j


def node_axes(grid: Heightfield | Raster) -> tuple[Array, Array]:
    """Coordinates [m] along x and along y of a grid's nodes."""
    nx, ny = (grid.heights if isinstance(grid, Heightfield) else grid.values).shape[:2]
    return grid.x0 + grid.spacing * np.arange(nx, dtype=float), grid.y0 + grid.spacing * np.arange(ny, dtype=float)


@dataclass(frozen=True, kw_only=True)
class Terrain:
    """The ground. ``trail_distance`` [m] is signed: below 0 inside a trail. The class is trail there, ground elsewhere.

    ``field`` is soil, paving and rock: what bears wheels and objects. ``layer`` (nx, ny) [m] is the height of short
    grass and litter above it at the field's nodes, at least 0; it bends under a wheel; None without one.

    ``snow`` (nx, ny) [m] is the depth of snow, of which ``layer`` is at least as high; None without any.

    ``cover`` has one channel per name in ``ground_materials``: the weights with which they are mixed outside trails, or
    everywhere if ``trail_material`` is empty: then trails differ in their materials.

    ``colour`` (nx, ny, 3) is the linear colour of the ground at the cover's nodes; None: the mean of its materials.
    """

    field: Heightfield
    trail_distance: Raster
    cover: Raster
    ground_materials: tuple[str, ...]
    trail_material: str
    border_material: str
    border_width: float = 0.0  # [m], measured inwards from the trail's edge
    layer: NDArray[np.float32] | None = None
    snow: NDArray[np.float32] | None = None
    colour: NDArray[np.float32] | None = None
    visible: bool = True
    """True: rays meet it, and exports contain it. Otherwise only light and physics assume the ground there."""

    @property
    def trail_materials(self) -> tuple[str, ...]:
        """Materials of trails and of their borders that are not in the cover."""
        return (self.trail_material, self.border_material) if self.trail_material else ()

    @property
    def other_ground(self) -> Raster:
        """Distance [m] to the ground that has one of ``trail_materials``, signed as ``trail_distance``."""
        nowhere = np.full((2, 2), np.float32(1e3))
        return self.trail_distance if self.trail_material else Raster(values=nowhere, spacing=1e6, x0=-5e5, y0=-5e5)

    @cached_property
    def surface(self) -> Heightfield:
        """Field with its layer, which rays meet, cameras show and exports contain."""
        return self.field if self.layer is None else replace(self.field, heights=self.field.heights + self.layer)

    def label_at(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.uint8]:
        """Class id of the ground at world x, y [m]."""
        return np.where(self.trail_distance.at(x, y) < 0, Label.TRAIL, Label.GROUND).astype(np.uint8)


@dataclass(frozen=True, kw_only=True)
class World:
    """An environment built from a seed and a layout. Frame: x north, y west, z up, origin in its centre."""

    name: str
    seed: int
    size: tuple[float, float]  # [m] along x and y
    terrain: Terrain
    meshes: Mapping[str, Mesh]
    instances: tuple[Instance, ...]
    materials: Mapping[str, Material]
    textures: Mapping[str, NDArray[np.uint8]]  # (n, n, 3) sRGB or (n, n, 4) with heights, tileable, n a power of two
    swarms: tuple[Swarm, ...] = ()
    water_level: float | Raster | None = None
    """Height [m] of the water's surface, which are instances of kind "water"; lower ground is under water. A raster if
    there are several bodies of water, far below the ground where it is dry."""
    backdrop: Mesh | None = None
    """Land outside the world's edge down to the horizon, class ground, visible to cameras and LiDAR."""
    layout: Mapping[str, Any] = field(default_factory=dict)
    """Changes to the environment's layout with which it was built."""
    object_names: tuple[str, ...] = field(default=())
    """Name of each instance id; 0 is the robot, 1 the ground."""
    origin: Origin = PAPER_ORIGIN
    """Origin of the frame on the Earth."""

    @classmethod
    def from_meshes(
        cls, meshes: Iterable[Any], *, ground: float | None = None, classes: Mapping[str, Any] | None = None
    ) -> "World":
        """Make a world of your own meshes, for ``Scene``, ``Lidar``, ``Camera`` and ``LabelCamera``.

        Instance ids count from 2 in the order of the meshes; ``object_names`` has their names. Surfaces have plain
        colours, and nothing that a robot in the physics would touch. What no ray hits is sky.

        Args:
            meshes: each a ``MeshPart``, or a mesh or scene of trimesh whose metadata has a ``label``; in the world's
                frame, z up, within 10 km of the origin. Light takes the least time near it.
            ground: height [m] of flat ground, class ground and instance id 1, that reaches 10 m beyond the meshes.
                None: no ray hits ground.
            classes: of your own, by name, as in a layout: ``{"hay_bale": {"colour": [200, 180, 60]}}``.

        Raises:
            UnknownNameError: a class that does not exist, or that no object of a world has.
            ConfigurationError: no meshes, or one with numbers, faces, a name or a pose that are not allowed.
        """
        if ground is not None and (isinstance(ground, bool) or not isinstance(ground, Real) or not np.isfinite(ground)):
            raise ConfigurationError(f"ground must be a height [m] or None, got {ground}")
        layout = {"classes": dict(classes)} if classes else {}
        objects = objects_of(meshes, with_own(layout))
        materials: dict[str, Material] = {}
        soil = _plain(materials, CLASSES[Label.GROUND], GREY)
        placed = [_object(name, k, parts, materials) for k, (name, parts) in enumerate(objects.items(), GROUND_ID + 1)]
        corners = np.concatenate([each.corners for parts in objects.values() for each in parts])
        side = max(2 * (float(np.abs(corners[..., :2]).max()) + (0.0 if ground is None else _AROUND)), 1.0)
        height = float(corners[..., 2].min() if ground is None else ground)
        return cls(
            name="meshes",
            seed=0,
            size=(side, side),
            terrain=_plane(side, height, soil, visible=ground is not None),
            meshes={mesh.name: mesh for mesh, _ in placed},
            instances=tuple(instance for _, instance in placed),
            materials=materials,
            textures={"plain": np.full((1, 1, 3), 255, np.uint8)},
            layout=layout,
            object_names=(*TAKEN, *objects),
        )

    @cached_property
    def classes(self) -> ClassTable:
        """Those of ours that any world may have or that its materials have, and those of its layout."""
        present = {material.label for material in self.materials.values()}
        return with_own(self.layout).without(*(OF_MAPS | OF_ACTORS) - present)

    def water_at(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Height [m] of the water's surface at world x, y [m]; far below the ground where it is dry."""
        return water_at(self.water_level, x, y)

    @property
    def has_wide_ids(self) -> bool:
        """True if an instance id needs more than 16 bits."""
        ids = (*(each.object_id for each in self.instances), *(each.object_id for each in self.swarms))
        return max(ids, default=0) >= WIDE_IDS


def water_at(level: float | Raster | None, x: ArrayLike, y: ArrayLike) -> Array:
    """``World.water_at`` of a ``World.water_level``."""
    if isinstance(level, Raster):
        return level.at(x, y)
    return np.full(np.broadcast(x, y).shape, -np.inf if level is None else level)


GREY: Final = (0.3, 0.3, 0.3)
"""Colour of meshes without one."""
FARTHEST: Final = 10_000.0
"""Distance [m] of vertices from the origin along each axis at most: a position there is single precision, 1 mm."""
TAKEN: Final = ("husky", "meshes_ground")
"""Names of the robot and of the ground, instance ids 0 and 1."""
_AROUND: Final = 10.0
"""[m] of ground around a user's meshes."""
_WATER_MIRROR: Final = 0.02


@dataclass(frozen=True)
class MeshPart:
    """Triangles of one class for ``World.from_meshes``. Parts of equal names are one object with one instance id."""

    mesh: Any
    """``(vertices, faces)``: (n, 3) [m] and (m, 3) rows of vertices; or a mesh or a scene of trimesh. Corners are
    counter-clockwise seen from outside, as in glTF: photographs light that side. All else does not depend on it."""
    label: str | int | Mapping[str, str | int] = ""
    """Class: a name, a ``Label`` or its id, any of those that worlds have; for a scene also by the name of its node, in
    which ``*`` stands for any text and the first match counts. Otherwise it is the mesh's ``metadata["label"]``."""
    name: str = ""
    """Name of the object. Otherwise that of the scene's node, the mesh's ``metadata["name"]``, or class and number."""
    colour: tuple[float, float, float] = GREY
    """Share of red, green and blue light that it reflects, each 0 to 1, linear."""
    pose: ArrayLike | None = None
    """world_from_mesh (4, 4), which may scale; None: the mesh is in the world's frame, x north, y west, z up."""


class Triangles(NamedTuple):
    """Triangles of one class and colour in the world."""

    corners: Array  # (m, 3, 3) [m]
    kind: SemanticClass
    colour: tuple[float, float, float]


def objects_of(meshes: Iterable[Any], classes: ClassTable = CLASSES) -> dict[str, list[Triangles]]:
    """Return the triangles of each object by its name, in the order in which names first occur.

    Raises as ``World.from_meshes``.
    """
    if not isinstance(meshes, Iterable):
        raise ConfigurationError(f"meshes must be a list, got a {type(meshes).__name__}")
    found = [each for k, item in enumerate(meshes) for each in _triangles(item, f"meshes[{k}]", classes)]
    if not found:
        raise ConfigurationError("meshes must hold one mesh at least, got none")
    names = {name for name, _ in found}
    objects: dict[str, list[Triangles]] = {}
    for name, triangles in found:
        key = name or next(new for k in count(1) if (new := f"{triangles.kind.key}_{k}") not in names)
        names.add(key)
        objects.setdefault(key, []).append(triangles)
    return objects


def _triangles(item: Any, where: str, classes: ClassTable) -> Iterator[tuple[str, Triangles]]:
    """Yield names, empty where a mesh has no name, and triangles of the meshes of a part."""
    part = item if isinstance(item, MeshPart) else MeshPart(item)
    colour = _numbers(part.colour, (3,), f"{where}: colour")
    if not ((colour >= 0) & (colour <= 1)).all():
        raise ConfigurationError(f"{where}: colour must be three numbers from 0 to 1, got {part.colour}")
    outer = _pose(np.eye(4) if part.pose is None else part.pose, where)
    for node, mesh, inner in _nodes(part.mesh, where):
        metadata = getattr(mesh, "metadata", None) or {}
        name = str(part.name or node or metadata.get("name", ""))
        here = f"{where} ({node or name})" if node or name else where
        if name in TAKEN:
            raise ConfigurationError(f"{here}: name must not be {name!r}, which the robot or the ground has")
        label = label_of(part.label, node or name, metadata.get("label", ""), here, classes)
        pose = outer @ _pose(inner, here)
        corners = _corners(mesh, here) @ pose[:3, :3].T + pose[:3, 3]
        if (far := float(np.abs(corners).max())) > FARTHEST:
            raise ConfigurationError(f"{here}: vertices must be within {FARTHEST:g} m of the origin, got {far:g} m")
        if np.linalg.det(pose[:3, :3]) < 0:  # a mirror turns triangles inside out
            corners = corners[:, ::-1]
        red, green, blue = colour.tolist()
        yield name, Triangles(corners, classes[label], (red, green, blue))


def _nodes(mesh: Any, where: str) -> Iterator[tuple[str, Any, Any]]:
    """Yield name, mesh and pose of a scene's nodes in the order of their names, or the mesh itself."""
    if hasattr(mesh, "graph") and hasattr(mesh, "geometry"):
        for node in sorted(mesh.graph.nodes_geometry):
            pose, geometry = mesh.graph[node]
            yield str(node), mesh.geometry[geometry], pose
    elif (isinstance(mesh, tuple | list) and len(mesh) == 2) or (hasattr(mesh, "vertices") and hasattr(mesh, "faces")):
        yield "", mesh, np.eye(4)
    else:
        kind = type(mesh).__name__
        raise ConfigurationError(f"{where}: expected (vertices, faces), or a mesh or scene of trimesh, got a {kind}")


def label_of(given: Any, node: str, own: Any, where: str, classes: ClassTable = CLASSES) -> int:
    """Return the class that is given for all nodes or by a pattern of their names, else the ``own`` one of a mesh."""
    known = classes.of_objects
    if isinstance(given, Mapping):
        given = next((value for pattern, value in given.items() if fnmatchcase(node, pattern)), "")
    value = own if isinstance(given, str) and given == "" else given
    if isinstance(value, int | np.integer) and not isinstance(value, bool) and value in known.values():
        return int(value)
    if value == "":
        raise ConfigurationError(f"{where}: label is missing; one of {', '.join(known)}")
    found = known.get(as_key(str(value)))
    if found is None:
        raise UnknownNameError("class", str(value), nearest_first(str(value), known), where)
    return found


def _corners(mesh: Any, where: str) -> Array:
    """Corners (m, 3, 3) of the triangles of vertices and faces."""
    vertices, faces = mesh if isinstance(mesh, tuple | list) else (mesh.vertices, getattr(mesh, "faces", ()))
    points = _numbers(vertices, (None, 3), f"{where}: vertices")
    rows = _numbers(faces, (None, 3), f"{where}: faces")
    bad = np.flatnonzero(((rows < 0) | (rows >= len(points)) | (rows != np.floor(rows))).any(axis=1))
    if len(bad):
        raise ConfigurationError(
            f"{where}: faces must be whole numbers from 0 to {len(points) - 1}, rows of the vertices; "
            f"row {bad[0]} is {np.asarray(faces)[bad[0]].tolist()}"
        )
    return points[rows.astype(np.intp)]


def _pose(pose: ArrayLike, where: str) -> Array:
    found = _numbers(pose, (4, 4), f"{where}: pose")
    if found[3].tolist() != [0, 0, 0, 1] or np.linalg.det(found[:3, :3]) == 0:
        raise ConfigurationError(f"{where}: pose must have a last row of 0, 0, 0, 1 and not be flat")
    return found


def _numbers(values: ArrayLike, shape: tuple[int | None, ...], what: str) -> Array:
    """Return finite numbers of a shape, in which None is any number but 0."""
    try:
        found: NDArray[Any] = np.asarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise ConfigurationError(f"{what} must be numbers: {error}") from error
    fits = found.ndim == len(shape) and all(
        n == s or (s is None and n) for n, s in zip(found.shape, shape, strict=True)
    )
    if not fits:
        text = ", ".join("n" if s is None else str(s) for s in shape)
        raise ConfigurationError(f"{what} must have the shape ({text}), not empty, got {found.shape}")
    bad = np.argwhere(~np.isfinite(found))
    if len(bad):
        raise ConfigurationError(f"{what} must be finite; row {bad[0][0]} is {found[bad[0][0]].tolist()}")
    return found


def _plane(side: float, height: float, material: str, *, visible: bool) -> Terrain:
    """Flat square of terrain about the origin."""
    grid: dict[str, float] = {"spacing": side, "x0": -side / 2, "y0": -side / 2}
    return Terrain(
        field=Heightfield(heights=np.full((2, 2), height, np.float32), **grid),
        trail_distance=Raster(values=np.ones((2, 2), np.float32), **grid),
        cover=Raster(values=np.ones((2, 2, 1), np.float32), **grid),
        ground_materials=(material,),
        trail_material=material,
        border_material=material,
        visible=visible,
    )


def _plain(materials: dict[str, Material], kind: SemanticClass, colour: tuple[float, float, float]) -> str:
    """Add a material of one colour, and return its name."""
    name = " ".join([kind.key, *(f"{share:g}" for share in colour)])
    mirror = _WATER_MIRROR if kind.label == Label.WATER else 0.0
    materials.setdefault(name, Material(name=name, label=kind.label, texture="plain", tint=colour, mirror=mirror))
    return name


def _object(
    name: str, object_id: int, parts: Sequence[Triangles], materials: dict[str, Material]
) -> tuple[Mesh, Instance]:
    """Object of flat triangles, with its origin below the middle of its box; adds its materials."""
    corners = np.concatenate([part.corners for part in parts])
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    pose = np.eye(4)
    pose[:3, 3] = (low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]
    corners = corners - pose[:3, 3]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    normals = np.where(length > 0, across / np.where(length > 0, length, 1.0), (0.0, 0.0, 1.0))
    own = [_plain(materials, part.kind, part.colour) for part in parts]
    names, count = tuple(dict.fromkeys(own)), 3 * len(corners)
    mesh = make_mesh(
        name, corners, np.repeat(normals, 3, axis=0), np.zeros((count, 2)), np.arange(count), names,
        np.repeat([names.index(n) for n in own], [len(part.corners) for part in parts]),
        footprint=float(np.hypot(*(high - low)[:2])) / 2,
    )  # fmt: skip
    return mesh, Instance(name=name, kind=parts[0].kind.key, mesh=name, object_id=object_id, world_from_object=pose)
