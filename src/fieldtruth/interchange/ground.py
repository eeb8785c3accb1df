# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The ground as meshes of one class each, and images of it with its materials mixed as in photographs.

The meshes are the terrain's triangles, cut along the edges of the trails.

The ray tracer takes the class of the ground from ``Terrain.trail_distance`` at the point that was hit; other tools have
one class per triangle. A triangle that a trail's edge crosses is divided down to the resolution of that raster and cut
there. Its neighbours are divided so that each edge belongs to two triangles: a renderer sees through the gap that
rounding opens where a vertex lies on another triangle's edge (T-junction), as Gazebo did in one of 2.8 million pixels.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.core.classes import Label
from fieldtruth.core.parallel import cpu_count, in_order
from fieldtruth.interchange.surfaces import Surface, encode_image
from fieldtruth.kernels.light import MaterialTable
from fieldtruth.kernels.textures import LEVELS, patch_offsets, srgb_from_linear
from fieldtruth.render.materials import material_table
from fieldtruth.world.model import Heightfield, Raster, Terrain, World

_TOLERANCE: Final = 0.002
"""A triangle is divided further where the middle of its cut is farther than this [m] from the contour."""
_DEPTH: Final = 3
"""Times that it may be divided further."""
_SNAP: Final = 0.0005
"""A cut nearer to a vertex than this [m] passes through the vertex: no thin slivers."""
_WELD: Final = 1e-5
"""Vertices nearer than this [m] are one."""
_SMALLEST: Final = 1e-8
"""Smaller triangles [m^2] are left out."""
_CORNERS: Final = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])
"""The two triangles of a cell, anticlockwise seen from above, as ``Heightfield`` divides it."""


@dataclass(frozen=True, kw_only=True)
class GroundTile:
    """A square of the ground, in world coordinates.

    ``surfaces`` are those of class ground and of class trail that have triangles, in this order. Their uv run over the
    tile: (0, 0) at its corner ``x0``, ``y0`` [m], (1, 1) at ``x0 + size``, ``y0 + size``.
    """

    name: str
    surfaces: tuple[Surface, ...]
    x0: float
    y0: float
    size: float  # [m]


def ground_tiles(world: World, size_m: float = 25.0) -> Iterator[GroundTile]:
    """Cut the terrain into tiles with a side of ``size_m`` [m], rounded to whole cells of the heightfield.

    Each vertex lies on the heightfield's triangles. Measured: the class of a triangle is wrong on less than a millionth
    of the park's area and on 0.004 % of the forest's, at most 2 cm from the contour of ``Terrain.trail_distance``.
    """
    field, slopes = world.terrain.surface, _slopes(world.terrain.surface)
    for tile, start, counts in _squares(world, size_m):
        points, is_trail = _cut_block(world.terrain, start, counts)
        parts = ((Label.GROUND, points[~is_trail]), (Label.TRAIL, points[is_trail]))
        surfaces = (_surface(tile, label, part, field, slopes) for label, part in parts)
        yield replace(tile, surfaces=tuple(surface for surface in surfaces if len(surface.faces)))


def ground_squares(world: World, size_m: float = 25.0) -> list[GroundTile]:
    """The tiles of ``ground_tiles`` without surfaces, which take most of the time: all that ``ground_images`` needs."""
    return [tile for tile, _, _ in _squares(world, size_m)]


def _squares(world: World, size_m: float) -> Iterator[tuple[GroundTile, tuple[int, int], tuple[int, int]]]:
    """Tiles without surfaces, with the first cell of each and the number of its cells along x and y."""
    if not world.terrain.visible:
        return
    field = world.terrain.surface
    side = max(1, round(size_m / field.spacing))
    nx, ny = field.heights.shape
    for i in range(0, nx - 1, side):
        for j in range(0, ny - 1, side):
            x0, y0 = field.x0 + field.spacing * i, field.y0 + field.spacing * j
            name = f"terrain_{i // side}_{j // side}"
            tile = GroundTile(name=name, surfaces=(), x0=x0, y0=y0, size=side * field.spacing)
            yield tile, (i, j), (min(side, nx - 1 - i), min(side, ny - 1 - j))


def _slopes(field: Heightfield) -> Raster:
    """Slopes along x and y at the nodes (nx, ny, 2), which make smooth normals."""
    along_x, along_y = np.gradient(field.heights.astype(np.float64), field.spacing)
    slopes = np.stack([np.asarray(along_x), np.asarray(along_y)], axis=-1)
    return Raster(values=slopes.astype(np.float32), spacing=field.spacing, x0=field.x0, y0=field.y0)


def _surface(tile: GroundTile, label: Label, points: Array, field: Heightfield, slopes: Raster) -> Surface:
    """Share the vertices of triangles (n, 3, 2) [m], and lift them onto the heightfield."""
    xy, faces = _welded(points)
    slope = slopes.at(xy[:, 0], xy[:, 1])
    normals = np.column_stack([-slope, np.ones(len(xy))])
    return Surface(
        material=f"{tile.name}_{label.name.lower()}",
        label=label,
        vertices=np.column_stack([xy, field.height_at(xy[:, 0], xy[:, 1])]).astype(np.float32),
        normals=(normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32),
        uv=((xy - (tile.x0, tile.y0)) / tile.size).astype(np.float32),
        faces=faces.astype(np.int32),
    )


# ---------------------------------------------------------------------------------------------------------------------
# The cut, seen from above


def _cut_block(terrain: Terrain, start: tuple[int, int], counts: tuple[int, int]) -> tuple[Array, Mask]:
    """Triangles (n, 3, 2) [m] of a block of cells, whose edges match each other and those around it; True for trail."""
    field = terrain.surface
    first = [max(0, at - 1) for at in start]
    last = [min(n - 1, at + count + 1) for n, at, count in zip(field.heights.shape, start, counts, strict=True)]
    points, trail = _cut_cells(terrain, (first[0], first[1]), (last[0] - first[0], last[1] - first[1]))
    points, trail = _without_junctions(points, trail)
    at = (points.mean(axis=1) - (field.x0, field.y0)) / field.spacing - start
    inside = ((at > 0) & (at < counts)).all(axis=1)
    return points[inside], trail[inside]


def _cut_cells(terrain: Terrain, start: tuple[int, int], counts: tuple[int, int]) -> tuple[Array, Mask]:
    """Triangles (n, 3, 2) [m] of a block of cells; True for trail."""
    field, distance = terrain.surface, terrain.trail_distance
    parts = max(1, ceil(field.spacing / distance.spacing - 1e-6))  # of a cell's side
    u = start[0] + np.arange(counts[0] * parts + 1) / parts
    v = start[1] + np.arange(counts[1] * parts + 1) / parts
    x, y = field.x0 + field.spacing * u, field.y0 + field.spacing * v
    inside = distance.at(*np.meshgrid(x, y, indexing="ij")) < 0
    cells = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 2) * parts
    whole, divided = [], []
    for corners, small in zip(_CORNERS, _divisions(parts), strict=True):
        nodes = np.unique(small.reshape(-1, 2), axis=0)
        count = sum(inside[tuple((cells + node).T)].astype(int) for node in nodes)
        mixed = (count > 0) & (count < len(nodes))
        whole.append(cells[~mixed, None] + corners * parts)
        divided.append((cells[mixed, None, None] + small).reshape(-1, 3, 2))
    nodes = np.concatenate([*whole, *divided])
    points = np.stack([x[nodes[..., 0]], y[nodes[..., 1]]], axis=-1)
    return _cut(points, inside[nodes[..., 0], nodes[..., 1]], distance, _DEPTH)


def _divisions(parts: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Divide each of a cell's two triangles into parts^2 small ones (parts^2, 3, 2), in nodes of the finer grid."""
    i, j = (n.ravel() for n in np.meshgrid(np.arange(parts), np.arange(parts), indexing="ij"))
    corner = np.stack([i, j], axis=-1)[:, None]
    right, left = corner + _CORNERS[0], corner + _CORNERS[1]
    return np.concatenate([right[i >= j], left[i > j]]), np.concatenate([left[i <= j], right[i < j]])


def _cut(points: Array, trail: Mask, distance: Raster, depth: int) -> tuple[Array, Mask]:
    """Cut those of the triangles (n, 3, 2) whose vertices are on both sides of the contour (``trail``) into three."""
    crossed = trail.any(axis=1) & ~trail.all(axis=1)
    pieces, classes = [points[~crossed]], [trail[~crossed, 0]]
    points, trail = points[crossed], trail[crossed]
    rows = np.arange(len(points))
    lone = np.argmax(trail == (trail.sum(axis=1) == 1)[:, None], axis=1)  # the vertex that is alone on its side
    a, b, c = (points[rows, (lone + k) % 3] for k in range(3))
    p, q = _crossing(a, b, distance), _crossing(a, c, distance)
    curved = (np.abs(distance.at(*((p + q) / 2).T)) > _TOLERANCE) & (depth > 0)
    if curved.any():
        ab, bc, ca = (a + b)[curved] / 2, (b + c)[curved] / 2, (c + a)[curved] / 2
        four = ((a[curved], ab, ca), (ab, b[curved], bc), (ca, bc, c[curved]), (ab, bc, ca))
        small = np.concatenate([np.stack(corners, axis=1) for corners in four])
        finer, finer_trail = _cut(small, distance.at(small[..., 0], small[..., 1]) < 0, distance, depth - 1)
        pieces, classes = [*pieces, finer], [*classes, finer_trail]
    alone = trail[rows, lone]
    for corners, side in (((a, p, q), alone), ((p, b, c), ~alone), ((p, c, q), ~alone)):
        pieces, classes = [*pieces, np.stack(corners, axis=1)[~curved]], [*classes, side[~curved]]
    return np.concatenate(pieces), np.concatenate(classes)


def _without_junctions(points: Array, trail: Mask) -> tuple[Array, Mask]:
    """Divide triangles (n, 3, 2) that have other triangles' vertices on their edges, from their middle to each part."""
    (ax, ay), (bx, by), (cx, cy) = np.moveaxis(points, 0, -1)
    large = ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) / 2 > _SMALLEST
    points, trail = points[large], trail[large]
    vertices, faces = _welded(points)
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1)
    _, edge, count = np.unique(edges[..., 0] << 32 | edges[..., 1], return_inverse=True, return_counts=True)
    lone = count[edge].reshape(faces.shape) == 1  # on the border of the block, or with a vertex on it, or a part of one
    ends = vertices[np.unique(edges[lone])]
    tree, divided, parts = cKDTree(ends), np.zeros(len(points), np.bool_), list[Array]()
    rows, sides = np.nonzero(lone)
    between = _vertices_between(points[rows, sides], points[rows, (sides + 1) % 3], ends, tree)
    found = {(int(rows[k]), int(sides[k])): vertices for k, vertices in between}
    for row in sorted({row for row, _ in found}):
        corners, none = points[row], np.empty((0, 2))
        outline = np.concatenate([part for k in range(3) for part in (corners[k, None], found.get((row, k), none))])
        middle = np.broadcast_to(corners.mean(axis=0), outline.shape)
        parts.append(np.stack([middle, outline, np.roll(outline, -1, axis=0)], axis=1))
        divided[row] = True
    classes = np.repeat(trail[divided], [len(part) for part in parts])
    return np.concatenate([points[~divided], *parts]), np.concatenate([trail[~divided], classes])


def _vertices_between(a: Array, b: Array, vertices: Array, tree: cKDTree) -> Iterator[tuple[int, Array]]:
    """Yield those of n sides from ``a`` to ``b`` (n, 2) that have vertices on them, and these (m, 2) in order."""
    length = np.linalg.norm(b - a, axis=1)
    near = tree.query_ball_point((a + b) / 2, length / 2 - _WELD)
    for k in np.flatnonzero(np.array([len(rows) for rows in near])).tolist():
        found, (ux, uy) = vertices[near[k]], (b[k] - a[k]) / length[k]
        x, y = (found - a[k]).T
        along, on_side = x * ux + y * uy, np.abs(x * uy - y * ux) < _WELD
        if on_side.any():
            yield k, found[on_side][np.argsort(along[on_side])]


def _welded(points: Array) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (v, 2) and faces (n, 3) of triangles (n, 3, 2) [m]."""
    flat = points.reshape(-1, 2)
    keys = np.rint(flat / _WELD).astype(np.int64)
    _, first, rows = np.unique(keys[:, 0] << 32 ^ keys[:, 1], return_index=True, return_inverse=True)
    return flat[first], rows.reshape(-1, 3)


def _crossing(a: Array, b: Array, distance: Raster) -> Array:
    """Point between a and b (n, 2), on different sides of the contour, that lies on it (false position)."""
    swap = (a[:, 0] > b[:, 0]) | ((a[:, 0] == b[:, 0]) & (a[:, 1] > b[:, 1]))  # the same for both triangles of an edge
    a, b = np.where(swap[:, None], b, a), np.where(swap[:, None], a, b)

    def value(share: Array) -> Array:
        return distance.at(*(a + share[:, None] * (b - a)).T)

    low, high = np.zeros(len(a)), np.ones(len(a))
    f_low, f_high = value(low), value(high)
    share = low
    for _ in range(4):
        # A vertex exactly on the contour counts as outside, so that the denominator is never 0.
        share = low + (high - low) * f_low / (f_low - f_high)
        f = value(share)
        same = (f < 0) == (f_low < 0)
        low, f_low = np.where(same, share, low), np.where(same, f, f_low)
        high, f_high = np.where(same, high, share), np.where(same, f_high, f)
    snap = _SNAP / np.linalg.norm(b - a, axis=1)
    share = np.where(share < snap, 0.0, np.where(share > 1 - snap, 1.0, share))
    return np.asarray(a + share[:, None] * (b - a))


# ---------------------------------------------------------------------------------------------------------------------
# Images

GROUND_PIXELS: Final = 2048
"""Side of a tile's image in scenes: 12 mm a pixel on tiles of 25 m."""
_ROWS: Final = 128
"""Rows of an image that are made at once, which bounds the memory."""
_CODES: Final = np.rint(srgb_from_linear(np.arange(65536) / 65535.0) * 255.0).astype(np.uint8)
"""The byte of sRGB for linear values in steps of 1 / 65535."""


def ground_images(world: World, tiles: Sequence[GroundTile]) -> Iterator[bytes]:
    """JPEG of each tile with ``GROUND_PIXELS`` on a side, made in threads."""
    table = material_table(world)

    def jpeg(tile: GroundTile) -> bytes:
        return encode_image(ground_image(world, tile, GROUND_PIXELS / tile.size, table))

    return in_order(tiles, jpeg, cpu_count())


def ground_image(
    world: World, tile: GroundTile, pixels_per_metre: float, table: MaterialTable | None = None
) -> NDArray[np.uint8]:
    """Albedo (n, n, 3) sRGB of a tile seen from above: +x to the right, +y up, as its uv.

    It is that of a photograph's hits (``kernels.gbuffer.terrain_gbuffer``): the colour of the mixed materials times the
    texture of one of them off the trails, and the trail's or its border's own texture on them. ``table`` is
    ``render.materials.material_table(world)``, which takes half a second: make it once for all tiles.
    """
    table = material_table(world) if table is None else table
    count = round(tile.size * pixels_per_metre)
    steps = np.asarray((np.arange(count) + 0.5) / pixels_per_metre, np.float64)
    x, y = tile.x0 + steps, tile.y0 + steps[::-1]
    image = np.empty((count, count, 3), np.uint8)
    for start in range(0, count, _ROWS):
        rows = slice(start, start + _ROWS)
        linear = _albedo(world, table, x, y[rows], pixels_per_metre)
        image[rows] = _CODES[np.rint(linear.clip(0, 1) * (len(_CODES) - 1)).astype(np.uint16)]
    return image


def _albedo(world: World, table: MaterialTable, x: Array, y: Array, pixels_per_metre: float) -> Float32Array:
    """Linear albedo (h, w, 3) of the ground at world x (w,) and y (h,) [m]."""
    (x0, y0), grain = table.corner, table.ground_material
    i, j = (
        np.clip(np.rint((value - low) * table.per_metre_material).astype(int), 0, size - 1)
        for value, low, size in zip((x, y), (x0, y0), grain.shape, strict=True)
    )
    x, y = np.meshgrid(x, y)
    trail = world.terrain.other_ground.at(x, y)
    border = np.where(trail > -table.border_width, table.border, table.trail)
    row = np.where(trail < 0, border, grain[np.ix_(i, j)].T)
    mixed = Raster(values=table.ground[..., :3], spacing=1 / table.per_metre_rgb, x0=x0, y0=y0)
    wear = replace(mixed, values=table.ground[..., 4])
    linear = np.empty((*x.shape, 3), np.float32)
    code = 2 * row + (trail < 0)
    for found in np.unique(code).tolist():
        (material, on_trail), here = divmod(found, 2), code == found
        texture, repeat = int(table.texture[material]), float(table.repeat[material])
        shift = np.empty((np.count_nonzero(here), 2), np.float32)
        patch_offsets(x[here].astype(np.float32), y[here].astype(np.float32), table.patch[material], shift)
        u, v = x[here] / repeat + shift[:, 0], y[here] / repeat + shift[:, 1]
        texels = _sampled(table, texture, u, v, repeat * pixels_per_metre)
        if on_trail:
            linear[here] = texels * table.tint[material] * wear.at(x[here], y[here])[:, None]
        else:
            linear[here] = texels * (mixed.at(x[here], y[here]) / np.maximum(table.atlas.mean[texture], 1e-6))
    return linear


def _sampled(table: MaterialTable, texture: int, u: Array, v: Array, pixels_per_repeat: float) -> Float32Array:
    """Linear colours (n, 3) of a texture at u, v (n,) in repeats, from the mip level of one to two texels a pixel."""
    atlas, level = table.atlas, 0
    while level < LEVELS - 1 and atlas.size[texture, level] >= 2 * pixels_per_repeat:
        level += 1
    size, start = int(atlas.size[texture, level]), int(atlas.start[texture, level])
    packed = atlas.texels[start : start + size * size, None] >> np.array([0, 8, 16], np.uint32) & 255
    texels = atlas.linear[packed]
    x, y = u * size - 0.5, -v * size - 0.5  # as ``kernels.textures.sample``
    i, j = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    fx, fy = (x - i).astype(np.float32)[:, None], (y - j).astype(np.float32)[:, None]
    left, right, upper, lower = i % size, (i + 1) % size, j % size * size, (j + 1) % size * size
    above = texels[upper + left] * (1 - fx) + texels[upper + right] * fx
    below = texels[lower + left] * (1 - fx) + texels[lower + right] * fx
    return np.asarray(above * (1 - fy) + below * fy)
