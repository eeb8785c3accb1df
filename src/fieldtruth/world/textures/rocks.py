# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Surfaces of stones and rocks, weathered and grown over with lichen. A tile is 1.2 m."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from fieldtruth.world.textures.canvas import Image, Recipe, Rng, blur, cells, crevices, even_out, linear, mix, noise

N = 512


def _cracks(rng: Rng, across: int, *, width: float, share: float) -> Image:
    """Lines (n, n) between cells, 1 in a crack; only about ``share`` of them are open."""
    bend = [0.16 * noise(rng, N, 3, 40, slope=1.2) for _ in range(2)]
    net = cells(rng, N, across, across, jitter=0.95, shift=bend)
    open_here = np.clip((noise(rng, N, 2, 12, slope=0.8) + 2.2 * (share - 0.5)) * 1.5, 0, 1)
    line = np.clip(1 - (net.second - net.nearest) / width, 0, 1)
    return np.asarray(line * open_here, np.float32)


def _lichen(rng: Rng, colour: Image, shade: tuple[int, int, int], *, patches: float, share: float) -> Image:
    """Cover about ``share`` of the image with crusts of a colour, ``patches`` to a tile, with ragged rims."""
    field = noise(rng, N, patches / 3, patches * 2, slope=0.6) + 0.55 * noise(rng, N, patches * 2, 160, slope=0.9)
    level = np.float32(np.quantile(field, 1 - share))
    crust = np.clip((field - level) * 3.0, 0, 1)[..., None] * np.float32(0.8)
    grain = (1 + 0.12 * noise(rng, N, 60, 256, slope=0.2))[..., None]
    return np.asarray(colour * (1 - crust) + linear(shade) * grain * crust, np.float32)


def limestone(rng: Rng) -> Image:
    """Karst of dry mountains: pale grey, pitted by rain, stained ochre and dark, with black and orange lichen."""
    swell, grain = noise(rng, N, 3, 40, slope=1.1), noise(rng, N, 30, 256, slope=0.7)
    pits = np.clip(noise(rng, N, 25, 120, slope=0.4) - 1.0, 0, 1.5)
    cracks = _cracks(rng, 5, width=0.06, share=0.5) + 0.6 * _cracks(rng, 14, width=0.1, share=0.35)
    height = 0.35 * swell + 0.16 * grain - 0.7 * pits - 1.4 * cracks
    colour = mix([(120, 114, 104), (158, 152, 140), (184, 178, 166), (204, 198, 188)], 0.5 + 0.16 * swell + 0.1 * grain)
    ochre = np.clip(0.45 * noise(rng, N, 3, 30, slope=1.0) - 0.25, 0, 0.6)[..., None]
    colour = colour * (1 - ochre) + linear((176, 146, 106)) * ochre
    colour = _lichen(rng, colour, (104, 101, 95), patches=14, share=0.22)
    colour = _lichen(rng, colour, (198, 195, 186), patches=22, share=0.05)
    colour = _lichen(rng, colour, (184, 128, 62), patches=26, share=0.025)
    light = crevices(height, 3.0, 0.4) * (1 - np.float32(0.5) * np.clip(cracks, 0, 1))
    return even_out(np.asarray(colour * light[..., None], np.float32))


def granite(rng: Rng) -> Image:
    """Grains of feldspar, quartz and mica, weathered to buff, with green map lichen and dark crusts."""
    mineral = cells(rng, N, 190, 190)
    kind = rng.choice(5, 190 * 190, p=[0.34, 0.25, 0.2, 0.13, 0.08])[mineral.owner]
    tones = linear([(172, 160, 144), (184, 168, 150), (150, 146, 140), (126, 118, 110), (80, 77, 74)])
    swell, grain = noise(rng, N, 3, 40, slope=1.1), noise(rng, N, 40, 256, slope=0.5)
    cracks = _cracks(rng, 3, width=0.035, share=0.45)
    rust = np.clip(0.4 * noise(rng, N, 3, 24, slope=1.0) - 0.1, 0, 0.55)[..., None]
    colour = tones[kind] * (1 + 0.10 * swell + 0.06 * grain)[..., None]
    colour = colour * (1 - rust) + linear((150, 122, 90)) * (1 + 0.08 * grain)[..., None] * rust
    colour = _lichen(rng, colour, (92, 92, 84), patches=12, share=0.2)
    colour = _lichen(rng, colour, (140, 144, 92), patches=20, share=0.07)
    return even_out(colour * crevices(0.3 * swell + 0.15 * grain - 1.5 * cracks, 3.0, 0.5)[..., None])


def fieldstone(rng: Rng) -> Image:
    """Stones turned up by ploughs and streams: brown grey, smooth, earthy in the hollows, some moss-green lichen."""
    swell, grain = noise(rng, N, 3, 50, slope=1.0), noise(rng, N, 40, 256, slope=0.4)
    colour = mix([(92, 84, 74), (124, 116, 104), (150, 142, 128), (170, 162, 150)], 0.5 + 0.17 * swell + 0.09 * grain)
    earth = np.clip(0.5 * noise(rng, N, 4, 60, slope=0.8) - 0.35, 0, 0.7)[..., None]
    colour = colour * (1 - earth) + linear((104, 84, 62)) * earth
    colour = _lichen(rng, colour, (164, 166, 150), patches=16, share=0.1)
    colour = _lichen(rng, colour, (96, 102, 66), patches=12, share=0.06)
    return even_out(colour * crevices(0.4 * swell + 0.25 * grain, 2.5, 0.4)[..., None])


def schist(rng: Rng) -> Image:
    """Leaves of mica schist: fine parallel layers along u, silver grey to rust."""
    layers = noise(rng, N, 12, 200, slope=0.5, stretch=0.03)
    swell, grain = noise(rng, N, 3, 40, slope=1.1), noise(rng, N, 50, 256, slope=0.3)
    colour = mix([(78, 74, 70), (112, 106, 100), (138, 132, 126), (158, 152, 146)], 0.5 + 0.13 * layers + 0.09 * swell)
    rust = np.clip(0.45 * noise(rng, N, 3, 40, slope=0.9, stretch=0.3) - 0.15, 0, 0.6)[..., None]
    colour = colour * (1 - rust) + linear((136, 104, 76)) * rust
    colour *= (1 + 0.1 * grain)[..., None]
    colour = _lichen(rng, colour, (160, 162, 146), patches=18, share=0.07)
    return even_out(colour * crevices(blur(0.7 * layers, 0.6) + 0.2 * swell, 2.5, 0.5)[..., None])


# Albedos: limestone 0.3 to 0.4 fresh, 0.2 to 0.3 weathered; granite 0.2 to 0.3; schist 0.1 to 0.2 (ECOSTRESS spectral
# library 1.0, rocks; lichens take a fifth or so of it).
RECIPES: Final[Mapping[str, Recipe]] = MappingProxyType(
    {
        "rock_limestone": Recipe(limestone, (0.262, 0.236, 0.197)),
        "rock_granite": Recipe(granite, (0.230, 0.200, 0.162)),
        "rock_fieldstone": Recipe(fieldstone, (0.185, 0.160, 0.126)),
        "rock_schist": Recipe(schist, (0.165, 0.145, 0.122)),
    }
)
