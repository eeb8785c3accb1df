# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of the page against known answers."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fieldtruth.bag.file import BagError
from fieldtruth.core import transforms
from fieldtruth.core.classes import CLASSES, PALETTE
from fieldtruth.experiment.rig import Rig
from fieldtruth.report.page.bag_pass import (
    BUCKETS,
    VERTICES,
    Fixes,
    Line,
    Motion,
    class_ids,
    count_pixels,
    decimated,
    draw_curves,
    time_ticks,
)
from fieldtruth.report.page.tables import rpy_deg

SECOND = 10**9


def lines(stamps: Any, values: Any) -> list[Line]:
    return [decimated(stamps, column, (int(stamps[0]), int(stamps[-1]), BUCKETS)) for column in values.T]


def test_decimation_keeps_readings_and_every_extreme() -> None:
    rng = np.random.default_rng(1)
    stamps = np.arange(1, 700_001, dtype=np.int64) * 1_000_000
    values = rng.normal(size=(700_000, 2)).cumsum(axis=0)
    values[123_456, 0], values[654_321, 1] = 1e6, -1e6  # single readings far outside
    for channel, line in enumerate(lines(stamps, values)):
        assert 1000 < len(line.values) <= VERTICES
        assert (np.diff(line.stamps_ns) > 0).all()
        rows = line.stamps_ns // 1_000_000 - 1
        assert (values[rows, channel] == line.values).all()
        spans = np.minimum((stamps - stamps[0]) * 1000 // (stamps[-1] - stamps[0]), 999)
        edges = np.searchsorted(spans, np.arange(1000))
        kept_spans = spans[rows]
        kept_edges = np.searchsorted(kept_spans, np.arange(1000))
        for extreme in (np.minimum, np.maximum):
            assert (extreme.reduceat(values[:, channel], edges) == extreme.reduceat(line.values, kept_edges)).all()


def test_short_series_is_kept_whole_without_nan_and_inf() -> None:
    stamps = np.arange(1, 101, dtype=np.int64) * 20_000_000
    values = np.sin(stamps / 1e8)[:, None]
    (line,) = lines(stamps, values)
    assert (line.stamps_ns == stamps).all()
    values[10], values[20] = np.nan, np.inf
    (line,) = lines(stamps, values)
    assert len(line.values) == 98
    assert np.isfinite(line.values).all()


@pytest.mark.parametrize(("encoding", "order"), [("rgb8", 1), ("bgr8", -1), ("8UC3", -1)])
def test_pixels_are_counted_by_colour(encoding: str, order: int) -> None:
    label = np.random.default_rng(3).integers(1, len(CLASSES), (40, 56)).astype(np.uint8)
    label[:, 30:] = 3
    colours = PALETTE[label]
    colours[0, 0], colours[39, 55] = (1, 2, 3), (0, 255, 1)  # colours without a class
    padded = np.zeros((40, 56 * 3 + 8), np.uint8)
    padded[:, : 56 * 3] = colours[..., ::order].reshape(40, -1)
    message = SimpleNamespace(
        encoding=encoding, width=56, height=40, step=56 * 3 + 8, is_bigendian=0, data=padded.ravel()
    )
    expected = np.bincount(label.ravel(), minlength=18)
    expected[[label[0, 0], label[39, 55]]] -= 1
    expected[0] = 2
    assert count_pixels(message).tolist() == expected.tolist()


def test_tag_image_with_one_byte_per_pixel_is_an_error() -> None:
    message = SimpleNamespace(encoding="mono8", width=2, height=1, step=2, is_bigendian=0, data=np.zeros(2, np.uint8))
    with pytest.raises(BagError, match="mono8"):
        count_pixels(message)


def test_class_ids_come_from_label_or_intensity() -> None:
    both = np.array([(3.0, 7), (4.0, 17), (5.0, 24), (5.0, 0)], [("intensity", "<f4"), ("label", "<u2")])
    assert class_ids(both).tolist() == [7, 17, 0, 0]
    intensity = np.array([3.0, 3.5, -1.0, 200.0, np.nan, 13.0], "<f4")
    assert class_ids(intensity.view([("intensity", "<f4")])).tolist() == [3, 0, 0, 0, 0, 13]
    assert class_ids(np.zeros(2, [("x", "<f4")])).tolist() == [0, 0]


def test_curve_vertices_match_readings_and_ticks() -> None:
    line = Line(np.array([0, 5, 10]) * SECOND, np.array([-3.0, 1.0, 5.0]))
    (curve,) = draw_curves({"height": {"height": line}}, 0, 10 * SECOND)
    x, y = np.array([pair.split(",") for pair in curve.channels[0].path[1:].split("L")], float).T
    assert x.tolist() == [0.0, 500.0, 1000.0]
    zero = next(tick.at for tick in curve.ticks if tick.text == "0")
    two = next(tick.at for tick in curve.ticks if tick.text == "2")
    per_metre = (zero - two) / 2  # SVG y points down
    assert per_metre > 0
    assert y == pytest.approx([zero + 3 * per_metre, zero - per_metre, zero - 5 * per_metre], abs=0.05)
    assert (curve.channels[0].lowest, curve.channels[0].highest) == ("\N{MINUS SIGN}3.00", "5.00")


def test_time_ticks_are_at_their_seconds() -> None:
    ticks = time_ticks(254.5)
    assert [tick.text for tick in ticks] == ["0", "50", "100", "150", "200", "250"]
    assert [tick.at for tick in ticks] == pytest.approx(
        [100 * s / 254.5 for s in (0, 50, 100, 150, 200, 250)], abs=1e-3
    )


def test_nearly_constant_readings_are_drawn_flat() -> None:
    line = Line(np.array([0, 10]) * SECOND, np.array([1.0, 1.0 + 1e-6]))
    (curve,) = draw_curves({"height": {"height": line}}, 0, 10 * SECOND)
    heights = [float(pair.split(",")[1]) for pair in curve.channels[0].path[1:].split("L")]
    assert abs(heights[0] - heights[1]) < 0.1


def odometry(pose: Any, velocity: Any) -> Any:
    x, y, z, w = transforms.xyzw_from_wxyz(transforms.quaternion_wxyz_from_rotation(pose[:3, :3]))
    return SimpleNamespace(
        pose=SimpleNamespace(
            pose=SimpleNamespace(
                position=SimpleNamespace(**dict(zip("xyz", pose[:3, 3], strict=True))),
                orientation=SimpleNamespace(x=x, y=y, z=z, w=w),
            )
        ),
        twist=SimpleNamespace(twist=SimpleNamespace(linear=SimpleNamespace(**dict(zip("xyz", velocity, strict=True))))),
    )


def test_attitude_is_about_fixed_axes_and_heading_is_unwrapped() -> None:
    motion = Motion(from_model_states=False)
    yaws = np.arange(150.0, 230.0, 2.0)
    for k, yaw in enumerate(yaws):
        motion.add(
            k * SECOND // 10, motion.row(odometry(transforms.pose((k, 0.0, 0.5), (3.0, -7.0, yaw)), (0.3, 0.4, 0.0)))
        )
    found = motion.lines((0, 40 * SECOND // 10, BUCKETS))
    assert found["tilt"]["roll"].values == pytest.approx(np.full(40, 3.0))
    assert found["tilt"]["pitch"].values == pytest.approx(np.full(40, -7.0))
    assert found["heading"]["heading"].values == pytest.approx(yaws)
    assert found["speed"]["speed"].values == pytest.approx(np.full(40, 0.5))
    assert found["height"]["height"].values == pytest.approx(np.full(40, 0.5))
    trajectory = motion.trajectory()
    assert trajectory is not None
    assert trajectory.length_m == pytest.approx(39.0)
    assert trajectory.world_from_base(SECOND) == pytest.approx(transforms.pose((10.0, 0.0, 0.5), (3.0, -7.0, 170.0)))


def test_pose_with_zero_quaternion_is_skipped() -> None:
    motion = Motion(from_model_states=False)
    motion.add(0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert motion.trajectory() is None


def test_fixes_are_metres_from_the_first() -> None:
    fixes = Fixes()
    degree = 111_319.49079  # [m] of longitude at the equator: the WGS 84 semi-major axis times pi / 180
    for k, (latitude, longitude, height) in enumerate(
        [(0.0, 8.9, 2.0), (0.0, 8.9 + 10.0 / degree, 2.0), (0.0, 8.9, 5.0)]
    ):
        fixes.add(k * SECOND, (latitude, longitude, height))
    found = fixes.lines((0, 2 * SECOND, BUCKETS))["position"]
    assert found["east"].values == pytest.approx([0.0, 10.0, 0.0], abs=1e-4)
    assert found["north"].values == pytest.approx([0.0, 0.0, 0.0], abs=1e-4)
    assert found["up"].values == pytest.approx([0.0, 0.0, 3.0], abs=1e-4)
    assert fixes.first == (0.0, 8.9, 2.0)


@pytest.mark.parametrize("name", Rig().mounts())
def test_rpy_of_a_mount_matches_its_configuration(name: str) -> None:
    mount = Rig().mounts()[name]
    assert rpy_deg(mount.base_from_sensor[:3, :3]) == pytest.approx(mount.rpy_deg, abs=1e-6)


def test_rpy_round_trip() -> None:
    for rpy in np.random.default_rng(4).uniform((-180, -89, -180), (180, 89, 180), (50, 3)):
        assert rpy_deg(transforms.pose((0, 0, 0), tuple(rpy))[:3, :3]) == pytest.approx(rpy, abs=1e-6)
