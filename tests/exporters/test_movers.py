# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What moves in a run of several robots: states against the drives, moving points, boxes, tracks, and what reads them.

A watcher sees a leader, which drives at up to 1 m/s, in part behind a post, and a robot that creeps at 2 cm/s.
"""

import configparser
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
import yaml
from export_bags import without
from numpy.typing import NDArray
from pycocotools.coco import COCO
from sense_worlds import at, box, make_world

from fieldtruth import local_maps, pipeline
from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError
from fieldtruth.bag.movers import STILL, Mover, MoverState
from fieldtruth.bag.run import Run, open_run
from fieldtruth.core import transforms
from fieldtruth.datasets import RunDataset
from fieldtruth.experiment.config import Experiment
from fieldtruth.exporters import export, kitti_object, kitti_tracking
from fieldtruth.validation.runner import validate
from fieldtruth.world.model import World

pytestmark = pytest.mark.usefixtures("small_sky")

F8 = NDArray[np.float64]

LIDAR: Final = {"kind": "lidar", "columns": 256, "rings": 32, "max_range": 20.0, "spinning": True}
EYE: Final = {"kind": "camera", "name": "eye", "width": 160, "height": 120, "rate_hz": 10, "instances": True,
              "mount": {"xyz": [0.3, 0.0, 0.5]}}  # fmt: skip
BASE: Final[list[dict[str, Any]]] = [{"kind": "imu"}, {"kind": "gnss"}]
LATE_NS: Final = 500_000_000
"""A stamp at which the leader drives at its full speed."""


def world() -> World:
    return make_world([(box("post", (0.05, 0.05, 0.5)), at(-1.0, 0.9, 0.5))])


def robot(speed: float, *points: tuple[float, float], sensors: list[dict[str, Any]] = BASE) -> dict[str, Any]:
    route = {"metres": {"start": points[0], "waypoints": points[1:]}}
    return {"route": route, "control": {"speed": speed}, "rig": {"sensors": sensors}}


@pytest.fixture(name="folder", scope="module")
def _folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the runs."""
    experiment = Experiment.model_validate({
        "name": "trio",
        "environment": "park",
        "seconds": 0.62,
        "robots": {
            "leader": robot(1.0, (0, 1), (8, 2)),
            "parked": robot(0.02, (2.0, -0.5), (8, -1)),
            "watcher": robot(0.3, (-2.5, 1), (8, 1.5), sensors=[*BASE, LIDAR, EYE]),
        },
    })  # fmt: skip
    return pipeline.generate(experiment, tmp_path_factory.mktemp("runs"), world=world(), workers=2)


@pytest.fixture(name="run", scope="module")
def _run(folder: Path) -> Run:
    return open_run(folder / "watcher")


def number_of(run: Run, name: str) -> int:
    return next(mover.object_id for mover in run.movers if mover.name == name)


# ---------------------------------------------------------------------------------------------------------------------
# States


def test_a_mover_is_moving_if_a_corner_is() -> None:
    mover = Mover("a", 5, 16, "robot", np.array([2.0, 1.0, 0.5]), np.array([1.0, 0.0, 0.0]))
    pose = transforms.pose((3.0, 0.0, 1.0), (0.0, 0.0, 90.0))
    turning = MoverState(pose, np.zeros(3), np.array([0.0, 0.0, 0.1]))
    assert mover.box(turning).centre == pytest.approx([3.0, 1.0, 1.0])
    assert mover.velocity(turning) == pytest.approx([-0.1, 0.0, 0.0])
    farthest = np.hypot(2.0, 0.5)  # [m] from its origin
    for rate, moves in ((1.01, True), (0.99, False)):
        state = MoverState(pose, np.zeros(3), np.array([0.0, 0.0, -rate * STILL / farthest]))
        assert mover.is_moving(state) is moves
    assert mover.is_moving(MoverState(pose, np.array([0.0, 0.0, -0.051]), np.zeros(3)))


def test_states_are_those_of_the_other_robots_drives(run: Run, folder: Path) -> None:
    """The leader's own run has the same drive as odometry, and states between two messages are between theirs."""
    leader = open_run(folder / "leader")
    number = number_of(run, "leader")
    assert [mover.name for mover in run.movers] == ["leader", "parked"]
    assert [mover.name for mover in leader.movers] == ["parked", "watcher"]
    for row in (5, 25):
        stamp = int(leader.trajectory.stamps_ns[row])
        state = run.movers.at(stamp)[number]
        assert np.array_equal(state.pose, leader.trajectory.world_from_base(stamp))
        after = run.movers.at(stamp + 1_000_000)[number]
        between = run.movers.at(stamp + 250_000)[number]
        assert between.pose[:3, 3] == pytest.approx(0.75 * state.pose[:3, 3] + 0.25 * after.pose[:3, 3], abs=1e-12)
        assert between.linear == pytest.approx(0.75 * state.linear + 0.25 * after.linear)
        assert after.pose[:3, 3] - state.pose[:3, 3] == pytest.approx(1e-3 * after.linear, abs=1e-9)
    last = run.movers.at(620_000_000)[number]
    assert np.array_equal(run.movers.at(650_000_000)[number].pose, last.pose)
    with pytest.raises(BagError, match="has no message of /gazebo/model_states near 2000000000 ns"):
        run.movers.at(2_000_000_000)


def test_points_and_pixels_of_what_moves(run: Run, folder: Path) -> None:
    leader, parked = number_of(run, "leader"), number_of(run, "parked")
    dataset = RunDataset(folder / "watcher", ["moving", "moving_mask", "instances", "instance_mask"])
    dataset = pickle.loads(pickle.dumps(dataset))  # as for a loader's processes
    sample = next(each for each in dataset if each["stamp_ns"] == LATE_NS)
    for moving, instances in (
        (sample["moving"], sample["instances"]),
        (sample["moving_mask"], sample["instance_mask"]),
    ):
        assert moving.dtype == np.bool_
        assert np.array_equal(moving, instances == leader)
        assert np.count_nonzero(moving) > 40
        assert np.count_nonzero(instances == parked) > 20
    first = run["lidar"][0]
    assert not run.movers.moving(first.instance, 1_000_000).any()  # when all stand
    alone = without(folder / "watcher" / "trio_watcher.bag", folder / "alone" / "a.bag")
    with pytest.raises(BagError, match=r"moving: .*a\.bag has no experiment\.yaml beside it, which says what moves"):
        RunDataset(alone, ["moving"])


def test_ids_and_poses_where_static_objects_come_once(tmp_path: Path) -> None:
    """Then /gazebo/model_states has the robots behind the ground, and other rows than instance ids."""
    pair = {"leader": robot(1.0, (0, 1), (8, 2)), "watcher": robot(0.3, (-2.5, 1), (8, 1.5), sensors=[*BASE, LIDAR])}
    experiment = Experiment.model_validate(
        {"name": "duo", "environment": "park", "seconds": 0.3, "static_objects": "latched", "robots": pair}
    )
    folder = pipeline.generate(experiment, tmp_path, world=world(), workers=1)
    run, leader = open_run(folder / "watcher"), open_run(folder / "leader")
    assert table.STATIC_MODEL_STATES in run.counts
    cloud, (mover,) = run["lidar"][1], run.movers
    assert set(cloud.instance[cloud.label == mover.label]) == {mover.object_id}
    state = run.movers.at(200_000_000)[mover.object_id]
    assert np.array_equal(state.pose, leader.trajectory.world_from_base(200_000_000))
    checks = {check.name: check for check in validate(folder / "watcher", workers=2, quick=True)}
    assert checks["moving objects"].passed is True
    assert not [check for check in checks.values() if check.passed is False]


def test_a_run_without_the_poses_of_what_moves_is_refused(folder: Path, tmp_path: Path) -> None:
    bag = without(
        folder / "watcher" / "trio_watcher.bag", tmp_path / "trio_watcher.bag", f"/watcher{table.MODEL_STATES}"
    )
    bag.with_name("experiment.yaml").write_bytes((folder / "watcher" / "experiment.yaml").read_bytes())
    with pytest.raises(BagError, match=r"has no /gazebo/model_states"), pytest.warns(match="does not fit the bag"):
        RunDataset(bag, ["moving"])


# ---------------------------------------------------------------------------------------------------------------------
# Files


@pytest.fixture(name="_tiny")
def _tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_maps, "world_of", lambda _: world())


def rows_of(path: Path) -> list[list[str]]:
    return [line.split() for line in path.read_text().splitlines()]


def calib_of(path: Path) -> dict[str, F8]:
    rows = [(row[0].rstrip(":"), np.array(row[1:], float)) for row in rows_of(path)]
    return {name: values.reshape(3, -1) for name, values in rows}


def inside(label: list[str], points: F8) -> NDArray[np.bool_]:
    """Whether points (n, 3) in the camera are in a box in KITTI's columns from the type on, or 2 cm beside it."""
    height, width, length, x, y, z, angle = map(float, label[8:15])
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    own = (points - [x, y, z]) @ turn
    low, high = np.array([-length / 2, -height, -width / 2]), np.array([length / 2, 0.0, width / 2])
    return np.asarray(((own >= low - 0.02) & (own <= high + 0.02)).all(axis=1))


@pytest.mark.usefixtures("_tiny")
def test_kitti_object_has_other_robots_with_their_velocity(run: Run, folder: Path, tmp_path: Path) -> None:
    made = export(folder / "watcher", "kitti-object", out=tmp_path / "object", workers=2)
    number = next(row[0] for row in rows_of(made / "stamps.txt") if int(row[1]) == LATE_NS)
    training, eye = made / "training", run.trajectory.world_from_base(LATE_NS) @ run.calibration.base_from("eye")
    labels, extras = (rows_of(training / part / f"{number}.txt") for part in ("label_2", "visibility"))
    assert [(label[0], extra[3]) for label, extra in zip(labels, extras, strict=True)] == [
        ("object", "object_0"), ("robot", "leader"), ("robot", "parked"),
    ]  # fmt: skip
    leader = open_run(folder / "leader")
    before, after = (leader.trajectory.world_from_base(LATE_NS + step)[:3, 3] for step in (-20_000_000, 20_000_000))
    found = eye[:3, :3] @ np.array(extras[1][5:8], float)
    assert found == pytest.approx((after - before) / 0.04, abs=0.02)
    assert np.linalg.norm(found) > 0.9
    assert 0.5 < float(extras[1][1]) < 0.97  # behind the post
    assert float(extras[2][1]) == 1.0
    cloud, ids = run["lidar"].at(LATE_NS), run["eye"].at(LATE_NS).instance
    calib = calib_of(training / "calib" / f"{number}.txt")["Tr_velo_to_cam"]
    points = cloud.xyz @ calib[:, :3].T + calib[:, 3]
    for label, extra in zip(labels, extras, strict=True):
        own = cloud.instance == int(extra[0])
        assert [int(extra[2]), int(extra[4])] == [(ids == int(extra[0])).sum(), own.sum()]
        assert inside(label, points[own]).mean() > 0.97  # the robots move in the time of the scan
    assert not inside(labels[1], points[own] + [0.0, 0.0, 0.3]).any()
    assert [float(value) for value in labels[2][8:11]] == pytest.approx([0.39, 0.67, 0.99], abs=0.01)


@pytest.mark.usefixtures("_tiny")
def test_kitti_tracking_as_trackeval_reads_it(
    run: Run, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(kitti_tracking.TYPES, "robot", "Car")
    made = export([folder / "watcher"], "kitti-tracking", out=tmp_path / "made", workers=2) / "training"
    labels, ids = rows_of(made / "label_02" / "0000.txt"), {number_of(run, name) for name in ("leader", "parked")}
    frames = len(rows_of(made / "stamps" / "0000.txt"))
    assert frames == 6
    assert [(int(row[0]), int(row[1])) for row in labels] == [
        (k, number) for k in range(frames) for number in sorted(ids)
    ]
    assert {(row[2], row[3], row[4]) for row in labels} == {("Car", "0", "0"), ("Car", "0", "1")}
    assert len(list((made / "image_02" / "0000").iterdir())) == len(list((made / "velodyne" / "0000").iterdir())) == 6
    calib = calib_of(made / "calib" / "0000.txt")
    assert list(calib) == ["P0", "P1", "P2", "P3", "Tr_velo_cam", "R_rect", "Tr_imu_velo"]
    pose = np.array(rows_of(made / "poses" / "0000.txt")[3], float).reshape(3, 4)
    stamp = int(rows_of(made / "stamps" / "0000.txt")[3][0])
    assert pose == pytest.approx((run.trajectory.world_from_base(stamp) @ run.calibration.base_from("eye"))[:3])
    trackeval = pytest.importorskip("trackeval")
    scores = tracked(trackeval.datasets.Kitti2DBox, made / "label_02" / "0000.txt", tmp_path, "car", {
        "GT_FOLDER": str(made), "CLASSES_TO_EVAL": ["car"],
    })  # fmt: skip
    assert scores == {"perfect": (12, 0, 0), "swapped": (12, 0, 2)}


@pytest.mark.usefixtures("_tiny")
def test_a_track_goes_on_where_its_object_is_hidden(run: Run) -> None:
    image, cloud = run["eye"].at(LATE_NS), run["lidar"].at(LATE_NS)
    eye = run.trajectory.world_from_base(LATE_NS) @ run.calibration.base_from("eye")
    objects = kitti_object.KittiObjects(run, run.source("eye"))
    seen = {row.name: row for row in objects.rows(image, cloud, eye, moving=True)}
    empty = replace(image, instance=np.zeros_like(image.instance))
    hidden = {row.name: row for row in objects.rows(empty, replace(cloud, instance=None), eye, moving=True)}
    assert hidden.keys() == seen.keys() == {"leader", "parked"}
    for name, row in hidden.items():
        assert (row.pixels, row.points, row.visibility) == (0, 0, 0.0)
        assert row.label("Car", "0").split()[2] == "3"
        assert row.label("Car", "0").split()[3:] == seen[name].label("Car", "0").split()[3:]
    assert not list(objects.rows(empty, cloud, eye))
    back = eye @ np.diag([-1.0, 1.0, -1.0, 1.0])
    assert not list(objects.rows(empty, cloud, back, moving=True))  # nothing is behind


@pytest.mark.usefixtures("_tiny")
def test_mot_as_trackeval_reads_it(run: Run, folder: Path, tmp_path: Path) -> None:
    made = export(folder / "watcher", "mot", out=tmp_path / "made", workers=2)
    sequence = made / "train" / "trio_watcher"
    truth = np.loadtxt(sequence / "gt" / "gt.txt", delimiter=",")
    assert truth[:, [6, 7]].tolist() == [[1, 8]] * 12
    images = run["eye"]
    for frame, number, left, top, width, height, _, _, share in truth.tolist():
        v, u = np.nonzero(images[int(frame) - 1].instance == number)
        alone = width * height
        assert left <= u.min() + 1 <= u.max() + 1 <= left + width - 1
        assert top <= v.min() + 1 <= v.max() + 1 <= top + height - 1
        assert len(u) <= alone * share
    shares = {number: truth[truth[:, 1] == number, 8] for number in (number_of(run, n) for n in ("leader", "parked"))}
    assert [round(float(each.min()), 1) < 1.0 for each in shares.values()] == [True, False]
    info = configparser.ConfigParser()
    info.read(sequence / "seqinfo.ini")
    assert dict(info["Sequence"]) == {"name": "trio_watcher", "imdir": "img1", "framerate": "10", "seqlength": "6",
                                      "imwidth": "160", "imheight": "120", "imext": ".jpg"}  # fmt: skip
    assert images.message(0, "photo").data.tobytes() == (sequence / "img1" / "000001.jpg").read_bytes()
    trackeval = pytest.importorskip("trackeval")
    scores = tracked(trackeval.datasets.MotChallenge2DBox, sequence / "gt" / "gt.txt", tmp_path, "pedestrian", {
        "GT_FOLDER": str(made / "train"), "SEQMAP_FILE": str(made / "seqmaps" / "train.txt"), "SKIP_SPLIT_FOL": True,
        "DO_PREPROC": False,  # which leaves all kinds but people out
    })  # fmt: skip
    assert scores == {"perfect": (12, 0, 0), "swapped": (12, 0, 2)}


@pytest.mark.usefixtures("_tiny")
def test_coco_has_tracks_boxes_and_velocities(run: Run, folder: Path, tmp_path: Path) -> None:
    made = export(folder / "watcher", "coco", out=tmp_path / "coco", boxes=True, workers=2)
    coco = COCO(str(made / "instances.json"))
    numbers = {name: number_of(run, name) for name in ("leader", "parked")}
    assert {coco.cats[each["category_id"]]["name"] for each in coco.anns.values()} == {"robot", "rock"}
    for name, number in numbers.items():
        own = [each for each in coco.anns.values() if each.get("track_id") == number]
        assert [coco.imgs[each["image_id"]]["stamp_ns"] for each in own] == run["eye"].stamps_ns.tolist()
        for each in own:
            image = coco.imgs[each["image_id"]]
            assert each["iscrowd"] == 0
            assert np.array_equal(coco.annToMask(each), run["eye"].at(image["stamp_ns"]).instance == number)
            state = run.movers.at(image["stamp_ns"])[number]
            assert each["attributes"] == {"moving": name == "leader"}
            eye, found = np.array(image["world_from_camera"]), each["box_3d"]
            assert eye[:3, :3] @ found["velocity"] == pytest.approx(state.linear, abs=0.02)
            assert transforms.transform(eye, [found["center"]])[0] == pytest.approx(
                transforms.transform(state.pose, [[0.0, 0.0, 0.06272]])[0], abs=1e-6
            )
            assert found["size"] == pytest.approx([0.99, 0.67, 0.39], abs=1e-3)
            assert each["visibility"] == 1.0 or name == "leader"
    post = [each for each in coco.anns.values() if each["track_id"] not in numbers.values()]
    assert {each["attributes"]["moving"] for each in post} == {False}
    assert not any("velocity" in each["box_3d"] for each in post)


def test_semantickitti_has_moving_classes_as_the_benchmark_counts_them(run: Run, folder: Path, tmp_path: Path) -> None:
    made = export(folder / "watcher", "semantickitti", out=tmp_path / "sk", label_map="semantickitti", workers=2)
    numbers, counts = {name: number_of(run, name) for name in ("leader", "parked")}, np.zeros((2, 2), int)
    for row, cloud in enumerate(run["lidar"]):
        word = np.fromfile(made / "sequences" / "00" / "labels" / f"{row:06d}.label", np.uint32)
        label, instance = word & 0xFFFF, word >> 16
        assert set(label[instance == numbers["leader"]]) == {259}  # moving-other-vehicle
        assert set(label[instance == numbers["parked"]]) <= {20}
        moving = run.movers.moving(cloud.instance, cloud.stamp_ns)
        # iou_moving of evaluate_mos.py: 251 and above are moving, 0 and 1 ignored; the prediction misses one robot
        predicted = np.isin(cloud.instance, [*numbers.values()])
        for true, said in zip(label[label > 1] > 250, predicted[label > 1], strict=True):
            counts[int(true), int(said)] += 1
        assert np.array_equal(label > 250, moving)
    iou = counts[1, 1] / (counts[1, 1] + counts[0, 1] + counts[1, 0])
    points = {name: sum(int((cloud.instance == n).sum()) for cloud in run["lidar"]) for name, n in numbers.items()}
    assert iou == points["leader"] / sum(points.values())
    described = yaml.safe_load((made / "fieldtruth.yaml").read_text())
    assert described["labels"][259] == "moving-other-vehicle"
    assert described["color_map"][259] == described["color_map"][20] == [255, 0, 0]
    assert described["content"][259] > 0.0
    assert described["learning_ignore"][described["learning_map"][259]] is False
    assert described["learning_ignore"][described["learning_map"][252]] is True
    own = export(folder / "watcher", "semantickitti", out=tmp_path / "own", workers=1)
    words = np.fromfile(own / "sequences" / "00" / "labels" / "000003.label", np.uint32)
    assert (words & 0xFFFF).max() == 16  # our classes have none of what moves


def tracked(
    kind: Any, truth: Path, tmp_path: Path, name: str, config: dict[str, Any]
) -> dict[str, tuple[int, int, int]]:
    """Matches, misses and changes of the track of two trackers, by TrackEval: the truth, and one that swaps its tracks.

    The latter swaps the two tracks in the middle.
    """
    import trackeval

    rows = truth.read_text().splitlines()
    comma = "," if "," in rows[0] else " "
    sequence = truth.parent.parent.name if comma == "," else truth.stem
    ids = list(dict.fromkeys(row.split(comma)[1] for row in rows))
    other = dict(zip(ids, reversed(ids), strict=True))
    for tracker in ("perfect", "swapped"):
        text = []
        for k, row in enumerate(rows):
            columns = row.split(comma)
            columns[1] = other[columns[1]] if tracker == "swapped" and k >= len(rows) // 2 else columns[1]
            columns = [*columns[:7], "-1", "-1", "-1"] if comma == "," else columns
            text.append(comma.join(columns) + "\n")
        file = tmp_path / "trackers" / tracker / "data" / f"{sequence}.txt"
        file.parent.mkdir(parents=True)
        file.write_text("".join(text))
    data = kind(config | {"TRACKERS_FOLDER": str(tmp_path / "trackers"), "PRINT_CONFIG": False})
    quiet = {"PRINT_RESULTS": False, "PRINT_CONFIG": False, "TIME_PROGRESS": False, "OUTPUT_SUMMARY": False,
             "OUTPUT_DETAILED": False, "PLOT_CURVES": False, "OUTPUT_EMPTY_CLASSES": False}  # fmt: skip
    found, _ = trackeval.Evaluator(quiet).evaluate([data], [trackeval.metrics.CLEAR({"PRINT_CONFIG": False})])
    clear = {each: row["COMBINED_SEQ"][name]["CLEAR"] for each, row in found[data.get_name()].items()}
    return {each: tuple(int(row[key]) for key in ("CLR_TP", "CLR_FN", "IDSW")) for each, row in clear.items()}  # type: ignore[misc]
