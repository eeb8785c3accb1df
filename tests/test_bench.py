# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The benchmark traces the sensors' own rays and gives every figure. No assertion depends on speed."""

import json
import math
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kept_worlds import Kept
from many_sensors import many_rig
from numpy.typing import NDArray
from scaling import image_time_ratio, is_tree, with_trees_around
from small_park import RIG, in_small_park, small_park
from views import poses_on_route

from fieldtruth.bench import Settings, measure, settings_of, table, unit_of
from fieldtruth.bench.sensors import MODES, BareTracer, Mode, Stretches, best_mode, recording, stretches_of
from fieldtruth.core import transforms
from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.drive.simulate import drive
from fieldtruth.experiment.config import metres_from_route
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.embree import Engine, RayScene
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.camera.sensing import IdealCamera
from fieldtruth.sensors.camera.sensor import pixel_directions
from fieldtruth.sensors.lidar.sensing import IdealLidar, ray_directions
from fieldtruth.world.environments import ENVIRONMENTS, Environment
from fieldtruth.world.model import World

pytestmark = pytest.mark.usefixtures("small_sky", "in_park")

EXPERIMENT = in_small_park(rig=RIG, seconds=1.2)
FIGURES = (
    *("lidar_mrays_per_s", "lidar_bare_mrays_per_s", "lidar_over_bare"),
    *("camera_mrays_per_s", "camera_bare_mrays_per_s", "label_image_over_bare", "photograph_over_bare"),
    *("normals_over_bare", "flow_over_bare", "images_per_s", "pairs_per_s", "image_efficiency", "peak_rss_mb"),
)


@pytest.fixture(scope="module")
def world() -> World:
    return small_park()


def spread(rows: int, columns: int) -> NDArray[np.float32]:
    """Directions that fan out about -z and +z, all different."""
    v, u = np.meshgrid(np.linspace(-0.8, 0.8, rows), np.linspace(-0.9, 0.9, columns), indexing="ij")
    rays = np.stack([u, v, np.where(np.arange(columns) % 5 == 0, 1.0, -1.0) * np.ones_like(u)], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    return np.asarray(rays, np.float32)


@pytest.mark.parametrize("mode", MODES, ids=str)
def test_bare_distances_to_a_plane_match_closed_form(mode: Mode) -> None:
    engine = Engine()
    scene, far = RayScene(engine), 500.0
    scene.add_mesh([[-900, -900, 1], [900, -900, 1], [900, 900, 1], [-900, 900, 1]], [[0, 1, 2], [0, 2, 3]])
    scene.commit()
    directions = spread(32, 48)
    tracer = BareTracer(scene.handle, directions, far, mode)
    for pose in (transforms.pose((3, -2, 5), (10, -20, 30)), transforms.pose((1, 1, 8))):
        tracer.trace(pose)
        down = -(directions.astype(float) @ pose[2, :3])
        expected = np.where(down > 0, (pose[2, 3] - 1) / down, far).clip(max=far)
        np.testing.assert_allclose(tracer.distances, expected, rtol=2e-5)


def test_best_mode_and_size_of_tiles() -> None:
    engine = Engine()
    scene = RayScene(engine)
    scene.add_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    scene.commit()
    assert best_mode(scene.handle, spread(16, 16), 9.0, [transforms.pose((0, 0, 1))] * 2) in MODES
    with pytest.raises(ValueError, match="rays must be a multiple of tiles of 4 x 2, got 6 x 16"):
        BareTracer(scene.handle, spread(6, 16), 9.0, Mode(8, 4, True))


def test_bare_rays_equal_those_of_camera_and_lidar(world: World) -> None:
    scene = Scene(world)
    pose = poses_on_route(EXPERIMENT.route, world, RIG, 3)[1]
    camera, world_from_optical = RIG.stereo, pose @ RIG.imagers[0].base_from_optical
    directions = pixel_directions(camera)
    bare = BareTracer(scene.rays.handle, directions, camera.far, Mode(8, 2, True))
    bare.trace(world_from_optical)
    depth = LabelCamera(camera, scene).label(world_from_optical).depth
    seen = np.where(bare.distances < camera.far, bare.distances * directions[..., 2], 0.0)
    assert 0.2 < (depth > 0).mean() <= 1.0
    assert (np.abs(seen - depth) < 1e-3 + 1e-3 * depth).mean() > 0.998

    world_from_lidar = pose @ RIG.lidar.mount.base_from_sensor
    bare = BareTracer(
        scene.rays.handle, ray_directions(RIG.lidar).astype(np.float32), RIG.lidar.max_range, Mode(16, 4, False)
    )
    bare.trace(world_from_lidar)
    scan = IdealLidar(RIG.lidar, scene).scan(world_from_lidar)
    assert len(scan.range_m) == (bare.distances < RIG.lidar.max_range).sum() > 300
    assert (np.abs(bare.distances[scan.column, scan.ring] - scan.range_m) < 2e-3).mean() > 0.998


def test_poses_are_evenly_spaced_on_the_route_and_face_along_it(world: World) -> None:
    poses = np.stack(poses_on_route(EXPERIMENT.route, world, RIG, 4))
    np.testing.assert_allclose(metres_from_route(EXPERIMENT.route), [(-6, 0), (2, 0), (2, 8)], atol=1e-3)
    np.testing.assert_allclose(poses[:, :2, 3], [(-4, 0), (0, 0), (2, 2), (2, 6)], atol=0.05)
    yaw = np.degrees(transforms.yaw_from_rotation(poses[:, :3, :3]))
    np.testing.assert_allclose(yaw, [0, 0, 90, 90], atol=0.1)
    ground = world.terrain.field.height_at(poses[:, 0, 3], poses[:, 1, 3])
    np.testing.assert_allclose(poses[:, 2, 3] - ground, 0.13228, atol=0.03)


def test_table_shows_value_and_unit() -> None:
    lines = table({"lidar_mrays_per_s": 1.5, "lidar_over_bare": 1.41, "peak_rss_mb": 1500.4})
    assert [line.split() for line in lines.splitlines()] == [
        ["figure", "value", "unit"],
        ["lidar_mrays_per_s", "1.50", "Mrays/s"],
        ["lidar_over_bare", "1.41", "x"],
        ["peak_rss_mb", "1500", "MB"],
    ]
    assert [unit_of(name) for name in ("images_per_s", "pairs_per_s", "light_bake_s")] == ["images/s", "pairs/s", "s"]


@pytest.mark.parametrize(
    ("duration_s", "workers", "expected"),
    [
        (60.0, 2, ((5, 15, 25, 35, 45, 55), 2)),
        (59.9, 3, ((4, 14, 24, 34, 44, 54), 2)),
        (2.5, 2, ((0, 1), 6)),
        (0.4, 16, ((0,), 12)),
    ],
)
def test_stretches_are_spread_over_the_drive(
    duration_s: float, workers: int, expected: tuple[tuple[int, ...], int]
) -> None:
    assert stretches_of(duration_s, 12, workers) == expected


def test_rows_of_stretches_are_consecutive_and_each_in_its_second() -> None:
    stamps = np.arange(1, 101) * 40_000_000  # 25 Hz: the 25th is that at 1 s, which ends the first second
    rows = Stretches((0, 2), 3).rows(stamps)
    assert [each.tolist() for each in rows] == [[0, 1, 2], [50, 51, 52]]
    assert [len(each) for each in Stretches((1, 3, 4), 99).rows(stamps)] == [25, 25, 0]


def test_photographs_that_are_timed_are_those_that_are_recorded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Photographs take a time that depends on the pose, bare rays half of it, and nothing else any: the ratio is 2."""
    clock = threading.local()

    def passing(work: Callable[..., Any], share: float) -> Callable[..., Any]:
        def call(self: object, pose: NDArray[np.float64], *others: Any) -> Any:
            clock.now = getattr(clock, "now", 0.0) + share * (2.0 + math.sin(99.0 * pose[0, 3] + pose[1, 3]))
            return work(self, pose, *others)

        return call

    for name in ("perf_counter", "thread_time"):
        monkeypatch.setattr(f"fieldtruth.bench.sensors.{name}", lambda: getattr(clock, "now", 0.0))
    monkeypatch.setattr(IdealCamera, "render", passing(IdealCamera.render, 1.0))
    monkeypatch.setattr(LabelCamera, "label", passing(LabelCamera.label, 0.6))
    monkeypatch.setattr(BareTracer, "trace", passing(BareTracer.trace, 0.5))
    experiment = EXPERIMENT.model_copy(update={"seconds": 2.2})
    found = measure(
        Settings(experiment=experiment.model_copy(update={"rig": Rig(sensors=RIG.enabled(CameraConfig))}), views=3)
    )
    assert found["photograph_over_bare"] == pytest.approx(2.0, rel=1e-9)
    assert found["label_image_over_bare"] == pytest.approx(1.2, rel=1e-9)
    assert found["image_efficiency"] == pytest.approx(0.5, rel=1e-9)


def test_reduced_run_gives_every_figure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    figures = measure(Settings(experiment=EXPERIMENT, views=2))
    assert list(json.loads(json.dumps(figures))) == list(FIGURES)
    assert all(type(value) is float and math.isfinite(value) and value > 0 for value in figures.values())
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("names", [("top", "front", "fisheye"), ("top",)])
def test_figures_are_those_of_the_sensors_that_a_rig_has(names: tuple[str, ...]) -> None:
    sensors = [sensor for sensor in many_rig().sensors if sensor.name in names]
    experiment = EXPERIMENT.model_copy(update={"rig": Rig(sensors=tuple(sensors))})
    figures = measure(Settings(experiment=experiment, views=1))
    lacking = {"pairs_per_s"}
    if "front" not in names:
        of_cameras = ("image", "camera", "photograph", "normals", "flow")
        lacking |= {key for key in FIGURES if any(word in key for word in of_cameras)}
    assert figures.keys() == set(FIGURES) - lacking
    assert all(math.isfinite(value) and value > 0 for value in figures.values())


def test_pixels_outside_the_image_circle_have_finite_bare_rays() -> None:
    fisheye = next(camera for camera in many_rig().enabled(CameraConfig) if camera.name == "fisheye")
    rays = pixel_directions(fisheye)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1.0, rtol=1e-5)
    assert rays[0, 0].tolist() == [0.0, 0.0, 1.0]
    assert (rays[48, :, 2] < 0).any()  # beyond 180 deg


def test_a_recording_has_the_readings_of_every_sensor(world: World, kept: Kept) -> None:
    track = drive(world, EXPERIMENT.model_copy(update={"seconds": 0.4}))
    baked = kept.bake(kept.scene(world), EXPERIMENT.light)
    with recording(baked, track, many_rig(), Stretches((0,), 99), workers=1) as slices:
        slices.make_one(0)
        assert not slices.missing()
        images = [len(each.stamps_ns) for each in slices.streams if len(each.topics) > 1]
        scans = [len(each.stamps_ns) for each in slices.streams if len(each.topics) == 1]
    assert sum(images) == 5 * 2 + 4  # five views at 5 Hz, one at 10 Hz
    assert sum(scans) == 4 + 8


def test_environment_is_measured_with_its_first_experiment() -> None:
    assert settings_of("park").experiment.name == "park_1"
    with pytest.raises(UnknownNameError, match="unknown environment 'prak'; did you mean 'park'"):
        settings_of("prak")


def test_environment_without_experiment_is_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ENVIRONMENTS, "desert", Environment("sand", ENVIRONMENTS["park"].package))
    monkeypatch.setattr("fieldtruth.bench.check_layout", lambda *_: None)  # it has no file
    with pytest.raises(ConfigurationError, match="cannot measure desert: it has no built-in experiment"):
        settings_of("desert")


def test_copies_of_trees_surround_the_world(world: World) -> None:
    many = with_trees_around(world)
    trees = [instance for instance in world.instances if is_tree(world, instance)]
    assert {instance.kind for instance in trees} == {"large_tree", "small_tree"}
    assert many.instances[: len(world.instances)] == world.instances
    copies = many.instances[len(world.instances) :]
    assert len(copies) == 9 * len(trees)
    positions = np.array([copy.world_from_object[:2, 3] for copy in copies])
    assert (np.abs(positions) > 12).any(axis=1).all()
    assert len(np.unique(np.round(positions, 6), axis=0)) == len(copies)
    height_at = world.terrain.field.height_at
    for copy, tree in zip(copies, trees * 9, strict=True):
        move = copy.world_from_object[:2, 3] - tree.world_from_object[:2, 3]
        np.testing.assert_allclose(np.remainder(move + 1e-9, 24.0), 0.0, atol=1e-6)
        above = [float(i.world_from_object[2, 3] - height_at(*i.world_from_object[:2, 3])) for i in (copy, tree)]
        assert above[0] == pytest.approx(above[1], abs=1e-9)


@pytest.mark.slow
def test_ratio_of_image_times_is_finite(world: World) -> None:
    settings = Settings(experiment=EXPERIMENT, views=2)
    ratio = image_time_ratio((with_trees_around(world), settings), (world, settings))
    assert math.isfinite(ratio)
    assert ratio > 0


def test_document_explains_every_figure_with_its_unit() -> None:
    text = (Path(__file__).parents[1] / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    rows = {
        cells[1].strip().strip("`"): cells for cells in (line.split("|") for line in text.splitlines()) if cells[2:]
    }
    for key in FIGURES:
        assert rows[key][2].strip() == unit_of(key)
        assert rows[key][-2].strip()
