# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of photographs: against images and distributions whose figures are known."""

from pathlib import Path

import numpy as np
import pytest
from photo_figures import (
    _fit,
    _patch_features,
    block_deviations,
    figures,
    kurtosis,
    local_contrast,
    made_narrower,
    niqe,
    spectrum_slope,
)
from scipy.io import savemat

from fieldtruth.core.arrays import Array


def noise(slope: float, side: int = 512) -> Array:
    """Image whose power spectrum falls with a power of the frequency."""
    rng = np.random.default_rng(3)
    radius = np.hypot(*np.meshgrid(np.fft.fftfreq(side), np.fft.fftfreq(side)))
    radius[0, 0] = 1.0
    return np.asarray(np.fft.ifft2(np.fft.fft2(rng.normal(size=(side, side))) * radius ** (slope / 2)).real)


@pytest.mark.parametrize("slope", [-1.0, -2.0, -3.0])
def test_slope_of_the_spectrum(slope: float) -> None:
    assert spectrum_slope(noise(slope)) == pytest.approx(slope, abs=0.08)


def test_kurtosis_of_known_distributions() -> None:
    rng = np.random.default_rng(1)
    assert kurtosis(rng.normal(size=200_000)) == pytest.approx(3.0, abs=0.1)
    assert kurtosis(rng.uniform(size=200_000)) == pytest.approx(1.8, abs=0.02)
    assert kurtosis(rng.laplace(size=400_000)) == pytest.approx(6.0, abs=0.3)


def test_local_contrast_is_that_of_blocks() -> None:
    image = np.tile(np.arange(0, 40.0)[:, None] // 16, (1, 48))  # level within each block
    assert not block_deviations(image).any()
    assert block_deviations(image).shape == (2, 3)
    checks = np.indices((32, 32)).sum(axis=0) % 2
    assert local_contrast(0.2 * checks) == pytest.approx(0.1)


def test_a_photograph_is_made_narrower_by_means() -> None:
    photo = np.zeros((90, 1600, 3), np.uint8)
    photo[:, ::2] = 200
    small = made_narrower(photo)
    assert small.shape == (36, 640, 3)
    assert small.mean() == pytest.approx(100.0)
    flat = np.full((100, 1280, 3), 77, np.uint8)
    np.testing.assert_allclose(made_narrower(flat), 77.0)


def test_figures_of_flat_colours() -> None:
    photo = np.zeros((480, 640, 3), np.uint8)
    photo[:240] = 255
    photo[240:] = (200, 100, 100)
    found = figures(photo)
    assert found["clipped to white [%]"] == 50.0
    assert found["saturation, 90th percentile"] == pytest.approx(0.5)
    assert found["smooth blocks, lower third [%]"] == 100.0
    assert found["luminance, 95th percentile"] == pytest.approx(1.0)


def test_the_fit_finds_the_distribution() -> None:
    rng = np.random.default_rng(5)
    shape, mean, left, right = _fit(rng.normal(size=400_000))
    assert shape == pytest.approx(2.0, abs=0.03)
    assert mean == pytest.approx(0.0, abs=0.02)
    assert left == pytest.approx(np.sqrt(2.0), rel=0.02)
    assert right == pytest.approx(np.sqrt(2.0), rel=0.02)
    assert _fit(rng.laplace(size=400_000))[0] == pytest.approx(1.0, abs=0.03)
    uneven = rng.normal(size=400_000)
    _, mean, left, right = _fit(np.where(uneven < 0, uneven, 3.0 * uneven))
    assert right > 2.0 * left
    assert mean > 0.0


def test_niqe_grows_with_the_distance_from_the_model(tmp_path: Path) -> None:
    natural = 128.0 + 30.0 * noise(-2.0) / noise(-2.0).std()
    both = (
        _patch_features(natural[:480, :480], 96),
        _patch_features(natural[:240, :240], 48),
    )
    rows = np.hstack(both)
    savemat(tmp_path / "model.mat", {"pop_mu": rows.mean(axis=0), "pop_cov": np.cov(rows.T) + 1e-4 * np.eye(36)})
    rng = np.random.default_rng(2)
    values = [niqe(natural + sigma * rng.normal(size=natural.shape), tmp_path / "model.mat") for sigma in (0, 5, 40)]
    assert values == sorted(values)
    assert values[2] > 2.0 * values[0]
    assert np.isnan(niqe(natural[:100], tmp_path / "model.mat"))
