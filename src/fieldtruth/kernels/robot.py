# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot that sensors see: rays against its boxes and cylinders, and its colours in photographs.

They are convex, so that a ray is inside one between where it enters and where it leaves: a box is the intersection of
three slabs (Kay and Kajiya 1986), a cylinder that of a slab and an endless cylinder. A part that contains the ray's
origin is not met, so that no sensor sees the inside of what it is built into.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.light import EXPOSURE, READ, LightTable, RobotTable, falling_on, read_probes
from fieldtruth.kernels.packets import Grid, IntArray, read_grid

RIM: Final = 6 / 13
"""Radius of a rim over that of its tyre: the size 13x5.00-6, which a Husky has, is a 13 in tyre on a 6 in rim."""
SKIN: Final = 1e-3
"""Depth [m] of the air at a part from which it is not seen: that of a housing that stands on it."""
NO_FACE: Final = -1
FACES: Final = 8
"""Faces that a part may have: face f of part p is number ``FACES * p + f``. See ``material_of``."""
BOX, CYLINDER = 0.0, 1.0
_TREAD, _SIDE, HUB = 0, 1, 3  # faces of a cylinder; the second and third exist on the right and on the left


class Surface(NamedTuple):
    """First surface on each ray: ``range_m`` (n,) [m], infinite for none; ``face`` (n,); unit ``normal`` (n, 3)."""

    range_m: Array
    face: NDArray[np.int32]
    normal: Array


@inlined
def _contains(table: Array, part: int, x: float, y: float, z: float) -> bool:
    """Return whether a part with its skin contains a point in the part's frame."""
    a, b, c = table[part, 4] + SKIN, table[part, 5] + SKIN, table[part, 6] + SKIN
    if abs(y) > b:
        return False
    return x * x + z * z <= a * a if table[part, 0] == CYLINDER else abs(x) <= a and abs(z) <= c  # type: ignore[no-any-return]


@inlined
def _slab(start: float, step: float, half: float) -> tuple[float, float]:
    """Where a ray enters and leaves |x| <= half."""
    if step == 0.0:
        return (-np.inf, np.inf) if abs(start) <= half else (np.inf, -np.inf)
    first, second = (-half - start) / step, (half - start) / step
    return min(first, second), max(first, second)


@inlined
def _round(x: float, z: float, dx: float, dz: float, radius: float) -> tuple[float, float]:
    """Where a ray enters and leaves an endless cylinder about y."""
    a, b, c = dx * dx + dz * dz, x * dx + z * dz, x * x + z * z - radius * radius
    if a == 0.0:
        return (-np.inf, np.inf) if c <= 0.0 else (np.inf, -np.inf)
    square = b * b - a * c
    if square < 0.0:
        return np.inf, -np.inf
    root = np.sqrt(square)
    return (-b - root) / a, (-b + root) / a


@kernel
def enters(
    table: Array, part: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float
) -> tuple[float, int]:
    """Range at which a ray enters a part, infinite if it does not, and the face."""
    x, y, z = ox - table[part, 1], oy - table[part, 2], oz - table[part, 3]
    if _contains(table, part, x, y, z):
        return np.inf, NO_FACE
    side, side_end = _slab(y, dy, table[part, 5])
    if table[part, 0] == CYLINDER:
        tread, tread_end = _round(x, z, dx, dz, table[part, 4])
        enter, leave = max(side, tread), min(side_end, tread_end)
        if not (0.0 < enter < leave):
            return np.inf, NO_FACE
        if tread >= side:
            return enter, _TREAD
        px, pz, rim = x + enter * dx, z + enter * dz, RIM * table[part, 4]
        return enter, (HUB if px * px + pz * pz < rim * rim else _SIDE) + (1 if dy < 0.0 else 0)
    ahead, ahead_end = _slab(x, dx, table[part, 4])
    up, up_end = _slab(z, dz, table[part, 6])
    enter, leave = max(side, ahead, up), min(side_end, ahead_end, up_end)
    if not (0.0 < enter < leave):
        return np.inf, NO_FACE
    if enter == ahead:
        return enter, 1 if dx < 0.0 else 0
    if enter == side:
        return enter, 3 if dy < 0.0 else 2
    return enter, 5 if dz < 0.0 else 4


@kernel
def meet_parts(table: Array, origin: Array, directions: Array, found: Surface) -> None:
    """Set what rays from an origin (3,) along unit directions (n, 3) in base_link meet."""
    range_m, faces, normal = found
    ox, oy, oz = origin[0], origin[1], origin[2]
    for k in range(len(directions)):
        dx, dy, dz = directions[k, 0], directions[k, 1], directions[k, 2]
        nearest, face = np.inf, NO_FACE
        for part in range(len(table)):
            enter, own = enters(table, part, ox, oy, oz, dx, dy, dz)
            if enter < nearest:
                nearest, face = enter, FACES * part + own
        range_m[k], faces[k] = nearest, face
        normal[k, 0], normal[k, 1], normal[k, 2] = 0.0, 0.0, 0.0
        if face == NO_FACE:
            continue
        part, own = face // FACES, face % FACES
        if table[part, 0] == BOX:
            normal[k, own // 2] = 1.0 if own % 2 else -1.0
        elif own == _TREAD:
            radius = table[part, 4]
            normal[k, 0] = (ox + nearest * dx - table[part, 1]) / radius
            normal[k, 2] = (oz + nearest * dz - table[part, 3]) / radius
        else:
            normal[k, 1] = 1.0 if dy < 0.0 else -1.0


_FEW: Final = 3
_Vector = tuple[float, float, float]


@inlined
def _turned(pose: Array, x: float, y: float, z: float) -> _Vector:
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z,
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z,
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z,
    )


@kernel
def place_robot(robot: RobotTable, world_from_optical: Array, place: Array) -> None:
    """Write ``place`` (4, 4) of the robot whose camera has a pose (4, 4).

    It is base_from_world, whose last row is replaced by the centre, in the world, and the radius [m] of ``robot.ball``.
    """
    own, ball = robot.base_from_optical, robot.ball
    place[3, 0], place[3, 1], place[3, 2], place[3, 3] = 0.0, 0.0, 0.0, ball[3]
    for row in range(3):
        place[row, 3] = own[row, 3]
        for column in range(3):
            turned = 0.0
            for axis in range(3):
                turned += own[row, axis] * world_from_optical[column, axis]
            place[row, column] = turned
            place[row, 3] -= turned * world_from_optical[column, 3]
        for column in range(3):
            place[3, column] += place[row, column] * (ball[row] - place[row, 3])


@inlined
def in_reach(place: Array, x: np.float32, y: np.float32, z: np.float32, sun: Array) -> bool:
    """Return whether a ray from a point [m] in the world to any part of the sun's disc may meet the robot."""
    cx, cy, cz, radius = place[3, 0] - x, place[3, 1] - y, place[3, 2] - z, place[3, 3]
    ahead = cx * sun[0] + cy * sun[1] + cz * sun[2]
    wide = radius + 0.005 * abs(ahead)
    return ahead > -radius and cx * cx + cy * cy + cz * cz - ahead * ahead < wide * wide  # type: ignore[no-any-return]


@kernel
def sun_past_robot(robot: RobotTable, place: Array, x: float, y: float, z: float) -> np.float32:
    """Share of the sun's disc that the robot does not hide from a point [m] in the world.

    Most points see all of it or nothing, which the first _FEW rays, to its rim, find out.
    """
    parts, disc, hidden = robot.parts, robot.disc, 0
    p = _turned(place, x, y, z)
    px, py, pz = p[0] + place[0, 3], p[1] + place[1, 3], p[2] + place[2, 3]
    for k in range(len(disc)):
        towards = _turned(place, disc[k, 0], disc[k, 1], disc[k, 2])
        for part in range(len(parts)):
            if enters(parts, part, px, py, pz, towards[0], towards[1], towards[2])[0] < np.inf:
                hidden += 1
                break
        if k + 1 == _FEW and hidden % _FEW == 0:
            return np.float32(1.0 if hidden == 0 else 0.0)
    return np.float32(1.0 - hidden / len(disc))


class RobotSamples(NamedTuple):
    """Points of the robot that photographs show, ordered by pixel: one at its centre, or several at an edge."""

    pixel: IntArray  # (m,) number in the image, row by row
    share: Float32Array  # (m,) of the pixel's area
    depth: Float32Array  # (m,) [m] as in the depth image
    point: Float32Array  # (m, 3) [m] in base_link
    normal: Float32Array  # (m, 3) unit, in base_link
    material: IntArray  # (m,)


ALBEDO: Final = np.array([[0.055, 0.057, 0.060], [0.030, 0.029, 0.028], [0.20, 0.20, 0.19]], np.float32)
"""Of dark paint, rubber and a grey rim, by material: our choice."""
_MIRROR: Final = np.array([0.04, 0.0, 0.0], np.float32)
"""Reflectance at normal incidence: that of a varnish with the refractive index 1.5, in Schlick's approximation."""
_MIDDLE: Final = 0.4  # [m] of the robot above the origin of base_link


@inlined
def _sun_at(table: Array, sunlit: Grid, level: float, x: float, y: float, z: float, sun: _Vector) -> float:
    """Share of the sun that reaches a point of the robot. A convex part does not shade itself."""
    for part in range(len(table)):
        if enters(table, part, x, y, z, sun[0], sun[1], sun[2])[0] < np.inf:
            return 0.0
    along = (level - z) / max(sun[2], 0.1)
    return float(read_grid(sunlit, x + along * sun[0], y + along * sun[1]))


@inlined
def _reflected(normal: _Vector, ray: _Vector, reflectance: float) -> float:
    """Share of the sky's light that dull varnish reflects to the camera, with Schlick's approximation (1994)."""
    length = np.sqrt(ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2])
    cosine = -(normal[0] * ray[0] + normal[1] * ray[1] + normal[2] * ray[2]) / length
    if reflectance == 0.0 or ray[2] + 2.0 * cosine * length * normal[2] <= 0.0:
        return 0.0
    return reflectance + (1.0 - reflectance) * (1.0 - min(max(cosine, 0.0), 1.0)) ** 5  # type: ignore[no-any-return]


@kernel(allocates=True)
def paint_samples(
    samples: RobotSamples,
    table: Array,
    poses: tuple[Array, Array],
    sunlit: Grid,
    level: float,
    light: LightTable,
    exposure: np.float32,
    depth: Float32Array,
    linear: Float32Array,
) -> None:
    """Blend the samples into their pixels; ``poses`` are those of base_link and of the camera's origin in it (3,)."""
    pixel, share, own_depth, points, normals, material = samples
    pose, eye = poses
    width, sun, probe = depth.shape[1], (light.sun[0], light.sun[1], light.sun[2]), np.empty(READ, np.float32)
    above = _turned(pose.T, sun[0], sun[1], sun[2])
    (x0, y0), per = light.volume_corner, light.volume_per_metre
    at_x, at_y = np.float32((pose[0, 3] - x0) * per), np.float32((pose[1, 3] - y0) * per)
    read_probes(light.volume, light.volume_base, at_x, at_y, np.float32(pose[2, 3] + _MIDDLE), probe)
    scale, colour, cover = EXPOSURE * exposure, np.zeros(3), 0.0
    for k in range(len(pixel)):
        v, u = pixel[k] // width, pixel[k] % width
        if depth[v, u] == 0.0 or own_depth[k] < depth[v, u]:
            x, y, z = points[k, 0], points[k, 1], points[k, 2]
            n = _turned(pose, normals[k, 0], normals[k, 1], normals[k, 2])
            ray = _turned(pose, x - eye[0], y - eye[1], z - eye[2])
            front = max(n[0] * sun[0] + n[1] * sun[1] + n[2] * sun[2], 0.0) / np.pi
            if front > 0.0:
                front *= _sun_at(table, sunlit, level, x, y, z, above)
            nx, ny, nz = np.float32(n[0]), np.float32(n[1]), np.float32(n[2])
            mirrored = _reflected(n, ray, _MIRROR[material[k]])
            for channel in range(3):
                falling = light.sun_rgb[channel] * front + falling_on(probe, channel, nx, ny, nz)
                level_light = probe[4 * channel] + probe[4 * channel + 3]
                value = ALBEDO[material[k], channel] * falling + mirrored * level_light
                colour[channel] += share[k] * scale * value
            cover += share[k]
        if k + 1 == len(pixel) or pixel[k + 1] != pixel[k]:
            for channel in range(3):
                linear[v, u, channel] = (1.0 - cover) * linear[v, u, channel] + colour[channel]
                colour[channel] = 0.0
            cover = 0.0
