# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Drawing tools of all textures: noise, cells and scattered pieces on a square that wraps at its edges.

An image is (n, n) or (n, n, 3): u runs along axis 1, v up axis 0 (v = 0 is the lower edge). Light is linear until
:func:`finish` encodes it as sRGB.
"""

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft, ndimage

from fieldtruth.core.arrays import Index

Image = NDArray[np.float32]
Rng = np.random.Generator
Tone = tuple[float, float, float]
"""An sRGB colour, 0 to 255."""
Tones = Sequence[Tone]
Drawing = Callable[..., Image]
"""Takes a random generator and the parameters of a texture's data entry as keywords; gives linear light (n, n, 3), or
(n, n, 4) with heights 0 to 1."""
DRAWINGS: Final[dict[str, Drawing]] = {}
"""Functions that draw textures, by name."""


def drawing(draw: Drawing) -> Drawing:
    """Register a function that draws a texture."""
    DRAWINGS[draw.__name__] = draw
    return draw


def linear(rgb8: ArrayLike) -> Image:
    """Linear light of sRGB values 0 to 255 (IEC 61966-2-1)."""
    s = np.asarray(rgb8, np.float32) / np.float32(255)
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4).astype(np.float32)


def noise(rng: Rng, n: int, low: float, high: float, *, slope: float = 1.0, stretch: float = 1.0) -> Image:
    """Smooth noise (n, n), mean 0, deviation 1, of ``low`` to ``high`` cycles per tile, amplitude frequency^-slope.

    ``stretch`` above 1 lengthens it along v by that factor, below 1 along u.
    """
    spectrum = fft.rfft2(rng.standard_normal((n, n), np.float32))
    v = (fft.fftfreq(n, 1 / n) * np.sqrt(stretch))[:, None]
    u = (fft.rfftfreq(n, 1 / n) / np.sqrt(stretch))[None, :]
    k = np.maximum(np.hypot(u, v), 1e-6).astype(np.float32)
    gain = (
        k ** np.float32(-slope) * np.exp(-((k / np.float32(high)) ** 4)) * (1 - np.exp(-((k / np.float32(low)) ** 4)))
    )
    gain[0, 0] = 0.0
    field = fft.irfft2(spectrum * gain, (n, n)).astype(np.float32)
    return np.asarray(field / field.std(), np.float32)


def ridges(rng: Rng, n: int, count: float, *, stretch: float, spread: float = 0.35) -> Image:
    """Long ridges (n, n) along v that fork and join, ``count`` per tile: 1 on their crests, 0 in the furrows between.

    Noise of a narrow band of frequencies about ``count`` across has a phase whose dislocations are forks (as in
    fingerprints; Sherlock and Monro, "A model for interpreting fingerprint topology", Pattern Recognition 1993). The
    band's relative width is ``spread``; ridges are about ``stretch`` times as long between forks as they are wide.
    """
    spectrum = fft.fft2(rng.standard_normal((n, n)).astype(np.float32))
    v, u = fft.fftfreq(n, 1 / n)[:, None], fft.fftfreq(n, 1 / n)[None, :]
    gain = np.exp(-(((u - count) / (spread * count)) ** 2 + (v * stretch / count) ** 2)) * (u > 0)  # one side: a phase
    wave = fft.ifft2(spectrum * gain)
    return np.asarray(0.5 + 0.5 * wave.real / np.maximum(np.abs(wave), 1e-12), np.float32)


class Cells(NamedTuple):
    """For each pixel: distance to the nearest and second nearest seed [spacings], and the nearest one's number."""

    nearest: Image
    second: Image
    owner: NDArray[np.int32]


def cells(rng: Rng, n: int, across: int, along: int, *, jitter: float = 0.8, shift: Sequence[Image] = ()) -> Cells:
    """Worley's cells (SIGGRAPH 1996) of across x along seeds, one per grid cell, moved by ``jitter`` of its size.

    ``shift`` (u, v) [spacings] bends the borders.
    """
    offset = (rng.random((2, along, across)).astype(np.float32) - 0.5) * jitter
    grid = (np.arange(n, dtype=np.float32) + 0.5) / n
    u, v = np.broadcast_to(grid * across, (n, n)), np.broadcast_to((grid * along)[:, None], (n, n))
    if shift:
        u, v = u + shift[0], v + shift[1]
    column, row = np.floor(u).astype(np.int32), np.floor(v).astype(np.int32)
    nearest, second = np.full((n, n), 9, np.float32), np.full((n, n), 9, np.float32)
    owner = np.zeros((n, n), np.int32)
    for di in (-1, 0, 1):
        for dj in (-1, 0, 1):
            i, j = (row + di) % along, (column + dj) % across
            du = u - (column + dj) - np.float32(0.5) - offset[0, i, j]
            dv = v - (row + di) - np.float32(0.5) - offset[1, i, j]
            distance = np.hypot(du, dv)
            closer = distance < nearest
            second = np.where(closer, nearest, np.minimum(second, distance))
            owner = np.where(closer, i * across + j, owner)
            nearest = np.where(closer, distance, nearest)
    return Cells(nearest, second, owner)


class Samples(NamedTuple):
    """Points of scattered pieces, each (m,): position [pixels], height, the piece's number, position in the piece."""

    x: Image
    y: Image
    height: Image
    owner: NDArray[np.int32]
    a: Image
    b: Image


class Relief(NamedTuple):
    """The pieces from above, each (n, n): height, number (-1 where there is no piece), position in the piece."""

    height: Image
    owner: NDArray[np.int32]
    a: Image
    b: Image


def settle(n: int, pieces: Sequence[Samples]) -> Relief:
    """The pieces from above: each pixel shows its highest sample; heights are clipped to 0 to 1."""
    x, y, height, owner, a, b = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    pixel = (np.floor(y).astype(np.int64) % n) * n + np.floor(x).astype(np.int64) % n
    key = (np.clip(height * 65535, 0, 65535).astype(np.int64) << 32) | np.arange(len(x))
    top = np.full(n * n, -1, np.int64)
    np.maximum.at(top, pixel, key)
    seen = (top & 0xFFFFFFFF) * (top >= 0)
    empty = top < 0
    return Relief(
        np.where(empty, 0, height[seen]).reshape(n, n).astype(np.float32),
        np.where(empty, -1, owner[seen]).reshape(n, n).astype(np.int32),
        a[seen].reshape(n, n),
        b[seen].reshape(n, n),
    )


def strokes(rng: Rng, n: int, count: int, length: tuple[float, float], width: float, bend: float) -> Samples:
    """Blades: bent lines of ``length`` and ``width`` [pixels] that rise from a root (a = 0) to a tip (a = 1)."""
    steps, across = int(np.ceil(length[1] * 0.9)), int(np.ceil(width * 1.2))
    a = ((np.arange(steps, dtype=np.float32) + 0.5) / steps)[None, :, None]
    b = (((np.arange(across, dtype=np.float32) + 0.5) / across - 0.5) * 2)[None, None, :]
    x, y, angle, share, top = (f.astype(np.float32)[:, None, None] for f in rng.random((5, count)))
    extent = np.float32(length[0]) + share * np.float32(length[1] - length[0])
    turn = np.float32(2 * np.pi) * angle + a * rng.normal(0, bend, (count, 1, 1)).astype(np.float32)
    c, s = np.cos(turn), np.sin(turn)
    side = b * np.float32(width / 2) * (1 - np.float32(0.7) * a)
    along = extent * a
    # Short blades are upright ones: they are the highest.
    height = (np.float32(0.35) + np.float32(0.65) * top) * (1 - np.float32(0.4) * share) * a * (1.6 - 0.6 * a)
    owner = np.arange(count, dtype=np.int32)[:, None, None]
    full = (count, steps, across)
    fields = (x * n + along * c - side * s, y * n + along * s + side * c, height, owner, a, b)
    return Samples(*(np.broadcast_to(f, full).ravel() for f in fields))


Profile = Callable[[Image, Image, Index], Image]
"""Height 0 to 1 at a, b (m,) in -1 to 1 of the pieces numbered by the third argument; below 0 is outside."""


def stamps(
    rng: Rng, n: int, length: ArrayLike, width: ArrayLike, profile: Profile, rise: ArrayLike, *, turn: float = np.pi
) -> Samples:
    """Scattered pieces of half ``length`` and ``width`` (k,) [pixels], turned by ``turn`` at most, ``rise`` high."""
    half_a, half_b = np.asarray(length, np.float32), np.asarray(width, np.float32)
    top = np.broadcast_to(np.asarray(rise, np.float32), half_a.shape)
    centre = rng.uniform(0, n, (2, len(half_a))).astype(np.float32)
    angle = rng.uniform(-turn, turn, len(half_a)).astype(np.float32)
    size_class = np.ceil(np.log2(np.maximum(np.hypot(half_a, half_b), 1.0)) * 2).astype(int)
    found: list[Samples] = []
    for step in np.unique(size_class):
        rows = np.flatnonzero(size_class == step)
        radius = int(np.ceil(2.0 ** (step / 2)))
        grid = np.arange(-radius, radius + 1, dtype=np.float32)
        dx, dy = (g.ravel()[None, :] for g in np.meshgrid(grid, grid))
        c, s = np.cos(angle[rows])[:, None], np.sin(angle[rows])[:, None]
        a, b = (c * dx + s * dy) / half_a[rows, None], (c * dy - s * dx) / half_b[rows, None]
        piece, pixel = np.nonzero((np.abs(a) <= 1) & (np.abs(b) <= 1))
        at_a, at_b = a[piece, pixel].astype(np.float32), b[piece, pixel].astype(np.float32)
        owner = rows[piece]
        shape = profile(at_a, at_b, owner)
        inside = shape >= 0
        x, y = centre[0, owner] + dx[0, pixel], centre[1, owner] + dy[0, pixel]
        height = top[owner] * (np.float32(0.6) + np.float32(0.4) * shape)
        number = owner.astype(np.int32)
        found.append(Samples(x[inside], y[inside], height[inside], number[inside], at_a[inside], at_b[inside]))
    return Samples(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def stone_profile(lumps: Image) -> Profile:
    """Profile of rounded pebbles; the phases ``lumps`` (k, 4) vary their outlines."""

    def profile(a: Image, b: Image, rows: Index) -> Image:
        turn, wave = np.arctan2(b, a), lumps[rows]
        rim = (
            0.86
            + 0.09 * np.sin(2 * turn + wave[:, 0])
            + 0.07 * np.sin(3 * turn + wave[:, 1])
            + 0.04 * np.sin(5 * turn + wave[:, 2])
        )
        inside = 1 - (np.hypot(a, b) / rim) ** 2
        return np.asarray(np.where(inside > 0, np.sqrt(np.maximum(inside, 0)), -1), np.float32)

    return profile


def blur(image: Image, sigma: float) -> Image:
    """Gaussian blur [pixels] over u and v."""
    return np.asarray(ndimage.gaussian_filter(image, (sigma, sigma) + (0,) * (image.ndim - 2), mode="wrap"), np.float32)


def crevices(height: Image, sigma: float, strength: float) -> Image:
    """Light that reaches the surface, about 1, less where it is below its surroundings within ``sigma`` [pixels]."""
    below = blur(height, sigma) - height
    return np.asarray(np.clip(1 - strength * below, 0.15, 1.3), np.float32)


def hollows(height: Image, depth: float, sigmas: Sequence[float] = (1.5, 4.0, 10.0)) -> Image:
    """Share of the light of a hemisphere that reaches the ground of a relief, about 1 on its crests.

    ``height`` is times ``depth`` [pixels]. What is a height h below the mean of its surroundings within s is like the
    floor of a furrow s wide and h deep, which sees cos(atan(2 h / s)) of the light (a trench's sky view factor; Oke,
    Boundary Layer Climates, 1987); scales multiply.
    """
    light = np.ones_like(height)
    for sigma in sigmas:
        below = np.maximum(blur(height, sigma) - height, 0) * np.float32(depth)
        light = light / np.sqrt(1 + (2 * below / np.float32(sigma)) ** 2)
    return np.asarray(light, np.float32)


def mix(colours: ArrayLike, where: NDArray[np.floating[Any]]) -> Image:
    """Colours (k, 3), sRGB 0 to 255, interpolated at ``where`` (n, n) in 0 to 1."""
    table = linear(colours)
    steps = np.linspace(0, len(table) - 1, 1024)
    fine = np.stack([np.interp(steps, np.arange(len(table)), channel) for channel in table.T], axis=1)
    return np.asarray(fine.astype(np.float32)[np.clip(where * 1023, 0, 1023).astype(np.int32)])


def halve(image: Image) -> Image:
    """Mean of each 2 x 2 pixels."""
    rows = image[::2] + image[1::2]
    return np.asarray((rows[:, ::2] + rows[:, 1::2]) * np.float32(0.25), np.float32)


def even_out(image: Image, *, cycles: float = 3.0) -> Image:
    """Divide by the image's own slow changes, below ``cycles`` per tile, which would show the repetition."""
    grey = image[..., :3] @ np.full(3, 1 / 3, np.float32)
    n = len(grey)
    k = np.hypot(fft.fftfreq(n, 1 / n)[:, None], fft.rfftfreq(n, 1 / n)[None, :])
    slow = fft.irfft2(fft.rfft2(grey) * np.exp(-0.5 * (k / cycles) ** 2).astype(np.float32), (n, n))
    return np.concatenate([image[..., :3] * (grey.mean() / slow)[..., None], image[..., 3:]], -1).astype(np.float32)


def finish(image: Image, albedo: Sequence[float]) -> NDArray[np.uint8]:
    """Scale each colour to its mean ``albedo`` (linear), encode it as sRGB bytes, and heights 0 to 1 as 0 to 255."""
    light = np.clip(image[..., :3], 0, None)
    light = np.minimum(light * (np.asarray(albedo, np.float32) / light.mean((0, 1))), 1.0)
    # Clipped highlights lower the mean; a second pass restores it.
    light = np.minimum(light * (np.asarray(albedo, np.float32) / light.mean((0, 1))), 1.0)
    s = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.round(np.concatenate([s, np.clip(image[..., 3:], 0, 1)], axis=-1) * 255).astype(np.uint8)
