# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs with normals and flow: from bag to data set, from any number of workers, and what `validate` finds wrong."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from changed_bags import bag_in, messages_in, rewritten
from numpy.typing import NDArray
from small_park import in_small_park

from fieldtruth.bag import decode as read
from fieldtruth.bag.messages import STORE
from fieldtruth.bag.reader import RawMessage
from fieldtruth.bag.run import open_run
from fieldtruth.core import transforms
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.datasets import RunDataset
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.exporters import export
from fieldtruth.pipeline import generate
from fieldtruth.sensors.camera import sensor as write
from fieldtruth.validation import Check
from fieldtruth.validation.runner import validate

pytestmark = pytest.mark.usefixtures("small_sky", "in_park")

EXTRAS = ("depth", "instances", "normals", "flow")
LEFT = "/stereo/camera/left"


def experiment(*extras: str, **sensor: Any) -> Experiment:
    """0.8 s, of which slices are made apart, with images every 80 ms."""
    camera = {"width": 96, "height": 64, "rate_hz": 12.5, **dict.fromkeys(extras, True), **sensor}
    return in_small_park(seconds=0.8, rig={"cameras": camera, "lidar": {"enabled": False}})


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Folders of runs with all extras, by one worker and by two, without them, and with a clock that loses images."""
    lossy = {"clock": {"offset_s": 0.01, "drop_share": 0.4}}
    given: dict[str, tuple[Experiment, int]] = {
        "one": (experiment(*EXTRAS), 1),
        "two": (experiment(*EXTRAS), 2),
        "plain": (experiment(), 2),
        "lossy": (experiment(*EXTRAS, **lossy), 2),
    }
    return {
        name: generate(made, tmp_path_factory.mktemp(name), workers=workers).parent
        for name, (made, workers) in given.items()
    }


def images(folder: Path, part: str) -> dict[int, Any]:
    """Messages of the left camera by their stamp in the bag [ns]."""
    return {each.stamp_ns: each.message for each in read.read_bag(bag_in(folder), [f"{LEFT}/{part}"])}


def test_bytes_depend_neither_on_workers_nor_on_the_extras(runs: dict[str, Path]) -> None:
    one, two, plain = (messages_in(runs[name]) for name in ("one", "two", "plain"))
    assert bag_in(runs["one"]).read_bytes() == bag_in(runs["two"]).read_bytes()
    assert one == two
    assert {topic: one[topic] for topic in plain} == plain
    sides = ("left", "right")
    assert one.keys() - plain.keys() == {f"/stereo/camera/{side}/{extra}" for side in sides for extra in EXTRAS}


@pytest.mark.parametrize("name", ["one", "lossy"])
def test_flow_in_the_bag_leads_to_the_next_recorded_image(runs: dict[str, Path], name: str) -> None:
    """With depth and poses of the bag, and the pinhole's formula written out."""
    run = open_run(runs[name])
    imager, trajectory = run.rig.imagers[0], run.trajectory
    depths, flows, ids = (images(runs[name], part) for part in ("depth", "flow", "instances"))
    stamps, lens = sorted(flows), imager.config.projection
    assert len(stamps) == 10 if name == "one" else 3 < len(stamps) < 10
    v, u = np.mgrid[:64, :96].astype(float)
    moved = []
    for now, later in pairwise(stamps):
        poses = [trajectory.world_from_base(stamp) @ imager.base_from_optical for stamp in (now, later)]
        z = read.depth(depths[now]).astype(float)
        points = np.stack([(u - lens.cx) / lens.fx * z, (v - lens.cy) / lens.fy * z, z], axis=-1)[np.isfinite(z)]
        x, y, z_later = transforms.transform(transforms.inverse(poses[1]) @ poses[0], points).T
        due = np.stack([lens.cx + lens.fx * x / z_later, lens.cy + lens.fy * y / z_later], axis=-1)
        flow = read.flow(flows[now])
        target = (np.stack([u, v], axis=-1) + flow)[np.isfinite(z)]
        known = ~np.isnan(target[:, 0])
        assert np.abs(target - due)[known].max() < 1e-3
        inside = (np.abs(due - [47.5, 31.5]) < [47.9, 31.9]).all(axis=1)
        assert known[inside].mean() > 0.8
        assert not known[(np.abs(due - [47.5, 31.5]) > [48.1, 32.1]).any(axis=1)].any()
        column, row = np.rint(target[known]).astype(int).T.clip(0, [[95], [63]])
        same = read.instances(ids[later])[row, column] == read.instances(ids[now])[np.isfinite(z)][known]
        assert same.mean() > 0.8
        moved.append(np.nanmax(np.abs(flow)))
    assert max(moved) > 0.3
    assert np.isnan(read.flow(flows[stamps[-1]])).all()


def test_a_data_set_and_files_have_them(runs: dict[str, Path], tmp_path: Path) -> None:
    normals, flows = (images(runs["one"], part) for part in ("normals", "flow"))
    sample = RunDataset(runs["one"], items=("image", "normals", "flow"))[3]
    stamp = sorted(flows)[3]
    assert np.array_equal(sample["normals"], read.normals(normals[stamp]).transpose(2, 0, 1))
    assert np.array_equal(sample["flow"], read.flow(flows[stamp]).transpose(2, 0, 1), equal_nan=True)
    made = export(runs["one"], "files", out=tmp_path / "files")
    for folder in ("normals_left", "flow_right", "flow_left_raw"):
        assert len(list((made / folder).iterdir())) == 10
        assert folder in (made / "README.txt").read_text()
    raw = (made / "flow_left_raw" / f"{stamp}.flo").read_bytes()
    assert len(raw) == 12 + 64 * 96 * 8


def test_validate_passes_and_finds_wrong_normals_and_flow(runs: dict[str, Path], tmp_path: Path) -> None:
    def results(folder: Path, samples: int) -> dict[str, Check]:
        return {check.name: check for check in validate(folder, samples=samples)}

    for name in ("one", "lossy"):
        good = results(runs[name], samples=5)
        assert not [check for check in good.values() if check.passed is False]
        assert good["normals"].passed
        assert good["optical flow"].passed
    assert "normals" not in results(runs["plain"], samples=3)

    def changed(part: str, change: Callable[[NDArray[Any]], NDArray[Any]]) -> dict[str, Check]:
        def of_message(raw: RawMessage, k: int) -> RawMessage:
            if raw.topic != f"{LEFT}/{part}":
                return raw
            message: Any = STORE.deserialize_ros1(raw.data, raw.msgtype)
            pixels = change(getattr(read, part)(message).copy())
            data = getattr(write, part)(k, read.stamp_ns(message.header), message.header.frame_id, pixels)
            return raw._replace(data=data)

        wrong = rewritten(runs["one"], tmp_path / f"{part}{change(np.ones((1, 1, 3))).sum()}", of_message)
        return results(wrong, samples=3)

    assert changed("normals", lambda pixels: -pixels)["normals"].passed is False
    assert changed("flow", lambda pixels: 1.5 * pixels)["optical flow"].passed is False


def test_frames_have_no_next_image() -> None:
    values = load_experiment("park_1").model_dump() | {"route": None, "frames": {"count": 3}, "seconds": None}
    values["rig"] = {"lidar": {"spinning": False}}
    with pytest.raises(ConfigurationError, match="frames need flow: false of stereo, as no frame follows another"):
        with_overrides(Experiment.model_validate(values), extras=["flow"])
