# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What was seen of places before, in closed form: a straight drive on a plane, seen by a pinhole; and of a run."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tiny_runs import TinyRun, cloud, image, straight

from fieldtruth.bag.geometry import Lens, Trajectory
from fieldtruth.bag.run import open_run
from fieldtruth.core.progress import Silent
from fieldtruth.core.readings import Joints
from fieldtruth.core.transforms import pose
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.rig import Rig
from fieldtruth.exporters import Options, export
from fieldtruth.exporters.experience import SPACING, places_of, write
from fieldtruth.local_maps.costs import CostMap
from fieldtruth.world_maps.layers import Grid

SECOND = 1_000_000_000
SPEED = 0.5
F, CX, CY, WIDTH, HEIGHT = 100.0, 80.0, 60.0, 161, 161
BASE_FROM_VIEW = pose((0.3, 0.0, 1.0)) @ OPTICAL
GROUND = Rig().robot.footprint.xyz[2]
RADIUS = Rig().robot.outline[1] / 2
LENS = Lens("", WIDTH, HEIGHT, np.array([[F, 0, CX], [0, F, CY], [0, 0, 1]]), np.eye(3), np.eye(3, 4), np.zeros(5), "")


def plane(wall: float = np.inf) -> NDArray[np.float32]:
    """Depth of the ground below the robot, in front of a wall at a distance from the view."""
    v = np.arange(HEIGHT)[:, None] - CY
    depth = np.where(v > 0, (1.0 - GROUND) * F / np.where(v > 0, v, 1.0), np.inf)
    return np.broadcast_to(np.minimum(depth, wall), (HEIGHT, WIDTH)).astype(np.float32)


def view(stamp_ns: int, wall: float = np.inf) -> Any:
    return image(stamp_ns, photo=np.zeros((HEIGHT, WIDTH, 3), np.uint8), depth=plane(wall))


def tiny_run(path: Trajectory | None = None, **readings: Any) -> TinyRun:
    mounts = {"view": BASE_FROM_VIEW, "scan": pose((0.0, 0.0, 1.0))}
    return TinyRun(path or straight(SPEED, 20.0), readings, mounts, LENS)


def lines_of(run: TinyRun, target: Path) -> list[dict[str, Any]]:
    write([run], target, Options(None, 1, Silent()))
    return [json.loads(line) for line in (target / "frames.jsonl").read_text(encoding="utf-8").splitlines()]


def test_a_patch_ahead_is_at_its_pixel_and_is_reached_x_over_v_later(tmp_path: Path) -> None:
    (line,) = lines_of(tiny_run(view=[view(2 * SECOND)]), tmp_path / "e")
    with np.load(tmp_path / "e" / line["file"]) as file:
        pixel, place = file["pixel"], file["place"]
    shown = np.full((HEIGHT, WIDTH), -1)
    shown[pixel[:, 1], pixel[:, 0]] = place
    eye = 2 * SPEED + 0.3
    for number, seconds in zip(line["place"], line["seconds"], strict=True):
        x = number * SPACING
        assert seconds == pytest.approx((x - 2 * SPEED) / SPEED, abs=0.011)
        row = CY + F * (1.0 - GROUND) / (x - eye)
        if x - eye < 4.0:  # farther away a pixel spans several places
            assert shown[round(row), round(CX)] in (number - (abs(row - round(row)) > 0.25), number, number + 1)
    v, u = np.nonzero(shown >= 0)
    distance = (1.0 - GROUND) * F / (v - CY)
    across = (u - CX) / F * distance
    number = shown[v, u]
    apart = np.hypot(distance + eye - number * SPACING, across)
    assert apart.max() <= RADIUS + 0.005
    others = np.abs(distance + eye - np.clip(np.rint((distance + eye) / SPACING), None, 39) * SPACING)
    np.testing.assert_allclose(np.abs(distance + eye - number * SPACING), others, atol=0.006)  # the nearest place
    expected = (np.abs((np.arange(WIDTH) - CX) / F * 2.0) <= np.sqrt(RADIUS**2 - (SPACING / 2) ** 2) - 0.01).sum()
    assert (shown[round(CY + F * (1.0 - GROUND) / 2.0)] >= 0).sum() >= expected


def test_what_is_hidden_or_behind_is_not_seen(tmp_path: Path) -> None:
    (line,) = lines_of(tiny_run(view=[view(2 * SECOND, wall=3.0)]), tmp_path / "e")
    ways = SPACING * np.array(line["place"])
    assert ways.min() > 2 * SPEED
    assert 4.0 < ways.max() <= 1.3 + 3.0 + RADIUS
    assert lines_of(tiny_run(view=[view(20 * SECOND)]), tmp_path / "f") == []


def test_points_of_a_cloud_have_the_places_that_they_are_on(tmp_path: Path) -> None:
    down = GROUND - 1.0
    points = [
        [2.1, 0.2, down],
        [2.1, RADIUS + 0.05, down],
        [2.1, 0.0, down + 0.6],
        [-0.5, 0.0, down],
        [31.0, 0.0, down],
    ]
    (line,) = lines_of(tiny_run(straight(2.0, 20.0), scan=[cloud(SECOND, points)]), tmp_path / "e")
    assert line["place"] == [16]  # 4.1 m is nearest to 4 m
    assert line["xyz"] == [[2.1, 0.2, round(down, 3)]]
    assert line["seconds"] == [pytest.approx(1.0, abs=0.011)]
    with np.load(tmp_path / "e" / line["file"]) as file:
        assert file["point"].tolist() == [0]


def test_costs_of_places_are_those_of_the_drive() -> None:
    amplitude, wave = 0.002, 0.25
    path = straight(SPEED, 20.0)
    x = path.position[:, 0]
    position = np.column_stack([x, np.zeros_like(x), amplitude * np.sin(2 * np.pi * x / wave)])
    stamps = np.arange(0, 20 * SECOND + 1, SECOND // 50)
    angle = 1.25 * SPEED * stamps / 1e9 / Rig().robot.wheels.radius
    joints = [
        Joints(stamp_ns=int(s), header_ns=int(s), names=tuple("abcd"), angle=np.full(4, a), speed=np.zeros(4))
        for s, a in zip(stamps, angle, strict=True)
    ]
    run = tiny_run(Trajectory(path.stamps_ns, position, path.quaternion_wxyz), joints=joints)
    energy = np.arange(1.0, 9.0).reshape(8, 1) * np.ones((1, 2))
    layers = {"energy_v0.5_h000": energy, "energy_v0.5_h180": -energy, "energy_v2_h000": 0 * energy}
    found = places_of(run, CostMap(Grid(0.0, -1.0, 1.0, (8, 2)), layers, Path(), ""))
    inner = slice(4, -4)
    np.testing.assert_allclose(found["rms"][inner], amplitude * (2 * np.pi * SPEED / wave) ** 2 / np.sqrt(2), rtol=0.03)
    np.testing.assert_allclose(found["slip"][inner], 0.2, atol=0.005)
    np.testing.assert_allclose(found["speed"][inner], SPEED, rtol=0.01)
    assert found["energy"][[5, 6, 13]].tolist() == [2.0, 2.0, 4.0]
    np.testing.assert_allclose(np.diff(found["position"][:, 0]), SPACING, atol=0.006)


def test_photographs_of_a_run_are_kept_and_point_to_places(brief_run: Path, tmp_path: Path) -> None:
    made = export(brief_run, "experience", out=tmp_path / "e", workers=1)
    with np.load(made / "places.npz") as file:
        places = dict(file)
    assert np.isfinite(np.concatenate([places[name] for name in ("slip", "rms", "tilt", "speed")])).all()
    lines = [json.loads(line) for line in (made / "frames.jsonl").read_text(encoding="utf-8").splitlines()]
    run = open_run(brief_run)
    assert {line["sensor"] for line in lines} <= {"left", "right", "lidar"}
    for line in lines:
        assert (places["stamp_ns"][line["place"]] > line["stamp_ns"]).all()
        if "photo" in line:
            stored = run[f"stereo/{line['sensor']}"].at(line["stamp_ns"]).jpeg
            assert (made / line["photo"]).read_bytes() == stored
