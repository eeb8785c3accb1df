# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds for Gazebo: their bodies, the files of meshes and textures, and the world files and models around these.

A body is the ground, an object or a swarm, as a set of placed meshes of one material each. Meshes are Wavefront OBJ for
Gazebo 11 and glTF for the newer Gazebo. Gazebo 11 reads OBJ fast (two million triangles in 5 s), but crashes on a file
without a material library, so each file has one, which also shows the texture in other tools.
"""

import re
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np
import orjson
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import GROUND_ID, PALETTE, Label
from fieldtruth.drive.ground import HARD
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.gazebo.files import render, write
from fieldtruth.gazebo.robot import Flavour
from fieldtruth.interchange import check_scene_memory
from fieldtruth.interchange.gltf import INDICES, VERTICES, Glb
from fieldtruth.interchange.ground import ground_images, ground_squares, ground_tiles
from fieldtruth.interchange.surfaces import (
    Surface,
    beyond_edge,
    encode_image,
    material_image,
    mesh_surfaces,
    tiles_of_swarms,
)
from fieldtruth.render.daylight import sun_direction
from fieldtruth.world.model import LOOSE, Collider, Mesh, Swarm, World

SOFT: Final = frozenset({Label.TREETOP, Label.BUSH, Label.HIGH_GRASS, Label.CABLE, Label.WATER})
"""Classes that a robot passes through. LiDAR rays hit them: water hides the ground below, and its class marks such a
point as none, because Gazebo knows no surface that swallows a ray.
"""
UP: Final = np.array([0, 0, 1], np.float32)
RAY_RANGE: Final = 120.0
"""Distance [m] from the world's edge beyond which nothing returns a ray."""
SMALL: Final = 500
"""Triangles of a member, on average, below which members of a swarm are merged: thousands of small meshes take Gazebo
minutes to load, and sharing their files saves little."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """A mesh file, named ``mesh`` in the folder of ``model``, placed in a body.

    ``pose`` is (x, y, z) [m] and (roll, pitch, yaw) [rad] in the body; ``name`` is distinct there.
    """

    name: str
    model: str
    mesh: str
    material: str
    label: int
    pose: tuple[float, ...] = (0.0,) * 6
    scale: float = 1.0
    solid: bool = True
    """True if wheels and chassis touch it."""
    returns: bool = True
    """True if rays of a LiDAR hit it."""
    visible: bool = True
    """True if cameras see it."""


TILE: Final = 12.5
"""Side [m] of a tile of merged members, as small as keeps the numbers in its file short."""
AddMesh = Callable[[Part, Surface], None]
"""Stores the mesh file of a part, which is at the origin of its model."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """A static model: its name in /gazebo/model_states, pose in the world, parts.

    ``colliders`` are the primitive shapes of its physics, to be scaled by ``scale``; without any it is its solid parts.
    """

    name: str
    parts: tuple[Part, ...]
    pose: tuple[float, ...] = (0.0,) * 6
    colliders: tuple[Collider, ...] = ()
    scale: float = 1.0


def world_bodies(world: World, add: AddMesh, *, beyond: bool) -> Iterator[Body]:
    """Yield the bodies of a world, with ``beyond`` also those beyond its edge."""
    files: dict[str, tuple[Part, ...]] = {}

    def parts_of(mesh: Mesh) -> tuple[Part, ...]:
        if mesh.name not in files:
            surfaces = mesh_surfaces(mesh, world.materials)
            files[mesh.name] = tuple(_part(add, mesh.name, surface) for surface in surfaces)
        return files[mesh.name]

    yield _ground(world, add)
    for instance in world.instances:
        mesh, (pose, scale) = world.meshes[instance.mesh], pose_and_scale(instance.world_from_object)
        parts = tuple(replace(p, scale=scale, solid=p.solid and not mesh.passable) for p in parts_of(mesh))
        primitives = () if any(collider.points for collider in mesh.colliders) else mesh.colliders
        yield Body(name=instance.name, parts=parts, pose=pose, colliders=primitives, scale=scale)
    if beyond and world.backdrop is not None:
        yield Body(name=f"{world.name}_backdrop", parts=parts_of(world.backdrop))
    small = {swarm.name for swarm in world.swarms if _mean_faces(world, swarm) < SMALL}
    merged = replace(world, swarms=tuple(swarm for swarm in world.swarms if swarm.name in small))
    for outside in (False, True) if beyond else (False,):
        yield from _merged(merged, add, beyond=outside)
        for swarm in world.swarms:
            members = np.flatnonzero(beyond_edge(world, swarm) == outside)
            if swarm.name not in small and len(members):
                meshes = {row: parts_of(world.meshes[swarm.meshes[row]]) for row in set(swarm.mesh[members].tolist())}
                yield _members(world, swarm, members.tolist(), meshes, beyond=outside)


def pose_and_scale(matrix: Array) -> tuple[tuple[float, ...], float]:
    """Position [m] and fixed-axis angles [rad] of a pose (4, 4) with a uniform scale, and the scale."""
    scale = float(np.cbrt(np.linalg.det(matrix[:3, :3])))
    angles = Rotation.from_matrix(matrix[:3, :3] / scale).as_euler("xyz")
    return tuple(np.round([*matrix[:3, 3], *angles], 9).tolist()), round(scale, 9)


def _part(
    add: AddMesh,
    model: str,
    surface: Surface,
    *,
    mesh: str = "",
    material: str = "",
    solid: bool = True,
    placed: bool = False,
) -> Part:
    """Store a surface; ``mesh`` and ``material`` are by default the name of the surface's material.

    One that is ``placed`` in the world is stored around its middle, because shorter numbers make smaller files.
    """
    name = mesh or surface.material
    middle = np.zeros(3, np.float32)
    if placed:
        middle = np.rint(surface.vertices.mean(axis=0))
        surface = replace(surface, vertices=surface.vertices - middle)
    part = Part(
        name=name,
        model=model,
        mesh=name,
        material=material or surface.material,
        label=surface.label,
        pose=(*middle.tolist(), 0.0, 0.0, 0.0),
        solid=solid and surface.label not in SOFT,
    )
    add(part, surface)
    return part


def _ground(world: World, add: AddMesh) -> Body:
    """The terrain. The material of a tile's surfaces has the name of the tile: they share an image.

    Rays and cameras meet grass and litter, which are not solid, and wheels the soil below.
    """
    name, layer = world.object_names[GROUND_ID], world.terrain.layer
    parts = []
    for tile in ground_tiles(world):
        for surface in tile.surfaces:
            part = _part(add, name, surface, material=tile.name, solid=layer is None, placed=True)
            parts.append(part)
    if layer is not None:
        soil = replace(world, terrain=replace(world.terrain, layer=None))
        for tile in ground_tiles(soil):
            for surface in tile.surfaces:
                bare = replace(surface, uv=np.zeros_like(surface.uv), normals=surface.normals * 0 + UP)
                part = _part(add, name, bare, mesh=f"{surface.material}_soil", material=tile.name, placed=True)
                parts.append(replace(part, visible=False))
    return Body(name=name, parts=tuple(parts))


def _merged(world: World, add: AddMesh, *, beyond: bool) -> Iterator[Body]:
    """One body for the members of each swarm inside the world or beyond its edge, with a part per tile and material."""
    parts: dict[str, list[Part]] = {}
    for tile in tiles_of_swarms(world, TILE, beyond=beyond):
        if tile.beyond == beyond:
            for surface in tile.surfaces(world):
                solid = surface.label in HARD and not beyond and tile.swarm.kind not in LOOSE
                mesh = f"{tile.name}_{surface.material}"
                part = _part(add, tile.swarm.name, surface, mesh=mesh, solid=solid, placed=True)
                parts.setdefault(_body_name(world, tile.swarm, beyond=beyond), []).append(part)
    for name, found in parts.items():
        yield Body(name=name, parts=tuple(found))


def _body_name(world: World, swarm: Swarm, *, beyond: bool) -> str:
    """Name of the swarm; the members beyond the edge of one that has others, too, are another body."""
    return f"{swarm.name}_beyond" if beyond and not beyond_edge(world, swarm).all() else swarm.name


def _mean_faces(world: World, swarm: Swarm) -> float:
    faces = np.array([len(world.meshes[name].faces) for name in swarm.meshes])
    return float(faces[swarm.mesh].mean())


def _members(
    world: World, swarm: Swarm, members: list[int], meshes: dict[int, tuple[Part, ...]], *, beyond: bool
) -> Body:
    """Body of the members of a swarm inside the world or beyond its edge, which share mesh files."""
    parts = []
    for member in members:
        pose, scale = pose_and_scale(swarm.world_from_object[member])
        outside = np.maximum(np.abs(pose[:2]) - np.array(world.size) / 2, 0.0)
        near = bool(np.hypot(*outside) < RAY_RANGE)
        for part in meshes[int(swarm.mesh[member])]:
            returns = part.returns and near
            name = f"{part.name}_{member}"
            solid = part.label in HARD and not beyond and swarm.kind not in LOOSE
            parts.append(replace(part, name=name, pose=pose, scale=scale, solid=solid, returns=returns))
    return Body(name=_body_name(world, swarm, beyond=beyond), parts=tuple(parts))


# ---------------------------------------------------------------------------------------------------------------------
# Files of meshes and textures

FINE: Final = (5, 3, 2)
"""Decimals of positions [m], texture coordinates and normals: 10 um keep ranges at grazing incidence.

A ray that meets the ground at 0.24 deg is 240 times as far off as the ground is high: 23 um make 5.5 mm."""
SOLID: Final = (4, 3, 2)
"""For what else wheels touch, such as trunks and rocks."""
COARSE: Final = (4, 3, 1)
"""For swarms and leaves, whose files are most of a package: normals turn by up to 4 deg."""
Decimals = tuple[int, int, int]
EDGE_ON: Final = 0.04
"""Product of cosines to an axis below which the triangles of a quad are seen from their edge, or one from behind."""
CONVEX: Final = 3.1
"""Largest angle [rad] at a corner of a quad that no reader takes for concave."""


def obj_text(surface: Surface, library: str, decimals: Decimals = FINE) -> bytes:
    """Text of an OBJ file of a surface, whose material is in the file ``library`` beside it."""
    lines = [f"mtllib {library}\n".encode()]
    rows, points = [], np.empty(0)
    for key, values, digits in zip(
        ("v", "vt", "vn"), (surface.vertices, surface.uv, surface.normals), decimals, strict=True
    ):
        distinct, row = _distinct(values, digits, often_first=key != "v")
        lines.append(_vectors_text(key.encode(), distinct))
        rows.append(row)
        points = distinct if key == "v" else points
    lines.append(f"usemtl {surface.material}\n".encode())
    faces = surface.faces[np.argsort(surface.faces.min(axis=1), kind="stable")]  # neighbours follow one another
    corners = np.stack([row[faces] for row in rows], axis=-1)
    return b"".join([*lines, *map(_faces_text, _quads(corners, points))])


def _vectors_text(key: bytes, values: NDArray[np.float64]) -> bytes:
    """A line per row (n, k) of numbers of at most nine digits, each as ``%.9g`` writes it."""
    text = orjson.dumps(values, option=orjson.OPT_SERIALIZE_NUMPY)[2:-1]  # 1.5,2.0],[0.00002,3.0]
    text = text.replace(b".0,", b",").replace(b".0]", b"]")
    if np.any((np.abs(values) < 1e-4) & (values != 0.0)):
        text = re.sub(rb"(?<!\d)0\.0000([1-9])(?!\d)", rb"\1e-05", text)
    lines = text[:-1].replace(b"],[", b"\n" + key + b" ").replace(b",", b" ")
    return key + b" " + lines + b"\n" if len(values) else b""


def _faces_text(polygons: NDArray[np.intp]) -> bytes:
    """A line per polygon (n, corners, 3) of rows of vertices, texture coordinates and normals, counted from 1 there."""
    count, corners, _ = polygons.shape
    if not count:
        return b""
    columns = [_counted(int(polygons[..., k].max()) + 1)[polygons[..., k]] for k in range(3)]
    blank, slash = (np.full((count, corners, 1), ord(char), np.uint8) for char in " /")
    texts = np.concatenate([blank, columns[0], slash, columns[1], slash, columns[2]], axis=2).reshape(count, -1)
    ends = (np.full((count, 1), ord(char), np.uint8) for char in "f\n")
    return np.hstack([next(ends), texts, next(ends)]).tobytes().translate(None, b"\0")


def _counted(count: int) -> NDArray[np.uint8]:
    """Digits of the numbers from 1 to ``count``, with zero bytes before them."""
    numbers, width = np.arange(1, count + 1, dtype=np.int32), len(str(count))
    powers = 10 ** np.arange(width - 1, -1, -1, dtype=np.int32)
    digits = numbers[:, None] // powers % 10 + ord("0")
    return np.where(numbers[:, None] >= powers, digits, 0).astype(np.uint8)


def _quads(corners: NDArray[np.intp], points: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Quads (q, 4, 3) of faces (n, 3, 3) that follow one another and share an edge, and the faces that are left.

    Every tool divides a quad again along the edge from the first corner to the third; see ``_divides_again``.
    """
    sizes = corners.max(axis=(0, 1), initial=0) + 1
    key = (corners[..., 0] * sizes[1] + corners[..., 1]) * sizes[2] + corners[..., 2]
    turns = np.full(max(len(corners) - 1, 0), -1)
    for i, j in product(range(3), range(3)):  # by which the corners of a face and of the next one are turned
        one, other = np.roll(key[:-1], i, axis=1), np.roll(key[1:], j, axis=1)
        turns[(one[:, 0] == other[:, 0]) & (one[:, 2] == other[:, 1])] = 3 * i + j
    rows = np.flatnonzero(turns >= 0)
    turn, turn_next = np.divmod(turns[rows], 3)
    first = corners[rows[:, None], (np.arange(3) - turn[:, None]) % 3]
    pairs = np.concatenate([first, corners[rows + 1, (2 - turn_next) % 3][:, None]], axis=1)
    fits = turns >= 0
    fits[rows] = _divides_again(*np.moveaxis(points[pairs[..., 0]], 1, 0))
    at = np.arange(len(fits))
    start = np.maximum.accumulate(np.where(fits, 0, at + 1))  # of the row of pairs that fit
    chosen = np.flatnonzero(fits & ((at - start) % 2 == 0))
    return pairs[np.searchsorted(rows, chosen)], np.delete(corners, [chosen, chosen + 1], axis=0)


def _divides_again(a: Array, b: Array, c: Array, d: Array) -> Mask:
    """Mask of quads of corners (n, 3) that readers of OBJ files divide along a to c; twisted ones would change shape.

    Gazebo's tinyobjloader takes the shorter diagonal or, in older versions, cuts the first ear that it finds, in the
    plane of two axes that is nearest to the first three corners; Assimp begins at a corner that it takes for concave
    (rules from memory; Gazebo 11 confirms the result, docs/gazebo.md).
    """
    first, second = np.cross(b - a, c - a), np.cross(c - a, d - a)
    axis = np.abs(first).argmax(axis=1)[:, None]
    one, other = (np.take_along_axis(normal, axis, axis=1)[:, 0] for normal in (first, second))
    seen = one * other > EDGE_ON * np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    shorter = np.linalg.norm(a - c, axis=1) < 0.999 * np.linalg.norm(b - d, axis=1)
    convex = [_angle(a - p, q - p) + _angle(c - p, q - p) < CONVEX for p, q in ((b, d), (d, b))]
    return np.asarray(seen & shorter & convex[0] & convex[1])


def _angle(one: Array, other: Array) -> Array:
    """Angles (n,) [rad] between vectors (n, 3)."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(axis=1)))


def mtl_text(material: str, texture: str) -> str:
    """Text of a material library with one material; ``texture`` is a path relative to it."""
    return f"newmtl {material}\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd {texture}\n"


def write_obj(path: Path, surface: Surface, texture: str, decimals: Decimals) -> None:
    """Write ``path`` and its material library beside it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    library = path.with_suffix(".mtl")
    path.write_bytes(obj_text(surface, library.name, decimals))
    library.write_text(mtl_text(surface.material, texture))


def _distinct(
    values: NDArray[np.float32], decimals: int, *, often_first: bool
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Distinct rows of ``values`` (n, k) rounded to decimals, and the row (n,) of each.

    With ``often_first`` those that are used most come first, so that faces refer to them by short numbers.
    """
    scaled = np.rint(values.astype(np.float64) * 10**decimals).astype(np.int64)
    low = scaled.min(axis=0)
    spans = (scaled - low).max(axis=0) + 1
    key = np.zeros(len(values), np.int64)
    for column, span in zip((scaled - low).T, spans.tolist(), strict=True):
        key = key * span + column
    _, first, row, count = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
    order = np.argsort(-count * often_first, kind="stable")
    return scaled[first[order]] / 10**decimals + 0.0, np.argsort(order)[row]


def write_glb(path: Path, surface: Surface) -> None:
    """Write a surface as a GLB file with z up: Gazebo does not turn the y axis of glTF upwards.

    It has no texture: the material of the model has it, so that meshes share it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    wide = np.uint32 if len(surface.vertices) > np.iinfo(np.uint16).max else np.uint16
    with Glb(path.parent, {"asset": {"version": "2.0", "generator": "fieldtruth"}, "scene": 0}) as glb:
        attributes = {
            "POSITION": glb.array(surface.vertices, target=VERTICES, bounds=True),
            "NORMAL": glb.array(surface.normals, target=VERTICES),
            "TEXCOORD_0": glb.array((surface.uv * (1, -1) + (0, 1)).astype(np.float32), target=VERTICES),
        }
        primitive = {
            "attributes": attributes,
            "indices": glb.array(surface.faces.ravel().astype(wide), target=INDICES),
            "material": glb.add("materials", {"name": surface.material, "doubleSided": True}),
        }
        mesh = glb.add("meshes", {"name": path.stem, "primitives": [primitive]})
        glb.add("scenes", {"nodes": [glb.add("nodes", {"name": path.stem, "mesh": mesh})]})
        glb.save(path)


def texture_file(world: World, material: str) -> str:
    """Name of the image of a material, or of a tile of the ground.

    It starts with the world's name, because Gazebo 11 finds textures by name in all folders of models.
    """
    return f"{world.name}_{material}.jpg"


def write_textures(folder: Path, world: World, materials: Set[str]) -> None:
    """Write the images of these materials; those that are not the world's are tiles of its ground."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in sorted(materials & world.materials.keys()):
        (folder / texture_file(world, name)).write_bytes(encode_image(material_image(world, name)))
    tiles = [tile for tile in ground_squares(world) if tile.name in materials]
    for tile, jpeg in zip(tiles, ground_images(world, tiles), strict=True):
        (folder / texture_file(world, tile.name)).write_bytes(jpeg)


# ---------------------------------------------------------------------------------------------------------------------
# World files and models

HEADING_DEG: Final = 90.0
"""Of the world's x axis, from east towards north: x is north and y west."""
_LIGHT: Final = {"ambient": (0.5, 0.52, 0.55), "sky": (0.62, 0.74, 0.88), "sun": (0.95, 0.9, 0.8)}
"""Colours in sRGB, chosen by eye beside photographs of the same views."""
_TEXTURES: Final = "materials/textures"
"""Folder of images in that of the model which has the materials."""
_FACE_BYTES: Final = 700
_MEMBER_BYTES: Final = 10_000
_VERSION: Final = {"classic": "1.7", "gz": "1.9"}
"""Version of SDF that the oldest Gazebo of a flavour reads: 11.1, and Garden."""


def write_worlds(packages: Mapping[Flavour, Path], world: World, *, beyond: bool) -> None:
    """Write a world into ``packages``, the root folder of the package of each flavour.

    - ``worlds/{name}.world`` (classic) or ``.sdf`` (gz), and ``{name}_plain`` in the flat colours of the classes;
    - ``models/``: one folder for each mesh that objects share, for the ground and for each swarm; they are models of
      their own, too; and ``{name}_materials`` with textures and, for Gazebo 11, the materials.

    Raises:
        OutputError: the memory is too small.
    """
    check_scene_memory(world, "gazebo", _needed_memory(world))
    materials = f"{world.name}_materials"
    textures = {flavour: folder / "models" / materials / _TEXTURES for flavour, folder in packages.items()}
    swarms = {swarm.name for swarm in world.swarms}

    def add(part: Part, surface: Surface) -> None:
        for flavour, folder in packages.items():
            path = folder / "models" / part.model / "meshes" / part.mesh
            if flavour == "gz":
                write_glb(path.with_name(f"{path.name}.glb"), surface)
            else:
                texture = f"../../{materials}/{_TEXTURES}/{texture_file(world, part.material)}"
                ground = part.label in (Label.GROUND, Label.TRAIL)
                decimals = FINE if ground else SOLID if part.solid and part.model not in swarms else COARSE
                write_obj(path.with_name(f"{path.name}.obj"), surface, texture, decimals)

    bodies = list(world_bodies(world, add, beyond=beyond))
    names = {part.material for body in bodies for part in body.parts}
    first, *others = textures.values()
    write_textures(first, world, names)
    for other in others:
        shutil.copytree(first, other)
    for flavour, folder in packages.items():
        _write_models(folder, world, flavour, bodies, {name: texture_file(world, name) for name in sorted(names)})


def _write_models(
    folder: Path, world: World, flavour: Flavour, bodies: list[Body], textures: Mapping[str, str]
) -> None:
    """Write the models and the two world files; ``textures`` are the files of images by material."""
    models, materials = folder / "models", f"{world.name}_materials"
    clear = {material.name for material in world.materials.values() if material.mirror > 0}
    keys = {int(row.label): row.key.upper() for row in world.classes.coloured}
    values = {
        "flavour": flavour,
        "version": _VERSION[flavour],
        "materials": materials,
        "textures": textures,
        "clear": clear,
        "keys": keys,
        "colours": {key: world.classes.palette[label] / 255 for label, key in keys.items()},
    }
    if flavour == "classic":
        script = render("worlds", "ogre.material.jinja", **values)
        write(models / materials / "materials" / "scripts" / f"{materials}.material", script)
    for body in _shared(bodies):
        _write_model(models / body.name, world, body, values)
    for flat in (False, True):
        name = f"{world.name}_plain" if flat else world.name
        text = render("worlds", "world.xml.jinja", **values, **_scene(world, flat=flat), bodies=bodies)
        write(folder / "worlds" / f"{name}.{'sdf' if flavour == 'gz' else 'world'}", text)


def _needed_memory(world: World) -> int:
    """Memory [byte] for the text of the largest mesh file, and for a world file with a part per member of a swarm."""
    tiles = (tile.face_count(world) for tile in tiles_of_swarms(world, TILE, beyond=True))
    largest = max((*tiles, *(len(mesh.faces) for mesh in world.meshes.values())), default=0)
    return largest * _FACE_BYTES + sum(len(swarm.mesh) for swarm in world.swarms) * _MEMBER_BYTES


def _shared(bodies: Iterable[Body]) -> list[Body]:
    """One body at the origin for each folder of meshes, with the meshes that are in it."""
    found: dict[str, tuple[dict[str, Part], Body]] = {}
    for body in bodies:
        for part in body.parts:
            parts, _ = found.setdefault(part.model, ({}, body))
            pose = part.pose if part.name == part.mesh else Part.pose  # that of a tile, not of a member
            parts.setdefault(part.mesh, replace(part, name=part.mesh, pose=pose, scale=1.0))
    return [
        Body(name=model, parts=tuple(parts.values()), colliders=first.colliders)
        for model, (parts, first) in found.items()
    ]


def _write_model(folder: Path, world: World, body: Body, values: dict[str, Any]) -> None:
    classes = sorted({part.label for part in body.parts})
    description = f"{body.name}: {', '.join(world.classes[label].name for label in classes)}. Made for {world.name}."
    write(folder / "model.sdf", render("worlds", "model.xml.jinja", **values, body=body, flat=False))
    config = render(
        "worlds", "model.config.xml.jinja", name=body.name, description=description, version=values["version"]
    )
    write(folder / "model.config", config)


def _scene(world: World, *, flat: bool) -> dict[str, Any]:
    sun = LightConfig().values
    light = _LIGHT | {"direction": -sun_direction(sun.azimuth_deg, sun.elevation_deg)}
    if flat:
        light |= {"ambient": np.ones(3), "sky": PALETTE[Label.SKY] / 255}
    where = {"origin": world.origin, "heading": HEADING_DEG, "gravity": GRAVITY}
    return {"world": world, "flat": flat, "light": light, **where}
