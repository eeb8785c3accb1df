# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground from above, as data: soil with pieces that lie on it and on each other, such as blades, stones and leaves.

The pieces' heights decide which are seen; the picture has their colours, and the light that reaches between them. A
tile is 1.5 m of ground with texels of 1.5 mm, or 2.5 m of scree; its alpha channel has heights.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Final, Literal, NamedTuple, TypeVar

import numpy as np
from pydantic import Field
from scipy import ndimage

from fieldtruth.core.arrays import Index
from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.world.textures.canvas import (
    Image,
    Profile,
    Rng,
    Samples,
    Tone,
    Tones,
    blur,
    drawing,
    even_out,
    linear,
    mix,
    noise,
    settle,
    stamps,
    stone_profile,
    strokes,
)

T = TypeVar("T")
N: Final = 1024
"""Texels along each side."""
Pair = tuple[float, float]
"""Least and greatest value."""
Above = Annotated[float, Field(gt=0)]
Sizes = tuple[Above, Above]
"""Least and greatest size."""
Count = Annotated[int, Field(ge=1)]


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Smooth noise of ``low`` to ``high`` cycles per tile, as in ``canvas.noise``."""

    shape: Literal["noise"]
    low: Above
    high: Above
    slope: float = 1.0
    stretch: Above = 1.0


@dataclass(frozen=True, kw_only=True)
class Sum:
    """A number for each texel: ``middle`` and noises by name times their amplitudes, between limits if there are."""

    middle: float
    waves: Mapping[str, float] = field(default_factory=dict)
    limits: Pair | None = None

    def over(self, noises: Mapping[str, Image]) -> Image:
        """Return the numbers (N, N)."""
        total: Image = np.full((N, N), self.middle, np.float32)
        for name, amplitude in self.waves.items():
            total = total + amplitude * _named("noise", noises, name)
        return total if self.limits is None else total.clip(*self.limits)


@dataclass(frozen=True, kw_only=True)
class Pieces:
    """Pieces of one kind: colours from dark to light, and how the tones of pieces vary (beta distribution)."""

    count: Count
    tones: Tones
    tone: Sizes = (2.0, 2.0)

    def scattered(self, rng: Rng) -> Samples:
        """Scatter the pieces, with heights 0 to 1."""
        raise NotImplementedError

    def raised(self, pieces: Samples, _noises: Mapping[str, Image]) -> Samples:
        """Return the pieces with heights that depend on the place."""
        return pieces


@dataclass(frozen=True, kw_only=True)
class Blades(Pieces):
    """Blades, needles, straw and twigs, which rise from one end to the other, as ``canvas.strokes``."""

    shape: Literal["blades"]
    length: Sizes  # [texel]
    width: Above  # [texel]
    bend: Annotated[float, Field(ge=0)]
    heights: Pair = (0.0, 1.0)
    tall: Sum | None = None
    """Of the place: a factor on the height."""
    foot: Sum | None = None
    """Of the place: the height of the root, above which they rise by their own."""
    rise: float = 1.0
    """Factor on their own height."""

    def scattered(self, rng: Rng) -> Samples:
        """Scatter the blades."""
        found, (low, high) = strokes(rng, N, self.count, self.length, self.width, self.bend), self.heights
        return found._replace(height=(low + (high - low) * found.height).astype(np.float32))

    def raised(self, pieces: Samples, noises: Mapping[str, Image]) -> Samples:
        """Return the blades with heights that depend on the place."""
        at = np.floor(pieces.y).astype(np.intp) % N, np.floor(pieces.x).astype(np.intp) % N
        own = pieces.height
        if self.tall is not None:
            own = own * self.tall.over(noises)[at]
        own = own * np.float32(self.rise)
        return pieces._replace(height=own if self.foot is None else self.foot.over(noises)[at] + own)


@dataclass(frozen=True, kw_only=True)
class Stones(Pieces):
    """Rounded stones, or shards with straight sides; the number above a radius r falls as r^-power.

    Fuller's curve, by which the mass that passes a sieve grows as the root of its mesh, has a power of 2.5 (Fuller and
    Thompson 1907). Large shards are on top.
    """

    shape: Literal["stones", "shards"]
    radius: Sizes  # [texel]
    power: Above = 2.5
    rise: Pair = (0.0, 1.0)
    """Heights of the smallest and the largest stones."""

    def scattered(self, rng: Rng) -> Samples:
        """Scatter the stones."""
        low, high = (each**-self.power for each in self.radius)
        size = (low + rng.random(self.count) * (high - low)) ** (-1 / self.power)
        grown = (size - self.radius[0]) / (self.radius[1] - self.radius[0])
        if self.shape == "shards":
            outline = _shard(rng, self.count)
            top = np.minimum(0.25 + 0.7 * grown + 0.25 * rng.random(self.count), 1.0)
            return stamps(rng, N, size, size * rng.uniform(0.55, 0.95, self.count), outline, top)
        outline = stone_profile(rng.uniform(0, 2 * np.pi, (self.count, 4)).astype(np.float32))
        top = self.rise[0] + (self.rise[1] - self.rise[0]) * grown
        wide = size * rng.uniform(0.6, 0.95, self.count)
        return stamps(rng, N, size, wide, outline, top * rng.uniform(0.8, 1, self.count))


@dataclass(frozen=True, kw_only=True)
class Flat(Pieces):
    """Flat pieces: dead leaves, chips of bark, leaves of clover, bits of reed."""

    shape: Literal["leaves", "chips", "clover", "reed"]
    length: Sizes  # [texel], half of it
    gamma: Sizes | None = None
    """Shape and scale of the gamma distribution of lengths, which ``length`` then limits; None: uniform."""
    width: Sizes = (0.4, 0.75)  # relative to the length; of reed, half of it [texel]
    rise: Pair | float = (0.0, 1.0)

    def scattered(self, rng: Rng) -> Samples:
        """Scatter the pieces."""
        drawn = rng.uniform(*self.length, self.count) if self.gamma is None else rng.gamma(*self.gamma, self.count)
        length = drawn.clip(*self.length)
        width = rng.uniform(*self.width, self.count) * (1.0 if self.shape == "reed" else length)
        rise = rng.uniform(*self.rise, self.count) if isinstance(self.rise, tuple) else self.rise
        return stamps(rng, N, length, width, _OUTLINES[self.shape], rise)


def _clover(a: Image, b: Image, _rows: Index) -> Image:
    turn = np.arctan2(b, a)
    return np.asarray(0.75 + 0.25 * np.cos(3 * turn) - np.hypot(a, b), np.float32)


def _chip(a: Image, b: Image, rows: Index) -> Image:
    ends = 0.92 + 0.08 * np.sin(7 * b + rows)
    inside = np.minimum(ends - np.abs(a), 1 - np.abs(b) * (1 + 0.3 * np.abs(a)))
    return np.asarray(np.where(inside > 0, np.minimum(1, 4 * inside), -1), np.float32)


def _dead_leaf(a: Image, b: Image, rows: Index) -> Image:
    """Profile of a leaf: a pointed oval with a wavy margin that differs between rows."""
    wave = 1 + 0.08 * np.sin(11 * a + rows)
    half = np.clip(1 - a**2, 0, 1) ** 0.8 * (1 - 0.25 * a) * wave
    return np.asarray(np.where(np.abs(b) < half, 0.7 + 0.3 * np.abs(b), -1), np.float32)


def _reed(a: Image, b: Image, _rows: Index) -> Image:
    return 1 - b**2 - 0.2 * a**2


_OUTLINES: Final[Mapping[str, Profile]] = {"leaves": _dead_leaf, "chips": _chip, "clover": _clover, "reed": _reed}


def _shard(rng: Rng, count: int) -> Profile:
    """Profile of splinters with six straight sides and a tilted top."""
    turn = (np.arange(6) / 6 * 2 * np.pi + rng.uniform(-0.5, 0.5, (count, 6))).astype(np.float32)
    reach = rng.uniform(0.55, 0.95, (count, 6)).astype(np.float32)
    lean = rng.uniform(-0.35, 0.35, (count, 2)).astype(np.float32)

    def profile(a: Image, b: Image, rows: Index) -> Image:
        edge = np.full(a.shape, 1.0, np.float32)
        for k in range(6):
            edge = np.minimum(edge, 1 - (a * np.cos(turn[rows, k]) + b * np.sin(turn[rows, k])) / reach[rows, k])
        tilt = lean[rows, 0] * a + lean[rows, 1] * b
        return np.asarray(np.where(edge > 0, np.clip(0.35 + 3 * edge, 0, 0.8) + tilt, -1), np.float32)

    return profile


class Patches(NamedTuple):
    """Patches of another colour, moss: where a noise is above ``least``."""

    noise: str
    colour: Tone
    least: float


@dataclass(frozen=True, kw_only=True)
class Soil:
    """Ground between the pieces: tones from dark to light by a number of 0 to 1, times a ``brightness``."""

    tones: Tones
    by: Sum
    brightness: float = 1.0
    patches: Patches | None = None

    def seen(self, noises: Mapping[str, Image]) -> Image:
        """Return the colours (N, N, 3)."""
        colour = mix(self.tones, self.by.over(noises))
        if self.brightness != 1.0:
            colour = colour * np.float32(self.brightness)
        if self.patches is None:
            return colour
        name, tone, least = self.patches
        share = np.clip(_named("noise", noises, name) - least, 0, 0.8)[..., None]
        return np.asarray(colour * (1 - share) + linear(tone) * share, np.float32)


Step = Annotated[Noise | Blades | Stones | Flat, Field(discriminator="shape")]


@drawing
def strewn(
    rng: Rng,
    *,
    steps: Mapping[str, Step],
    laid: Annotated[tuple[str, ...], Field(min_length=1)],
    soil: Soil,
    height: Sum,
    depth: float = 1.0,
    clumps: float = 0.1,
) -> Image:
    """Draw soil of a ``height`` 0 to 1 with pieces on it: colour and height (N, N, 4).

    ``steps`` are noises and pieces by name, in the order in which random numbers are drawn for them; ``laid`` names
    the pieces from below. What lies below soil or other pieces is hidden. ``depth`` scales the darkness between pieces,
    ``clumps`` is the deviation of the tones that neighbours share, over 2 to 20 cm.
    """
    noises, scattered = dict[str, Image](), dict[str, tuple[Pieces, Samples]]()
    for name, step in steps.items():
        if isinstance(step, Noise):
            noises[name] = noise(rng, N, step.low, step.high, slope=step.slope, stretch=step.stretch)
        else:
            scattered[name] = step, step.scattered(rng)
    kinds = [_named("pieces", scattered, name) for name in laid]
    kinds = [(kind, kind.raised(pieces, noises)) for kind, pieces in kinds]
    return _layered(rng, soil.seen(noises), height.over(noises), kinds, depth, clumps)


def _named(kind: str, known: Mapping[str, T], name: str) -> T:
    if name not in known:
        raise ConfigurationError(f"unknown {kind} {name!r}; {suggestion(name, known)}")
    return known[name]


def _layered(
    rng: Rng, colour: Image, height: Image, kinds: Sequence[tuple[Pieces, Samples]], depth: float, clumps: float
) -> Image:
    first = np.cumsum([0, *(int(pieces.owner.max()) + 1 for _, pieces in kinds)])
    relief = settle(N, [p._replace(owner=p.owner + np.int32(f)) for (_, p), f in zip(kinds, first, strict=False)])
    shown = (relief.owner >= 0) & (relief.height > height)
    grain = 0.06 * noise(rng, N, 20, 0.45 * N, slope=0.4) + clumps * noise(rng, N, 8, 60, slope=0.5)
    fleck = np.exp(np.float32(0.06) * noise(rng, N, N / 8, N / 2, slope=0.0))
    for (kind, _), start, end in zip(kinds, first[:-1], first[1:], strict=True):
        own = shown & (relief.owner >= start) & (relief.owner < end)
        tone = rng.beta(*kind.tone, end - start).astype(np.float32)[relief.owner[own] - start]
        colour[own] = mix(kind.tones, (tone + grain[own])[None])[0]
    top = blur(np.where(shown, relief.height, height), 0.7)
    soft = blur(colour * (_openness(top, depth) * fleck)[..., None], 0.45)  # a piece covers a part of a texel
    return even_out(np.concatenate([soft, top[..., None]], axis=-1).astype(np.float32))


def _openness(height: Image, depth: float) -> Image:
    """Light from the sky between pieces, about 1: less below the surroundings at three widths [texel]."""
    lost = sum(
        weight * np.maximum(ndimage.uniform_filter(height, size, mode="wrap") - height, -0.15)
        for size, weight in ((5, 1.0), (13, 0.9), (31, 0.7))
    )
    return np.asarray(np.clip(np.exp(-np.float32(depth * 1.2) * lost), 0.2, 1.3), np.float32)
