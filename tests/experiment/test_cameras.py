# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cameras by name and lenses by coefficients: what they fill in, what is refused, and what CameraInfo says."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.lenses import fields_of_view
from fieldtruth.experiment.catalogue import figures_of, list_models, models
from fieldtruth.experiment.files import dump_experiment, parse_experiment
from fieldtruth.experiment.imaging_config import LensConfig
from fieldtruth.experiment.rig import paper_rig
from fieldtruth.gazebo import write_gazebo
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.sensor import camera_matrix, distortion, projection_matrix

PAGE = (Path(__file__).parents[2] / "docs" / "cameras.md").read_text(encoding="utf-8")
TEXT = "name: a\nenvironment: park\nroute: {start: [49.9, 8.9], waypoints: [[49.9001, 8.9]]}\nrig: {cameras: {%s}}\n"


def cameras(keys: str) -> StereoConfig:
    return parse_experiment(TEXT % keys).rig.stereo


def test_the_zed_of_the_paper_is_the_default() -> None:
    assert cameras("model: zed_2").model_copy(update={"model": None}) == StereoConfig()


@pytest.mark.parametrize("name", list_models("camera"))
def test_every_camera_is_described_with_its_data(name: str) -> None:
    camera = StereoConfig(model=name)
    [row] = re.findall(rf"^\| `{name}` \|(.*)\|$", PAGE, re.M)
    image, fov, baseline, rate, lens, source = (cell.strip() for cell in row.split("|"))
    assert image == f"{camera.width} x {camera.height}"
    seen = fields_of_view(camera.projection, camera.width, camera.height)
    named = [float(angle) for angle in re.findall(r"\d+", fov)]
    assert np.abs(np.subtract(seen[: len(named)], named)).max() < 0.5
    figures = figures_of("camera", name)
    assert baseline == (f"{1000 * camera.baseline:g} mm" if "baseline" in figures else "")
    assert rate == (f"{camera.rate_hz:g} Hz" if "rate_hz" in figures else "")
    assert lens == camera.lens.model
    sources = " ".join(figure["source"] for figure in models("camera")[name]["figures"].values())
    assert all(link in sources for link in re.findall(r"\(https://(?:github\.com/)?([^)]+)\)", source))
    assert sources.startswith("no product") == (source == "ideal")


def test_what_is_given_wins_over_the_model() -> None:
    camera = cameras("model: oak_d, width: 640, left: {xyz: [0, 1, 0]}, right: {xyz: [0, 0, 0]}")
    assert (camera.width, camera.height, camera.horizontal_fov_deg) == (640, 800, 80.0)
    assert camera.baseline == 1.0
    again = parse_experiment(dump_experiment(parse_experiment(TEXT % "model: realsense_d455"))).rig.stereo
    assert again == StereoConfig(model="realsense_d455")
    assert again.baseline == pytest.approx(0.095)


def test_a_panorama_is_whole_unless_it_is_said() -> None:
    whole = cameras("lens: {model: equirectangular}")
    assert (whole.horizontal_fov_deg, whole.vertical_fov_deg) == (360.0, 180.0)
    assert cameras("lens: {model: equirectangular}, vertical_fov_deg: 90").vertical_fov_deg == 90.0


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (
            "model: oakd",
            r"rig\.cameras\.model must be a model of kind stereo, nearest first: oak_d, .*; got 'oakd'$",
        ),
        ("lens: {model: fisheye}", r"rig\.cameras\.lens\.model must be pinhole, plumb_bob, .*, got 'fisheye'"),
        (
            "lens: {model: equidistant, coefficients: [0.1]}",
            r"lens: coefficients: equidistant has 4 coefficients, k1, k2, k3, k4, got 1",
        ),
        ("lens: {coefficients: [0.1]}", r"lens: coefficients: pinhole has no coefficients, got 1"),
        ("lens: {fy: 300}", r"rig\.cameras\.lens: fy needs fx"),
        ("horizontal_fov_deg: 170", r"horizontal_fov_deg must be below 170 with the lens pinhole, got 170"),
        (
            "lens: {model: plumb_bob, coefficients: [-0.5, 0, 0, 0, 0], fx: 400}",
            r"lens\.coefficients: the distortion is not monotonic within the image: .* up to 39\.23 deg from the axis",
        ),
        (
            "lens: {model: plumb_bob, coefficients: [-0.5, 0, 0, 0, 0]}, horizontal_fov_deg: 100",
            r"horizontal_fov_deg: lens\.coefficients can be inverted up to 39\.23 deg from the axis only",
        ),
        ("lens: {model: equirectangular}, vertical_fov_deg: 181", r"vertical_fov_deg must be at most 180"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(keys: str, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message) as refusal:
        cameras(keys)
    assert "\n" not in str(refusal.value)


def test_an_image_circle_cuts_where_the_distortion_turns() -> None:
    """Its slope is zero at tan = 1 / sqrt(1.5), which is 39.23 deg."""
    lens = "lens: {model: plumb_bob, coefficients: [-0.5, 0, 0, 0, 0], fx: 400, image_circle_deg: %s}"
    assert cameras(lens % 78).lens.image_circle_deg == 78
    with pytest.raises(ConfigurationError, match="not monotonic"):
        cameras(lens % 79)


def test_camera_info_says_the_lens() -> None:
    coefficients = (0.1, -0.05, -0.003, 0.002, 0.0)
    lens = LensConfig(model="plumb_bob", coefficients=coefficients, fx=700.0, cx=650.0, cy=350.0)
    camera = StereoConfig(lens=lens)
    assert camera_matrix(camera).tolist() == [[700.0, 0.0, 650.0], [0.0, 700.0, 350.0], [0.0, 0.0, 1.0]]
    assert projection_matrix(camera.imagers()[1])[0].tolist() == pytest.approx([700.0, 0.0, 650.0, -84.0])
    model, numbers = distortion(camera)
    assert (model, tuple(numbers)) == ("plumb_bob", coefficients)
    assert distortion(StereoConfig())[0] == "plumb_bob"
    assert distortion(StereoConfig())[1].tolist() == [0.0] * 5
    assert distortion(StereoConfig(model="fisheye_190"))[0] == "equidistant"
    panorama = StereoConfig(model="panorama")
    assert not camera_matrix(panorama).any()
    assert not projection_matrix(panorama.imagers()[0]).any()
    assert distortion(panorama)[0] == "equirectangular"
    assert not len(distortion(panorama)[1])


def test_a_package_for_gazebo_refuses_other_lenses(tmp_path: Path) -> None:
    world: Any = None  # is not looked at
    rig = paper_rig(cameras=StereoConfig(model="fisheye_190"))
    with pytest.raises(
        ConfigurationError, match=r"^rig\.sensors: stereo has the lens equidistant; .* pinhole cameras only"
    ):
        write_gazebo(world, tmp_path / "package", rig=rig)
    assert not (tmp_path / "package").exists()
