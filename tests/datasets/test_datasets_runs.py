# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Folders of runs, splits for training and testing, and PyTorch's loader."""

import pickle
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dataset_bags import equal

from fieldtruth.core.errors import FieldtruthError
from fieldtruth.datasets import RunDataset, Runs, bags_in, collate, open_runs, split
from fieldtruth.datasets.items import GEOMETRY, ITEMS
from fieldtruth.experiment.files import dump_experiment, load_experiment

RAGGED = ("cloud", "labels", "instances", "moving", "rays", "reflectivity")


def lay(run: Path, folder: Path, names: Sequence[str], worlds: Mapping[str, int] | None = None) -> Path:
    """Copy a run into a folder under several names, with the seed of its world by name."""
    for name in names:
        (folder / name).mkdir(parents=True)
        stem = Path(name).name
        (folder / name / f"{stem}.bag").hardlink_to(run / f"{run.name}.bag")
        if worlds is not None:
            values = load_experiment("park_1").model_copy(update={"name": stem, "seed": worlds[name]})
            (folder / name / "experiment.yaml").write_text(dump_experiment(values))
    return folder


@pytest.fixture(scope="module")
def ten(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Runs:
    """Ten runs."""
    data = tmp_path_factory.mktemp("ten") / "data"
    return open_runs(lay(small_run, data, [f"run_{k}" for k in range(10)]), ["labels"])


def test_a_folder_is_its_runs_one_after_the_other(small_run: Path, tmp_path: Path) -> None:
    runs = open_runs(lay(small_run, tmp_path, ["b", "c/a", "a"]), ["labels", "pose"], anchor="lidar")
    alone = RunDataset(small_run, ["labels", "pose"], anchor="lidar")
    assert (runs.names, len(runs), len(alone)) == (("a", "b", "c/a"), 36, 12)
    assert [(frame["run"], frame["stamp_ns"]) for frame in runs] == [
        (name, stamp) for name in runs.names for stamp in alone.stamps_ns
    ]
    for place in (0, 11, 12, 35, -1, -36, -13):
        run, frame = runs.locate(place)
        assert (run.name, frame) == (runs.names[place % 36 // 12], place % 12)
        equal(runs[place], {**alone[frame], "run": run.name})
    for wrong in (36, -37):
        with pytest.raises(IndexError, match=f"frame must be between -36 and 35, got {wrong}"):
            runs[wrong]
    with pytest.raises(TypeError, match="Subset"):
        runs[:2]  # type: ignore[index]
    copy = pickle.loads(pickle.dumps(runs))
    equal(copy[20], runs[20])
    assert runs.classes[15] == "sky"


def test_copies_and_unfinished_runs_are_skipped_and_links_followed(small_run: Path, tmp_path: Path) -> None:
    data = lay(small_run, tmp_path / "data", ["park_1", ".slices/x"])
    bag = data / "park_1/park_1.bag"
    (data / "park_1/park_1_annotated.bag").hardlink_to(bag)
    (data / "park_1/.hidden.bag").hardlink_to(bag)
    (data / "foreign").mkdir()
    for name in ("one.bag", "two.bag", "three.bag.part"):
        (data / "foreign" / name).hardlink_to(bag)
    (data / "linked").symlink_to(lay(small_run, tmp_path / "elsewhere", ["lake_1"]))
    (data / "linked_again").symlink_to(data)
    assert open_runs(data).names == ("foreign/one", "foreign/two", "linked/lake_1", "park_1")
    assert open_runs(data / "park_1").names == ("park_1",)


def test_a_bag_of_ros_2_is_a_file_or_a_folder_of_files(tmp_path: Path) -> None:
    names = ("alone.db3", "drone/drone_0.db3", "drone/drone_1.db3", "drone/metadata.yaml", "other/metadata.yaml")
    for path in map(tmp_path.joinpath, names):
        path.parent.mkdir(exist_ok=True)
        path.touch()
    assert bags_in(tmp_path) == [("alone", tmp_path / "alone.db3"), ("drone", tmp_path / "drone")]
    assert bags_in(tmp_path / "drone") == [("drone", tmp_path / "drone")]


def test_a_folder_without_runs_or_with_equal_names_is_an_error(small_run: Path, tmp_path: Path) -> None:
    with pytest.raises(FieldtruthError, match="has no runs"):
        open_runs(tmp_path)
    with pytest.raises(FieldtruthError, match="is not a folder"):
        open_runs(tmp_path / "nowhere")
    data = lay(small_run, tmp_path, ["park_1"])
    (data / "park_1.bag").hardlink_to(data / "park_1/park_1.bag")
    with pytest.raises(FieldtruthError, match="have the same name 'park_1'"):
        open_runs(data)
    (data / "park_1.bag").unlink()
    (data / "broken.bag").write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(FieldtruthError, match=r"cannot read .*broken\.bag"):
        open_runs(data)


@pytest.mark.parametrize(
    ("shares", "counts"),
    [
        ({"train": 0.7, "val": 0.2, "test": 0.1}, [7, 2, 1]),
        ({"train": 0.7, "val": 0.15, "test": 0.15}, [7, 2, 1]),
        ({"train": 0.98, "val": 0.01, "test": 0.01}, [8, 1, 1]),
        ({"all": 1}, [10]),
    ],
)
def test_shares_are_of_whole_runs(ten: Runs, shares: dict[str, Any], counts: list[int]) -> None:
    parts = split(ten, rng=np.random.default_rng(1), **shares)
    assert list(parts) == list(shares)
    assert [len(part.runs) for part in parts.values()] == counts
    frames = Counter((name, part) for part, runs in parts.items() for name in runs.names for _ in range(12))
    assert set(frames.values()) == {12}
    assert sorted(name for name, _ in frames) == sorted(ten.names)
    assert all(list(runs.names) == sorted(runs.names) for runs in parts.values())
    again = split(ten, rng=np.random.default_rng(1), **shares)
    assert [runs.names for runs in again.values()] == [runs.names for runs in parts.values()]


def test_shares_are_assigned_at_random(ten: Runs) -> None:
    drawn = {split(ten, rng=np.random.default_rng(k), train=0.5, test=0.5)["train"].names for k in range(5)}
    assert len(drawn) == 5


def test_lists_name_the_parts(ten: Runs) -> None:
    parts = split(ten, train=["run_3", "run_1"], test=("run_0",))
    assert {name: runs.names for name, runs in parts.items()} == {"train": ("run_1", "run_3"), "test": ("run_0",)}
    assert parts["test"][0]["run"] == "run_0"


def test_both_cameras_of_a_run_stay_together(small_run: Path, tmp_path: Path) -> None:
    data = lay(small_run, tmp_path, ["a", "b"])
    both = Runs([*open_runs(data, camera="left").runs, *open_runs(data, camera="right").runs])
    for k in range(5):
        parts = split(both, rng=np.random.default_rng(k), train=0.5, test=0.5)
        assert sorted(runs.names for runs in parts.values()) == [("a", "a"), ("b", "b")]
    left, right = parts["train"].runs
    assert not np.array_equal(left[0]["image"], right[0]["image"])
    assert split(both, train=["a"], test=["b"])["test"].names == ("b", "b")


def test_runs_in_one_world_stay_together_by_world(small_run: Path, tmp_path: Path) -> None:
    seeds = {"a": 0, "b": 1, "c": 0, "d": 1, "e": 2}
    runs = open_runs(lay(small_run, tmp_path, list(seeds), seeds), ["pose"])
    for k in range(5):
        parts = split(runs, by="world", rng=np.random.default_rng(k), train=0.6, test=0.4)
        worlds = [{seeds[name] for name in part.names} for part in parts.values()]
        assert not worlds[0] & worlds[1]
        assert worlds[0] | worlds[1] == {0, 1, 2}
    with pytest.raises(FieldtruthError, match="4 parts need at least 4 worlds, got 3"):
        split(runs, by="world", rng=np.random.default_rng(0), a=0.25, b=0.25, c=0.25, d=0.25)
    with pytest.raises(FieldtruthError, match="'a' and 'c' are of the same world, which is in two parts, 'train'"):
        split(runs, by="world", train=["a"], val=["c"])
    assert split(runs, train=["a"], val=["c"])["val"].names == ("c",)


@pytest.mark.parametrize(
    ("line", "arguments"),
    [
        ("11 parts need at least 11 runs, got 10", {f"p{k}": 1 / 11 for k in range(11)}),
        ("shares must be above 0 with the sum 1, got 0.7, 0.2", {"train": 0.7, "val": 0.2}),
        ("shares must be above 0 with the sum 1, got 1.1, -0.1", {"train": 1.1, "val": -0.1}),
        ("either all shares, such as train=0.7, val=0.3, or all lists", {"train": 0.7, "val": ["run_1"]}),
        ("either all shares, such as train=0.7, val=0.3, or all lists", {}),
        ("shares need a random generator, such as rng=", {"train": 0.5, "val": 0.5, "rng": None}),
        ("run 'run_1' is in two parts, 'train' and 'val'", {"train": ["run_1"], "val": ["run_1"]}),
        ("unknown run 'run_x'; did you mean 'run_", {"train": ["run_x"]}),
        ("part 'train' must be a share or a list of runs, got 'run_1'", {"train": "run_1"}),
        ("part 'train' must be a share or a list of runs, got []", {"train": []}),
        ("unknown unit of a split", {"train": 1.0, "by": "frame"}),
    ],
)
def test_wrong_parts_give_one_line(ten: Runs, line: str, arguments: dict[str, Any]) -> None:
    with pytest.raises(FieldtruthError, match=re.escape(line)) as caught:
        split(ten, **({"rng": np.random.default_rng(0)} | arguments))
    assert "\n" not in str(caught.value)


def test_one_run_cannot_be_split(small_run: Path) -> None:
    with pytest.raises(FieldtruthError, match="2 parts need at least 2 runs, got 1"):
        split(Runs([RunDataset(small_run)]), rng=np.random.default_rng(0), train=0.5, val=0.5)


def test_no_runs_or_different_classes_are_an_error(small_run: Path) -> None:
    for runs in ([], [RunDataset(small_run), RunDataset(small_run, label_map="rellis")]):
        with pytest.raises(FieldtruthError, match="must be at least one, and an id must be of the same class in all"):
            Runs(runs)


# ---------------------------------------------------------------------------------------------------------------------
# PyTorch


def same(batch: Mapping[str, Any], frames: Sequence[Mapping[str, Any]]) -> None:
    """A batch holds these frames, in this order."""
    torch = pytest.importorskip("torch")
    assert batch.keys() == frames[0].keys()
    for key, held in batch.items():
        assert len(held) == len(frames)
        for k, frame in enumerate(frames):
            if isinstance(frame[key], np.ndarray):
                expected = torch.from_numpy(frame[key].copy())
                assert held[k].dtype == expected.dtype, key
                assert torch.equal(held[k], expected), key
            else:
                assert held[k] == frame[key], key


@pytest.mark.filterwarnings("error")
def test_a_batch_is_stacked_and_clouds_are_not_padded(small_run: Path) -> None:
    torch = pytest.importorskip("torch")
    lacking = ("normals", "flow", "parts", "part_mask", "passability", "passability_mask")
    frames = list(RunDataset(small_run, [name for name in (*ITEMS, *GEOMETRY) if name not in lacking]))[:3]
    batch = collate(frames)
    same(batch, frames)
    assert batch["image"].shape == (3, 3, 92, 160)
    assert (batch["mask"].dtype, batch["image"].dtype, batch["cloud"][0].dtype) == (
        torch.int64,
        torch.uint8,
        torch.float32,
    )
    assert batch["stamp_ns"].tolist() == [frame["stamp_ns"] for frame in frames]
    assert batch["run"] == ["park_1"] * 3
    assert {key for key, value in batch.items() if isinstance(value, list)} == {"run", "distortion_model", *RAGGED}


@pytest.mark.parametrize("start", ["fork", pytest.param("spawn", marks=pytest.mark.slow)])
def test_two_loader_workers_match_direct_access(small_run: Path, tmp_path: Path, start: str) -> None:
    torch = pytest.importorskip("torch")
    from torch.utils.data import DataLoader

    runs = open_runs(lay(small_run, tmp_path, ["a", "b"]), ("image", "mask", "cloud", "labels", "pose"))
    assert len(runs) == 12
    runs[5]  # a chunk is in the parent's memory when it forks
    loader = DataLoader(
        runs,
        batch_size=5,
        shuffle=True,
        generator=torch.Generator().manual_seed(0),
        num_workers=2,
        collate_fn=collate,
        multiprocessing_context=start,
        persistent_workers=True,
    )
    orders = []
    for _ in range(2):
        order = []
        for batch in loader:
            places = [
                12 // 2 * "ab".index(run) + int(stamp) // 200_000_000 - 1
                for run, stamp in zip(batch["run"], batch["stamp_ns"], strict=True)
            ]
            same(batch, [runs[k] for k in places])
            order += places
        assert sorted(order) == list(range(12))
        orders.append(order)
    assert orders[0] != orders[1] != list(range(12))
