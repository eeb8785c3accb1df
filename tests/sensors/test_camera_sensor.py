# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sensor, lens, exposure and colours of a real camera against closed forms."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.catalogue import datasheet_of, models
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.files import parse_experiment
from fieldtruth.kernels.camera import interpolate
from fieldtruth.sensors.camera.config import CameraConfig, CameraSignal
from fieldtruth.sensors.camera.exposure import (
    METERINGS,
    daylight,
    exposure_of,
    metered_exposure,
    metering_lags,
    white_balance,
)
from fieldtruth.sensors.camera.photo import Developer, encoded, sensor_of

SIZE = 256
CONFIG = CameraConfig(width=SIZE, height=SIZE, horizontal_fov_deg=60.0, vertical_fov_deg=50.0)
FULL_WELL, READ_NOISE, BITS, BLACK = 4000.0, 6.0, 12, 100
NOISY: dict[str, Any] = {
    "photon_noise": True,
    "full_well_e": FULL_WELL,
    "read_noise_e": READ_NOISE,
    "bits": BITS,
    "black_level": BLACK,
    "response": "srgb",
}


def flat(value: float) -> NDArray[np.float32]:
    return np.full((SIZE, SIZE, 3), value, np.float32)


def developer(**values: Any) -> Developer:
    return Developer(CONFIG, CameraSignal(**values), 5)


def raw_of(light: NDArray[np.float32], gain: float = 1.0, number: int = 0, **values: Any) -> NDArray[np.float64]:
    return developer(**values).raw(light, "left", number, 1.0, gain)[0].astype(np.float64)


def photo_of(light: NDArray[np.float32], balance: Any = (1.0, 1.0, 1.0), **values: Any) -> NDArray[np.uint8]:
    own, photo = developer(**values), np.zeros((SIZE, SIZE, 3), np.uint8)
    raw, sensor = own.raw(light, "left", 0, 1.0, 1.0)
    own.photograph(raw, sensor, np.array(balance), photo)
    return photo


@pytest.mark.parametrize("gain", [1.0, 4.0])
@pytest.mark.parametrize("mosaic", ["none", "mono", "rggb"])
def test_photon_transfer_curve(gain: float, mosaic: Any) -> None:
    """Variance over mean of grey patches: the slope is the system gain, the value in the dark is the read noise's."""
    per_electron = gain * (2**BITS - 1 - BLACK) / FULL_WELL
    means, variances = [], []
    for k, level in enumerate(np.linspace(0.0, 0.8, 9)):
        raw = raw_of(flat(level), gain, k, **NOISY, mosaic=mosaic)
        means.append(raw.mean() - BLACK)
        variances.append(raw.var())
    slope, dark = np.polyfit(means, variances, 1, w=1.0 / np.array(variances))
    assert means[-1] == pytest.approx(0.8 * (2**BITS - 1 - BLACK), rel=2e-3)
    assert slope == pytest.approx(per_electron, rel=0.015)
    assert dark == pytest.approx((per_electron * READ_NOISE) ** 2 + 1.0 / 12.0, rel=0.03)


def test_noise_is_white_and_each_photograph_has_its_own() -> None:
    first, second = (raw_of(flat(0.3), number=k, **NOISY)[..., 0] - BLACK for k in (0, 1))
    other = developer(**NOISY).raw(flat(0.3), "right", 0, 1.0, 1.0)[0][..., 0] - BLACK
    pairs: list[tuple[Any, Any]] = [(first, second), (first, other)]
    for a, b in [*pairs, (first[:, 1:], first[:, :-1]), (first[1:], first[:-1])]:
        assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 0.02
    assert np.array_equal(first, raw_of(flat(0.3), number=0, **NOISY)[..., 0] - BLACK)


def test_pattern_stays_the_same() -> None:
    """PRNU scales with light, DSNU does not; both are the same in each photograph of a view."""
    values: dict[str, Any] = {"full_well_e": FULL_WELL, "prnu": 0.02, "dsnu_e": 10.0, "response": "srgb"}
    dark, bright = (raw_of(flat(level), number=7, **values) * FULL_WELL for level in (0.2, 0.8))
    assert bright.std() == pytest.approx(np.hypot(0.02 * 0.8 * FULL_WELL, 10.0), rel=0.02)
    assert dark.std() == pytest.approx(np.hypot(0.02 * 0.2 * FULL_WELL, 10.0), rel=0.02)
    assert np.array_equal(dark, raw_of(flat(0.2), number=8, **values) * FULL_WELL)


def test_exposure_doubles_light_until_the_sensor_saturates() -> None:
    own = developer(bits=12, response="srgb")
    levels = [float(own.raw(flat(0.1), "left", 0, factor, 1.0)[0].mean()) for factor in (1.0, 2.0, 4.0, 8.0, 16.0)]
    assert levels[:4] == pytest.approx([409.5, 819.0, 1638.0, 3276.0], abs=0.51)
    assert levels[4] == 4095.0
    assert (photo_of(flat(1.5), bits=12, response="srgb") == 255).all()


@pytest.mark.parametrize("power", [4.0, 2.0])
def test_vignetting_follows_the_angle_to_the_axis(power: float) -> None:
    raw = raw_of(flat(0.5), vignetting_power=power, response="srgb")[..., 0]
    across, down = np.tan(np.radians(30.0)), np.tan(np.radians(25.0))
    u, v = (np.arange(SIZE) + 0.5) / SIZE * 2.0 - 1.0, (np.arange(SIZE)[:, None] + 0.5) / SIZE * 2.0 - 1.0
    cosine = 1.0 / np.sqrt(1.0 + (u * across) ** 2 + (v * down) ** 2)
    assert np.allclose(raw[1:-1, 1:-1], 0.5 * cosine[1:-1, 1:-1] ** power, rtol=1e-3)
    assert raw[0, 0] / raw[SIZE // 2, SIZE // 2] == pytest.approx((1 + across**2 + down**2) ** (-power / 2), rel=0.02)


def test_polynomial_vignetting_is_given_at_the_corner() -> None:
    raw = raw_of(flat(0.5), vignetting_polynomial=(-0.5, 0.1, -0.05), response="srgb")[..., 0]
    assert raw[0, 0] == pytest.approx(0.5 * 0.55, rel=0.01)
    half = raw[SIZE // 2, int(SIZE / 2 + SIZE / np.sqrt(8.0))]  # at half of the radius
    assert half == pytest.approx(0.5 * (1.0 - 0.5 / 4 + 0.1 / 16 - 0.05 / 64), rel=0.01)


def test_glare_spreads_the_mean_and_keeps_it() -> None:
    light = flat(0.0)
    light[: SIZE // 2] = 0.8
    raw = raw_of(light, glare=0.1, response="srgb")
    assert raw[-4:].mean() == pytest.approx(0.1 * 0.4, rel=1e-3)
    assert raw.mean() == pytest.approx(0.4, rel=1e-3)


def test_lens_blur_has_its_width() -> None:
    """An edge becomes the normal distribution: the variance of its slope is that of the point spread."""
    light = flat(0.0)
    light[:, SIZE // 2 :] = 0.8
    spread = []
    for sigma in (0.0, 2.0):
        slope = np.diff(raw_of(light, lens_blur_px=sigma, response="srgb")[SIZE // 2, :, 0])
        share = slope / slope.sum()
        u = np.arange(SIZE - 1)
        spread.append(share @ (u - share @ u) ** 2)
    assert spread[1] - spread[0] == pytest.approx(4.0, rel=0.03)


@pytest.mark.parametrize("mosaic", ["rggb", "grbg", "gbrg", "bggr"])
def test_colours_between_filters_are_linear(mosaic: Any) -> None:
    """Bilinear interpolation gives back light that changes linearly, each channel in its own direction."""
    u, v = np.meshgrid(np.linspace(0.1, 0.5, SIZE), np.linspace(0.1, 0.4, SIZE))
    light = np.stack([u, v, 0.5 * (u + v)], axis=-1).astype(np.float32)
    signal, found = CameraSignal(mosaic=mosaic, response="srgb"), np.empty_like(light)
    raw, sensor = Developer(CONFIG, signal, 0).raw(light, "left", 0, 1.0, 1.0)
    interpolate(raw, sensor, 1.0, found)
    assert np.allclose(found[2:-2, 2:-2], light[2:-2, 2:-2], atol=1e-5)


def test_mono_cameras_make_grey_photographs() -> None:
    light = flat(0.0) + np.array([0.6, 0.2, 0.1], np.float32)
    photo = photo_of(light, mosaic="mono", response="linear")
    assert (photo == photo[..., :1]).all()
    assert photo[9, 9, 0] == round(255 * (0.2126 * 0.6 + 0.7152 * 0.2 + 0.0722 * 0.1))


def test_weak_channels_are_made_white_and_noisier() -> None:
    """Half the responsivity is half the electrons: after the gain, the relative noise is sqrt(2) times as large."""
    values = {"photon_noise": True, "full_well_e": 50_000.0, "responsivity": (0.5, 1.0, 1.0), "response": "linear"}
    photo = photo_of(flat(0.5), **values).astype(float)
    assert photo.mean(axis=(0, 1)) == pytest.approx([127.5] * 3, abs=0.1)
    rms = np.sqrt(photo.var(axis=(0, 1)) - 1.0 / 12.0)
    assert rms[0] / rms[1] == pytest.approx(np.sqrt(2.0), rel=0.05)
    assert rms[1] / 127.5 == pytest.approx(1.0 / np.sqrt(25_000.0), rel=0.05)


def test_white_stays_white_whatever_the_balance() -> None:
    gains = white_balance(CameraSignal(white_balance_gains=(1.2, 0.8, 1.6)), [], 1.0)
    assert gains == pytest.approx([1.5, 1.0, 2.0])
    assert (photo_of(flat(1.0), gains, response="srgb") == 255).all()
    assert photo_of(flat(0.4), gains, response="linear")[9, 9].tolist() == [153, 102, 204]


def test_daylight_has_the_chromaticities_of_the_standard() -> None:
    """x and y of the CIE's D50, D55 and D75, as linear sRGB relative to D65."""
    matrix = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    d65 = matrix @ np.ones(3)
    for kelvin, x, y in [(5003, 0.34567, 0.35850), (5503, 0.33242, 0.34743), (7504, 0.29902, 0.31485)]:
        seen = matrix @ (daylight(kelvin) * np.linalg.solve(matrix, d65))
        assert seen[:2] / seen.sum() == pytest.approx([x, y], abs=5e-4)


def test_camera_set_to_warmer_light_makes_the_scene_blue() -> None:
    red, _, blue = white_balance(CameraSignal(white_balance_k=4500.0), [], 1.0)
    assert blue / red > 1.3
    red, _, blue = white_balance(CameraSignal(white_balance_k=9000.0), [], 1.0)
    assert red / blue > 1.2


@pytest.mark.parametrize("strength", [1.0, 0.5])
def test_gray_world_makes_the_mean_grey(strength: float) -> None:
    image = np.tile([0.1, 0.2, 0.05], (50, 1))
    gains = white_balance(CameraSignal(gray_world=strength), [image], 2.0)
    assert gains / gains[1] == pytest.approx([2.0**strength, 1.0, 4.0**strength])


@pytest.mark.parametrize("response", ["filmic", "srgb", "linear"])
def test_automatic_exposure_reaches_its_target(response: Any) -> None:
    signal = CameraSignal(exposure="automatic", response=response, metering_target=0.4)
    image = np.random.default_rng(1).uniform(0.0, 0.3, (500, 3))
    factor = metered_exposure(signal, [image])
    assert encoded(factor * image @ np.array([0.2126, 0.7152, 0.0722]), signal.response).mean() == pytest.approx(
        0.4, abs=1e-4
    )
    assert metered_exposure(signal, [image * 4.0]) == pytest.approx(factor / 4.0, rel=1e-4)


def test_automatic_exposure_follows_a_step_of_light() -> None:
    """After light has doubled, exposure in stops follows 1 - exp(-t / T), in steps of the metering images."""
    signal = CameraSignal(exposure="automatic", response="linear", metering_time_s=0.5, metering_delay_s=0.1)
    lags = metering_lags(signal)
    assert len(lags) == METERINGS
    assert (np.diff(lags) > 0).all()
    grey = np.full((4, 3), 0.1)
    before = metered_exposure(signal, [grey] * METERINGS)
    for seconds in (0.05, 0.3, 0.6, 1.0, 3.0):
        stops = np.log2(metered_exposure(signal, [grey * (2.0 if lag < seconds else 1.0) for lag in lags]) / before)
        due = -(1.0 - np.exp(-max(seconds - 0.1, 0.0) / 0.5))
        assert stops == pytest.approx(due, abs=0.5 / METERINGS + 1e-6)


def test_exposure_takes_time_first_and_then_gain() -> None:
    signal = CameraSignal(exposure_time_ms=2.0, max_exposure_time_ms=10.0, gain_db=6.0, max_gain_db=18.0)
    gain = 10.0 ** (6.0 / 20.0)
    assert exposure_of(signal, 3.0) == pytest.approx((3.0, 0.006, gain))
    assert exposure_of(signal, 10.0) == pytest.approx((10.0, 0.010, 2.0 * gain))
    most = 10.0 ** (18.0 / 20.0)
    assert exposure_of(signal, 1000.0) == pytest.approx((5.0 * most / gain, 0.010, most))
    assert exposure_of(CameraSignal(gain_db=6.0), 3.0) == pytest.approx((3.0, 0.0, gain))


def test_gain_trades_full_well_for_raw_values() -> None:
    low, high = (sensor_of(CameraSignal(**NOISY), gain) for gain in (1.0, 2.0))
    assert high.gain == pytest.approx(2.0 * low.gain)
    assert high.electrons == pytest.approx(low.electrons / 2.0)


@pytest.mark.parametrize("name", models("camera"))
def test_data_sheets_are_signals(name: str) -> None:
    mount = Mount(xyz=(0.0, 0.0, 1.0))
    config = CameraConfig(name="eye", model=name, mount=mount, signal="datasheet")  # type: ignore[arg-type]
    assert config.signal == CameraSignal(**datasheet_of("camera", name))
    assert not config.signal.is_ideal


def test_shutters_and_filters_are_those_of_the_makers() -> None:
    rolling = {name: datasheet_of("camera", name)["readout_ms"] for name in models("camera")}
    assert {name for name, value in rolling.items() if value} == {"zed_2"}
    assert rolling["zed_2"] == pytest.approx(720 * 0.0256, abs=0.01)
    mono = {name for name in models("camera") if datasheet_of("camera", name)["mosaic"] == "mono"}
    assert mono == {"oak_d", "realsense_d435i"}


TEXT = (
    "name: a\nenvironment: park\nroute: {{metres: {{start: [0, 0], waypoints: [[5, 0]]}}}}\nrig: {{cameras: {{{}}}}}\n"
)


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ("signal: {read_noise_e: 2.0}", "full_well_e is required with read_noise_e"),
        ("signal: {black_level: 5}", "bits is required with black_level"),
        ("signal: {bits: 8, black_level: 200}", "black_level must be below half"),
        ("signal: {gain_db: 70.0}", "gain_db"),
        ("signal: {gain_db: 20.0, max_gain_db: 10.0}", "max_gain_db must be at least gain_db"),
        ("signal: {mosaic: rgbw}", "mosaic"),
        ("signal: {iso: 100}", "iso"),
        (
            "signal: {vignetting_power: 4.0}, lens: {model: equirectangular}",
            "signal.vignetting_power must be 0 with the lens equirectangular",
        ),
    ],
)
def test_what_is_not_allowed_is_named(values: str, line: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        parse_experiment(TEXT.format(values))
    assert line in str(error.value)
    assert "\n" not in str(error.value)
