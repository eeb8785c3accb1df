# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Changes of batches for training, which make a network indifferent to what differs between cameras, or LiDARs.

All draw from a generator, and move pixels and labels alike.
"""

import math

import torch
from torch import Tensor
from torch.nn.functional import affine_grid, conv2d, grid_sample, pad

IGNORED = 255
ZOOM = (0.8, 2.0)
ASPECT = 0.1
TURN = math.radians(6.0)


def photos(images: Tensor, masks: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Mirror, scale, crop and turn photographs and their masks; change colours, sharpness and noise.

    Args:
        images: (n, 3, h, w) in 0 to 1.
        masks: (n, h, w) int64; 255, which does not count, where the view leaves the image.
        generator: on the CPU.
    """
    images, masks = moved(images, masks, generator)
    return _blurred(coloured(images, generator), generator), masks


def moved(images: Tensor, masks: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Mirror, scale, crop and turn; pixels are interpolated, labels are those of the nearest pixel."""
    n, _, h, w = images.shape
    zoom = torch.exp(_uniform(generator, n, *map(math.log, ZOOM)))
    aspect = torch.exp(_uniform(generator, n, -ASPECT, ASPECT))
    turn, mirror = _uniform(generator, n, -TURN, TURN), 1.0 - 2.0 * (_uniform(generator, n, 0.0, 1.0) < 0.5)
    slack = torch.clamp(1.0 - 1.0 / zoom, min=0.0)
    theta = torch.zeros(n, 2, 3)
    theta[:, 0, 0], theta[:, 0, 1] = mirror * torch.cos(turn) / (zoom * aspect), -torch.sin(turn) / zoom * h / w
    theta[:, 1, 0], theta[:, 1, 1] = mirror * torch.sin(turn) / zoom * w / h, torch.cos(turn) / (zoom / aspect)
    theta[:, 0, 2] = slack * _uniform(generator, n, -1.0, 1.0)
    theta[:, 1, 2] = slack * _uniform(generator, n, -1.0, 1.0)
    grid = affine_grid(theta.to(images.device), [n, 1, h, w], align_corners=False)
    seen = grid_sample(images, grid, padding_mode="reflection", align_corners=False)
    above = (IGNORED - masks[:, None]).to(images.dtype)  # 0 outside becomes 255, which does not count
    labels = grid_sample(above, grid, mode="nearest", padding_mode="zeros", align_corners=False)
    return seen, IGNORED - labels[:, 0].round().long()


def coloured(images: Tensor, generator: torch.Generator) -> Tensor:
    """Change exposure, white balance, colour matrix, saturation, gamma, contrast, haze and noise, as cameras differ."""
    n = len(images)

    def each(values: Tensor) -> Tensor:
        return values.view(n, -1, 1, 1).to(images.device)

    gain = torch.exp(0.3 * torch.randn(n, 1, generator=generator) + 0.12 * torch.randn(n, 3, generator=generator))
    mixing = torch.eye(3) + 0.06 * torch.randn(n, 3, 3, generator=generator)
    mixing = (mixing / mixing.sum(dim=2, keepdim=True)).to(images.device)
    x = torch.einsum("nij,njhw->nihw", mixing, images * each(gain))
    grey = x.mean(dim=1, keepdim=True)
    saturation = _uniform(generator, n, 0.3, 1.5) * (_uniform(generator, n, 0.0, 1.0) > 0.05)
    x = grey + each(saturation) * (x - grey)
    x = x.clamp(1e-3, 1.0) ** each(torch.exp(0.3 * torch.randn(n, generator=generator)))
    middle = x.mean(dim=(1, 2, 3), keepdim=True)
    x = middle + each(torch.exp(0.2 * torch.randn(n, generator=generator))) * (x - middle)
    haze = each(_uniform(generator, n, 0.0, 0.3) * (_uniform(generator, n, 0.0, 1.0) < 0.3))
    x = x + haze * (0.8 - x)
    sigma = each(_uniform(generator, n, 0.0, 0.04))
    noise = torch.randn(images.shape, generator=generator).to(images.device)
    return (x + sigma * noise).clamp(0.0, 1.0)


def _blurred(images: Tensor, generator: torch.Generator) -> Tensor:
    """Blur each image by a Gaussian of its own; a third are left as they are."""
    n, c, h, w = images.shape
    sigma = _uniform(generator, n, -0.6, 1.2).clamp(min=0.01)
    taps = torch.exp(-0.5 * (torch.arange(-3.0, 4.0)[None] / sigma[:, None]) ** 2)
    taps = (taps / taps.sum(dim=1, keepdim=True)).to(images.device).repeat_interleave(c, dim=0)
    x = pad(images.reshape(1, n * c, h, w), (3, 3, 3, 3), mode="replicate")
    x = conv2d(x, taps.view(n * c, 1, 1, 7), groups=n * c)
    return conv2d(x, taps.view(n * c, 1, 7, 1), groups=n * c).view(n, c, h, w)


def _uniform(generator: torch.Generator, n: int, low: float, high: float) -> Tensor:
    return low + (high - low) * torch.rand(n, generator=generator)
