# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""ROS's own tools read our bags. Runs where Debian's python3-rosbag is installed, its only requirement."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest
from record_fakes import make_experiment, make_slices

from fieldtruth.bag.decode import count_messages, read_bag
from fieldtruth.bag.topics import topics_of
from fieldtruth.core.progress import Silent
from fieldtruth.experiment.rig import Rig

PYTHON = "/usr/bin/python3"


def installed() -> bool:
    if not Path(PYTHON).exists() or shutil.which("rosbag") is None:
        return False
    return subprocess.run([PYTHON, "-c", "import rosbag"], capture_output=True, check=False).returncode == 0


pytestmark = pytest.mark.skipif(not installed(), reason="needs Debian's python3-rosbag")

READ = """
import collections, json, sys
import rosbag

counts, last, problems = collections.Counter(), {}, []
with rosbag.Bag(sys.argv[1]) as bag:
    for topic, message, stamp in bag.read_messages():
        counts[topic] += 1
        if not stamp.to_nsec() > last.get(topic, 0):
            problems.append(topic + ": stamps do not rise")
        last[topic] = stamp.to_nsec()
        if hasattr(message, "header") and message.header.stamp != stamp:
            problems.append(topic + ": header and bag disagree")
        if topic == "/gazebo/model_states" and (message.name[0] != "husky" or len(message.pose) != len(message.name)):
            problems.append(topic + ": rows")
        if topic.endswith("/img_raw") and len(message.data) != message.height * message.step:
            problems.append(topic + ": size")
        if topic == "/os1_cloud_node/points" and len(message.data) != 24 * message.width:
            problems.append(topic + ": size")
    latched = [i.header.get("latching", b"").decode() for i in bag._get_connections() if i.topic == "/tf_static"]
print(json.dumps({"counts": counts, "problems": problems, "latched": latched}))
"""


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ros")
    # images of full size, so that chunks have several LZ4 blocks
    slices = make_slices(folder, make_experiment(0.6, rig=Rig()))
    slices.record(folder / "tiny.bag", 2, Silent())
    return folder / "tiny.bag"


def run(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_reads_every_message_of_every_topic(bag: Path) -> None:
    result = json.loads(run(PYTHON, "-c", READ, str(bag)))
    assert result["problems"] == []
    assert result["counts"] == count_messages(bag)
    assert result["latched"] == ["1"]


def test_info_lists_the_topics_with_their_types(bag: Path) -> None:
    text = run("rosbag", "info", str(bag))
    for topic in topics_of(Rig()):
        line = next(line for line in text.splitlines() if f" {topic.name} " in line)
        assert line.split(":")[-1].strip() == topic.msgtype.replace("/msg/", "/")
    assert "lz4" in text
    assert "0.6s" in text


APPEND = """
import sys
import genpy, rosbag

with rosbag.Bag(sys.argv[1]) as bag:
    topic, message, stamp = next(bag.read_messages("/imu/data"))
with rosbag.Bag(sys.argv[1], "a") as bag:
    bag.write(topic, message, genpy.Time(9))
"""


def test_ros_may_append_messages(bag: Path, tmp_path: Path) -> None:
    # ROS rewrites the file header, which must not be longer than ours.
    copy = shutil.copy(bag, tmp_path / "copy.bag")
    run(PYTHON, "-c", APPEND, str(copy))
    before = [reading.stamp_ns for reading in read_bag(bag)]
    assert [reading.stamp_ns for reading in read_bag(Path(copy))] == [*before, 9 * 10**9]


def test_reindexing_finds_the_same_messages(bag: Path, tmp_path: Path) -> None:
    copy = shutil.copy(bag, tmp_path / "copy.bag")
    run("rosbag", "reindex", str(copy))
    assert count_messages(Path(copy)) == count_messages(bag)
