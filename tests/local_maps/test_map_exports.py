# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Maps around the robot as topics, in WebDataset and in Parquet, read back by libraries that are not ours."""

import gc
import shutil
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from numpy.typing import NDArray
from pyarrow import parquet
from rosbags.highlevel import AnyReader
from rosbags.interfaces import ConnectionExtRosbag1

from fieldtruth.exporters import MapOptions, export, local_maps
from fieldtruth.local_maps import LocalMap, LocalMaps

pytestmark = pytest.mark.usefixtures("in_park")
OPTIONS = MapOptions(side=6.0, resolution=0.25)
N = 24


@pytest.fixture(scope="module")
def maps(brief_run: Path, in_park: None) -> list[LocalMap]:
    return list(LocalMaps(brief_run, side=6.0, resolution=0.25, workers=1))


def grid_of(message: Any) -> NDArray[np.int8]:
    """Values over x and y of nav_msgs/OccupancyGrid, as ROS defines it: row by row, x within a row."""
    values = np.asarray(message.data, np.int8).reshape(message.info.height, message.info.width)
    return np.asarray(values.T)


def test_topics_have_the_cells_of_the_maps(brief_run: Path, tmp_path: Path, maps: list[LocalMap]) -> None:
    bag = export(brief_run, "local-maps-bag", out=tmp_path / "park_1_local_maps.bag", workers=1, maps=OPTIONS)
    found: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([bag]) as stored:
        digests = {c.topic: (c.digest, c.ext) for c in stored.connections}
        for connection, stamp, data in stored.messages():
            found.setdefault(connection.topic, []).append((stamp, stored.deserialize(data, connection.msgtype)))
    per_frame = dict.fromkeys(("/local_map", "/local_map/seen", "/local_map/grid_map"), len(maps))
    assert {topic: len(each) for topic, each in found.items()} == {"/grid_map": 1, "/grid_map/names": 1, **per_frame}
    assert digests["/local_map"][0] == "3381f2d731d4076ec5c71b0759edbe4e"  # of ROS's nav_msgs/OccupancyGrid
    assert digests["/grid_map"][0] == "95681e052b1f73bf87b7eb984382b401"  # of ANYbotics' grid_map_msgs/GridMap
    assert isinstance(digests["/grid_map"][1], ConnectionExtRosbag1)
    assert digests["/grid_map"][1].latching == 1
    for (stamp, plain), (_, seen), (_, layers), made in zip(
        found["/local_map"], found["/local_map/seen"], found["/local_map/grid_map"], maps, strict=True
    ):
        assert stamp == made.stamp_ns
        assert plain.header.frame_id == "world"
        assert (plain.info.origin.position.x, plain.info.origin.position.y) == (made.grid.x0, made.grid.y0)
        assert plain.info.resolution == pytest.approx(0.25)
        free, known = made.layers["free"] > 0, np.isfinite(made.layers["ground"])
        assert np.array_equal(grid_of(plain), np.where(known, np.where(free, 0, 100), -1))
        reached = known & (made.layers["seen"] > 0)
        assert np.array_equal(grid_of(seen), np.where(reached, np.where(free, 0, 100), -1))
        for name, data in zip(layers.layers, layers.data, strict=True):
            matrix = data.data.reshape(N, N, order="F")[::-1, ::-1]
            np.testing.assert_array_equal(matrix, made.layers[name].astype(np.float32), name)
    world = found["/grid_map"][0][1]
    assert world.info.length_x >= 6.0 + 20.0  # 10 m around the square that the maps cover
    file = export(bag, "mcap", out=tmp_path / "maps.mcap")
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        read = [decoded for *_, decoded in reader.iter_decoded_messages(topics=["/local_map"])]
    assert [list(each.data) for each in read] == [each.data.tolist() for _, each in found["/local_map"]]


def test_samples_of_webdataset_have_the_map_of_their_stamp(
    brief_run: Path, tmp_path: Path, maps: list[LocalMap]
) -> None:
    webdataset = pytest.importorskip("webdataset")
    folder = export(brief_run, "webdataset", out=tmp_path / "wds", workers=1, maps=OPTIONS)
    urls = [str(path) for path in sorted(folder.glob("clouds-*.tar"))]
    samples = list(webdataset.WebDataset(urls, shardshuffle=False, nodesplitter=None).decode())
    assert len(samples) == len(maps)
    for sample, made in zip(samples, maps, strict=True):
        stored = sample["local_map.npz"]
        assert int(stored["stamp_ns"]) == made.stamp_ns
        for name, values in made.layers.items():
            np.testing.assert_array_equal(stored[name], values, name)
        np.testing.assert_array_equal(stored["free_distance"], made.free_distance)
    frames = [str(path) for path in sorted(folder.glob("train-*.tar"))]
    assert "local_map.npz" in next(iter(webdataset.WebDataset(frames, shardshuffle=False, nodesplitter=None)))


def test_a_table_of_maps_is_read_by_datasets(
    brief_run: Path, tmp_path: Path, maps: list[LocalMap], monkeypatch: pytest.MonkeyPatch
) -> None:
    datasets = pytest.importorskip("datasets")
    monkeypatch.setattr(datasets.config, "HF_DATASETS_CACHE", tmp_path / "cache")
    datasets.disable_progress_bars()
    folder = export(brief_run, "huggingface", out=tmp_path / "hf", workers=1, maps=OPTIONS)
    table = datasets.load_dataset(str(folder), "maps", split="train")  # as NumPy, it would make them single precision
    assert len(table) == len(maps)
    for row, made in zip(table, maps, strict=True):
        assert (int(row["stamp_ns"]), float(row["x0"]), str(row["run"])) == (made.stamp_ns, made.grid.x0, "park_1")
        for name, values in made.layers.items():
            np.testing.assert_array_equal(np.array(row[name], values.dtype).reshape(N, N), values, name)
        np.testing.assert_array_equal(np.reshape(row["world_from_base"], (4, 4)), made.world_from_base)
    assert "### maps" in (folder / "README.md").read_text()


def test_maps_of_one_cell_are_lists_and_one_run_is_mapped_at_a_time(
    brief_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    alive = weakref.WeakSet[LocalMaps]()

    class Watched(LocalMaps):
        def __init__(self, *given: Any, **named: Any) -> None:
            gc.collect()
            assert not alive, "the maps of the run before are in memory"
            super().__init__(*given, **named)
            alive.add(self)

    monkeypatch.setattr(local_maps, "LocalMaps", Watched)
    runs = [shutil.copytree(brief_run, tmp_path / name) for name in ("a", "b")]
    one = MapOptions(side=0.25, resolution=0.25, layers=["ground", "free"])
    folder = export(runs, "huggingface", out=tmp_path / "hf", workers=1, maps=one)
    (path,) = (folder / "maps").glob("*.parquet")
    rows = parquet.read_table(path).to_pylist()
    assert len({row["run"] for row in rows}) == 2
    assert {(len(row["ground"]), len(row["free"])) for row in rows} == {(1, 1)}
    assert isinstance(rows[0]["x0"], float)
    export(runs, "webdataset", out=tmp_path / "wds", workers=1, maps=one)
