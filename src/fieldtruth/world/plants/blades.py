# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shapes of grass and herbs: bent blades, pairs of pinnae, flower discs and spindles.

Shapes have four or eight vertices. Cameras vary the shade by groups of four vertices, by the first vertex of each
triangle; in thin shapes that vertex is one of the first four, so that a blade has one shade. A blade of eight vertices
is a root point, three pairs, and a tip; one of four is a kite.

Shading normals are blended with the vertical, so that a meadow is lit as a soft volume (as for leaves in `leaves`).
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Index
from fieldtruth.world.plants.growth import unit
from fieldtruth.world.plants.meshing import Surface

STEPS: Final = 24
"""Segments of a midrib."""
UPWARD_BLEND: Final = 0.6
"""Weight of "up" in a blade's shading normal."""
_UP: Final = np.array([0.0, 0.0, 1.0])
_LEVELS: Final = np.array([0.3, 0.62, 0.86])  # of a blade's pairs of vertices, relative to the length
_WIDTHS: Final = np.array([1.0, 0.86, 0.5])  # at these levels, relative to the widest


def midribs(foot: Array, azimuth: Array, length: Array, lean: Array, bend: Array, drift: Array) -> Array:
    """Midribs (n, STEPS + 1, 3) [m] from ``foot`` (n, 3), ``length`` (n,) [m] long.

    They start at ``lean`` [rad] from vertical towards ``azimuth`` [rad]. The inclination grows by ``bend`` [rad] until
    the tip, slowly at first, like that of a thrown particle (Reeves and Blau, "Approximate and Probabilistic Algorithms
    for Shading and Rendering Structured Particle Systems", SIGGRAPH 1985), and the azimuth turns by ``drift`` [rad].
    """
    s = (np.arange(STEPS) + 0.5) / STEPS
    tilt = lean[:, None] + bend[:, None] * s**1.5
    turn = azimuth[:, None] + drift[:, None] * s
    heading = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], -1)
    rise = np.cumsum(heading * (length / STEPS)[:, None, None], axis=1)
    return np.asarray(foot[:, None] + np.concatenate([np.zeros_like(rise[:, :1]), rise], axis=1))


def along(path: Array, row: Index, fraction: Array) -> tuple[Array, Array]:
    """Position [m] and unit tangent (m, 3) of midrib ``row`` at a fraction of its length (m,)."""
    at = np.clip(fraction, 0, 1) * STEPS
    i = np.minimum(at.astype(np.intp), STEPS - 1)
    f = (at - i)[:, None]
    a, b = path[row, i], path[row, i + 1]
    return a + f * (b - a), unit(b - a)


def strips(path: Array, width: Array, depth: Array, roll: Array, twist: Array, band: Array, *, kite: bool) -> Surface:
    """Blades along midribs, ``width`` (n,) [m] wide, rooted ``depth`` (n,) [m] below the start of the midribs.

    The upper side of an upright blade faces the middle of the tuft; it is turned about the midrib by ``roll`` and, from
    root to tip, by ``twist`` (n,) [rad]. ``band`` (n, 2) is u of its left and right edges; v runs from root to tip. A
    ``kite`` has two triangles instead of six.
    """
    n = len(path)
    levels, widths = (np.array([0.4]), np.array([1.0])) if kite else (_LEVELS, _WIDTHS)
    k = len(levels)
    rows = np.arange(n, dtype=np.intp).repeat(k)
    middle, tangent = (a.reshape(n, k, 3) for a in along(path, rows, np.tile(levels, n)))
    across = np.cross(path[:, -1] - path[:, 0], _UP)
    across[:, 0] += 1e-9  # a vertical blade: any direction across it
    across = unit(across)[:, None]
    across = unit(across - (across * tangent).sum(-1, keepdims=True) * tangent)
    turn = (roll[:, None] + twist[:, None] * levels)[..., None]
    across = np.cos(turn) * across + np.sin(turn) * np.cross(tangent, across)
    own = np.cross(across, tangent)
    own = np.where(own[..., 2:] < 0, -own, own)

    half = (0.5 * width[:, None] * widths)[..., None] * across
    root = path[:, :1] - depth[:, None, None] * _UP
    left, right = middle + half, middle - half
    bulge = 0.4 * across
    ends = own[:, :1], own[:, -1:]
    u_left, u_right = (np.broadcast_to(band[:, i, None], (n, k)) for i in (0, 1))
    centre = band.mean(1, keepdims=True)
    v = np.broadcast_to(levels, (n, k))
    zero, one = np.zeros((n, 1)), np.ones((n, 1))
    if kite:
        vertices = np.concatenate([root, left, path[:, -1:], right], 1)
        normals = np.concatenate([ends[0], own + bulge, ends[1], own - bulge], 1)
        u, v = np.concatenate([centre, u_left, centre, u_right], 1), np.concatenate([zero, v, one, v], 1)
        pattern = [[0, 1, 3], [1, 2, 3]]
    else:
        vertices = np.concatenate([root, left, right, path[:, -1:]], 1)
        normals = np.concatenate([ends[0], own + bulge, own - bulge, ends[1]], 1)
        u, v = np.concatenate([centre, u_left, u_right, centre], 1), np.concatenate([zero, v, v, one], 1)
        pattern = [[0, 1, 4], [1, 5, 4], [1, 2, 5], [2, 6, 5], [2, 3, 6], [3, 7, 6]]
    return _gathered(vertices, lifted(normals), np.stack([u, v], -1), pattern)


def lifted(normals: Array, blend: float = UPWARD_BLEND) -> Array:
    """Unit normals blended with the vertical."""
    return unit((1 - blend) * unit(normals) + blend * _UP)


def pinnae(path: Array, number: int, length: Array, start: float, rng: np.random.Generator) -> Surface:
    """Fronds: ``number`` pairs of pinnae along each midrib from ``start`` on; ``length`` (n,) [m] of the longest.

    Each pinna is a narrow blade of two triangles, folded along its edge from stalk to tip. Pinnae are longest at a
    third of the frond, shorter towards its tip, to which they lean; they droop and differ. The upper side faces up.
    """
    n = len(path)
    row = np.arange(n, dtype=np.intp).repeat(2 * number)
    sign = np.tile([1.0, -1.0], n * number)
    s = np.tile((np.arange(2 * number) // 2 + 0.5 * (np.arange(2 * number) % 2)) / number, n)
    s = (s + rng.normal(0, 0.15 / number, len(s))).clip(0, 0.985)
    foot, tangent = along(path, row, start + (1 - start) * s)
    frond = np.linalg.norm(np.diff(path, axis=1), axis=2).sum(1)
    outline = np.where(s < 0.3, 0.6 + 1.33 * s, 1.0 - 0.97 * (np.maximum(s - 0.3, 0) / 0.7) ** 1.15)
    size = length[row] * outline * np.exp(rng.normal(0, 0.09, len(s)))
    broad = np.minimum(1.1 * (1 - start) * frond[row] / number, 0.42 * size)
    side = np.cross(path[:, -1] - path[:, 0], _UP)
    side[:, 0] += 1e-9
    side = unit(side)[row]
    side = unit(side - (side * tangent).sum(-1, keepdims=True) * tangent)
    upper = np.cross(side, tangent)
    lean = (0.2 + 0.45 * s + rng.normal(0, 0.08, len(s)))[:, None]
    hang = (0.1 + 0.12 * rng.random(n)[row] + rng.normal(0, 0.1, len(s)))[:, None]
    out = unit(sign[:, None] * side + lean * tangent - hang * upper)
    own = unit(upper + hang * sign[:, None] * side)
    half = 0.5 * broad[:, None] * unit(np.cross(own, out))
    bow = (0.16 + rng.normal(0, 0.06, len(s)))[:, None] * size[:, None]  # the tip bends down and forwards
    tip = foot + size[:, None] * out + bow * (0.6 * tangent - 0.8 * own)
    middle = foot + 0.42 * size[:, None] * out + 0.16 * broad[:, None] * own
    vertices = np.stack([foot, middle + half, tip, middle - half], 1)
    fold = 0.35 * unit(half)
    shading = lifted(np.stack([own, own + fold, own, own - fold], 1), 0.3)
    v = 0.5 + sign[:, None] * np.array([0.0, 0.2, 0.48, 0.2])
    u = s[:, None] + np.array([0.03, 0.06, 0.03, 0.0])
    return _gathered(vertices, shading, np.stack([u, v], -1), [[0, 2, 1], [0, 3, 2]])


def kites(base: Array, direction: Array, upper: Array, length: Array, width: Array, widest: float) -> Surface:
    """Small leaves and spikelets of two triangles, slightly folded; ``upper`` is approximately their normal.

    ``base`` and ``direction`` (n, 3), ``length`` and ``width`` (n,) [m]; ``widest`` is a fraction of the length.
    """
    n = len(base)
    normal = unit(upper - (upper * direction).sum(-1, keepdims=True) * direction)
    side = np.cross(normal, direction)
    middle = base + widest * length[:, None] * direction + 0.25 * width[:, None] * normal
    half = 0.5 * width[:, None] * side
    vertices = np.stack([base, middle + half, base + length[:, None] * direction, middle - half], 1)
    normals = lifted(np.stack([normal, normal - 0.35 * side, normal, normal + 0.35 * side], 1), 0.35)
    uv = np.broadcast_to([[0.5, 0.03], [0.04, widest], [0.5, 0.97], [0.96, widest]], (n, 4, 2))
    return _gathered(vertices, normals, uv, [[0, 2, 1], [0, 3, 2]])


def arched_leaves(base: Array, direction: Array, upper: Array, length: Array, width: Array, widest: float) -> Surface:
    """Broad leaves of six triangles, folded along the midrib, with rims between base, widest part and tip that are
    convex, and a tip that bends down; parameters as of `kites`.
    """
    n = len(base)
    normal = unit(upper - (upper * direction).sum(-1, keepdims=True) * direction)
    side = np.cross(normal, direction)
    levels = np.array([0.45 * widest, widest, widest + 0.55 * (1 - widest)])
    half = 0.5 * width[:, None, None] * (np.array([0.72, 1.0, 0.62])[:, None] * side[:, None])
    sag = 0.22 * length[:, None] * np.append(levels, 1.0) ** 2
    line = base[:, None] + length[:, None, None] * np.append(levels, 1.0)[:, None] * direction[:, None]
    line = line - sag[..., None] * normal[:, None]
    rim = line[:, :3] + 0.2 * width[:, None, None] * normal[:, None]
    vertices = np.concatenate([base[:, None], rim + half, rim - half, line[:, 3:]], 1)
    own = unit(normal[:, None] + 0.44 * np.append(levels, 1.0)[:, None] * direction[:, None])
    fold = 0.35 * side[:, None]
    normals = np.concatenate([normal[:, None], own[:, :3] - fold, own[:, :3] + fold, own[:, 3:]], 1)
    across = 0.46 * np.array([0.72, 1.0, 0.62])
    uv = np.concatenate([[[0.5, 0.03]], np.stack([0.5 - across, levels], 1), np.stack([0.5 + across, levels], 1),
                         [[0.5, 0.97]]])  # fmt: skip
    pattern = [[0, 4, 1], [1, 4, 5], [1, 5, 2], [2, 5, 6], [2, 6, 3], [3, 6, 7]]
    return _gathered(vertices, lifted(normals, 0.35), np.broadcast_to(uv, (n, 8, 2)), pattern)


def discs(centre: Array, normal: Array, radius: Array) -> Surface:
    """Flat octagons for flowers; the flower fills the texture."""
    n = len(centre)
    across = unit(np.cross(normal, [0.31, 0.95, 0.0]))
    over = np.cross(normal, across)
    turn = 2 * np.pi * np.arange(8) / 8
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    vertices = centre[:, None] + radius[:, None, None] * (c * across[:, None] + s * over[:, None])
    normals = np.broadcast_to(lifted(normal, 0.3)[:, None], (n, 8, 3))
    uv = np.broadcast_to(np.concatenate([0.5 + 0.49 * c, 0.5 + 0.49 * s], 1), (n, 8, 2))
    return _gathered(vertices, normals, uv, [[0, k, k + 1] for k in range(1, 7)])


def spindles(low: Array, high: Array, radius: Array) -> Surface:
    """Three-sided spindles from ``low`` to ``high`` (n, 3): the spikes of cattails."""
    n = len(low)
    axis = unit(high - low)
    across = unit(np.cross(axis, [0.95, 0.31, 0.1]))
    over = np.cross(axis, across)
    turn = 2 * np.pi * np.arange(3) / 3
    spoke = np.cos(turn)[:, None] * across[:, None] + np.sin(turn)[:, None] * over[:, None]
    out = radius[:, None, None] * spoke
    rise = (high - low)[:, None]
    start = low[:, None]
    vertices = np.concatenate([start, start + 0.06 * rise + out, start + 0.94 * rise + out, high[:, None]], 1)
    normals = np.concatenate([-axis[:, None], spoke, spoke, axis[:, None]], 1)
    u = np.broadcast_to([0.5, 0.0, 0.33, 0.67, 0.0, 0.33, 0.67, 0.5], (n, 8))
    v = np.broadcast_to([0.0, 0.06, 0.06, 0.06, 0.94, 0.94, 0.94, 1.0], (n, 8))
    pattern = [
        [0, 2, 1], [0, 3, 2], [0, 1, 3],
        [1, 2, 5], [1, 5, 4], [2, 3, 6], [2, 6, 5], [3, 1, 4], [3, 4, 6],
        [4, 5, 7], [5, 6, 7], [6, 4, 7],
    ]  # fmt: skip
    return _gathered(vertices, normals, np.stack([u, v], -1), pattern)


def _gathered(vertices: Array, normals: Array, uv: Array, pattern: list[list[int]]) -> Surface:
    """One surface of ``n`` shapes of ``k`` vertices (n, k, ...), each with the faces of ``pattern``."""
    n, k, _ = vertices.shape
    faces = k * np.arange(n)[:, None, None] + np.array(pattern)
    return vertices.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), faces.reshape(-1, 3).astype(np.int32)
