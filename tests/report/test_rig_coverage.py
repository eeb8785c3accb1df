# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Fields of view and blind spots on flat ground against closed forms and the ray tracer's own directions."""

import math
from typing import Any

import numpy as np
import pytest
from many_sensors import many_rig

from fieldtruth.core import lenses
from fieldtruth.experiment.field_of_view import SensorView
from fieldtruth.experiment.rig import Rig, chassis_box, sensor_views
from fieldtruth.experiment.scanning_config import ScanningConfig
from fieldtruth.report.rig.picture import (
    draw_rig,
    ground_classes,
    ground_coverage,
    ground_height,
    ground_hits,
    nearest_ground,
)
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import ray_directions


def rig_of(**sensor: Any) -> Rig:
    return Rig.model_validate({"sensors": [{"name": "view"} | sensor]})


def only_eye(rig: Rig) -> SensorView:
    [view] = sensor_views(rig)
    return view


@pytest.mark.parametrize("height", [0.5, 0.826, 2.0])
@pytest.mark.parametrize("lowest", [-15.0, -22.5, -46.2])
def test_the_blind_circle_of_a_lidar_has_the_radius_of_its_lowest_beam(height: float, lowest: float) -> None:
    rig = rig_of(kind="lidar", elevations_deg=[10.0, 0.0, lowest], mount={"xyz": [1.0, -0.5, height]})
    ground, radius = ground_height(rig), (height + 0.13228) / math.tan(math.radians(-lowest))
    assert nearest_ground(only_eye(rig), ground) == pytest.approx(radius, rel=1e-12)
    # The plan agrees: nothing is seen within the circle, everything outside up to the horizon.
    coverage = ground_coverage(rig, half=8.0, step=0.1)
    x, y = np.meshgrid(coverage.axis, coverage.axis)
    distance = np.hypot(x - 1.0, y + 0.5)
    np.testing.assert_array_equal(coverage.in_view[0], distance >= radius)


def test_rings_of_the_plan_are_where_the_rays_of_the_scan_meet_the_ground() -> None:
    rig = many_rig()
    ground = ground_height(rig)
    for lidar, view in zip(rig.enabled(LidarConfig), sensor_views(rig), strict=False):
        origin, rays = view.position, ray_directions(lidar) @ view.base_from_sensor[:3, :3].T
        down = rays[rays[..., 2] < -0.1]
        hits = origin + down * ((ground - origin[2]) / down[:, 2])[:, None]
        hits = hits[np.linalg.norm(hits - origin, axis=1) > lidar.min_range]
        assert view.sees(hits).all()
        found = ground_hits(view, ground)
        assert np.nanmax(np.abs(found[..., 2] - ground)) < 1e-9
        nearest = np.hypot(*(hits - origin)[:, :2].T).min()
        assert nearest_ground(view, ground) == pytest.approx(nearest, rel=1e-2)


@pytest.mark.parametrize("pitch", [0.0, 20.0, 60.0])
def test_a_camera_sees_the_ground_between_its_lower_and_upper_border(pitch: float) -> None:
    rig = rig_of(kind="camera", mount={"xyz": [2.0, 0.0, 0.8], "rpy_deg": [0.0, pitch, 0.0]})
    height, half = 0.8 + 0.13228, 21.0
    coverage = ground_coverage(rig, half=10.0, step=0.05)
    ahead = coverage.axis[coverage.in_view[0][len(coverage.axis) // 2]] - 2.0  # on y = 0
    near = height / math.tan(math.radians(pitch + half))
    assert nearest_ground(only_eye(rig), ground_height(rig)) == pytest.approx(abs(near), abs=0.02)
    assert ahead.min() == pytest.approx(near, abs=0.051)
    far = height / math.tan(math.radians(pitch - half)) if pitch > half else 8.0  # the end of the plan
    assert ahead.max() == pytest.approx(far, abs=0.051)


def test_fields_of_view_end_where_the_rays_of_the_image_do() -> None:
    for view in sensor_views(many_rig()):
        rays, config = view.rays(), view.config
        if isinstance(config, ScanningConfig):
            assert view.sees(view.position + 5.0 * rays.reshape(-1, 3)).all()
            continue
        within = rays[1:-1, 1:-1].reshape(-1, 3)
        assert view.sees(view.position + 5.0 * within[np.isfinite(within[:, 0])]).all(), view.name
        if config.lens.model == "pinhole":
            u, v = np.array([-0.6, config.width - 0.4, 10.0, 10.0]), np.array([10.0, 10.0, -0.6, config.height - 0.4])
            beyond = lenses.directions(config.projection, u, v) @ view.base_from_sensor[:3, :3].T
            assert not view.sees(view.position + 5.0 * beyond).any()
            assert not view.sees(view.position - 5.0 * within).any()  # what is behind also has image points


def test_what_looks_back_sees_ground_behind_the_robot() -> None:
    rig = rig_of(kind="camera", mount={"xyz": [-0.6, 0.0, 0.8], "rpy_deg": [0.0, 20.0, 180.0]})
    coverage = ground_coverage(rig, half=5.0, step=0.1)
    rows, columns = np.nonzero(coverage.in_view[0])
    assert len(rows)
    assert coverage.axis[columns].max() < -0.6
    assert abs(coverage.axis[rows].mean()) < 0.01
    left = rig_of(kind="camera", mount={"xyz": [0.0, 0.5, 0.8], "rpy_deg": [0.0, 20.0, 90.0]})
    rows, columns = np.nonzero(ground_coverage(left, half=5.0, step=0.1).in_view[0])
    assert coverage.axis[rows].min() > 0.5


def test_the_hull_hides_ground_from_a_low_lidar_beside_it() -> None:
    rig = rig_of(kind="lidar", elevations_deg=[5.0, -60.0], mount={"xyz": [0.7, 0.0, 0.1]})
    coverage = ground_coverage(rig, half=4.0, step=0.1)
    middle = len(coverage.axis) // 2
    seen = coverage.seen(scans=True)
    ahead, behind = coverage.axis > 1.0, coverage.axis < -1.0
    assert seen[middle][ahead].all()
    assert not seen[middle][behind].any()
    assert coverage.in_view[0, middle][behind].all()
    # From above the hull's top, the ground is hidden as far as the line over its rear edge reaches.
    high = rig_of(kind="lidar", elevations_deg=[5.0, -80.0], mount={"xyz": [0.0, 0.0, 1.0]})
    hidden = ground_coverage(high, half=4.0, step=0.02).hidden[0]
    box, axis = chassis_box(high), np.linspace(-4.0, 4.0, 401)
    top = float(box.centre[2] + box.size[2] / 2)
    reach = 0.5 * float(box.size[0]) * (1.0 + 0.13228) / (1.0 - top)
    assert axis[hidden[200]].min() == pytest.approx(-reach, abs=0.021)


def test_every_point_of_the_ground_has_one_class() -> None:
    coverage = ground_coverage(many_rig(), half=5.0, step=0.1)
    classes = ground_classes(coverage)
    np.testing.assert_array_equal(sum(mask.astype(int) for mask in classes.values()), 1)
    assert classes["clouds and images"].any()
    none = ground_classes(ground_coverage(Rig.model_validate({"sensors": []}), half=2.0, step=0.1))
    assert none["blind"].all()


def colours(image: np.ndarray[Any, np.dtype[np.uint8]]) -> set[tuple[int, ...]]:
    packed = np.unique(image.reshape(-1, 3).astype(np.int64) @ [1 << 16, 1 << 8, 1]).tolist()
    return {(pixel >> 16, pixel >> 8 & 255, pixel & 255) for pixel in packed}


def test_the_picture_shows_blind_ground_only_where_there_is_some() -> None:
    blind, camera = (0xF4, 0xC7, 0xC3), (0xFB, 0xE6, 0xB8)
    picture = draw_rig(Rig(), "paper", pixels=900)
    assert picture.shape[1:] == (900, 3)
    assert blind in colours(picture)
    many = colours(draw_rig(many_rig(), "many", pixels=900))
    assert blind not in many
    assert camera in many


@pytest.mark.parametrize(
    "sensors",
    [
        [],
        [{"kind": "lidar", "name": "fan", "rings": 1, "mount": {"xyz": [0.6, 0.0, 0.5], "rpy_deg": [0.0, 90.0, 0.0]}}],
        [{"kind": "camera", "name": "sky", "mount": {"xyz": [0.4, 0.0, 0.5], "rpy_deg": [0.0, -90.0, 0.0]}}],
        [{"kind": "camera", "name": f"c{k}", "mount": {"xyz": [0.4, 0.0, 0.6]}} for k in range(3)],
    ],
    ids=["none", "fan", "sky", "more than are listed"],
)
def test_odd_rigs_can_be_drawn(sensors: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fieldtruth.report.rig.picture._ROWS", 2)
    robot = "husky" if sensors else "generic_differential"
    picture = draw_rig(Rig.model_validate({"robot": robot, "sensors": sensors}), "odd", pixels=600)
    assert len(colours(picture)) > 20
