# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Data sets of a rig with many sensors: a camera and a LiDAR by name, paired by their stamps."""

from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simplejpeg
from many_recording import with_sensors
from many_sensors import many_rig
from rosbags.highlevel import AnyReader

from fieldtruth.bag.file import BagError
from fieldtruth.core.errors import UnknownNameError
from fieldtruth.datasets import RunDataset, collate, open_runs
from fieldtruth.sensors.camera.sensor import camera_matrix
from fieldtruth.sensors.lidar.config import LidarConfig

RIG = many_rig()
LIDARS = {lidar.name: lidar for lidar in RIG.enabled(LidarConfig)}


def message_at(run: Path, topic: str, stamp_ns: int) -> Any:
    with AnyReader([run / "many.bag"]) as reader:
        for connection, stamp, data in reader.messages([c for c in reader.connections if c.topic == topic]):
            if stamp == stamp_ns:
                return reader.deserialize(data, connection.msgtype)
    raise AssertionError(f"no {topic} at {stamp_ns}")


@pytest.mark.parametrize("camera", [imager.name for imager in RIG.imagers])
def test_camera_is_chosen_by_name(camera: str, faked_many_run: Path) -> None:
    imager = next(imager for imager in RIG.imagers if imager.name == camera)
    dataset = RunDataset(faked_many_run, ("image", "mask", "pose"), camera=camera)
    assert len(dataset) == (6 if camera == "rear" else 3)
    sample = dataset[1]
    message = message_at(faked_many_run, f"{imager.topic}/real/compressed", sample["stamp_ns"])
    photo = simplejpeg.decode_jpeg(message.data.tobytes(), "RGB")
    np.testing.assert_array_equal(sample["image"], photo.transpose(2, 0, 1))
    base_from_camera = np.linalg.inv(sample["world_from_base"]) @ sample["world_from_camera"]
    np.testing.assert_allclose(base_from_camera, imager.base_from_optical, atol=1e-12)


@pytest.mark.parametrize(
    ("camera", "model", "coefficients"),
    [("front", "plumb_bob", 5), ("fisheye", "equidistant", 4), ("panorama", "equirectangular", 0)],
)
def test_calibration_says_which_lens_a_camera_has(
    camera: str, model: str, coefficients: int, faked_many_run: Path
) -> None:
    sample = RunDataset(faked_many_run, ("image", "calibration"), camera=camera)[0]
    config = next(imager.config for imager in RIG.imagers if imager.name == camera)
    assert (sample["distortion_model"], sample["D"].shape) == (model, (coefficients,))
    np.testing.assert_array_equal(sample["K"], camera_matrix(config))
    assert sample["K"].any() == (camera != "panorama")
    pytest.importorskip("torch")
    batch = collate([sample, sample])
    assert batch["distortion_model"] == [model, model]


@pytest.mark.parametrize(("lidar", "frames"), [("top", 6), ("low", 12)])
def test_lidar_is_chosen_by_name(lidar: str, frames: int, faked_many_run: Path) -> None:
    dataset = RunDataset(faked_many_run, ("cloud", "rays", "calibration"), lidar=lidar)
    assert len(dataset) == frames
    sample = dataset[1]
    message = message_at(faked_many_run, LIDARS[lidar].topic, sample["stamp_ns"])
    assert len(sample["cloud"]) == message.width
    first = np.frombuffer(message.data[:12].tobytes(), "<f4")
    np.testing.assert_array_equal(sample["cloud"][0], first)
    assert sample["rays"][:, 2].any() == (lidar == "low")  # only this one spins
    np.testing.assert_allclose(sample["base_from_lidar"], LIDARS[lidar].mount.base_from_sensor, atol=1e-12)


def test_first_sensors_are_the_default(faked_many_run: Path) -> None:
    default = RunDataset(faked_many_run, ("image", "cloud"))[0]
    named = RunDataset(faked_many_run, ("image", "cloud"), camera="pair_left", lidar="top")[0]
    np.testing.assert_array_equal(default["image"], named["image"])
    np.testing.assert_array_equal(default["cloud"], named["cloud"])


def test_sensors_at_different_rates_are_paired_by_stamp(faked_many_run: Path) -> None:
    exact = RunDataset(faked_many_run, ("image", "cloud"), camera="rear", lidar="low")
    assert exact.stamps_ns.tolist() == [k * 100_000_000 for k in range(1, 7)]
    anchored = RunDataset(
        faked_many_run, ("image", "cloud"), camera="rear", lidar="low", anchor="lidar", tolerance_s=0.05
    )
    assert len(anchored) == 12
    apart = [abs(sample["camera_stamp_ns"] - sample["lidar_stamp_ns"]) for sample in anchored]
    assert {*apart} == {0, 50_000_000}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"camera": "frnt"}, "unknown camera 'frnt'; did you mean 'front'? Available: pair_left, pair_right, front, "),
        ({"lidar": "lo"}, "unknown LiDAR 'lo'; did you mean 'low'? Available: top, low"),
    ],
)
def test_unknown_sensor_is_reported_with_the_nearest(options: Any, words: str, faked_many_run: Path) -> None:
    with pytest.raises(UnknownNameError) as caught:
        RunDataset(faked_many_run, **options)
    assert words in str(caught.value)


def test_item_of_a_sensor_that_the_rig_lacks_is_reported(faked_many_run: Path, tmp_path: Path) -> None:
    cameras = with_sensors(faked_many_run, tmp_path / "many", "front")
    with pytest.raises(BagError, match=r"cloud: the rig of .* has no LiDAR"):
        RunDataset(cameras, ("image", "cloud"))
    assert len(RunDataset(cameras)) == 3
    clouds = with_sensors(faked_many_run, tmp_path / "clouds" / "many", "low")
    with pytest.raises(BagError, match=r"image: the rig of .* has no camera"):
        RunDataset(clouds)
    assert len(RunDataset(clouds, ("cloud",))) == 12


def test_extra_that_a_camera_does_not_record_is_reported(faked_many_run: Path) -> None:
    with pytest.raises(BagError, match=r"has no /front/depth; `fieldtruth generate NAME --extras depth` records it"):
        RunDataset(faked_many_run, ("depth",), camera="front")
    assert np.isfinite(RunDataset(faked_many_run, ("depth",), camera="rear")[0]["depth"]).any()


def test_folder_of_runs_has_the_same_sensors(faked_many_run: Path) -> None:
    pytest.importorskip("torch")
    runs = open_runs(faked_many_run.parent, ("image", "cloud", "calibration"), camera="front", lidar="low")
    batch = collate([*islice(runs, 2)])
    assert batch["image"].shape == (2, 3, 96, 160)
    assert batch["base_from_lidar"].shape == (2, 4, 4)
    assert [len(cloud) for cloud in batch["cloud"]] == [len(runs[k]["cloud"]) for k in range(2)]
