# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground as pieces that lie on each other: their heights, their colours, and the light that reaches between them."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy import ndimage

from fieldtruth.world.textures.canvas import Image, Rng, Samples, Tones, blur, even_out, mix, noise, settle

SIEVE: Final = 2.5
"""Number of grains above a radius r falls as r^-2.5: by Fuller's curve the mass that passes a sieve grows as the root
of its mesh (Fuller and Thompson 1907)."""


class Kind(NamedTuple):
    """Pieces of one kind: samples, colours from dark to light, and how the tones of pieces vary (beta distribution)."""

    pieces: Samples
    tones: Tones
    tone: tuple[float, float] = (2.0, 2.0)


def at_heights(pieces: Samples, low: float, high: float) -> Samples:
    """Pieces with heights 0 to 1 moved to ``low`` to ``high``."""
    return pieces._replace(height=(low + (high - low) * pieces.height).astype(np.float32))


def layered(
    rng: Rng, colour: Image, height: Image, kinds: Sequence[Kind], *, depth: float = 1.0, clumps: float = 0.1
) -> Image:
    """Soil of a ``colour`` (n, n, 3) and ``height`` (n, n) 0 to 1 with pieces on it: colour and height (n, n, 4).

    What lies below soil or other pieces is hidden. ``depth`` scales the darkness between pieces, ``clumps`` is the
    deviation of the tones that neighbours share, over 2 to 20 cm.
    """
    n, first = len(height), np.cumsum([0, *(int(k.pieces.owner.max()) + 1 for k in kinds)])
    relief = settle(
        n, [k.pieces._replace(owner=k.pieces.owner + np.int32(f)) for k, f in zip(kinds, first, strict=False)]
    )
    shown = (relief.owner >= 0) & (relief.height > height)
    grain = 0.06 * noise(rng, n, 20, 0.45 * n, slope=0.4) + clumps * noise(rng, n, 8, 60, slope=0.5)
    fleck = np.exp(np.float32(0.06) * noise(rng, n, n / 8, n / 2, slope=0.0))
    for kind, start, end in zip(kinds, first[:-1], first[1:], strict=True):
        own = shown & (relief.owner >= start) & (relief.owner < end)
        tone = rng.beta(*kind.tone, end - start).astype(np.float32)[relief.owner[own] - start]
        colour[own] = mix(kind.tones, (tone + grain[own])[None])[0]
    top = blur(np.where(shown, relief.height, height), 0.7)
    light = openness(top, depth)
    soft = blur(colour * (light * fleck)[..., None], 0.45)  # a piece covers a part of a texel
    return even_out(np.concatenate([soft, top[..., None]], axis=-1).astype(np.float32))


def openness(height: Image, depth: float = 1.0) -> Image:
    """Light from the sky between pieces, about 1: less below the surroundings at three widths [texel]."""
    lost = sum(
        weight * np.maximum(ndimage.uniform_filter(height, size, mode="wrap") - height, -0.15)
        for size, weight in ((5, 1.0), (13, 0.9), (31, 0.7))
    )
    return np.asarray(np.clip(np.exp(-np.float32(depth * 1.2) * lost), 0.2, 1.3), np.float32)
