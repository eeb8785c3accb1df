# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Every example runs, and prints plausible results; the two that record with cameras at full size are marked slow."""

import json
import re
import runpy
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from kept_worlds import Kept
from matplotlib.image import imread
from rosbags.rosbag1 import Reader, Writer

import fieldtruth as ft

pytestmark = pytest.mark.usefixtures("small_sky", "in_park")

EXAMPLES = Path(__file__).parents[1] / "examples"
RunExample = Callable[..., list[str]]
BASELINES = {
    *(
        "augmentation",
        "baseline",
        "frame_arrays",
        "networks",
        "scoring",
        "train_reach",
        "segmentation",
        "train_clouds",
        "train_images",
    ),
}
"""Longer ones; those of networks have tests of their own: test_training.py."""
SCRIPTS = sorted(path for path in EXAMPLES.glob("*.py") if path.stem not in BASELINES)


@pytest.fixture
def _made_once(monkeypatch: pytest.MonkeyPatch, kept: Kept) -> None:
    """Examples use worlds, scenes and light that were made before, and open no window."""
    monkeypatch.setenv("MPLBACKEND", "agg")
    for name, made_once in {"load_world": kept.load_world, "Scene": kept.scene, "bake": kept.bake}.items():
        monkeypatch.setattr(ft, name, made_once)


@pytest.fixture
def run_example(_made_once: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> RunExample:
    """Run an example as a script with arguments, and return the lines that it prints."""

    def run(name: str, *arguments: object) -> list[str]:
        monkeypatch.setattr("sys.argv", [name, *map(str, arguments)])
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return capsys.readouterr().out.splitlines()

    return run


@pytest.fixture
def bare_bag(small_run: Path, tmp_path: Path) -> Path:
    """The first 0.12 s of the small run without images and clouds, as another recorder leaves it."""
    bag = tmp_path / "bare.bag"
    with Reader(ft.open_run(small_run).bag) as source, Writer(bag) as target:
        kept = [c for c in source.connections if not c.topic.startswith(("/stereo", "/os1"))]
        to = {c.id: target.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, md5sum=c.digest) for c in kept}
        for connection, stamp, data in source.messages(kept, stop=source.start_time + 120_000_000):
            target.write(to[connection.id], stamp, data)
    return bag


def test_fifteen_examples_have_at_most_60_lines_and_a_test_each() -> None:
    tests = Path(__file__).read_text(encoding="utf-8")
    assert len(SCRIPTS) == 15
    for script in SCRIPTS:
        assert len(script.read_text(encoding="utf-8").splitlines()) <= 60
        assert f'"{script.name}"' in tests
    assert {path.name for path in EXAMPLES.glob("*.ipynb")} == {"labelled_frame.ipynb", "run_statistics.ipynb"}


def test_labelled_frame_counts_every_point_and_every_pixel_once(run_example: RunExample) -> None:
    rows = [re.split(r"\s{2,}", line) for line in run_example("labelled_frame.py")]
    shares = {row[0]: (float(row[1].rstrip("%")), float(row[2].rstrip("%"))) for row in rows[1:]}
    assert rows[0] == ["class", "points", "pixels"]
    for column in (0, 1):
        assert sum(share[column] for share in shares.values()) == pytest.approx(100, abs=0.05 * len(shares))
    assert shares["sky"][0] == 0
    assert shares["sky"][1] > 5
    assert min(shares["ground"]) > 5


@pytest.mark.slow
def test_whole_run_makes_a_run_that_passes_its_checks(tmp_path: Path, run_example: RunExample) -> None:
    lines = run_example("whole_run.py", "park_1", 0.2, tmp_path)
    assert lines[0].startswith("park_1: 0.2 s")
    assert "      2 /os1_cloud_node/points" in lines
    assert lines[-1] == "all checks pass"


def test_stepping_goes_on_from_the_middle_in_another_way(run_example: RunExample) -> None:
    own, follower = run_example("stepping.py", 1.0)
    assert re.fullmatch(r"1.0 s, 0.[2-5]\d m from the start by the own controller", own)
    assert re.fullmatch(r"0.[0-4]\d m from there, if the follower drives from the middle on", follower)


def test_own_controller_turns_towards_the_trail(run_example: RunExample) -> None:
    [line] = run_example("own_controller.py", 3.0)
    assert re.fullmatch(r"3.0 s, 1.[2-5] m from the start, 100 % of the time on the trail", line)
    follow = runpy.run_path(str(EXAMPLES / "own_controller.py"))["follow"]
    label = np.full((90, 160), ft.Label.GROUND, np.uint8)
    assert follow(label) == (0.0, 0.5)
    label[60:, 20:40] = ft.Label.TRAIL
    assert follow(label) == (0.5, pytest.approx(2.0 * (0.5 - 29.5 / 160)))
    assert follow(label[:, ::-1])[1] == pytest.approx(-follow(label)[1], abs=0.02)


def test_leader_follower_follows_what_it_sees(run_example: RunExample) -> None:
    [line] = run_example("leader_follower.py", 1.0)
    assert re.fullmatch(r"1.0 s, 4.[3-8]\d m from base to base", line)
    follow = runpy.run_path(str(EXAMPLES / "leader_follower.py"))["follow"]
    points = np.array([[4.0, 4.0, 0.0], [2.0, 0.0, 0.0]], np.float32)
    label = np.array([ft.Label.ROBOT, ft.Label.TRAIL], np.uint8)
    cloud = ft.Cloud(stamp_ns=0, header_ns=0, xyz=points, label=label)
    assert follow(cloud) == (1.0, 1.0)
    label[:] = ft.Label.TRAIL
    assert follow(cloud) == (0.0, 0.0)


@pytest.mark.slow
def test_own_meshes_are_seen_by_their_names(tmp_path: Path, run_example: RunExample) -> None:
    pytest.importorskip("trimesh")
    lines = run_example("own_meshes.py", tmp_path)
    seen = [(line[:14].strip(), *map(int, re.findall(r"\d+", line[14:]))) for line in lines]
    room, ground = seen[:7], seen[7:]
    walls = [f"{side} wall" for side in ("north", "south", "west", "east")]
    assert [name for name, *_ in room] == ["floor", *walls, "desk", "bin"]
    assert [name for name, *_ in ground] == ["meshes_ground", "bin", "desk"]
    assert sorted(room[5:]) == sorted(ground[1:])  # the file has the same furniture
    assert (tmp_path / "furniture.glb").stat().st_size > 1000


def test_own_route_is_driven(tmp_path: Path, run_example: RunExample) -> None:
    lines = run_example("own_route.py", tmp_path, 0.2)
    assert lines[0] == "route:"
    assert lines[-1] == f"0.2 s in {tmp_path / 'my_route' / 'my_route.bag'}"


@pytest.mark.slow
def test_fly_track_looks_down_from_the_helix(tmp_path: Path, run_example: RunExample) -> None:
    [line] = run_example("fly_track.py", tmp_path, 0.5)
    figures = re.fullmatch(r"([\d.]+) s in .*; at the end ([\d.]+) m high, (\d+) points in the scan", line)
    assert figures is not None
    duration, height, points = map(float, figures.groups())
    assert (duration, height) == (0.5, 14.2)
    assert points > 5000
    tag = imread(tmp_path / "helix.png")[50:350, 700:]
    assert np.ptp(tag[..., :3].reshape(-1, 3), axis=0).min() > 0.3
    sky = np.abs(tag[..., :3] - 127 / 255).max(axis=-1) < 0.01
    assert sky.mean() < 0.05


@pytest.mark.slow
def test_own_sensors_have_their_rings_and_baseline(tmp_path: Path, run_example: RunExample) -> None:
    [line] = run_example("own_sensors.py", tmp_path, 0.2)
    assert re.fullmatch(r"0.20 m baseline, \d{4,5} points on 32 rings", line)


@pytest.mark.slow
def test_own_environment_has_fewer_objects(run_example: RunExample) -> None:
    default, own = (int(line.split("objects")[0].split()[-1]) for line in run_example("own_environment.py", 30, 0))
    assert own < default


def test_train_loader_shows_a_batch_and_its_loss(small_run: Path, run_example: RunExample) -> None:
    pytest.importorskip("torch")
    lines = run_example("train_loader.py", small_run)
    assert lines[0] == "6 frames"
    assert "image (4, 3, 92, 160) torch.uint8" in lines
    assert "mask (4, 92, 160) torch.int64" in lines
    assert re.fullmatch(r"loss [1-9]\.\d{3}", lines[-1])


def test_slam_input_is_tracked_by_kiss_icp(small_run: Path, run_example: RunExample) -> None:
    pytest.importorskip("kiss_icp")
    [line] = run_example("slam_input.py", small_run)
    clouds, driven, error = (float(x) for x in re.findall(r"[\d.]+", line))
    assert clouds == 12
    assert driven == pytest.approx(0.33, abs=0.05)
    assert error < 0.15


def test_export_two_formats_are_read_back(small_run: Path, tmp_path: Path, run_example: RunExample) -> None:
    clouds, poses = run_example("export_two_formats.py", small_run, tmp_path / "out")
    assert clouds.startswith("12 clouds; class ids of the first: [1, 3, 4")
    assert poses.startswith("60 poses, 0.3")


def test_class_statistics_are_drawn(small_run: Path, tmp_path: Path, run_example: RunExample) -> None:
    [line] = run_example("class_statistics.py", small_run, tmp_path / "shares.png")
    assert int(line.split()[0]) > 200_000
    assert np.ptp(imread(tmp_path / "shares.png")) > 0.5


@pytest.mark.slow
def test_annotate_bag_adds_clouds_and_images(bare_bag: Path, tmp_path: Path, run_example: RunExample) -> None:
    lines = run_example("annotate_bag.py", bare_bag, tmp_path / "annotated.bag")
    assert any(line.endswith("/os1_cloud_node/points") for line in lines)
    assert any(line.endswith("/stereo/camera/left/tag/img_raw") for line in lines)


@pytest.mark.slow
@pytest.mark.usefixtures("_made_once")
@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.ipynb")), ids=lambda path: path.name)
def test_notebooks_run(path: Path, small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / small_run.name).symlink_to(small_run)
    names: dict[str, object] = {}
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
