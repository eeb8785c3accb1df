# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Card, page, viewer, shares and preview of a rig with several sensors of each kind, and of rigs without some."""

import base64
import struct
from collections import defaultdict
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from many_sensors import many_rig
from PIL import Image
from report_pages import Page, changed, page_of, words
from report_worlds import EXPERIMENT, plain
from small_park import RIG, small_park

from fieldtruth.bag import decode as read
from fieldtruth.bag.geometry import read_static_frames
from fieldtruth.bag.run import open_run
from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.core.progress import Silent
from fieldtruth.core.readings import Inertial, Odometry
from fieldtruth.drive.plan import pose_on_ground
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.rig import Rig
from fieldtruth.report import preview as content_module
from fieldtruth.report.card import cloud_frames, frame_content, note_lines, sensor_lines
from fieldtruth.report.page import write_report
from fieldtruth.report.page.cloud import accumulate_scans
from fieldtruth.report.preview import collect_content, draw_sheet
from fieldtruth.report.shares import count_classes
from fieldtruth.report.viewer import view
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.lidar.config import LidarConfig

pytestmark = pytest.mark.usefixtures("small_sky", "in_park")

VIEWS = ["pair_left", "pair_right", "front", "rear", "fisheye", "panorama"]
TAGS = {imager.name: imager.topic_of("tag") for imager in many_rig().imagers}
CLOUDS = {"top": "/top/points", "low": "/low/points"}


@pytest.fixture(scope="module")
def page(many_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Page:
    return page_of(many_run, tmp_path_factory.mktemp("many") / "page.html")


# Card ----------------------------------------------------------------------------------------------------------------


def test_card_states_every_sensor_with_its_figures() -> None:
    lines = sensor_lines(many_rig())
    expected = [
        "- Stereo camera `pair`: 160 x 96, 69 x 42 deg, baseline 0.1 m. ",
        "- Camera `front`: 160 x 96, 69 x 42 deg. ",
        "- Camera `rear`: 160 x 96, 69 x 42 deg. ",
        "- Camera `fisheye`: 160 x 96, 190 x 190 deg. ",
        "- Camera `panorama`: 160 x 96, 360 x 180 deg. ",
        "- LiDAR `top`: 256 x 16 rays, 360 x 45 deg, 0.3 to 120 m; all rays leave at the stamp; ",
        "- LiDAR vlp_16 `low`: 904 x 16 rays, 360 x 30 deg (elevations -15 to 15 deg), 1 to 100 m; columns are ",
        "- IMU `imu_front`: 200 Hz in `imu_front_link`, means between stamps.",
        "- IMU `imu_rear`: 100 Hz in `imu_rear_link`, the last millisecond before each stamp.",
        "- GNSS receiver `antenna_left`: 5 Hz, antenna at `antenna_left_link`.",
        "- GNSS receiver `antenna_right`: 5 Hz, antenna at `antenna_right_link`.",
    ]
    assert [line[: len(text)] for line, text in zip(lines, expected, strict=True)] == expected
    front, rear = note_lines(many_rig(), Inertial)
    assert front.startswith("- `imu_front` reads means over the interval")
    assert "expressed in `imu_front_link` at the stamp" in front
    assert rear.startswith("- `imu_rear` reads the last millisecond")
    assert cloud_frames(many_rig()) == "`top_link`, `low_link`: frames of the points, x forward, y left, z up. "
    assert frame_content(many_rig()) == "6 images and 2 clouds"


def test_card_of_a_bare_rig_states_no_sensor_that_it_lacks() -> None:
    bare = Rig(sensors=())
    assert sensor_lines(bare) == ["- No sensor that sees was enabled."]
    assert (note_lines(bare, Inertial), note_lines(bare, Odometry), cloud_frames(bare), frame_content(bare)) == (
        [],
        [],
        "",
        "a pose",
    )


def test_card_of_a_run_names_its_frames_and_topics(many_run: Path) -> None:
    card = (many_run / "DATASET.md").read_text(encoding="utf-8")
    assert "`top_link`, `low_link`: frames of the points" in card
    assert "along the optical axis, of `fisheye`, `panorama` along the ray" in card
    assert "os1" not in card
    assert "/stereo/camera" not in card


# Page ----------------------------------------------------------------------------------------------------------------


def test_page_shows_the_images_of_every_camera(page: Page, many_run: Path) -> None:
    figures = page.root.findall(".//div[@class='stage']/figure")
    assert len(figures) == 2  # at 0.2 and 0.4 s
    for figure in figures:
        assert [words(span) for span in figure.findall(".//span[@class='side']")] == VIEWS
    pngs = [np.asarray(Image.open(BytesIO(base64.b64decode(p))).convert("RGB")) for p in page.images("image/png")]
    assert len(pngs) == 12
    for k, name in enumerate(VIEWS):
        tags = {r.stamp_ns: read.image(r.message) for r in read.read_bag(many_run / "many.bag", [TAGS[name]])}
        assert (pngs[k] == tags[200_000_000]).all(), name
        assert (pngs[6 + k] == tags[400_000_000]).all(), name


def test_images_of_a_camera_with_other_stamps_are_the_nearest(many_run: Path, tmp_path: Path) -> None:
    """The images of front, at 5 Hz, and of rear, at 10 Hz, are 60 ms later than those of the others."""

    def change(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        if not topic.endswith("tag/img_raw"):
            return None
        later = stamp + 60_000_000 * (topic in (TAGS["front"], TAGS["rear"]))
        return topic, later, data[:4] + struct.pack("<2L", *divmod(later, 10**9)) + data[12:]

    page = page_of(with_experiment(many_run, tmp_path, change), tmp_path / "page.html")
    first = page.root.find(".//div[@class='stage']/figure")
    assert first is not None
    shown = [words(span) for span in first.findall(".//span[@class='side']")]
    assert shown == ["pair_left", "pair_right", "front +60 ms", "rear -40 ms", "fisheye", "panorama"]


def with_experiment(
    run: Path, tmp_path: Path, change: Callable[[str, int, bytes], tuple[str, int, bytes] | None]
) -> Path:
    """Folder of a run with a changed bag."""
    folder = tmp_path / run.name
    folder.mkdir()
    changed(run / f"{run.name}.bag", folder / f"{run.name}.bag", change)
    (folder / "experiment.yaml").write_bytes((run / "experiment.yaml").read_bytes())
    return folder


def test_page_counts_pixels_and_points_of_all_sensors(page: Page, many_run: Path) -> None:
    bag = many_run / "many.bag"
    pixels = {name: len(list(read.read_bag(bag, [topic]))) * 160 * 96 for name, topic in TAGS.items()}
    points = sum(r.message.width * r.message.height for r in read.read_bag(bag, list(CLOUDS.values())))
    totals = [words(cell) for cell in page.root.findall(".//table[@class='shares']/tfoot/tr/td")]
    assert totals == [f"{sum(pixels.values()):,}", f"{points:,}"]
    intro = page.words(".//section[@id='classes']/p")
    assert "tag images of all 6 cameras and of every point in the scans of 2 LiDARs" in intro
    figures = page.terms(".//dl[@class='key']")
    assert (figures["stereo pairs"], figures["single images"], figures["LiDAR scans"]) == ("2", "10", "12")


def test_page_has_curves_of_every_imu_and_receiver(page: Page, many_run: Path) -> None:
    curves = page.data("numbers")["curves"]
    own = ["turning", "acceleration"]
    keys = [figure.get("data-key") for figure in page.root.findall(".//figure[@class='curve']")]
    assert keys[4:] == [
        *(f"{key} of {name}" for key in own for name in ("imu_front", "imu_rear")),
        "wheels",
        *(f"position of {name}" for name in ("antenna_left", "antenna_right")),
    ]
    assert set(keys) == set(curves)
    for name in ("imu_front", "imu_rear"):
        readings = [r.message for r in read.read_bag(many_run / "many.bag", [f"/{name}/data"])]
        for axis, (_, values) in zip("xyz", curves[f"turning of {name}"], strict=True):
            assert values == pytest.approx([getattr(m.angular_velocity, axis) for m in readings], rel=1e-4, abs=1e-12)
    notes = [words(note) for note in page.root.findall(".//figure[@class='curve']/figcaption/span[@class='note']")]
    assert "of imu_rear, in its own frame" in notes
    assert "of antenna_left, from the first fix" in notes
    about = page.terms(".//section[@id='path']/dl")
    assert {"First fix of antenna_left", "First fix of antenna_right"} < about.keys()


def test_page_has_the_calibration_of_every_camera(page: Page) -> None:
    cameras = page.root.findall(".//div[@class='camera']")
    assert [words(camera.find("h3")) for camera in cameras] == [f"{name} camera" for name in VIEWS]  # type: ignore[arg-type]
    intro = page.words(".//section[@id='calibration']/p[1]")
    assert "from P of the pair_right camera: 0.1000 m" in intro
    assert "pinholes" not in intro


def test_cloud_has_the_points_of_each_lidar_in_the_world(page: Page, many_run: Path) -> None:
    run = open_run(many_run)
    trajectory, static = run.trajectory, read_static_frames(run)
    found = accumulate_scans(run, trajectory)
    assert found is not None
    assert [name for name, _ in found.parts] == list(CLOUDS)
    first = 0
    for name, count in found.parts:
        own, first = found.xyz[first : first + count], first + count
        seen = []
        for r in read.read_bag(run.bag, [CLOUDS[name]]):
            cloud = read.points(r.message)
            xyz = np.column_stack([cloud[axis] for axis in "xyz"]).astype(np.float64)
            seen.append(
                transforms.transform(trajectory.world_from_base(r.stamp_ns) @ static.base_from(f"{name}_link"), xyz)
            )
        known = {tuple(row) for row in np.concatenate(seen).round(6).tolist()}
        assert count > 1000
        assert all(tuple(row) in known for row in own.round(6).tolist())
    assert first == len(found.xyz)
    parts = page.data("cloud-settings")["sensors"]
    path = page.data("cloud-settings")["count"] - first
    assert [count for _, count in parts] == [*(count for _, count in found.parts), path]
    shown = [words(label.find("span")) for label in page.root.findall(".//fieldset[@id='sensors']/label")]  # type: ignore[arg-type]
    assert shown == list(CLOUDS)


def test_page_of_some_topics_states_what_is_missing(many_run: Path, tmp_path: Path) -> None:
    def kept(topic: str, stamp: int, data: bytes) -> tuple[str, int, bytes] | None:
        return (topic, stamp, data) if topic in ("/imu_rear/data", "/top/points") else None

    page = Page(write_report(with_experiment(many_run, tmp_path, kept)))
    assert "no camera images" in page.words(".//section[@id='images']")
    assert set(page.data("numbers")["curves"]) == {"turning of imu_rear", "acceleration of imu_rear"}
    assert "in the frame top_link" in page.words(".//section[@id='cloud']/p[1]")


# Viewer --------------------------------------------------------------------------------------------------------------


def test_viewer_has_every_sensor_in_its_frame(many_run: Path, tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="the viewer's package is not installed")
    from rerun.chunk import RrdReader

    view(many_run, save=tmp_path / "many.rrd")
    rows: dict[str, int] = defaultdict(int)
    pinholes = set()
    for chunk in RrdReader(str(tmp_path / "many.rrd")).stream():
        rows[chunk.entity_path] += chunk.to_record_batch().num_rows
        if any("Pinhole" in name for name in chunk.to_record_batch().schema.names):
            pinholes.add(chunk.entity_path.rpartition("/")[2])
    base = "/world/base_link"
    assert {name: rows[f"{base}/{name}_link/points"] for name in CLOUDS} == {"top": 4, "low": 8}
    for name in VIEWS:
        assert rows[f"{base}/{name}_link/{name}_link_optical/photograph"] == 2, name  # 5 images per second
        assert rows[f"{base}/{name}_link/{name}_link_optical/tag"] == 2, name
    assert pinholes == {f"{name}_link_optical" for name in ("pair_left", "pair_right", "front", "rear")}
    assert {rows[f"/fixes/{name}"] for name in ("antenna_left", "antenna_right")} == {2}
    assert rows["/curves/imu_front/angular_velocity/x"] == 2 * rows["/curves/imu_rear/angular_velocity/x"] == 84


# Shares and preview --------------------------------------------------------------------------------------------------


def two_of_each() -> Rig:
    eye = CameraConfig(name="front", mount=Mount(xyz=(0.5, 0.0, 0.5)), width=64, height=48)
    back = Mount(xyz=(-0.6, 0.0, 0.5), rpy_deg=(0.0, 0.0, 180.0))
    return Rig(
        sensors=(
            eye,
            CameraConfig(name="rear", mount=back, width=64, height=48),
            LidarConfig(name="top", mount=Mount(xyz=(0.0, 0.0, 0.9)), columns=64, rings=16),
            LidarConfig(name="low", mount=Mount(xyz=(0.6, 0.0, 0.3)), columns=32, rings=8, enabled=False),
        )
    )


def test_shares_count_all_cameras_and_lidars() -> None:
    world = plain()
    poses = [pose_on_ground(world.terrain.field, np.array([x, 3.0, 0.4]), RIG) for x in (0.0, 10.0, 20.0)]
    shares = count_classes(Scene(world), two_of_each(), poses, workers=2)
    assert (shares.pixels[:, Label.GROUND] == 2 * 64 * 24).all()
    assert (shares.pixels[:, Label.SKY] == 2 * 64 * 24).all()
    assert (shares.points[:, Label.GROUND] == 64 * 8 + 32 * 4).all()
    none = count_classes(Scene(world), Rig(sensors=()), poses)
    assert not none.pixels.any()
    assert not none.points.any()


@pytest.mark.parametrize(("rig", "name", "scans"), [(two_of_each(), "front", 5), (Rig(sensors=()), None, 0)])
def test_sheet_shows_the_first_camera_and_every_lidar_of_a_rig(
    monkeypatch: pytest.MonkeyPatch, rig: Rig, name: str | None, scans: int
) -> None:
    monkeypatch.setattr(content_module, "experiments_in", lambda environment: [EXPERIMENT])
    found = collect_content(small_park(), aerial_width=160, rig=rig, spacing=3.0, workers=2, progress=Silent())
    assert (found.imager.name if found.imager else None) == name
    assert len(found.views) == (4 if name else 0)
    assert found.cloud.scans == scans
    assert draw_sheet(found, 1200).shape[1:] == (1200, 3)
