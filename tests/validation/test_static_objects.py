# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Static objects that are published once: the same rows, poses and readings as where they are repeated."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from changed_bags import failures, in_latched_form
from record_fakes import FakeEngine, make_experiment, make_world
from rosbags.rosbag1 import Reader

from fieldtruth.annotation import check_objects
from fieldtruth.bag.decode import count_messages
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import ModelStatesReader, read_objects, read_poses
from fieldtruth.bag.reader import RawMessage, open_bag
from fieldtruth.bag.run import open_run
from fieldtruth.bag.topics import MODEL_STATES, STATIC_MODEL_STATES
from fieldtruth.campaign.estimate import _bytes_once
from fieldtruth.experiment.rig import Rig
from fieldtruth.exporters import export
from fieldtruth.pipeline import generate_by
from fieldtruth.report.page.map import _same_objects
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.validation.context import Context
from fieldtruth.validation.runner import validate
from fieldtruth.validation.streams import check_topics
from fieldtruth.validation.world import WorldObjects

ALL = ("husky", "ground", *(f"tree_{k}" for k in range(2, 7)))


def run_of(out: Path, option: str) -> Path:
    experiment = make_experiment(1.5).model_copy(update={"static_objects": option})
    return generate_by(FakeEngine(), experiment, out / option, workers=2)


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return {option: run_of(tmp_path_factory.mktemp("static"), option) for option in ("repeated", "latched")}


def messages(bag: Path, *topics: str) -> list[RawMessage]:
    with open_bag(bag) as stored:
        return [raw._replace(connection=-1) for raw in stored.messages(topics)]


def test_all_objects_are_latched_and_the_robot_moves_alone(bags: dict[str, Path]) -> None:
    repeated, latched = messages(bags["repeated"], MODEL_STATES), messages(bags["latched"], MODEL_STATES)
    [once] = messages(bags["latched"], STATIC_MODEL_STATES)
    assert (once.stamp_ns, once.data) == (repeated[0].stamp_ns, repeated[0].data)
    reader, whole = ModelStatesReader(), ModelStatesReader()
    for one, other in zip(latched, repeated, strict=True):
        assert one.stamp_ns == other.stamp_ns
        np.testing.assert_array_equal(reader.poses(one.data), whole.poses(other.data)[:2])
        np.testing.assert_array_equal(reader.twists(one.data), whole.twists(other.data)[:2])
    assert (reader.names, whole.names) == (ALL[:2], ALL)
    with Reader(bags["latched"]) as source:
        flags = {c.topic: getattr(c.ext, "latching", None) for c in source.connections}
    assert {topic for topic, flag in flags.items() if flag} == {"/tf_static", STATIC_MODEL_STATES}


def test_everything_else_is_the_same(bags: dict[str, Path]) -> None:
    others = [topic for topic in count_messages(bags["repeated"]) if topic != MODEL_STATES]
    assert messages(bags["latched"], *others) == messages(bags["repeated"], *others)
    assert count_messages(bags["latched"]).keys() - {STATIC_MODEL_STATES} == count_messages(bags["repeated"]).keys()


def test_the_card_names_the_topic_with_the_rows(bags: dict[str, Path]) -> None:
    card = bags["latched"].with_name("DATASET.md").read_text()
    assert f"| `{STATIC_MODEL_STATES}` | gazebo_msgs/ModelStates | once | 1 |" in card
    assert f"and the row in `{STATIC_MODEL_STATES}`" in card
    assert STATIC_MODEL_STATES not in bags["repeated"].with_name("DATASET.md").read_text()


@pytest.mark.parametrize(("objects", "option", "once"), [(500, "auto", 0), (501, "auto", 1), (501, "repeated", 0)])
def test_auto_latches_beyond_500_objects(tmp_path: Path, objects: int, option: str, once: int) -> None:
    engine = FakeEngine(lambda _: make_world(objects=objects))
    experiment = make_experiment(0.01).model_copy(update={"static_objects": option})
    bag = generate_by(engine, experiment, tmp_path, workers=1)
    assert count_messages(bag).get(STATIC_MODEL_STATES, 0) == once
    assert len(read_objects(open_run(bag))[0]) == 2 + objects


def test_readers_find_the_same_objects_and_poses(bags: dict[str, Path]) -> None:
    one, other = open_run(bags["repeated"]), open_run(bags["latched"])
    for run in (one, other):
        names, poses = read_objects(run)
        assert names == ALL
        assert poses[2:, 0].tolist() == [2.0, 3.0, 4.0, 5.0, 6.0]
        assert _same_objects(run, make_world())
        assert not _same_objects(run, make_world(objects=6))
        assert not _same_objects(run, make_world(seed=1))
        check_objects(run, make_world())
        with pytest.raises(BagError, match="'tree_2' is at"):
            check_objects(run, make_world(seed=1))
    tracks = [read_poses(run, MODEL_STATES).trajectory for run in (one, other)]
    np.testing.assert_array_equal(tracks[0].position, tracks[1].position)


def test_exports_have_names_and_quality_of_service(bags: dict[str, Path], tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    from mcap.reader import make_reader

    target = export(bags["latched"], to="mcap", out=tmp_path / "x.mcap")
    with target.open("rb") as stream:
        channels = {c.topic: c.metadata for c in make_reader(stream).get_summary().channels.values()}  # type: ignore[union-attr]
    same = channels["/tf_static"]["offered_qos_profiles"]
    assert channels[STATIC_MODEL_STATES]["offered_qos_profiles"] == same
    assert channels[MODEL_STATES]["offered_qos_profiles"] != same


def test_the_table_of_objects_has_all_rows(small_run: Path, tmp_path: Path) -> None:
    folder = in_latched_form(small_run, tmp_path / "latched", until_ns=60_000_000)
    names = [name for _, name in csv.reader((export(folder, to="files") / "instances.csv").open())]
    assert tuple(names) == read_objects(open_run(small_run))[0]
    assert len(names) > 100


def test_what_is_published_once_counts_once(bags: dict[str, Path]) -> None:
    once = [len(reading.data) for reading in messages(bags["latched"], "/tf_static", STATIC_MODEL_STATES)]
    assert 0.2 * sum(once) < _bytes_once(bags["latched"], Rig()) < sum(once)
    assert _bytes_once(bags["repeated"], Rig()) < _bytes_once(bags["latched"], Rig())


def test_validate_checks_the_latched_objects(lean_run: Path, tmp_path: Path) -> None:
    folder = in_latched_form(lean_run, tmp_path / "latched")
    checks = validate(folder, quick=True)
    assert failures(checks) == {}
    assert {check.name: check.passed for check in checks}["object classes"]


def test_a_missing_topic_is_reported(bags: dict[str, Path]) -> None:
    run = open_run(bags["latched"])
    assert check_topics(Context(run), {}).passed
    counts = {topic: count for topic, count in run.counts.items() if topic != STATIC_MODEL_STATES}
    missing = check_topics(Context(replace(run, counts=counts)), {})
    assert not missing.passed
    assert missing.text.endswith(f"{STATIC_MODEL_STATES} is missing")


@pytest.mark.parametrize(
    ("option", "seed", "passed"), [("latched", 0, True), ("latched", 1, False), ("repeated", 1, False)]
)
def test_objects_are_compared_with_the_rebuilt_world(
    bags: dict[str, Path], option: str, seed: int, passed: bool
) -> None:
    checker = WorldObjects(Context(open_run(bags[option]), SensorWorld(make_world(seed=seed), Rig())))
    for raw in messages(bags[option], *checker.topics):
        checker.see(raw, None)
    assert [tally.result().passed for tally in checker.tallies] == [passed]
