# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tufts of grass or herbs, clumps of many tufts, and the shapes of their blades, leaves, pinnae, flowers and spikes.

A tuft has blades of several kinds from one disc of soil, with leaves, fronds and flowers. Blades bend like the paths of
particles. Tufts as the unit of instancing follow Deussen et al., "Realistic modeling and rendering of plant
ecosystems", SIGGRAPH 1998. A tuft leans as a whole, its blades differ in length, bend and direction, and dead ones lie
between the others: a meadow of equal tufts would look mown.

Shapes have four or eight vertices. Cameras vary the shade by groups of four vertices, by the first vertex of each
triangle; in thin shapes that vertex is one of the first four, so that a blade has one shade. A blade of eight vertices
is a root point, three pairs, and a tip; one of four is a kite.

Shading normals are blended with the vertical, so that a meadow is lit as a soft volume (as leaves are, in `trees`).

A clump is many tufts of one or several species as one mesh that is instanced over a meadow. A ray that grazes a meadow
visits every tuft whose bounding box it crosses. Blades extend far beyond their roots, so the boxes of single tufts
overlap many times; a clump of a metre, whose blades share one bounding volume hierarchy, took half the time for the
same blades.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final, assert_never

import numpy as np

from fieldtruth.core.arrays import Array, Index
from fieldtruth.core.classes import PlantPart
from fieldtruth.world.model import Mesh, merge_meshes
from fieldtruth.world.plants.growth import Surface, gathered, merged, unit
from fieldtruth.world.plants.species import Blades, Flower, Frond, GrassSpecies, Leaves, Organ, Spike, heights_of

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
    return gathered(vertices, lifted(normals), np.stack([u, v], -1), pattern)


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
    return gathered(vertices, shading, np.stack([u, v], -1), [[0, 2, 1], [0, 3, 2]])


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
    return gathered(vertices, normals, uv, [[0, 2, 1], [0, 3, 2]])


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
    return gathered(vertices, lifted(normals, 0.35), np.broadcast_to(uv, (n, 8, 2)), pattern)


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
    return gathered(vertices, normals, uv, [[0, k, k + 1] for k in range(1, 7)])


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
    return gathered(vertices, normals, np.stack([u, v], -1), pattern)


ROOT_DEPTH = 0.12
"""Depth [m] of the roots in the middle of a tuft."""
ROOT_SLOPE = 0.6
"""Slope of the ground up to which the rim of a tuft still reaches into it."""
SIMPLE_BELOW = 0.6
"""Detail below which every blade is a kite."""
MIN_HEIGHT = 0.006
"""Least height [m] of blades above the soil."""


def grow_tuft(
    species: GrassSpecies, *, name: str, height: float, rng: np.random.Generator, detail: float = 1.0
) -> Mesh:
    """A tuft whose highest blade or stalk ends at ``height`` [m].

    A ``detail`` below 1 gives fewer and wider blades, below 0.6 simpler ones as well. It has no collider: a robot
    drives through. The footprint [m] is the radius of the disc it roots in. Raises ValueError for a height below half
    the least or above 1.5 times the greatest usual height, and for a ``detail`` outside (0, 4].
    """
    low, high = heights_of(species, height)
    if not low <= height <= high:
        raise ValueError(f"height of {species.name} must be between {low:g} and {high:g} m, got {height}")
    if not 0 < detail <= 4:
        raise ValueError(f"detail of {species.name} must be above 0 and at most 4, got {detail}")
    scale = float(np.sqrt(2 * height / sum(species.height)))
    radius = species.radius * scale
    kinds = [_detailed(blades, detail) for blades in species.blades]
    side = rng.normal(0, 0.5 * species.lopsided, 2)
    paths = [_grown(blades, radius, side, rng) for blades in kinds]
    top = max(float(path[:, :, 2].max()) for path in paths)
    pieces: list[tuple[Surface, str, PlantPart]] = []
    for blades, path in zip(kinds, paths, strict=True):
        fitted = path[:, :1] + (height / top) * (path - path[:, :1])
        fitted[..., 2] = np.maximum(fitted[..., 2], MIN_HEIGHT)
        own = PlantPart.STEM if blades.organs else PlantPart.BLADE
        pieces.append((_surface(blades, fitted, scale, rng), blades.material, own))
        pieces.extend((_organ(organ, fitted, scale, rng), organ.material, _part_of(organ)) for organ in blades.organs)
    surfaces, materials, parts = zip(*pieces, strict=True)
    names = list(dict.fromkeys(materials))
    rows = np.repeat([names.index(material) for material in materials], [len(surface[3]) for surface in surfaces])
    mesh = merged(name, surfaces, rows, names, parts=parts, footprint=radius, species=(species.name,))
    return replace(mesh, tufts=np.array([[0.0, 0.0, height, 0.0]], np.float32))


def _part_of(organ: Organ) -> PlantPart:
    is_leaf = isinstance(organ, Frond) or (isinstance(organ, Leaves) and not organ.spikelets)
    return PlantPart.LEAF if is_leaf else PlantPart.FLOWER


def _detailed(blades: Blades, detail: float) -> Blades:
    """The blades with about ``detail`` times as many triangles: wider, with larger leaves."""
    share = detail if not blades.organs else float(np.sqrt(detail))
    number = max(1, round(blades.number * share))
    wider = min(float(np.sqrt(blades.number / number)), 1.6)
    organs = tuple(_coarser(organ, float(np.sqrt(detail))) for organ in blades.organs)
    return replace(
        blades, number=number, width=blades.width * wider, kite=blades.kite or detail < SIMPLE_BELOW, organs=organs
    )


def _coarser(organ: Organ, share: float) -> Organ:
    match organ:
        case Leaves():
            number = max(2, round(organ.number * share))
            size = float(np.sqrt(organ.number / number))
            return replace(organ, number=number, length=organ.length * size, width=organ.width * size)
        case Frond():
            return replace(organ, pairs=max(4, round(organ.pairs * share)))
        case Flower() | Spike():
            return organ
        case _:
            assert_never(organ)


def _grown(blades: Blades, radius: float, side: Array, rng: np.random.Generator) -> Array:
    """Midribs of one kind of blades with relative lengths; they root evenly in the disc."""
    n = blades.number
    out = np.sqrt((np.arange(n) + rng.uniform(0.1, 0.9, n)) / n)
    turn = np.radians(137.5) * np.arange(n) + rng.uniform(0, 2 * np.pi) + rng.normal(0, 0.4, n)
    outward = np.stack([np.cos(turn), np.sin(turn)], 1)
    foot = np.concatenate([radius * blades.rim * out[:, None] * outward, np.zeros((n, 1))], 1)
    towards = outward * (0.35 + 0.65 * out[:, None]) + side + rng.normal(0, 0.3, (n, 2))
    lean = blades.lean[0] + (blades.lean[1] - blades.lean[0]) * out + rng.normal(0, 5, n)
    return midribs(
        foot,
        azimuth=np.arctan2(towards[:, 1], towards[:, 0]),
        length=rng.uniform(*blades.length, n),
        lean=np.radians(lean.clip(-10, 85)),
        bend=np.radians(rng.uniform(*blades.bend, n)),
        drift=np.radians(rng.normal(0, blades.drift, n)),
    )


def _surface(blades: Blades, path: Array, scale: float, rng: np.random.Generator) -> Surface:
    """Blades along midribs; each shows its own band of the texture."""
    n = len(path)
    left = rng.uniform(0, 1, n)
    return strips(
        path,
        width=scale * blades.width * rng.uniform(0.75, 1.2, n),
        depth=ROOT_DEPTH + ROOT_SLOPE * np.hypot(*path[:, 0, :2].T),
        roll=np.radians(rng.normal(0, blades.roll, n)),
        twist=np.radians(rng.normal(0, blades.twist, n)),
        band=np.stack([left, left + 0.2], 1),
        kite=blades.kite,
    )


def _organ(organ: Organ, path: Array, scale: float, rng: np.random.Generator) -> Surface:
    """Leaves, pinnae, flowers or spikes on midribs."""
    n = len(path)
    rows = np.arange(n, dtype=np.intp)
    match organ:
        case Leaves():
            return _leaves(organ, path, scale, rng)
        case Frond():
            length = np.linalg.norm(np.diff(path, axis=1), axis=2).sum(1) * organ.length * rng.uniform(0.85, 1.15, n)
            return pinnae(path, organ.pairs, length, organ.start, rng)
        case Flower():
            top, tangent = along(path, rows, np.ones(n))
            return discs(top, unit(tangent + rng.normal(0, 0.25, (n, 3))), organ.radius * rng.uniform(0.7, 1.2, n))
        case Spike():
            low, _ = along(path, rows, np.full(n, organ.start))
            high, _ = along(path, rows, np.full(n, organ.end))
            return spindles(low, high, organ.radius * scale * rng.uniform(0.8, 1.2, n))
        case _:
            assert_never(organ)


def _leaves(organ: Leaves, path: Array, scale: float, rng: np.random.Generator) -> Surface:
    """Leaves along midribs, turned out from them, their upper sides up."""
    n, k = len(path), organ.number
    row = np.arange(n, dtype=np.intp).repeat(k)
    rank = np.tile(np.arange(k), n)
    step = rank // 2 * 2 if organ.arrangement == "pairs" else rank
    s = (step + 0.5 + rng.uniform(-0.2, 0.2, n * k)) / k
    base, tangent = along(path, row, organ.start + (organ.end - organ.start) * s)
    turn = np.radians(rng.uniform(0, 360, n)[row] + rng.normal(0, 15, n * k) + _divergence(organ, rank))
    across = unit(np.cross(tangent, np.broadcast_to([0.31, 0.95, 0.02], tangent.shape)))
    out = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * np.cross(tangent, across)
    angle = np.radians(organ.angle + rng.normal(0, 10, n * k))[:, None]
    direction = unit(np.cos(angle) * tangent + np.sin(angle) * out - [0, 0, organ.droop])
    size = scale * (1 - (1 - organ.smallest) * s) * np.exp(rng.normal(0, 0.15, n * k))
    upper = np.array([0.0, 0.0, 1.0]) + 0.3 * tangent + rng.normal(0, 0.25, (n * k, 3))
    shape = arched_leaves if organ.broad else kites
    return shape(base, direction, upper, organ.length * size, organ.width * size, organ.widest)


def _divergence(organ: Leaves, rank: Index) -> Array:
    """Angle [deg] about the stalk of each leaf."""
    if organ.arrangement == "pairs":  # each pair at right angles to the one before
        return np.asarray(90.0 * (rank // 2) + 180.0 * (rank % 2))
    return np.asarray(137.5 * rank) if organ.arrangement == "spiral" else np.zeros(len(rank))


def grow_clump(
    shares: Mapping[GrassSpecies, float],
    *,
    name: str,
    radius: float,
    per_m2: float,
    rng: np.random.Generator,
    size: float = 0.5,
    detail: float = 1.0,
) -> Mesh:
    """Tufts in a disc of ``radius`` [m] with a ragged rim, ``per_m2`` per square metre; ``shares`` by species.

    Heights vary about the ``size`` (0: each species' least usual height, 1: its greatest) and are lower at the rim.
    Tufts of clumps that are a radius apart mix. No colliders; the footprint [m] is the radius. Tilt a clump with the
    ground.
    """
    count = tufts_in(per_m2, radius)
    weights = np.array(list(shares.values()), np.float64)
    chosen = rng.choice(len(weights), size=count, p=weights / weights.sum())
    parts = []
    for k, (xy, row) in enumerate(zip(_positions(count, radius, rng), chosen, strict=True)):
        species = list(shares)[row]
        low, high = species.height
        share = size + rng.normal(0, 0.25) - 0.3 * (np.hypot(*xy) / radius) ** 2
        height = float(np.clip(low + (high - low) * share, 0.6 * low, 1.3 * high))
        parts.append(_moved(grow_tuft(species, name=f"{name}_{k}", height=height, rng=rng, detail=detail), xy))
    return merge_meshes(name, parts, footprint=radius)


def tufts_in(per_m2: float, radius: float) -> int:
    """Number of tufts in a clump of a radius [m]."""
    return max(1, round(per_m2 * np.pi * radius**2))


def _positions(count: int, radius: float, rng: np.random.Generator) -> Array:
    """Positions (count, 2) [m] spread evenly over the disc: a sunflower pattern with jitter."""
    k = np.arange(count)
    out = radius * np.sqrt((k + 0.5) / count) * rng.uniform(0.82, 1.12, count)
    turn = k * np.pi * (3 - np.sqrt(5)) + rng.normal(0, 0.3, count)
    return np.stack([out * np.cos(turn), out * np.sin(turn)], 1)


def _moved(mesh: Mesh, xy: Array) -> Mesh:
    """The mesh moved by ``xy`` [m], with deeper roots far from the clump's middle, for uneven ground."""
    vertices = mesh.vertices.copy()
    vertices[:, :2] += xy.astype(np.float32)
    deeper = vertices[:, 2] < 0
    vertices[deeper, 2] -= np.float32(0.25 * np.hypot(*xy))
    assert mesh.tufts is not None
    return replace(mesh, vertices=vertices, tufts=mesh.tufts + np.array([*xy, 0.0, 0.0], np.float32))
