# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Changes of batches for training, which make a network indifferent to what differs between cameras, or LiDARs.

All draw from a generator, and move pixels and labels alike.
"""

import math

import torch
from torch import Tensor
from torch.nn.functional import affine_grid, avg_pool2d, conv2d, grid_sample, interpolate, pad

IGNORED = 255
ZOOM = (0.7, 1.6)
ASPECT = 0.1
TURN = math.radians(6.0)


def photos(images: Tensor, masks: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Mirror, scale, crop and turn photographs and their masks; change shade, colours, sharpness and noise.

    Args:
        images: (n, 3, h, w) in 0 to 1.
        masks: (n, h, w) int64; 255, which does not count, where the view leaves the image.
        generator: of the same device.
    """
    images, masks = moved(images, masks, generator)
    images = coloured(shaded(images, masks, generator), generator)
    images = _sharpened(images, generator)
    sigma = _uniform(generator, len(images), 0.0, 0.04).view(-1, 1, 1, 1)
    return (images + sigma * _normal(generator, *images.shape)).clamp(0.0, 1.0), masks


def shaded(images: Tensor, masks: Tensor, generator: torch.Generator) -> Tensor:
    """Make each class brighter or darker than the others, and parts of the image, as species, soils and shade do."""
    n, _, h, w = images.shape
    gains = torch.exp(0.3 * _normal(generator, n, 256)).gather(1, masks.view(n, -1)).view(n, 1, h, w)
    gains = avg_pool2d(gains, 5, stride=1, padding=2, count_include_pad=False)  # no halos
    parts = interpolate(_normal(generator, n, 1, 4, 8), size=(h, w), mode="bilinear", align_corners=False)
    return (images * gains * torch.exp(0.3 * parts)).clamp(0.0, 1.0)


def moved(images: Tensor, masks: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Mirror, scale, crop and turn; pixels are interpolated, labels are those of the nearest pixel."""
    n, _, h, w = images.shape
    zoom = torch.exp(_uniform(generator, n, *map(math.log, ZOOM)))
    aspect = torch.exp(_uniform(generator, n, -ASPECT, ASPECT))
    turn, mirror = _uniform(generator, n, -TURN, TURN), 1.0 - 2.0 * (_uniform(generator, n, 0.0, 1.0) < 0.5)
    slack = torch.clamp(1.0 - 1.0 / zoom, min=0.0)
    theta = torch.zeros(n, 2, 3, device=images.device)
    theta[:, 0, 0], theta[:, 0, 1] = mirror * torch.cos(turn) / (zoom * aspect), -torch.sin(turn) / zoom * h / w
    theta[:, 1, 0], theta[:, 1, 1] = mirror * torch.sin(turn) / zoom * w / h, torch.cos(turn) / (zoom / aspect)
    theta[:, 0, 2] = slack * _uniform(generator, n, -1.0, 1.0)
    theta[:, 1, 2] = slack * _uniform(generator, n, -1.0, 1.0)
    grid = affine_grid(theta, [n, 1, h, w], align_corners=False)
    seen = grid_sample(images, grid, padding_mode="reflection", align_corners=False)
    above = (IGNORED - masks[:, None]).to(images.dtype)  # 0 outside becomes 255, which does not count
    labels = grid_sample(above, grid, mode="nearest", padding_mode="zeros", align_corners=False)
    return seen, IGNORED - labels[:, 0].round().long()


def coloured(images: Tensor, generator: torch.Generator) -> Tensor:
    """Change exposure, white balance, colour matrix, saturation, gamma, contrast and haze, as cameras differ."""
    n = len(images)

    def each(values: Tensor) -> Tensor:
        return values.view(n, -1, 1, 1)

    gain = torch.exp(0.3 * _normal(generator, n, 1) + 0.12 * _normal(generator, n, 3))
    mixing = torch.eye(3, device=images.device) + 0.06 * _normal(generator, n, 3, 3)
    mixing = mixing / mixing.sum(dim=2, keepdim=True)
    x = torch.einsum("nij,njhw->nihw", mixing, images * each(gain))
    grey = x.mean(dim=1, keepdim=True)
    saturation = _uniform(generator, n, 0.3, 1.5) * (_uniform(generator, n, 0.0, 1.0) > 0.05)
    x = grey + each(saturation) * (x - grey)
    x = x.clamp(1e-3, 1.0) ** each(torch.exp(0.3 * _normal(generator, n)))
    middle = x.mean(dim=(1, 2, 3), keepdim=True)
    x = middle + each(torch.exp(0.2 * _normal(generator, n))) * (x - middle)
    haze = each(_uniform(generator, n, 0.0, 0.3) * (_uniform(generator, n, 0.0, 1.0) < 0.3))
    return (x + haze * (0.8 - x)).clamp(0.0, 1.0)


def clouds(images: Tensor, masks: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Turn range images about the vertical, mirror, tilt and scale them; drop points, change ranges and reflectivities.

    Args:
        images: (n, 5, rings, columns): x, y, z [m], reflectivity, and 1 where there is a return. Columns go clockwise.
        masks: (n, rings, columns) int64; 255, which does not count, where a return is dropped.
        generator: of the same device.
    """
    n, _, _, columns = images.shape
    by = (_uniform(generator, n, 0.0, 1.0) * columns).long()
    source = (torch.arange(columns, device=images.device)[None] - by[:, None]) % columns
    is_mirrored = _uniform(generator, n, 0.0, 1.0) < 0.5
    source = torch.where(is_mirrored[:, None], source.flip(1), source)[:, None, None]
    images, masks = images.gather(3, source.expand_as(images)), masks.gather(2, source[:, 0].expand_as(masks))
    xyz = torch.einsum("nij,njhw->nihw", _turn(generator, by, is_mirrored, columns), images[:, :3])
    ranges = xyz.norm(dim=1, keepdim=True).clamp(min=0.1)
    noise = 0.03 * _uniform(generator, n, 0.0, 1.0).view(n, 1, 1, 1) * _normal(generator, *ranges.shape)
    xyz = xyz * (1.0 + noise / ranges)
    xyz[:, 2] += 0.1 * _normal(generator, n).view(n, 1, 1)
    gain = torch.exp(0.3 * _normal(generator, n)) * (_uniform(generator, n, 0.0, 1.0) > 0.3)
    reflectivity = images[:, 3:4] * gain.view(n, 1, 1, 1)
    dropped = 0.2 * _uniform(generator, n, 0.0, 1.0).view(n, 1, 1, 1)
    is_kept = (_rand(generator, *ranges.shape) > dropped) & (images[:, 4:5] > 0.5)
    images = torch.cat([xyz, reflectivity, torch.ones_like(ranges)], dim=1) * is_kept
    return images, masks.where(is_kept[:, 0], torch.full_like(masks, IGNORED))


def _turn(generator: torch.Generator, by: Tensor, is_mirrored: Tensor, columns: int) -> Tensor:
    """Return (n, 3, 3): a turn by a number of columns, clockwise, after a mirror, with some tilt and scale."""
    n, angle = len(by), -2.0 * math.pi * by / columns
    # the last column stands where the first was before the mirror
    angle = torch.where(is_mirrored, 2.0 * math.pi / columns - angle, angle)
    cos, sin, side = torch.cos(angle), torch.sin(angle), 1.0 - 2.0 * is_mirrored
    turn = torch.zeros(n, 3, 3, device=by.device)
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = cos, -sin * side, sin, cos * side, 1.0
    tilt = torch.eye(3, device=by.device).repeat(n, 1, 1)
    for axis in (0, 1):
        slope = 0.04 * _normal(generator, n)
        tilt[:, axis, 2], tilt[:, 2, axis] = slope, -slope
    scale = torch.exp(_uniform(generator, n, -0.05, 0.05)).view(n, 1, 1)
    return scale * tilt @ turn


def _sharpened(images: Tensor, generator: torch.Generator) -> Tensor:
    """Blur or sharpen each image: by -1 to 1.5 times what a Gaussian of its own takes away."""
    n, c, h, w = images.shape
    sigma = _uniform(generator, n, 0.4, 1.2)
    amount = _uniform(generator, n, -1.0, 1.5).view(n, 1, 1, 1)
    taps = torch.exp(-0.5 * (torch.arange(-3.0, 4.0, device=images.device)[None] / sigma[:, None]) ** 2)
    taps = (taps / taps.sum(dim=1, keepdim=True)).repeat_interleave(c, dim=0)
    x = pad(images.reshape(1, n * c, h, w), (3, 3, 3, 3), mode="replicate")
    x = conv2d(x, taps.view(n * c, 1, 1, 7), groups=n * c)
    blurred = conv2d(x, taps.view(n * c, 1, 7, 1), groups=n * c).view(n, c, h, w)
    return (images + amount * (images - blurred)).clamp(0.0, 1.0)


def _uniform(generator: torch.Generator, n: int, low: float, high: float) -> Tensor:
    return low + (high - low) * _rand(generator, n)


def _rand(generator: torch.Generator, *shape: int) -> Tensor:
    return torch.rand(shape, generator=generator, device=generator.device)


def _normal(generator: torch.Generator, *shape: int) -> Tensor:
    return torch.randn(shape, generator=generator, device=generator.device)
