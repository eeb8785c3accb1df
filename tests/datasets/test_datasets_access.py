# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Access to a run as a data set in any order and process, foreign clouds, and errors."""

import pickle
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_type_hints

import numpy as np
import pytest
from dataset_bags import equal, rewrite
from numpy.typing import NDArray

from fieldtruth.bag import reader
from fieldtruth.bag.reader import open_bag
from fieldtruth.bag.readings import cloud_of
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.datasets import RunDataset, collate
from fieldtruth.datasets.items import GEOMETRY, ITEMS, Meaning, Sample
from fieldtruth.ontology import label_map_of

LACKING = ("normals", "flow", "parts", "part_mask", "passability", "passability_mask")
"""Items that the small run does not have."""
ALL = tuple(name for name in (*ITEMS, *GEOMETRY) if name not in LACKING)
POINTS, ODOMETRY = "/os1_cloud_node/points", "/ground_truth/odom"

#


def test_any_order_any_thread_and_a_pickled_copy_give_the_same(
    small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(small_run.parent)
    dataset = RunDataset(small_run.name, ("image", "cloud", "pose"))
    one_by_one = [dataset[k] for k in range(len(dataset))]
    monkeypatch.chdir(tmp_path)
    reader._RECENT.forget()
    order = np.random.default_rng(0).permutation(len(dataset))
    copy = pickle.loads(pickle.dumps(dataset))
    with ThreadPoolExecutor(4) as pool:
        for frames in (
            [dataset[k] for k in order],
            list(pool.map(dataset.__getitem__, order)),
            [copy[k] for k in order],
        ):
            for k, frame in zip(order, frames, strict=True):
                equal(frame, one_by_one[k])
    assert len(pickle.dumps(dataset)) < 50_000


def test_indices_are_those_of_a_sequence(small_run: Path) -> None:
    dataset = RunDataset(small_run, ["pose"])
    stamps = dataset.stamps_ns.tolist()
    assert dataset[-1]["stamp_ns"] == dataset[np.int64(29)]["stamp_ns"] == stamps[-1]
    assert dataset[-30]["stamp_ns"] == stamps[0]
    assert [frame["stamp_ns"] for frame in dataset] == stamps
    for wrong in (30, -31):
        with pytest.raises(IndexError, match=f"frame must be between -30 and 29, got {wrong}"):
            dataset[wrong]
    with pytest.raises(TypeError, match="Subset"):
        dataset[0:2]  # type: ignore[index]
    with pytest.raises(TypeError):
        dataset["a"]  # type: ignore[index]


def test_changes_of_a_sample_do_not_affect_others(small_run: Path) -> None:
    dataset = RunDataset(small_run, ALL)
    first = dataset[0]
    for value in first.values():
        if isinstance(value, np.ndarray):
            value[...] = 99
    assert not any(np.all(value == 99) for value in dataset[0].values())


def test_the_chunks_in_memory_stay_below_their_budget() -> None:
    recent = reader.ChunkCache(100)
    made = []

    def chunk(k: int) -> Callable[[], bytes]:
        return lambda: made.append(k) or bytes(40)  # type: ignore[func-returns-value]

    for k in (0, 1, 0, 2, 0, 1):
        assert len(recent.get((Path("a"), (0, 0), k), chunk(k))) == 40
        assert recent.size <= 100
    assert made == [0, 1, 2, 1]  # 1 was the last to be used when 2 came
    recent.get((Path("a"), (0, 0), 9), lambda: bytes(500))
    assert recent.size == 500


def test_labels_of_another_ontology(small_run: Path) -> None:
    ours, theirs = (RunDataset(small_run, ("mask", "labels"), label_map=name) for name in (None, "rellis"))
    rellis = {2: 4, 3: 4, 4: 19, 15: 7}  # trunk, treetop, bush, sky: tree, tree, bush, sky
    for own, other in zip(ours, theirs, strict=True):
        for number, there in rellis.items():
            assert (other["mask"][own["mask"] == number] == there).all()
            assert (other["labels"][own["labels"] == number] == there).all()
        assert np.array_equal(label_map_of("rellis").ids[own["mask"]], other["mask"])
        assert np.array_equal(label_map_of("rellis").ids[own["labels"]], other["labels"])
    assert (ours.classes[2], theirs.classes[4]) == ("trunk and branch", "tree")
    given = RunDataset(small_run, ("mask",), label_map=label_map_of("rellis"))
    assert np.array_equal(given[4]["mask"], theirs[0]["mask"])


def test_a_transform_is_applied_to_each_sample(small_run: Path) -> None:
    dataset = RunDataset(small_run, transform=lambda sample: sample["mask"][:2, :2])
    assert np.array_equal(dataset[3], RunDataset(small_run)[3]["mask"][:2, :2])


def test_only_collate_needs_torch(small_run: Path) -> None:
    code = f"""
import sys

class NoTorch:
    def find_spec(self, name, *rest):
        if name.partition(".")[0] == "torch":
            raise ImportError(name)

sys.meta_path.insert(0, NoTorch())
from fieldtruth.datasets import RunDataset, collate
frames = list(RunDataset({str(small_run)!r}, ("image", "cloud")))
try:
    collate(frames)
except Exception as error:
    print(type(error).__name__, error)
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == "ConfigurationError collate needs PyTorch (pip install torch)"


# ---------------------------------------------------------------------------------------------------------------------
# Foreign clouds, and errors


def cloud(**columns: Any) -> SimpleNamespace:
    """sensor_msgs/PointCloud2 of float32 columns."""
    data = np.stack([np.asarray(column, "<f4") for column in columns.values()], axis=1)
    fields = [SimpleNamespace(name=n, offset=4 * k, datatype=7, count=1) for k, n in enumerate(columns)]
    step = 4 * len(fields)
    raw = np.frombuffer(data.tobytes(), np.uint8)
    return SimpleNamespace(
        is_bigendian=False,
        height=1,
        width=len(data),
        fields=fields,
        point_step=step,
        row_step=step * len(data),
        data=raw,
    )


def value(item: str, message: Any) -> NDArray[Any]:
    return ITEMS[item].value(cloud_of(message, labelled=item == "labels"), Meaning(np.arange(24)))


def test_a_cloud_of_the_papers_data_set_has_classes_as_intensity_and_nan_points_are_dropped() -> None:
    message = cloud(x=[1, np.nan, 3, np.inf], y=[4, 5, 6, 7], z=[7, 8, 9, 1], intensity=[3, 1, 13, 2])
    assert value("cloud", message).tolist() == [[1, 4, 7], [3, 6, 9]]
    assert value("labels", message).tolist() == [3, 13]
    both = cloud(x=[1], y=[1], z=[1], intensity=[77], label=[5])
    assert value("labels", both).tolist() == [5]


@pytest.mark.parametrize("wrong", [24.0, -1.0, 2.5])
def test_a_point_with_an_invalid_class_is_an_error(wrong: float) -> None:
    with pytest.raises(
        FieldtruthError, match=rf"intensity of a point must be a class, one of 0, 1, .* 23, got {wrong:g}"
    ):
        value("labels", cloud(x=[1, 1], y=[1, 1], z=[1, 1], intensity=[1, wrong]))


def test_a_cloud_without_object_ids_lists_its_fields() -> None:
    with pytest.raises(FieldtruthError, match="have no field 'instance'; available: x, y, z"):
        value("instances", cloud(x=[1], y=[1], z=[1]))


WRONG: list[tuple[str, Callable[[Path, Path], object]]] = [
    ("nowhere does not exist", lambda run, tmp: RunDataset(tmp / "nowhere")),
    ("has no bag", lambda run, tmp: RunDataset(tmp)),
    ("unknown item 'masks'; did you mean 'mask'", lambda run, tmp: RunDataset(run, ["masks"])),
    ("items must be a list or tuple of names", lambda run, tmp: RunDataset(run, "mask")),
    ("items must not be empty; available: image", lambda run, tmp: RunDataset(run, [])),
    ("unknown camera 'middle'", lambda run, tmp: RunDataset(run, camera="middle")),
    ("unknown anchor 'left'", lambda run, tmp: RunDataset(run, anchor="left")),  # type: ignore[arg-type]
    ("tolerance_s must be a time", lambda run, tmp: RunDataset(run, tolerance_s=-0.1)),
    ("tolerance_s must be a time", lambda run, tmp: RunDataset(run, tolerance_s=float("nan"))),
    ("unknown label map 'relis'; did you mean 'rellis'", lambda run, tmp: RunDataset(run, label_map="relis")),
]


@pytest.mark.parametrize(("line", "make"), WRONG)
def test_wrong_arguments_give_one_line(
    small_run: Path, tmp_path: Path, line: str, make: Callable[[Path, Path], object]
) -> None:
    with pytest.raises(FieldtruthError, match=line) as caught:
        make(small_run, tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("missing", "items", "line"),
    [
        ("/stereo/camera/left/depth", ["depth"], "--extras depth` records it"),
        ("/stereo/camera/left/instances", ["instance_mask"], "--extras instances` records it"),
        ("/os1_cloud_node/points", ["cloud"], "has no /os1_cloud_node/points; available: /clock"),
        ("/tf_static", ["image", "calibration"], "has no /tf_static"),
        ("/stereo/camera/left/camera_info", ["image", "calibration"], "has no /stereo/camera/left/camera_info"),
    ],
)
def test_a_missing_topic_is_named(small_run: Path, tmp_path: Path, missing: str, items: list[str], line: str) -> None:
    bag = rewrite(small_run, tmp_path / "less.bag", keep=lambda topic, k: topic != missing)
    assert len(RunDataset(bag, ["mask"])) == 30
    with pytest.raises(FieldtruthError, match=re.escape(line)):
        RunDataset(bag, items)


def test_a_run_without_frames_explains_why(small_run: Path, tmp_path: Path) -> None:
    odd = rewrite(small_run, tmp_path / "odd.bag", keep=lambda topic, k: topic != POINTS or k % 2 == 0)
    with pytest.raises(FieldtruthError, match=r"stamps of camera and LiDAR differ by at least 0\.020000 s"):
        RunDataset(odd, ["mask", "cloud"])
    assert len(RunDataset(odd, ["mask", "cloud"], tolerance_s=0.02)) == 12
    apart = rewrite(
        small_run, tmp_path / "a.bag", keep=lambda topic, k: "camera/left" not in topic or ("tag" in topic) == k % 2
    )
    with pytest.raises(FieldtruthError, match="no stamp is common to /stereo/camera/left/real/compressed, "):
        RunDataset(apart)
    still = rewrite(small_run, tmp_path / "still.bag", keep=lambda topic, k: topic != ODOMETRY or k == 0)
    with pytest.raises(FieldtruthError, match="there is no true pose at their stamps"):
        RunDataset(still, ["mask", "pose"])


def test_an_index_that_points_to_another_topic_is_damage(small_run: Path) -> None:
    with open_bag(small_run / "park_1.bag") as bag:
        found, elsewhere = reader.Storage(bag), bag.index([POINTS])[POINTS]
    with pytest.raises(FieldtruthError, match=f"its index has {ODOMETRY} at the position of a message of {POINTS}"):
        found.message(ODOMETRY, int(elsewhere.chunk[3]), int(elsewhere.offset[3]))


@pytest.fixture
def spoilt(small_run: Path, tmp_path: Path) -> Iterator[tuple[Path, RunDataset]]:
    """A copy of the bag, and an open data set of it."""
    path = tmp_path / "park_1.bag"
    path.write_bytes((small_run / "park_1.bag").read_bytes())
    yield path, RunDataset(path)
    reader._RECENT.forget()


def test_a_missing_changed_or_damaged_bag_is_an_error(spoilt: tuple[Path, RunDataset]) -> None:
    path, dataset = spoilt
    data = bytearray(path.read_bytes())
    topic = "/stereo/camera/left/tag/img_raw"
    with open_bag(path) as bag:
        chunk = int(bag.index([topic])[topic].chunk[15])
    data[chunk + 5_000 : chunk + 6_000] = bytes(1_000)
    path.write_bytes(data)
    reader._RECENT.forget()
    with pytest.raises(FieldtruthError, match=r"park_1\.bag has changed since the data set was opened; open it again"):
        list(dataset)
    again = RunDataset(path)
    with pytest.raises(FieldtruthError, match=r"cannot read .*park_1\.bag: "):
        list(again)
    path.unlink()
    reader._RECENT.forget()
    with pytest.raises(FieldtruthError, match="No such file"):
        again[0]


def test_the_documents_name_every_item_and_every_key() -> None:
    text = (Path(__file__).parents[2] / "docs/datasets.md").read_text(encoding="utf-8")
    rows = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("| `")]
    described = {re.findall(r"`(.*?)`", row[0])[0]: set(re.findall(r"`(.*?)`", row[1])) for row in rows}
    assert sorted(described) == sorted([*ITEMS, *GEOMETRY, "(always)"])
    assert set().union(*described.values()) == get_type_hints(Sample).keys()


def test_collate_is_a_function_of_the_module() -> None:
    assert pickle.loads(pickle.dumps(collate)) is collate
