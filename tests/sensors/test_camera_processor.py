# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bloom, chromatic aberration, colour matrix, sharpening and JPEG of a real camera; the words of ``signal``."""

from typing import Any

import numpy as np
import pytest
import simplejpeg
from numpy.typing import NDArray
from scipy.special import erf

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.files import load_experiment, parse_experiment, with_overrides
from fieldtruth.sensors.camera.config import CameraConfig, CameraSignal
from fieldtruth.sensors.camera.photo import Developer, encoded
from fieldtruth.sensors.camera.sensor import camera_jpeg

SIZE = 256
CONFIG = CameraConfig(width=SIZE, height=SIZE, horizontal_fov_deg=60.0, vertical_fov_deg=60.0)


def light_after(light: NDArray[np.float32], **values: Any) -> NDArray[np.float64]:
    """Light on the sensor."""
    developer = Developer(CONFIG, CameraSignal(response="srgb", **values), 5)
    raw, sensor = developer.raw(light, "left", 0, 1.0, 1.0)
    assert sensor.black == 0
    return raw.astype(np.float64)


def photo_of(light: NDArray[np.float32], balance: Any = (1.0, 1.0, 1.0), **values: Any) -> NDArray[np.int64]:
    own, photo = Developer(CONFIG, CameraSignal(**values), 5), np.zeros((SIZE, SIZE, 3), np.uint8)
    raw, sensor = own.raw(light, "left", 0, 1.0, 1.0)
    own.photograph(raw, sensor, np.array(balance), photo)
    return photo.astype(np.int64)


def disc(radius: float) -> NDArray[np.float32]:
    """Light that is a white disc in the middle, with an edge as wide as a pixel."""
    at = np.arange(SIZE) - (SIZE - 1) / 2
    share = np.clip(radius + 0.5 - np.hypot(at[:, None], at), 0, 1)
    return np.repeat(share[..., None], 3, axis=2).astype(np.float32)


@pytest.mark.parametrize("radius", [40.0, 80.0, 120.0])
def test_colours_are_displaced_in_proportion_to_the_radius(radius: float) -> None:
    """The area of a disc grows by twice the displacement over the radius, that of blue shrinks."""
    corner = np.hypot(SIZE, SIZE) / 2
    red, green, blue = light_after(disc(radius), chromatic_px=(3.0, -2.0)).sum(axis=(0, 1))
    plain = light_after(disc(radius)).sum(axis=(0, 1))
    assert green == pytest.approx(plain[1])
    assert np.sqrt(red / green) * radius - radius == pytest.approx(3.0 * radius / corner, rel=0.02)
    assert np.sqrt(blue / green) * radius - radius == pytest.approx(-2.0 * radius / corner, rel=0.02)


def test_bloom_at_an_edge_is_the_error_function_of_two_widths() -> None:
    """At a straight edge a share s of the light is spread with sigma and 4 sigma; nothing is lost."""
    light = np.zeros((SIZE, SIZE, 3), np.float32)
    light[:, SIZE // 2 :] = 0.8
    share, sigma = 0.3, 12.0
    found = light_after(light, bloom=share, bloom_px=sigma)
    away = np.arange(SIZE) + 0.5 - SIZE / 2
    part = 0.25 * sum(1 + erf(away / np.sqrt(2) / each) for each in (sigma, 4 * sigma))
    left = np.abs(away) > 2  # what the ideal camera spills ends there
    expected = (1 - share) * light[0, :, 0] + share * 0.8 * part
    np.testing.assert_allclose(found[SIZE // 2, left, 0], expected[left], atol=0.008)
    assert found.sum() == pytest.approx(light.sum(), rel=1e-3)


def test_bloom_leaves_even_light() -> None:
    light = np.full((SIZE, SIZE, 3), 0.37, np.float32)
    np.testing.assert_allclose(light_after(light, bloom=0.2, bloom_px=30.0), 0.37, rtol=1e-5)


def test_sharpening_overshoots_an_edge_by_its_amount() -> None:
    """Next to an edge of contrast c in the photograph, the blurred copy is c (1 - Phi(0.5 / sigma)) away."""
    light = np.full((SIZE, SIZE, 3), 0.1, np.float32)
    light[:, SIZE // 2 :] = 0.4
    plain, sharp = (photo_of(light, response="srgb", sharpening=each, sharpening_px=4.0) for each in (0.0, 0.5))
    edge = plain[9, :, 0]
    high, low = edge[-1], edge[0]
    beside = SIZE // 2 + 2  # the ideal camera's spill of a pixel is not there
    missing = (high - low) * 0.5 * (1 - erf(2.5 / 4.0 / np.sqrt(2)))
    assert sharp[9, beside, 0] - high == pytest.approx(0.5 * missing, abs=1.0)
    assert low - sharp[9, SIZE - 1 - beside, 0] == pytest.approx(0.5 * missing, abs=1.0)
    assert (sharp[9, [0, -1]] == plain[9, [0, -1]]).all()
    flat = np.full((SIZE, SIZE, 3), 0.2, np.float32)
    assert (photo_of(flat, response="srgb", sharpening=2.0) == photo_of(flat, response="srgb")).all()


def test_a_colour_matrix_keeps_grey_and_white_and_mixes_the_rest() -> None:
    matrix = (0.7, 0.2, 0.1, 0.1, 0.8, 0.1, 0.0, 0.3, 0.7)
    light = np.zeros((SIZE, SIZE, 3), np.float32)
    light[:64], light[64:128], light[128:] = (0.3, 0.3, 0.3), (3.0, 1.5, 2.0), (0.2, 0.5, 0.1)
    photo = photo_of(light, response="linear", colour_matrix=matrix)
    assert np.ptp(photo[20, 20]) == 0
    assert (photo[90, 20] == 255).all()
    np.testing.assert_allclose(photo[200, 20] / 255, np.array(matrix).reshape(3, 3) @ [0.2, 0.5, 0.1], atol=0.003)
    with pytest.raises(ValueError, match="colour_matrix must have rows with the sum 1"):
        CameraSignal(colour_matrix=(1.0, 0.1, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))


def test_the_signal_says_how_a_photograph_is_compressed() -> None:
    photo = np.random.default_rng(0).integers(0, 256, (64, 64, 3)).astype(np.uint8)

    def packed(**values: Any) -> tuple[int, str]:
        data = camera_jpeg(photo, CONFIG.model_copy(update={"signal": CameraSignal(**values)}))
        return len(data), simplejpeg.decode_jpeg_header(data)[3]

    plain = camera_jpeg(photo, CONFIG)
    assert packed() == (len(plain), "444")
    assert packed(jpeg_chroma="420")[1] == "420"
    assert packed(jpeg_quality=40)[0] < 0.6 * len(plain)


def test_words_of_signal() -> None:
    """Clean is ideal; robot is a preset of cameras, and the data sheet of other sensors."""

    def rig(word: str) -> Any:
        return with_overrides(load_experiment("park_1"), signal=word).rig

    assert rig("clean") == rig("ideal")
    robot, sheet = rig("robot"), rig("datasheet")
    assert [s for s in robot.sensors if s.kind != "stereo"] == [s for s in sheet.sensors if s.kind != "stereo"]
    (camera,) = robot.enabled(CameraConfig)
    assert camera.signal.colour_matrix != CameraSignal().colour_matrix
    text = "name: a\nenvironment: park\nroute: {random: {length_m: 20, seed: 1}}\nrig: {cameras: {signal: robot}}\n"
    assert parse_experiment(text).rig.enabled(CameraConfig)[0].signal == camera.signal
    with pytest.raises(ConfigurationError, match="signal must be ideal, datasheet, clean, robot, the path"):
        parse_experiment(text.replace("signal: robot", "signal: robots"))


def test_contrast_is_the_slope_at_medium_grey() -> None:
    """Black, medium grey and white stay."""
    values = np.array([0.0, 0.25, 0.48, 0.5, 0.52, 0.75, 1.0])
    plain, more = (encoded(values, "linear", each) for each in (0.0, 0.4))
    np.testing.assert_allclose(more[[0, 3, 6]], plain[[0, 3, 6]], atol=0.003)
    assert (more[4] - more[2]) / (plain[4] - plain[2]) == pytest.approx(1.4, abs=0.1)
    assert more[1] == pytest.approx(0.25 - 2 * 0.4 * 0.25 * 0.75 * 0.5, abs=0.003)


def test_fringes_blur_red_and_blue_by_their_own_widths() -> None:
    """The variances of the ideal camera's spill, and of each blur, add at an edge."""
    light = np.zeros((SIZE, SIZE, 3), np.float32)
    light[:, SIZE // 2 :] = 0.5

    def variance(**values: Any) -> NDArray[np.float64]:
        slope = np.diff(light_after(light, **values)[SIZE // 2], axis=0)
        at = np.arange(SIZE - 1)[:, None] - (SIZE // 2 - 1)
        return np.asarray((slope * at**2).sum(axis=0) / slope.sum(axis=0))

    plain, found = variance(), variance(fringe_px=(1.5, 2.5))
    np.testing.assert_allclose(found - plain, [1.5**2, 0.0, 2.5**2], rtol=0.03, atol=1e-6)
