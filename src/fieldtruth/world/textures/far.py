# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Woods as seen from afar: crowns side by side. A tile is 24 m, a pixel 4.7 cm."""

import numpy as np

from fieldtruth.world.textures.canvas import Image, Rng, Tones, cells, drawing, even_out, hollows, linear, mix, noise

N = 512


@drawing
def far_canopy(rng: Rng, *, tones: Tones) -> Image:
    """Crowns of several species and ages, each of bunches of leaves, with dark gaps between them."""
    bend = [0.16 * noise(rng, N, 4, 30, slope=0.9) for _ in range(2)]
    large, small = cells(rng, N, 5, 5, jitter=1.0, shift=bend), cells(rng, N, 11, 11, jitter=1.0, shift=bend)
    own = [rng.random((count, 3)).astype(np.float32) for count in (25, 121)]
    young = own[0][large.owner, 0] < 0.45  # crowns of half the size
    crown = np.where(young, small.nearest, large.nearest)
    kind, age = (np.where(young, own[1][small.owner, k], own[0][large.owner, k]) for k in (1, 2))
    bunch = noise(rng, N, 12, 50, slope=0.4) + 0.6 * noise(rng, N, 40, 110, slope=0.3)
    spray = noise(rng, N, 90, 256, slope=0.2)
    dome = np.sqrt(np.clip(1 - (crown / 0.66) ** 2, 0, 1)) * (0.6 + 0.5 * age)
    height = np.asarray(dome + 0.16 * bunch + 0.05 * spray, np.float32)
    colour = mix(tones, 0.05 + 0.75 * kind + 0.10 * bunch + 0.06 * spray)
    gap = np.clip(1.4 * (noise(rng, N, 10, 90, slope=0.6) - 1.0) + 1.6 * (0.32 - dome), 0, 0.85)[..., None]
    colour = colour * (1 - gap) + linear((22, 24, 16)) * gap
    light = hollows(height, 30.0, (2.0, 6.0, 16.0)) * (0.45 + 0.65 * dome)
    return even_out(np.asarray(colour * light[..., None], np.float32))
