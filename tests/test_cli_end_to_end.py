# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The command line end to end: a short bag of the park is made, kept, replaced and reproduced."""

import re
from pathlib import Path

import pytest

from fieldtruth import cli
from fieldtruth.bag.decode import count_messages


@pytest.mark.usefixtures("in_park")
def test_bag_is_made_kept_replaced_and_reproduced_from_its_experiment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    command = ["generate", "park_1", "--seconds", "0.1", "--no-cameras"]
    assert cli.main(command) == 0
    bag = Path("data/park_1/park_1.bag")
    counts = count_messages(bag)
    summary = capsys.readouterr().out
    assert re.match(rf"{bag}: {sum(counts.values())} messages of {len(counts)} topics, [\d.]+ MB; ", summary)
    assert (counts["/os1_cloud_node/points"], counts["/imu/data"], counts["/gazebo/model_states"]) == (1, 5, 100)
    assert not any("camera" in topic for topic in counts)
    names = sorted(path.name for path in bag.parent.iterdir())
    assert names == ["DATASET.md", "SHA256SUMS", "experiment.yaml", "made_by.json", "park_1.bag"]
    first = bag.read_bytes()

    assert cli.main(command) == 2  # finished
    assert cli.main([*command, "--seed", "1"]) == 2  # another experiment
    finished, other = capsys.readouterr().err.splitlines()[-2:]
    assert finished.startswith("error: data/park_1/park_1.bag is already finished; ")
    assert other.startswith("error: data/park_1 holds another experiment (different: seed); ")
    assert bag.read_bytes() == first

    assert cli.main(["generate", "data/park_1/experiment.yaml", "--out", "again", "--workers", "1"]) == 0
    assert Path("again/park_1/park_1.bag").read_bytes() == first
    assert Path("again/park_1/experiment.yaml").read_bytes() == Path("data/park_1/experiment.yaml").read_bytes()

    assert cli.main([*command, "--overwrite", "--workers", "1"]) == 0
    assert bag.read_bytes() == first
