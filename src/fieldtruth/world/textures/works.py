# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Man-made materials: planks (grain along u), painted iron, galvanised steel, concrete, glass. A tile is 0.5 m."""

import numpy as np

from fieldtruth.world.textures.canvas import (
    Image,
    Rng,
    Tones,
    cells,
    drawing,
    even_out,
    linear,
    mix,
    noise,
    settle,
    stamps,
)

N = 512


@drawing
def planks(rng: Rng, *, tones: Tones, cracks: float) -> Image:
    """Planks with growth rings bent around two knots, fibres, and ``cracks`` (0 to 1) along the grain."""
    grid = (np.arange(N, dtype=np.float32) + 0.5) / N
    bend = 0.55 * noise(rng, N, 1, 12, slope=1.6, stretch=0.02)
    knot = np.zeros((N, N), np.float32)
    for _ in range(2):
        at_u, at_v = rng.random(2)
        du, dv = (grid - at_u + 0.5) % 1 - 0.5, ((grid - at_v + 0.5) % 1 - 0.5)[:, None]
        knot += np.exp(-((du / 0.05) ** 2 + (dv / 0.018) ** 2))
    rings = (22 * grid[:, None] + bend + 1.6 * knot) % 1
    late = rings**3 * (1 - np.clip((rings - 0.93) / 0.07, 0, 1))
    fibre = noise(rng, N, 20, 256, slope=0.3, stretch=0.008)
    board = noise(rng, N, 2, 10, stretch=0.05)
    colour = mix(tones, 0.62 - 0.38 * late + 0.11 * fibre + 0.07 * board - 0.5 * np.clip(knot - 0.45, 0, 1))
    split = np.clip(noise(rng, N, 12, 200, slope=0.2, stretch=0.004) - 2.0, 0, 0.8) * cracks
    return even_out(colour * (1 - split)[..., None])


@drawing
def weathered_pole(rng: Rng) -> Image:
    """An impregnated and weathered trunk: brown grey, split along the grain."""
    fibre = noise(rng, N, 12, 256, slope=0.3, stretch=0.006)
    bleached = noise(rng, N, 4, 40, slope=0.8, stretch=0.05)
    colour = mix([(84, 70, 54), (116, 100, 80), (138, 124, 104), (152, 141, 124)], 0.5 + 0.13 * fibre + 0.12 * bleached)
    split = np.clip(1.6 * noise(rng, N, 8, 120, slope=0.5, stretch=0.003) - 2.9, 0, 0.85)
    return even_out(colour * (1 - split)[..., None])


@drawing
def painted_iron(rng: Rng) -> Image:
    """Cast iron under dark green paint, with rust where it is chipped."""
    coat = mix(
        [(34, 48, 42), (42, 58, 50), (50, 66, 58)],
        0.5 + 0.1 * noise(rng, N, 8, 120) + 0.07 * noise(rng, N, 60, 256, slope=0),
    )
    chips = noise(rng, N, 10, 200, slope=0.9)
    rust = mix([(92, 54, 34), (128, 80, 50)], 0.5 + 0.3 * noise(rng, N, 30, 250, slope=0.3))
    edge = np.clip((chips - 2.3) / 0.25, 0, 1)[..., None]
    dust = 0.05 * np.clip(1 + 0.6 * noise(rng, N, 4, 250, slope=0.4), 0, 3)[..., None]
    coat = coat * (1 - dust) + linear((120, 116, 104)) * dust
    return even_out(coat * (1 - edge) + rust * edge)


@drawing
def galvanised_steel(rng: Rng) -> Image:
    """Hot-dip galvanised steel: spangles of zinc in different greys, dulled by weather."""
    n = 256
    bend = [0.2 * noise(rng, n, 4, 60) for _ in range(2)]
    spangle = cells(rng, n, 26, 26, jitter=1.0, shift=bend)
    tone = rng.random(26 * 26).astype(np.float32)[spangle.owner]
    dull = 0.5 + 0.35 * (tone - 0.5) + 0.07 * noise(rng, n, 3, 40) + 0.05 * noise(rng, n, 40, 128, slope=0)
    return even_out(mix([(140, 144, 148), (170, 173, 176), (196, 198, 200)], dull))


@drawing
def concrete(rng: Rng) -> Image:
    """Cast concrete: fine sand, pores, weather stains."""
    tone = 0.5 + 0.08 * noise(rng, N, 4, 60) + 0.07 * noise(rng, N, 80, 256, slope=0) + 0.06 * noise(rng, N, 20, 200)
    colour = mix([(132, 128, 120), (160, 156, 147), (184, 180, 170)], tone)
    size = rng.gamma(1.2, 0.6, 700).clip(0.6, 3)
    pores = settle(N, [stamps(rng, N, size, size * rng.uniform(0.7, 1, 700), lambda a, b, _: 1 - a**2 - b**2, 1.0)])
    return even_out(np.where((pores.owner >= 0)[..., None], colour * np.float32(0.62), colour))


@drawing
def opal_glass(rng: Rng) -> Image:
    """Opal glass of a lantern: almost even, slightly dusty."""
    n = 128
    return np.asarray(mix([(205, 203, 194), (236, 234, 226)], 0.55 + 0.10 * noise(rng, n, 2, 30)), np.float32)
