# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Videos as OpenCV and Pillow decode them, against the images and scans of the bag.

A camera sees a walker, whose script takes it across at 1.4 m/s; scans are at half the rate of the images.
"""

import shutil
from pathlib import Path
from typing import Any, Final

import av
import cv2
import numpy as np
import pytest
from export_bags import copied
from numpy.typing import NDArray
from PIL import Image
from sense_worlds import make_world

from fieldtruth import pipeline
from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import Run, open_run
from fieldtruth.core import transforms
from fieldtruth.core.classes import PALETTE, Label
from fieldtruth.core.errors import OutputError
from fieldtruth.experiment.config import Experiment
from fieldtruth.exporters import export
from fieldtruth.exporters.video import times
from fieldtruth.exporters.video_frames import VideoFrames, depth_colours
from fieldtruth.report.drawing.cloud import looking
from fieldtruth.report.drawing.style import NIGHT

WIDTH, HEIGHT, LINE = 160, 121, 20
U1 = NDArray[np.uint8]
LIDAR: Final = {"kind": "lidar", "columns": 512, "rings": 64, "max_range": 20.0, "rate_hz": 5}
EYE: Final = {"kind": "camera", "name": "eye", "width": WIDTH, "height": HEIGHT, "rate_hz": 10, "depth": True,
              "mount": {"xyz": [0.3, 0.0, 0.5]}}  # fmt: skip
BASE: Final[list[dict[str, Any]]] = [{"kind": "imu"}, {"kind": "gnss"}]
ANNA: Final = {"kind": "person", "script": [{"at_s": 0.0, "xy": (4.0, -1.4)}, {"at_s": 2.0, "xy": (4.0, 1.4)}]}


def experiment(sensors: list[dict[str, Any]]) -> Experiment:
    return Experiment.model_validate({
        "name": "seen", "environment": "park", "seconds": 0.75, "actors": {"anna": ANNA}, "rig": {"sensors": sensors},
        "route": {"metres": {"start": (0, 0), "waypoints": [(9, 0)]}}, "control": {"speed": 0.1},
    })  # fmt: skip


@pytest.fixture(name="run", scope="module")
def _run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    made = experiment([*BASE, LIDAR, EYE])
    return open_run(pipeline.generate(made, tmp_path_factory.mktemp("run"), world=make_world(), workers=2).parent)


@pytest.fixture(name="video", scope="module")
def _video(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export(run.folder, "video", out=tmp_path_factory.mktemp("video") / "seen.mp4", workers=2)


def decoded(path: Path) -> tuple[list[U1], list[float], float]:
    """Frames in RGB, their times [ms] and the rate [Hz]."""
    file, frames, found = cv2.VideoCapture(str(path)), list[U1](), list[float]()
    while (read := file.read())[0]:
        frames.append(np.asarray(read[1][..., ::-1], np.uint8))
        found.append(file.get(cv2.CAP_PROP_POS_MSEC))
    return frames, found, file.get(cv2.CAP_PROP_FPS)


def error(one: U1, other: U1) -> float:
    return float(np.abs(one.astype(float) - other).mean())


def panel(frame: U1, row: int, column: int) -> U1:
    return frame[row * HEIGHT : (row + 1) * HEIGHT, column * WIDTH : (column + 1) * WIDTH]


def test_video_has_the_frames_of_the_camera_at_their_stamps(run: Run, video: Path) -> None:
    frames, found, rate = decoded(video)
    stamps = run["eye"].stamps_ns
    assert len(frames) == len(stamps) == 7
    assert rate == pytest.approx(10.0)
    assert found == pytest.approx((stamps - stamps[0]) / 1e6, abs=0.02)
    assert {frame.shape for frame in frames} == {(2 * HEIGHT + LINE, 2 * WIDTH, 3)}


def test_panels_are_photograph_tags_and_depth_of_each_stamp(run: Run, video: Path) -> None:
    """The walker moves by 5 pixels from frame to frame; a frame too early or late is wrong by more."""
    for k, frame in enumerate(decoded(video)[0]):
        image, later = run["eye"][k], run["eye"][(k + 1) % 7]
        tags = panel(frame, 0, 1)
        assert error(panel(frame, 0, 0), image.photo) < 4.0
        assert error(tags, PALETTE[image.label]) < 0.6 * error(tags, PALETTE[later.label])
        inner = cv2.erode((image.label == Label.PERSON).astype(np.uint8), np.ones((7, 7)))
        v, u = map(int, np.argwhere(inner)[0])
        assert tags[v, u] == pytest.approx(PALETTE[Label.PERSON], abs=16)  # also within the chroma's 2 x 2 pixels
        assert error(panel(frame, 1, 0), depth_colours(image.depth)) < 8.0


def test_scan_is_the_last_one_that_began_and_has_boxes_of_what_moves(run: Run) -> None:
    frames = [panel(VideoFrames(run).draw(k), 1, 1) for k in range(4)]
    assert (frames[0] == NIGHT).all()  # at 0.1 s, before the first scan
    assert np.array_equal(frames[1], frames[2])  # at 0.2 and 0.3 s
    assert not np.array_equal(frames[1], frames[3])
    (mover,), cloud = run.movers, run["lidar"][0]
    assert cloud.stamp_ns == 200_000_000
    corners = mover.box(run.movers.at(cloud.stamp_ns)[mover.object_id])
    base = run.trajectory.world_from_base(cloud.stamp_ns)
    assert abs(base[1, 0]) < 0.02  # it drives along x
    view = looking((13.0, 0.0, -4.5))
    view[:3, 3] = base[:3, 3] + [-7.0, 0.0, 4.5]
    x, y, z = transforms.transform(transforms.inverse(view), corners.centre + corners.size / 2 * [1, 1, 1])
    focal = WIDTH / 2 / np.tan(np.radians(37.5))
    u, v = round(focal * x / z + WIDTH / 2 - 0.5), round(focal * y / z + HEIGHT / 2 - 0.5)
    white = (frames[1] == 255).all(axis=-1)
    assert white[v - 1 : v + 2, u - 1 : u + 2].any()
    assert 20 < white.sum() < 300
    person = (np.abs(frames[1].astype(int) - PALETTE[Label.PERSON]) < 60).all(axis=-1)
    assert person.sum() > 10  # 17 at a distance of 12 m from the view


def test_clouds_without_classes_and_scans_without_poses_are_not_drawn(run: Run, tmp_path: Path) -> None:
    def unlabelled(topic: str, stamp: int, data: bytes) -> bytes:
        return data.replace(b"label", b"lobel").replace(b"intensity", b"intensitx") if "points" in topic else data

    def late(topic: str, stamp: int, data: bytes) -> bytes | None:
        return None if topic in ("/ground_truth/odom", "/gazebo/model_states") and stamp < 300_000_000 else data

    for name, change in (("plain", unlabelled), ("late", late)):
        (tmp_path / name).mkdir()
        copied(run.bag, tmp_path / name / run.bag.name, change)
        shutil.copy(run.folder / "experiment.yaml", tmp_path / name)
    frame = VideoFrames(open_run(tmp_path / "plain")).draw(3)
    assert frame.shape == (HEIGHT + LINE + 1, 3 * WIDTH, 3)
    drawn = VideoFrames(open_run(tmp_path / "late"))
    assert (panel(drawn.draw(2), 1, 1) == NIGHT).all()  # a scan at 0.2 s, poses from 0.3 s on
    assert np.array_equal(panel(drawn.draw(3), 1, 1), panel(VideoFrames(run).draw(3), 1, 1))


def test_pyav_without_x264_is_refused_in_one_line(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(av, "codecs_available", {"mpeg4"})
    with pytest.raises(OutputError, match=r"^PyAV is here without libx264; run: pip install .*'fieldtruth\[video\]'$"):
        export(run.folder, "video", out=tmp_path / "out.mp4")
    assert not list(tmp_path.iterdir())


def test_sizes_are_reduced_to_a_largest_width(run: Run) -> None:
    small = VideoFrames(run, widest=90).draw(3)
    assert small.shape == (2 * (HEIGHT // 2) + LINE, WIDTH, 3)
    tags = small[: HEIGHT // 2, WIDTH // 2 :]
    assert np.array_equal(tags, PALETTE[run["eye"][3].label[: HEIGHT // 2 * 2 : 2, ::2]])


def test_depth_has_colours_by_its_logarithm() -> None:
    depth = np.array([[0.5, 100.0, 7.07106781, np.inf, 0.1, 1e4]], np.float32)
    red, blue, green, sky, nearer, farther = depth_colours(depth)[0].astype(int)
    assert red[0] > 4 * max(1, red[2])
    assert blue[2] > blue[0]
    assert green[1] == green.max()
    assert (sky == 0).all()
    assert (nearer == red).all()
    assert (farther == blue).all()


def test_times_are_those_of_the_stamps_also_where_a_frame_is_lost() -> None:
    stamps = np.array([100, 140, 180, 260]) * 10**6
    ticks, lasts, rate = times(stamps)
    assert ticks.tolist() == [0, 3600, 7200, 14400]
    assert lasts.tolist() == [3600, 3600, 7200, 3600]
    assert rate == 25
    assert times(np.array([5]))[2] == 1
    assert times(np.round(np.arange(1, 9) * 1e9 / 30).astype(np.int64))[2] == 30


def test_webp_has_every_other_frame_for_its_time(run: Run, tmp_path: Path) -> None:
    made = export(run.folder, "webp", out=tmp_path / "seen.webp", workers=2)
    with Image.open(made) as file:
        assert (file.n_frames, file.size) == (4, (2 * WIDTH, 2 * HEIGHT + LINE))  # type: ignore[attr-defined]
        file.seek(1)
        tags = np.asarray(file.convert("RGB"))[:HEIGHT, WIDTH:]
        assert file.info["duration"] == 200
    label = run["eye"][2].label
    assert error(tags, PALETTE[label]) < 0.6 * error(tags, PALETTE[run["eye"][3].label])


def test_runs_without_a_camera_are_refused_in_one_line(tmp_path: Path) -> None:
    bag = pipeline.generate(experiment([*BASE, LIDAR]), tmp_path / "runs", world=make_world(), workers=1)
    for to in ("video", "webp"):
        with pytest.raises(BagError, match=r"has no camera, and frames of a video are photographs$"):
            export(bag, to, out=tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["runs"]


def test_other_sizes_are_refused_and_leave_nothing(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(VideoFrames, "_shape", (HEIGHT, WIDTH + 1))
    with pytest.raises(BagError, match=r"the photograph at \d+ ns of .* has another size than the first"):
        export(run.folder, "video", out=tmp_path / "out.mp4")
    with pytest.raises(OutputError, match="takes one run"):
        export([run.folder, run.folder], "video", out=tmp_path / "out.mp4")
    assert not list(tmp_path.iterdir())
