# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Images of traction of a drive whose slip is known, read as WayFAST's format says, and by its loader.

``WAYFAST=FOLDER`` names a copy of https://github.com/matval/WayFAST, whose loader then reads the export.
"""

import csv
import importlib.util
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tiny_runs import TinyRun, image, straight

from fieldtruth.bag.geometry import Lens, Trajectory
from fieldtruth.core.progress import Silent
from fieldtruth.core.readings import Joints
from fieldtruth.core.transforms import pose
from fieldtruth.drive.physics import skid_compensation
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.rig import Rig
from fieldtruth.exporters import Options
from fieldtruth.exporters.experience import places_of, write

SECOND = 1_000_000_000
SPEED, TURN_RATE, SECONDS = 0.5, 0.2, 20
MU, NU = 0.8, 0.6
F, CX, CY, WIDTH, HEIGHT = 50.0, 40.0, 30.0, 81, 81
GROUND = Rig().robot.footprint.xyz[2]
WHEELS = Rig().robot.wheels
LENS = Lens("", WIDTH, HEIGHT, np.array([[F, 0, CX], [0, F, CY], [0, 0, 1]]), np.eye(3), np.eye(3, 4), np.zeros(5), "")


def joints(turn_rate: float = 0.0) -> list[Joints]:
    """Wheels that ask for SPEED / MU and, to the left, for a turn rate [rad/s] over NU."""
    apart = turn_rate / NU * WHEELS.half_track * skid_compensation(WHEELS)
    rate = (SPEED / MU + np.array([-apart, apart, -apart, apart])) / WHEELS.radius
    stamps = [k * SECOND // 50 for k in range(50 * SECONDS + 1)]
    names = ("a", "b", "c", "d")
    return [Joints(stamp_ns=s, header_ns=s, names=names, angle=rate * s / 1e9, speed=rate) for s in stamps]


def arc(turn_rate: float) -> Trajectory:
    """A drive along an arc at SPEED."""
    stamps = np.arange(0, 100 * SECONDS + 1, dtype=np.int64) * 10_000_000
    yaw = turn_rate * stamps / 1e9
    radius = SPEED / turn_rate
    position = np.stack([radius * np.sin(yaw), radius * (1 - np.cos(yaw)), np.zeros(len(yaw))], axis=1)
    zero = np.zeros(len(yaw))
    return Trajectory(stamps, position, np.stack([np.cos(yaw / 2), zero, zero, np.sin(yaw / 2)], axis=1))


def photograph(stamp_ns: int) -> Any:
    """Look along x at the ground."""
    v = np.arange(HEIGHT)[:, None] - CY
    depth = np.broadcast_to(np.where(v > 0, (1.0 - GROUND) * F / np.where(v > 0, v, 1), np.inf), (HEIGHT, WIDTH))
    photo = np.full((HEIGHT, WIDTH, 3), (10, 20, 30), np.uint8)
    return image(stamp_ns, photo=photo, depth=depth.astype(np.float32))


def exported(target: Path, **readings: Any) -> Path:
    """Two photographs of a straight drive, the second of which sees no later place."""
    view = [photograph(2 * SECOND), photograph(SECONDS * SECOND)]
    run = TinyRun(straight(SPEED, SECONDS), {"view": view} | readings, {"view": pose((0.3, 0, 1)) @ OPTICAL}, LENS)
    write([run], target, Options(None, 1, Silent()))
    return target


def read(file: Path) -> NDArray[Any]:
    found = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    assert found is not None
    return found


def test_images_are_the_traction_of_the_pixels_on_the_path(tmp_path: Path) -> None:
    made = exported(tmp_path / "e", joints=joints())
    with (made / "data.csv").open(encoding="utf-8") as file:
        (row,) = csv.reader(file.readlines()[1:])
    assert len(row) == 11
    colour, depth, path, mu, nu = (read(made / name) for name in row[:5])
    assert row[5:7] == ["view", str(2 * SECOND)]
    np.testing.assert_allclose(np.array(row[7:], float), [2 * SPEED, 0, 0, 0], atol=1e-6)
    assert colour[0, 0].tolist() == [30, 20, 10]
    v = np.arange(1, HEIGHT - CY, dtype=int)
    assert depth.dtype == np.uint16
    np.testing.assert_allclose(depth[int(CY) + v, 5], 1000 * (1.0 - GROUND) * F / v, atol=0.51)
    assert not depth[: int(CY) + 1].any()
    with np.load(made / "view" / f"{2 * SECOND}.npz") as file:
        pixel = file["pixel"]
    expected = np.zeros((HEIGHT, WIDTH), np.uint8)
    expected[pixel[:, 1], pixel[:, 0]] = 255
    np.testing.assert_array_equal(path, expected)
    assert 0 < (path > 0).mean() < 0.5
    assert mu.dtype == nu.dtype == np.uint8
    assert set(np.unique(mu).tolist()) == {round(255 * MU)}
    assert set(np.unique(nu).tolist()) == {255}


def test_the_turn_is_the_share_of_what_the_wheels_ask_for() -> None:
    for sign in (1, -1):
        run = TinyRun(arc(sign * TURN_RATE), {"joints": joints(sign * TURN_RATE)}, {})
        found = places_of(run)
        np.testing.assert_allclose(found["turn_slip"], 1 - NU, atol=1e-6)
        np.testing.assert_allclose(found["slip"], 1 - MU, atol=1e-4)
    against = places_of(TinyRun(arc(TURN_RATE), {"joints": joints(-TURN_RATE)}, {}))
    np.testing.assert_allclose(against["turn_slip"], 1 + NU, atol=1e-6)
    assert np.isnan(places_of(TinyRun(straight(SPEED, SECONDS), {"joints": joints()}, {}))["turn_slip"]).all()


def test_without_wheels_there_is_no_table(tmp_path: Path) -> None:
    made = exported(tmp_path / "e")
    assert (made / "frames.jsonl").read_text(encoding="utf-8")
    assert not (made / "data.csv").exists()
    assert not list(made.rglob("*_mu.png"))


@pytest.mark.skipif("WAYFAST" not in os.environ, reason="WAYFAST=FOLDER names no copy of github.com/matval/WayFAST")
def test_wayfasts_loader_reads_it(tmp_path: Path) -> None:
    pytest.importorskip("torch")
    pytest.importorskip("pandas")
    made = exported(tmp_path / "e", joints=joints())
    spec = importlib.util.spec_from_file_location("loader", Path(os.environ["WAYFAST"]) / "utils" / "dataloader.py")
    assert spec is not None
    assert spec.loader is not None
    loader = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loader)
    size = (WIDTH, HEIGHT)
    parameters = SimpleNamespace(
        data_path=str(made), csv_path=str(made / "data.csv"), preproc=False, depth_mean=0.0, depth_std=1.0,
        input_size=size, output_size=size,
    )  # fmt: skip
    data = loader.TraversabilityDataset(parameters, lambda photo: photo)
    assert len(data) == 1
    colour, depth, path, mu, nu, weight = data[0]
    assert colour[0, 0].tolist() == [10, 20, 30]
    np.testing.assert_allclose(depth[0, int(CY) + 1 :, 7], (1.0 - GROUND) * F / np.arange(1, HEIGHT - CY), atol=6e-4)
    assert path.dtype == bool
    assert path.any()
    np.testing.assert_allclose(mu[path], MU, atol=1 / 510 + 1e-9)
    np.testing.assert_allclose(nu[path], 1.0)
    assert (weight[~path] == 0).all()
