# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The page as text: what it says equals what other readers find in the bag; it is whole, valid, and never refuses."""

import ast
import base64
import dataclasses
import os
import re
import shutil
import tracemalloc
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from report_pages import Page, changed, longer, only, page_of, words
from rosbags.highlevel import AnyReader

from fieldtruth import cli
from fieldtruth.classes import CLASSES
from fieldtruth.errors import OutputError
from fieldtruth.export import FORMS
from fieldtruth.record.ros import STORE
from fieldtruth.record.run import open_run
from fieldtruth.record.stored import BagError
from fieldtruth.record.topics import TOPICS
from fieldtruth.report.page import LARGEST_PAGE, orbit, place, samples, scans, thin, write_report
from fieldtruth.report.page import map as map_figure
from fieldtruth.report.page.gather import gather
from fieldtruth.report.page.passage import read_through
from fieldtruth.report.page.render import render
from fieldtruth.report.progress import Silent
from fieldtruth.world import World, load_world

TAGS = ["/stereo/camera/left/tag/img_raw", "/stereo/camera/right/tag/img_raw"]
TYPES = {topic.name: topic.msgtype for topic in TOPICS}
POINTS, ODOMETRY = "/os1_cloud_node/points", "/ground_truth/odom"
SCRIPTS = 5  # numbers, the cloud's settings and data, and two programs


@pytest.fixture(scope="module")
def page(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Page:
    return Page(page_of(small_run, tmp_path_factory))


@pytest.fixture(scope="module")
def messages(small_run: Path) -> dict[str, list[Any]]:
    """Messages by topic, as the rosbags library reads them; (stamp in the bag [ns], message)."""
    wanted = {*TAGS, POINTS, ODOMETRY, "/imu/data", "/stereo/camera/left/real/compressed"}
    found: dict[str, list[Any]] = {}
    with AnyReader([small_run / "park_1.bag"]) as reader:
        for connection, stamp, data in reader.messages([c for c in reader.connections if c.topic in wanted]):
            found.setdefault(connection.topic, []).append((stamp, reader.deserialize(data, connection.msgtype)))
    return found


@pytest.fixture(scope="module")
def park() -> World:
    return load_world("park", 0)


def way(messages: dict[str, list[Any]]) -> NDArray[np.float64]:
    """True positions (n, 3) [m]."""
    positions = [message.pose.pose.position for _, message in messages[ODOMETRY]]
    return np.array([(p.x, p.y, p.z) for p in positions])


# ---------------------------------------------------------------------------------------------------------------------
# What the page says is what is in the bag


def test_key_figures(page: Page, messages: dict[str, list[Any]]) -> None:
    length = np.linalg.norm(np.diff(way(messages), axis=0), axis=1).sum()
    assert 0.3 < length < 0.4
    found = page.terms(".//dl[@class='key']")
    expected = {
        "driven": f"{length:.2f} m",
        "recorded": "1.2 s",
        "mean speed": f"{length / 1.199:.2f} m/s",
        "stereo pairs": "30",
        "LiDAR scans": "12",
        "labelled pixels": f"{2 * 30 * 320 * 184:,}",
        "labelled points": f"{sum(cloud.width for _, cloud in messages[POINTS]):,}",
    }
    assert {key: found[key] for key in expected} == expected
    assert found["bag"].endswith("MB")


def test_what_was_driven(page: Page, small_run: Path) -> None:
    found = page.terms(".//section[@id='way']/dl")
    version = re.search(r"^fieldtruth: (\S+)$", (small_run / "experiment.yaml").read_text(), re.MULTILINE)
    assert version is not None
    expected = {
        "Experiment": "park_1",
        "Environment": "park",
        "Seed": "0",
        "Made by": f"fieldtruth {version[1]}",
        "Commanded speed": "0.3 m/s",
        "Ended after": "1.2 s, as asked",
        "Stamps": "0.001 s to 1.200 s",
    }
    assert {key: found[key] for key in expected} == expected
    assert page.words(".//h1") == "park_1"


def test_every_pixel_and_every_point_is_counted(page: Page, messages: dict[str, list[Any]]) -> None:
    pixels = dict.fromkeys(range(1, 16), 0)
    for topic in TAGS:
        for _, tag in messages[topic]:
            codes, counts = np.unique(tag.data.reshape(-1, 3) @ [65536, 256, 1], return_counts=True)
            for code, count in zip(codes.tolist(), counts.tolist(), strict=True):
                pixels[next(row.label for row in CLASSES if row.rgb == tuple(code.to_bytes(3)))] += count
    label = np.concatenate(
        [cloud.data.reshape(-1, 28)[:, 24:26].copy().view("<u2")[:, 0] for _, cloud in messages[POINTS]]
    )
    points = np.bincount(label, minlength=16)
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


def test_bars_are_as_long_as_the_shares(page: Page) -> None:
    widths, shares = [], []
    for cell in page.root.findall(".//table[@class='shares']/tbody/tr/td"):
        percent = words(cell.find("span[1]"))  # type: ignore[arg-type]
        bar = cell.find("span[@class='bar']/i")
        assert bar is not None
        widths.append(float(bar.get("style", "").removeprefix("width: ").removesuffix("%")))
        shares.append(0.0 if percent == "none" else float(percent.split()[-2]))
    assert max(widths) == 100.0
    assert widths == pytest.approx([100 * share / max(shares) for share in shares], abs=0.03)


def test_topics_with_counts_and_rates(page: Page, small_run: Path) -> None:
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


def test_calibration_is_the_closed_form(page: Page) -> None:
    fx, fy = 160 / np.tan(np.radians(34.5)), 92 / np.tan(np.radians(21.0))
    left, right = page.root.findall(".//div[@class='camera']")
    for camera, tx in ((left, 0.0), (right, -0.12 * fx)):
        k, p = camera.findall(".//table")
        expected = [[fx, 0, 159.5, 0], [0, fy, 91.5, 0], [0, 0, 1, 0]]
        assert numbers(k) == pytest.approx(np.array(expected)[:, :3], abs=5e-5)
        expected[0][3] = tx
        assert numbers(p) == pytest.approx(np.array(expected), abs=5e-5)
        assert "320 x 184" in words(camera)
        assert "69.00° x 42.00°" in words(camera)
    assert "Baseline, from the right camera's P: 0.1200 m." in page.words(".//section[@id='calibration']/p[1]")


def numbers(table: Any) -> NDArray[np.float64]:
    return np.array([[float(words(cell)) for cell in row] for row in table.findall("tbody/tr")])


def test_fixed_frames_are_those_of_the_papers_table_2(page: Page) -> None:
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
        "front_right_wheel": [0.256, -0.2854, 0.03282, 0, 0, 0],
        "rear_right_wheel": [-0.256, -0.2854, 0.03282, 0, 0, 0],
        "front_left_wheel": [0.256, 0.2854, 0.03282, 0, 0, 0],
        "rear_left_wheel": [-0.256, 0.2854, 0.03282, 0, 0, 0],
        "base_footprint": [0, 0, -0.13228, 0, 0, 0],
    }  # fmt: skip
    depths = {words(th): th.get("style") for th in page.root.findall(".//table[@class='numbers frames']/tbody/tr/th")}
    assert [depths[name] for name in ("base_link", "left_camera", "left_camera_optical")] == [
        "--depth: 0", "--depth: 1", "--depth: 2",
    ]  # fmt: skip


def test_checksums_are_those_of_the_folder(page: Page, small_run: Path) -> None:
    lines = (small_run / "SHA256SUMS").read_text().splitlines()
    stated = {name: digest for digest, name in (line.split("  ") for line in lines)}
    assert page.terms(".//dl[@class='sums']") == stated
    assert "park_1.bag" in stated


def test_images_are_the_bags_own(page: Page, messages: dict[str, list[Any]]) -> None:
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
        assert (png == tags[stamp].data.reshape(184, 320, 3)).all()


def test_curves_are_readings(page: Page, messages: dict[str, list[Any]]) -> None:
    curves = page.data("numbers")["curves"]
    channels = {"speed": 1, "tilt": 2, "heading": 1, "height": 1}
    channels |= {"turning": 3, "acceleration": 3, "wheels": 4, "gnss": 3}
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
    assert curves["height"][0][1] == pytest.approx(way(messages)[:, 2], rel=1e-4)


# ---------------------------------------------------------------------------------------------------------------------
# Map and cloud against the world itself


def test_the_way_lies_on_the_photograph_where_a_pinhole_sees_it(
    page: Page, messages: dict[str, list[Any]], park: World
) -> None:
    x, y, _ = way(messages).T
    above = float(park.terrain.field.heights.mean()) + 300.0 - park.terrain.field.height_at(x, y)
    sheet = page.one(".//figure[@class='map']//{*}svg")
    width, height = (float(v) for v in sheet.get("viewBox", "").split()[2:])
    column = width / 2 + width / 2 * (x / above) / (51.0 / 300.0)
    row = height / 2 - height / 2 * (y / above) / (26.0 / 300.0)
    photo = Image.open(BytesIO(base64.b64decode(page.images("image/jpeg")[0])))
    assert photo.size == (width, height)
    drawn = pairs(page.one(".//{*}polyline[@class='route']").get("points", ""))
    assert drawn == pytest.approx(np.column_stack([column, row]), abs=0.06)
    moves = page.data("numbers")["way"]
    assert np.array(moves)[:, 1:] == pytest.approx(100 * np.column_stack([column / width, row / height]), abs=0.02)
    assert [t for t, *_ in moves][:3] == [19, 39, 59]  # 0.02 s, less the 0.001 s at which the bag begins


def pairs(points: str) -> NDArray[np.float64]:
    return np.array([[float(v) for v in point.split(",")] for point in points.split()])


def test_way_points_are_circles_of_the_arrival_distance(page: Page) -> None:
    rings = [pairs(ring.get("points", "")) for ring in page.root.findall(".//{*}polygon[@class='ring']")]
    assert len(rings) == 9
    metre = 600 / 102.0
    for ring in rings:
        radius = np.linalg.norm(ring - ring.mean(axis=0), axis=1)
        assert radius == pytest.approx(np.full(48, 2.0 * metre), rel=0.02)
    # The route leads north, which is to the right: latitudes rise from one way-point to the next.
    assert (np.diff([ring[:, 0].mean() for ring in rings]) > 0).all()


def cloud_of(page: Page) -> tuple[NDArray[np.float64], NDArray[np.uint8], dict[str, Any]]:
    """Points (n, 3) [m] and labels of the page's cloud, decoded as a stranger would."""
    settings = page.data("cloud-settings")
    found = re.search(r'id="cloud-data">([^<]*)<', page.text)
    assert found is not None
    data = base64.b64decode(found[1])
    n = settings["count"]
    assert len(data) == 7 * n
    steps = np.frombuffer(data, "<i2", 3 * n).reshape(n, 3)
    return steps * settings["step"] + settings["middle"], np.frombuffer(data, np.uint8, offset=6 * n), settings


def test_points_of_ground_and_trail_lie_on_the_worlds_ground(page: Page, park: World) -> None:
    xyz, label, _ = cloud_of(page)
    inside = (np.abs(xyz[:, :2]) < np.array(park.size) / 2 - 0.5).all(axis=1)
    low = xyz[inside & np.isin(label, (1, 7))]
    assert len(low) > 20_000
    off = low[:, 2] - park.terrain.field.height_at(low[:, 0], low[:, 1])
    assert np.quantile(np.abs(off), 0.99) < 0.003  # the rest are kerbs and mulch, which are ground, too
    assert np.abs(off).max() < 0.1
    trail = xyz[inside & (label == 7)]
    assert len(trail) > 500
    spot = park.terrain.trail_distance
    column = np.rint((trail[:, 0] - spot.x0) / spot.spacing).astype(int)
    row = np.rint((trail[:, 1] - spot.y0) / spot.spacing).astype(int)
    assert (spot.values[column, row] < spot.spacing).mean() > 0.999


def test_the_cloud_shows_the_way_and_counts_what_it_shows(page: Page, messages: dict[str, list[Any]]) -> None:
    xyz, label, settings = cloud_of(page)
    route = xyz[label == settings["route"]]
    positions = way(messages)
    assert route[[0, -1]] == pytest.approx(positions[[0, -1]], abs=2 * settings["step"])
    counts = np.bincount(label, minlength=17)
    assert counts[:16].sum() <= scans.LARGEST
    legend = {
        words(row.find("span")): words(row.find("small"))  # type: ignore[arg-type]
        for row in page.root.findall(".//fieldset[@id='legend']/label")
    }
    assert legend.pop("the robot's way") == ""
    assert legend == {row.name: f"{counts[row.label]:,}" for row in CLASSES if counts[row.label]}
    cells = np.floor(xyz[label != settings["route"]] / settings["voxel"])
    assert len(np.unique(cells, axis=0)) > 0.9 * len(cells)  # but for points that rounding moved over a voxel's side


# ---------------------------------------------------------------------------------------------------------------------
# The file itself


def test_the_page_is_valid_whole_and_asks_for_nothing(page: Page) -> None:
    ids = [element.get("id") for element in page.root.iter() if element.get("id")]
    assert len(ids) == len(set(ids))
    for element in page.root.iter():
        for name in ("src", "href", "data", "poster", "action", "srcset", "{http://www.w3.org/1999/xlink}href"):
            value = element.get(name, "data:")
            assert value.startswith("data:") or (value[:1] == "#" and value[1:] in ids), (element.tag, name, value[:50])
    assert not re.search(r"url\(|@import|https?://(?!www\.w3\.org)", page.text)
    assert not {"link", "iframe", "object", "embed", "base"} & {
        str(e.tag) for e in page.root.iter() if e.get("href") != "data:,"
    }
    policy = page.one(".//meta[@http-equiv='Content-Security-Policy']").get("content", "")
    assert policy.startswith("default-src 'none'; img-src data:;")
    assert "unsafe-inline" not in policy.split("script-src")[1]


def test_fields_have_labels_and_images_have_texts(page: Page) -> None:
    labelled = {label.get("for") for label in page.root.iter("label")} | {
        element.get("id") for label in page.root.iter("label") for element in label.iter("input")
    }
    wrapped = {id(element) for label in page.root.iter("label") for element in label.iter("input")}
    for element in page.root.iter("input"):
        assert id(element) in wrapped or element.get("id") in labelled
    assert all(image.get("alt") is not None for image in page.root.iter("img"))
    assert all(svg.get("aria-label") for svg in page.root.findall(".//{*}svg"))
    assert page.root.get("lang") == "en"
    levels = [int(str(e.tag)[1]) for e in page.root.iter() if re.fullmatch("h[1-6]", str(e.tag))]
    assert levels[0] == 1
    assert max(np.diff(levels)) == 1


def test_no_run_makes_a_page_of_15_mb(page: Page) -> None:
    """Every large part has a limit in bytes or in number; their sum, and half a megabyte of words, stays below it."""
    images = samples.PAIRS * (2 * (samples.PHOTO_BYTES + samples.TAG_BYTES) + samples.THUMB_BYTES)
    cloud = 7 * (scans.LARGEST + orbit.ROUTE_POINTS) + orbit.POSTER_BYTES
    vertex = len("9999.9,99.99L") + len("9999999,") + len("-1.2345e-05,")  # in the path and among the numbers
    curves = 18 * thin.VERTICES * vertex
    way_points = map_figure.VERTICES * (len("9999.9,9999.9 ") + len("[99999999,99.99,99.99],"))
    assert 4 / 3 * (images + cloud + map_figure.PHOTO_BYTES) + curves + 2 * way_points + 500_000 < LARGEST_PAGE
    assert sum(len(channels) for channels in page.data("numbers")["curves"].values()) == 18
    assert all(len(base64.b64decode(p)) <= samples.TAG_BYTES for p in page.images("image/png"))
    rest = re.sub(r"base64,[A-Za-z0-9+/=]+|(?<=cloud-data\">)[^<]*|(?<= d=\")[^\"]*", "", page.text)
    rest = re.sub(r"(?<=id=\"numbers\">)[^<]*", "", rest)
    assert len(rest) < 150_000


def test_large_and_noisy_images_are_made_small() -> None:
    noise = np.random.default_rng(5).integers(0, 256, (1080, 1920, 3), np.uint8)
    assert len(samples.jpeg_below(noise, samples.PHOTO_BYTES)) <= samples.PHOTO_BYTES


def test_programs_on_the_page_run_and_commands_exist(
    page: Page, small_run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(small_run)
    snippets = {
        words(figure.find("figcaption/b")): "".join(figure.find("pre").itertext())  # type: ignore[arg-type, union-attr]
        for figure in page.root.findall(".//figure[@class='snippet']")
    }
    for title in ("This package", "rosbags, without ROS", "PyTorch"):
        exec(compile(ast.parse(snippets[title]), title, "exec"), {})
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) > 12
    assert printed[0].startswith("100000000 ")
    commands = [words(code) for code in page.root.findall(".//dl[@class='forms']//code")]
    assert commands == [f"fieldtruth export park_1.bag --to {form}" for form in FORMS]
    assert snippets["Check it"] == "sha256sum -c SHA256SUMS\nfieldtruth validate park_1.bag"
    assert snippets["evo"] == "evo_traj bag park_1.bag /ground_truth/odom --plot"


# ---------------------------------------------------------------------------------------------------------------------
# Bags that lack something, and bags that mean harm

LACKS = {
    "images": "no camera images",
    "cloud": "has no /os1_cloud_node/points",
    "classes": "neither tag images nor clouds",
    "way": "no true poses",
    "motion": "neither true poses nor readings",
    "calibration": "no CameraInfo",
}


@pytest.mark.parametrize(
    ("topics", "shown"),
    [
        ([POINTS, ODOMETRY, "/tf_static"], {"cloud", "classes", "way", "motion"}),
        ([POINTS], {"cloud", "classes"}),
        ([TAGS[1]], {"images", "classes"}),
        (["/stereo/camera/left/real/compressed"], {"images"}),
        (["/imu/data", "/stereo/camera/right/camera_info"], {"motion", "calibration"}),
        (["/gazebo/model_states"], {"way", "motion"}),
        (["/clock"], set()),
    ],
)
def test_what_a_bag_lacks_the_page_lacks_and_says_so(
    small_run: Path, tmp_path: Path, topics: list[str], shown: set[str]
) -> None:
    bag = only(small_run / "park_1.bag", tmp_path / "some.bag", *topics)
    page = Page(write_report(bag))
    for section, text in LACKS.items():
        assert (text in page.words(f".//section[@id='{section}']")) == (section not in shown), section
    assert [row[0] for row in page.rows(".//section[@id='topics']//table")] == sorted(topics, key=page.text.index)
    assert ("No experiment.yaml lies beside the bag" in page.text) == ("way" in shown)


def test_model_states_tell_the_same_way_as_odometry(small_run: Path, tmp_path: Path, page: Page) -> None:
    bag = only(small_run / "park_1.bag", tmp_path / "states.bag", "/gazebo/model_states")
    other = Page(write_report(bag))
    assert other.terms(".//dl[@class='key']")["driven"] == page.terms(".//dl[@class='key']")["driven"]
    for curve in ("speed", "heading", "height"):
        (times, values), (_, known) = (
            other.data("numbers")["curves"][curve][0],
            page.data("numbers")["curves"][curve][0],
        )
        assert len(times) > 600  # of 1,200 readings, two in each thousandth of the time
        assert values[-1] == pytest.approx(known[-1], rel=1e-4)


def test_hostile_names_are_only_words(small_run: Path, tmp_path: Path) -> None:
    evil = '</script><script>hacked=1</script><img src=x onerror="hacked=2">{{ 7*7 }}'
    names = {POINTS: POINTS, "/imu/data": f"/{evil}", "/tf_static": "/tf_static"}

    def change(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        if topic == "/tf_static":
            frame = b"<script>1</script>"
            data = data.replace(b"\x12\x00\x00\x00left_camera_optical"[4:12], frame[:8])  # same length
        return (names[topic], stamp, data) if topic in names else None

    folder = tmp_path / "run"
    folder.mkdir()
    bag = changed(small_run / "park_1.bag", folder / "<b onclick=alert(1)>&.bag", change)
    page = Page(write_report(bag))
    assert page.words(".//h1") == "<b onclick=alert(1)>&"
    assert f"/{evil}" in [row[0] for row in page.rows(".//section[@id='topics']//table")]
    assert len(list(page.root.iter("script"))) == SCRIPTS
    assert not [e for e in page.root.iter() if any(str(name).startswith("on") for name in e.keys())]  # noqa: SIM118
    assert not list(page.root.iter("b onclick"))


def test_a_hostile_description_is_only_words(small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fieldtruth.report.page.gather.see_place", lambda *_: (None, ""))
    folder = tmp_path / "park_1"
    folder.mkdir()
    only(small_run / "park_1.bag", folder / "park_1.bag", ODOMETRY, "/gazebo/model_states")
    text = (small_run / "experiment.yaml").read_text()
    evil = "</p><script>alert(1)</script> {{ run }}"
    (folder / "experiment.yaml").write_text(re.sub(r"(?m)^description: .*$", f"description: '{evil}'", text))
    page = Page(write_report(folder))
    assert page.words(".//p[@class='lead']") == evil
    assert len(list(page.root.iter("script"))) == SCRIPTS - 2  # there is no cloud


def test_another_place_than_the_bags_is_not_shown(
    small_run: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    park: World,
    messages: dict[str, list[Any]],
) -> None:

    folder = tmp_path / "park_1"
    folder.mkdir()
    only(small_run / "park_1.bag", folder / "park_1.bag", ODOMETRY, "/gazebo/model_states")
    shutil.copy(small_run / "experiment.yaml", folder)
    moved = park.instances[5].world_from_object.copy()
    moved[1, 3] += 0.01
    instances = [*park.instances]
    instances[5] = dataclasses.replace(instances[5], world_from_object=moved)
    monkeypatch.setattr(place, "world_of", lambda _: dataclasses.replace(park, instances=tuple(instances)))
    page = Page(write_report(folder))
    assert "builds another place from experiment.yaml than the bag tells of" in page.words(".//section[@id='way']")
    assert page.one(".//figure[@class='map plain']") is not None
    metres = [ruler(page, "x", "left"), ruler(page, "y", "top")]
    assert metres[0][0] > 0.0 > metres[1][0]  # north is to the right, west up
    width, height = (float(v) for v in page.one(".//figure[@class='map plain']//{*}svg").get("viewBox", "").split()[2:])
    percent = 100 * pairs(page.one(".//{*}polyline[@class='route']").get("points", "")) / (width, height)
    drawn = [scale * column + offset for (scale, offset), column in zip(metres, percent.T, strict=True)]
    assert np.array(drawn) == pytest.approx(way(messages)[:, :2].T, abs=0.02)


def ruler(page: Page, kind: str, side: str) -> NDArray[np.float64]:
    """Metres per percent, and metres at nought, by the numbers along a side of the grid."""
    marks = page.root.findall(f".//span[@class='mark {kind}']")
    at = [float(re.findall(rf"{side}: ([-\d.]+)%", mark.get("style", ""))[0]) for mark in marks]
    assert len(at) > 2
    return np.polyfit(at, [float(words(mark)) for mark in marks], 1)


def test_messages_of_another_form_are_named(small_run: Path, tmp_path: Path) -> None:
    def change(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        if topic == TAGS[0]:
            return topic, stamp, data.replace(b"\x04\x00\x00\x00rgb8", b"\x04\x00\x00\x00rgb9")
        if topic == "/imu/data":
            return "/navsat/fix", stamp, data
        return (topic, stamp, data) if topic == TAGS[1] else None

    page = Page(write_report(changed(small_run / "park_1.bag", tmp_path / "odd.bag", change)))
    notes = page.words(".//section[@id='way']/div[@class='lack']")
    assert f"{TAGS[0]}: image is 'rgb9'" in notes
    assert "/navsat/fix: holds sensor_msgs/msg/Imu, not sensor_msgs/msg/NavSatFix" in notes
    assert f"{30 * 320 * 184:,}" in page.words(".//table[@class='shares']/tfoot")  # the right camera alone


def test_messages_that_make_no_sense_are_no_reason_to_stop(small_run: Path, tmp_path: Path) -> None:
    """Mounts without a rotation, a camera without a focal length, a cloud and images of another size than they say."""

    def change(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        if topic not in {*TAGS, POINTS, ODOMETRY, "/tf_static", "/stereo/camera/left/camera_info", "/imu/data"}:
            return None
        message: Any = STORE.deserialize_ros1(data, TYPES[topic])
        if topic == "/tf_static":
            for each in message.transforms:
                q = each.transform.rotation
                q.x = q.y = q.z = q.w = 0.0
        elif topic == POINTS:
            message.row_step += 1
        elif topic in TAGS:
            message.height += 1
        elif topic == "/imu/data":
            message.linear_acceleration.x = float("nan")
        elif topic != ODOMETRY:
            message.K = np.zeros(9)
        return topic, stamp, bytes(STORE.serialize_ros1(message, TYPES[topic]))

    page = Page(write_report(changed(small_run / "park_1.bag", tmp_path / "odd.bag", change)))
    for section in ("images", "classes", "cloud"):
        assert page.root.findall(f".//section[@id='{section}']/p[@class='lack']"), section
    notes = page.words(".//section[@id='way']/div[@class='lack']")
    assert all(topic in notes for topic in (*TAGS, POINTS))
    channels = page.root.findall(".//figure[@data-key='acceleration']//span[@class='channels']/span")
    assert [words(channel)[0] for channel in channels] == ["y", "z"]


def test_a_bag_of_one_instant_has_a_page(small_run: Path, tmp_path: Path) -> None:
    seen = set()

    def change(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        if topic in seen or topic not in {ODOMETRY, "/imu/data", POINTS}:
            return None
        seen.add(topic)
        return topic, 10**8, data

    page = Page(write_report(changed(small_run / "park_1.bag", tmp_path / "one.bag", change)))
    assert page.terms(".//dl[@class='key']")["recorded"] == "0.0 s"
    assert len(page.root.findall(".//figure[@class='curve']")) == 6


def test_names_that_no_file_can_hold_are_mended(small_run: Path, tmp_path: Path) -> None:
    odd = "/" + 300 * "long"

    odds = {"/imu/data": odd, "/navsat/fix": "/\x01\u202e"}

    def kept(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        return (odds[topic], stamp, data) if topic in odds else None

    bag = changed(small_run / "park_1.bag", tmp_path / "odd.bag", kept)
    page = Page(write_report(bag.rename(tmp_path / os.fsdecode(b"n\xff.bag"))))
    assert page.words(".//h1") == "n?"
    names = {row[0] for row in page.rows(".//section[@id='topics']//table")}
    assert names == {odd[:159] + "…", "/\N{REPLACEMENT CHARACTER}\N{REPLACEMENT CHARACTER}"}


def test_a_pixel_of_no_class_is_counted_as_such(small_run: Path, tmp_path: Path) -> None:
    def change(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        return (topic, stamp, data[:-3] + b"\x01\x02\x03") if topic == TAGS[0] else None

    page = Page(write_report(changed(small_run / "park_1.bag", tmp_path / "odd.bag", change)))
    assert page.rows(".//table[@class='shares']")[0][:2] == ["no class", "< 0.01 %30"]


# ---------------------------------------------------------------------------------------------------------------------
# Writing it


def test_the_page_does_not_depend_on_the_number_of_threads(small_run: Path, tmp_path: Path) -> None:
    bag = only(small_run / "park_1.bag", tmp_path / "some.bag", TAGS[0], POINTS, "/imu/data")
    one, many = (render(gather(open_run(bag), workers, Silent())) for workers in (1, 5))
    assert one == many


def test_memory_does_not_grow_with_the_run(small_run: Path, tmp_path: Path) -> None:
    bag = only(small_run / "park_1.bag", tmp_path / "short.bag", TAGS[0], POINTS, "/imu/data", "/navsat/fix")
    peaks = []
    for number in (1, 2, 8):
        run = open_run(longer(bag, tmp_path / f"{number}.bag", number))
        tracemalloc.start()
        found = read_through(run, 2, Silent())
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert found.pixels[TAGS[0]].sum() == number * 30 * 320 * 184
    assert peaks[2] < 1.15 * peaks[1]


def test_a_page_that_is_there_stays(small_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = only(small_run / "park_1.bag", tmp_path / "some.bag", "/imu/data")
    assert cli.main(["report", str(bag)]) == 0
    made = tmp_path / "some_report.html"
    assert capsys.readouterr().out.startswith(f"{made}: 0.")
    made.write_text("mine")
    assert cli.main(["report", str(bag)]) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"fieldtruth: {made} is there already; choose another --out, or --overwrite replaces it"
    ]
    assert made.read_text() == "mine"
    assert cli.main(["report", str(bag), "--overwrite"]) == 0
    assert made.read_text().startswith("<!DOCTYPE html>")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["some.bag", "some_report.html"]


@pytest.mark.parametrize(
    ("out", "says"),
    [
        ("page.pdf", "must end in .html or .htm"),
        ("none/page.html", "there is no folder"),
        ("folder.html", "is a folder"),
    ],
)
def test_places_where_no_page_can_be(small_run: Path, tmp_path: Path, out: str, says: str) -> None:
    (tmp_path / "folder.html").mkdir()
    with pytest.raises(OutputError, match=re.escape(says)):
        write_report(small_run, out=tmp_path / out)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder.html"]


def test_a_broken_bag_makes_no_page(small_run: Path, tmp_path: Path) -> None:
    whole = (small_run / "park_1.bag").read_bytes()
    for name, data in {"cut": whole[: len(whole) // 2], "empty": b"", "foreign": b"PK\x03\x04" + b"\0" * 5000}.items():
        bag = tmp_path / f"{name}.bag"
        bag.write_bytes(data)
        with pytest.raises(BagError):
            write_report(bag)
    assert not list(tmp_path.glob("*.html*"))
    assert not list(tmp_path.glob(".*"))
