# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The page shows what other readers find in the bag."""

import base64
import re
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from report_pages import (
    ODOMETRY,
    POINTS,
    TAGS,
    Messages,
    Page,
    positions_of,
    words,
)
from rosbags.highlevel import AnyReader

from fieldtruth.core.classes import CLASSES


def test_key_figures(page: Page, messages: Messages) -> None:
    length = np.linalg.norm(np.diff(positions_of(messages), axis=0), axis=1).sum()
    assert 0.3 < length < 0.4
    found = page.terms(".//dl[@class='key']")
    expected = {
        "driven": f"{length:.2f} m",
        "recorded": "1.2 s",
        "mean speed": f"{length / 1.199:.2f} m/s",
        "stereo pairs": "30",
        "LiDAR scans": "12",
        "labelled pixels": f"{2 * 30 * 160 * 92:,}",
        "labelled points": f"{sum(cloud.width for _, cloud in messages[POINTS]):,}",
    }
    assert {key: found[key] for key in expected} == expected
    assert found["bag"].endswith("MB")


def test_experiment_facts(page: Page, small_run: Path) -> None:
    found = page.terms(".//section[@id='path']/dl")
    version = re.search(r"^fieldtruth: (\S+)$", (small_run / "experiment.yaml").read_text(), re.MULTILINE)
    assert version is not None
    expected = {
        "Experiment": "park_1",
        "Environment": "park",
        "Seed": "0",
        "Made by": f"fieldtruth {version[1]}",
        "Commanded speed": "0.3 m/s",
        "Time limit": "1.2 s",
        "Stamps": "0.001 s to 1.200 s",
    }
    assert {key: found[key] for key in expected} == expected
    assert page.words(".//h1") == "park_1"


def test_class_shares_count_every_pixel_and_point(page: Page, messages: Messages) -> None:
    pixels = dict.fromkeys(range(1, len(CLASSES)), 0)
    for topic in TAGS:
        for _, tag in messages[topic]:
            codes, counts = np.unique(tag.data.reshape(-1, 3) @ [65536, 256, 1], return_counts=True)
            for code, count in zip(codes.tolist(), counts.tolist(), strict=True):
                pixels[next(row.label for row in CLASSES if row.rgb == tuple(code.to_bytes(3)))] += count
    label = np.concatenate(
        [cloud.data.reshape(-1, 24)[:, 20:22].copy().view("<u2")[:, 0] for _, cloud in messages[POINTS]]
    )
    points = np.bincount(label, minlength=len(CLASSES))
    rows = {row[0]: row[1:] for row in page.rows(".//table[@class='shares']")}
    assert set(rows) == {row.name for row in CLASSES[1:] if pixels[row.label] or points[row.label]}
    for row in CLASSES[1:]:
        if row.name in rows:
            for cell, count, total in zip(
                rows[row.name],
                (pixels[row.label], points[row.label]),
                (sum(pixels.values()), points.sum()),
                strict=True,
            ):
                percent = f"{100 * count / total:.2f} %" if count / total >= 5e-5 else "< 0.01 %" if count else "none"
                assert cell == f"{percent}{count:,}", row.name


def test_bar_lengths_are_proportional_to_the_shares(page: Page) -> None:
    widths, shares = [], []
    for cell in page.root.findall(".//table[@class='shares']/tbody/tr/td"):
        percent = words(cell.find("span[1]"))  # type: ignore[arg-type]
        bar = cell.find("span[@class='bar']/i")
        assert bar is not None
        widths.append(float(bar.get("style", "").removeprefix("width: ").removesuffix("%")))
        shares.append(0.0 if percent == "none" else float(percent.split()[-2]))
    assert max(widths) == 100.0
    assert widths == pytest.approx([100 * share / max(shares) for share in shares], abs=0.03)


def test_topic_table_has_counts_and_rates(page: Page, small_run: Path) -> None:
    with AnyReader([small_run / "park_1.bag"]) as reader:
        expected = {
            topic: [(info.msgtype or "").replace("/msg/", "/"), f"{info.msgcount:,}"]
            for topic, info in reader.topics.items()
        }
    rates = {
        "/clock": "1000",
        "/imu/data": "50",
        "/tf_static": "once",
        POINTS: "10",
        TAGS[0]: "25",
        "/navsat/fix": "1.67",
    }
    rows = {row[0]: row[1:] for row in page.rows(".//section[@id='topics']//table")}
    assert {topic: row[:2] for topic, row in rows.items()} == expected
    assert {topic: rows[topic][2] for topic in rates} == rates


def test_calibration_matches_closed_form(page: Page) -> None:
    fx, fy = 80 / np.tan(np.radians(34.5)), 46 / np.tan(np.radians(21.0))
    left, right = page.root.findall(".//div[@class='camera']")
    for camera, tx in ((left, 0.0), (right, -0.12 * fx)):
        k, p = camera.findall(".//table")
        expected = [[fx, 0, 79.5, 0], [0, fy, 45.5, 0], [0, 0, 1, 0]]
        assert numbers(k) == pytest.approx(np.array(expected)[:, :3], abs=5e-5)
        expected[0][3] = tx
        assert numbers(p) == pytest.approx(np.array(expected), abs=5e-5)
        assert "160 x 92" in words(camera)
        assert "69.00° x 42.00°" in words(camera)
    assert "Baseline, from P of the right camera: 0.1200 m." in page.words(".//section[@id='calibration']/p[1]")


def numbers(table: Any) -> NDArray[np.float64]:
    return np.array([[float(words(cell)) for cell in row] for row in table.findall("tbody/tr")])


def test_static_frames_match_table_2_of_the_paper(page: Page) -> None:
    rows = {row[0]: [float(v) for v in row[1:] if v] for row in page.rows(".//table[@class='numbers frames']")}
    assert rows == {
        "base_link": [],
        "GNSS_link": [0.10, 0, 0.890, 0, 0, 0],
        "os1_lidar": [0.09, 0, 0.826, 0, 0, 0],
        "right_camera": [0.15, -0.06, 0.720, 0, 90, 0],
        "left_camera": [0.15, 0.06, 0.720, 0, 90, 0],
        "right_camera_optical": [0, 0, 0, 0, 0, -90],
        "left_camera_optical": [0, 0, 0, 0, 0, -90],
        "imu_link": [0.19, 0, 0.149, 0, -90, 180],
        "base_footprint": [0, 0, -0.13228, 0, 0, 0],
    }  # fmt: skip
    depths = {words(th): th.get("style") for th in page.root.findall(".//table[@class='numbers frames']/tbody/tr/th")}
    assert [depths[name] for name in ("base_link", "left_camera", "left_camera_optical")] == [
        "--depth: 0", "--depth: 1", "--depth: 2",
    ]  # fmt: skip


def test_checksums_match_sha256sums(page: Page, small_run: Path) -> None:
    lines = (small_run / "SHA256SUMS").read_text().splitlines()
    stated = {name: digest for digest, name in (line.split("  ") for line in lines)}
    assert page.terms(".//dl[@class='sums']") == stated
    assert "park_1.bag" in stated


def test_images_are_copies_from_the_bag(page: Page, messages: Messages) -> None:
    photos = {bytes(message.data): stamp for stamp, message in messages["/stereo/camera/left/real/compressed"]}
    shown = [data for data in map(base64.b64decode, page.images("image/jpeg")) if data in photos]
    seconds = [label.split()[1] for label in map(words, page.root.findall(".//fieldset[@class='strip']/label"))]
    assert len(shown) == len(seconds) == 6
    stamps = [photos[data] for data in shown]
    assert stamps == sorted(stamps)
    assert seconds == [f"{(stamp - 1_000_000) / 1e9:.1f}" for stamp in stamps]
    assert np.diff(stamps) == pytest.approx(np.full(5, 2e8), abs=4e7 + 1)  # evenly through 1.2 s
    tags = dict(messages[TAGS[0]])
    pngs = [np.asarray(Image.open(BytesIO(base64.b64decode(p))).convert("RGB")) for p in page.images("image/png")]
    assert len(pngs) == 12
    for stamp, png in zip(stamps, pngs[::2], strict=True):
        assert (png == tags[stamp].data.reshape(92, 160, 3)).all()


def test_curve_values_are_readings_from_the_bag(page: Page, messages: Messages) -> None:
    curves = page.data("numbers")["curves"]
    channels = {"speed": 1, "tilt": 2, "heading": 1, "height": 1}
    channels |= {"turning": 3, "acceleration": 3, "wheels": 4, "position": 3}
    assert {curve: len(found) for curve, found in curves.items()} == channels
    assert [figure.get("data-key") for figure in page.root.findall(".//figure[@class='curve']")] == list(channels)
    start = 1_000_000
    imu = {round((stamp - start) / 1e6): message for stamp, message in messages["/imu/data"]}
    for curve, part in (("turning", "angular_velocity"), ("acceleration", "linear_acceleration")):
        for axis, (times, values) in zip("xyz", curves[curve], strict=True):
            assert times == list(imu)  # 60 readings: all of them
            exact = [getattr(getattr(message, part), axis) for message in imu.values()]
            assert values == pytest.approx(exact, rel=1e-4, abs=1e-12)
    speeds = [np.linalg.norm([v.x, v.y, v.z]) for v in (m.twist.twist.linear for _, m in messages[ODOMETRY])]
    assert curves["speed"][0][1] == pytest.approx(speeds, rel=1e-4)
    assert curves["height"][0][1] == pytest.approx(positions_of(messages)[:, 2], rel=1e-4)
