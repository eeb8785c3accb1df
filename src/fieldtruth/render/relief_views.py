# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What relief does to the mean brightness of ground seen at an angle, so that distant ground has it, too.

Who looks along the sun's light sees lit sides, who looks against it shadows; and tops hide dark gaps. Near the camera
this comes from rays that are followed through the relief. Far away their mean is used instead: factors on colour and on
sunlight, fitted per material as polynomials of the view's cotangent and the cosine of its azimuth to the sun.
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.render.atlas import Atlas, sample_lit
from fieldtruth.render.ground_points import STEEP, Relief, ground_texels

TERMS: Final = 5
_DESCENTS: Final = (0.08, 0.16, 0.3, 0.5, 0.8)
_AZIMUTHS: Final = 8
_POINTS: Final = 1500
_PIXEL: Final = np.float32(0.001)


@inlined
def view_terms(
    dx: np.float32, dy: np.float32, descent: np.float32, sun_x: np.float32, sun_y: np.float32
) -> tuple[np.float32, np.float32, np.float32, np.float32, np.float32]:
    """Terms of the polynomials; all are 0 straight from above. The sun's azimuth is a unit vector, or 0."""
    across = np.sqrt(max(dx * dx + dy * dy, np.float32(1e-8)))
    cotangent = across / max(descent, STEEP)
    towards = (dx * sun_x + dy * sun_y) / across
    square = cotangent * cotangent
    return cotangent, cotangent * towards, cotangent * towards * towards, square, square * towards


@kernel
def _seen_means(
    atlas: Atlas, texture: int, relief: Relief, points: Float32Array, views: Float32Array, out: Float32Array
) -> None:
    """Mean brightness, and mean sunlit brightness, of ``points`` (m, 2) [m] in each of the ``views`` (n, 3)."""
    row = np.uintp(texture)
    for n in range(len(views)):
        total, lit = np.float32(0.0), np.float32(0.0)
        for m in range(len(points)):
            view = views[n, 0], views[n, 1], views[n, 2]
            texels = ground_texels(atlas, row, relief, points[m, 0], points[m, 1], view, _PIXEL)
            red, green, blue, sun = sample_lit(atlas, row, texels.u, texels.v, 0)
            bright = red + green + blue
            total, lit = total + bright, lit + bright * sun
        out[n, 0], out[n, 1] = total / np.float32(len(points)), lit / np.float32(len(points))


@kernel
def _fill_terms(views: Float32Array, sun_x: np.float32, sun_y: np.float32, out: Float32Array) -> None:
    for n in range(len(views)):
        out[n, 0], out[n, 1], out[n, 2], out[n, 3], out[n, 4] = view_terms(
            views[n, 0], views[n, 1], views[n, 2], sun_x, sun_y
        )


def view_factors(atlas: Atlas, texture: int, relief: Relief, sun: Array) -> Float32Array:
    """Coefficients (2, TERMS) of the factors less 1 on colour and on sunlight of ground that is far away."""
    rng = np.random.default_rng(5)
    points = rng.uniform(0.0, 1.0 / float(relief.per_metre), (_POINTS, 2)).astype(np.float32)
    angle = 2.0 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    views = np.array(
        [(np.sqrt(1 - d * d) * np.cos(a), np.sqrt(1 - d * d) * np.sin(a), d) for d in _DESCENTS for a in angle]
    )
    views = np.concatenate([[[0.0, 0.0, 1.0]], views]).astype(np.float32)
    means, terms = np.empty((len(views), 2), np.float32), np.empty((len(views), TERMS), np.float32)
    _seen_means(atlas, texture, relief, points, views, means)
    across = sun[:2] / max(float(np.hypot(sun[0], sun[1])), 1e-9)
    _fill_terms(views, np.float32(across[0]), np.float32(across[1]), terms)
    colour = means[:, 0] / means[0, 0]
    light = means[:, 1] / means[:, 0] / (means[0, 1] / means[0, 0])
    fitted = np.linalg.lstsq(terms[1:], np.stack([colour, light], axis=-1)[1:] - 1.0, rcond=None)[0]
    return np.asarray(fitted.T, np.float32)
