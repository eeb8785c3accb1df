# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The data card against its run, and the checksums against sha256sum."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml

import fieldtruth
from fieldtruth.bag.decode import count_messages, read_bag, static_transforms
from fieldtruth.bag.file import BagError
from fieldtruth.bag.provenance import CHECKSUMS, read_checksums, sha256_of
from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.world.build import load_world


def rows_of(card: str, heading: str) -> list[list[str]]:
    section = card.partition(f"## {heading}")[2].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip().strip("`") for cell in line.strip("|").split("|")] for line in lines[2:]]


@pytest.fixture(scope="module")
def card(small_run: Path) -> str:
    return (small_run / "DATASET.md").read_text(encoding="utf-8")


def test_card_has_front_matter_licence_citation_and_no_placeholder(card: str) -> None:
    front = yaml.safe_load(card.split("---")[1])
    assert (front["license"], front["pretty_name"]) == ("cc-by-4.0", "park_1")
    assert "10.3390/s22155599" in card
    assert f"fieldtruth {fieldtruth.__version__} from seed 0" in card
    assert "$" not in card
    assert "## Known limits" in card
    assert "leaves no ruts" in card
    assert "means over the interval" in card


def test_card_topics_match_the_bag(card: str, small_run: Path) -> None:
    counted = {row[0]: int(row[3]) for row in rows_of(card, "Contents")}
    assert counted == count_messages(small_run / "park_1.bag")


def test_card_length_matches_the_drive(card: str, small_run: Path) -> None:
    path = [r.message.pose.pose.position for r in read_bag(small_run / "park_1.bag", ["/ground_truth/odom"])]
    chord = np.linalg.norm(np.diff([[p.x, p.y, p.z] for p in path], axis=0), axis=1).sum()
    found = re.search(r"drives ([\d.]+) m in ([\d.]+) s", card)
    assert found is not None
    assert float(found[1]) == pytest.approx(chord, abs=0.02)
    assert float(found[2]) == 1.2


def test_card_counts_named_objects_without_robot_ground_and_swarms(card: str) -> None:
    found = re.search(r"(\d+)\s+named objects", card)
    assert found is not None
    assert int(found[1]) == len(load_world("park").instances) == 125


def test_card_frames_match_tf_static(card: str, small_run: Path) -> None:
    listed = {(row[0], row[1]): [float(x) for x in row[2].split(",")] for row in rows_of(card, "Frames")}
    true = static_transforms(small_run / "park_1.bag")
    assert listed.keys() == true.keys()
    for pair, xyz in listed.items():
        assert np.allclose(true[pair][:3, 3], xyz, atol=1e-5)


def test_card_classes_match_the_class_table(card: str) -> None:
    listed = {int(row[0]): (row[1], row[2]) for row in rows_of(card, "Classes")}
    assert listed == {int(c.label): (c.name, " ".join(map(str, c.rgb or ()))) for c in CLASSES[1:18]}
    assert Label.VOID not in listed


def test_sha256sum_accepts_the_folder_and_detects_one_flipped_bit(small_run: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(small_run, tmp_path / "copy"))
    command = ["sha256sum", "-c", "--strict", CHECKSUMS]
    checked = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    names = ("park_1.bag", "experiment.yaml", "DATASET.md", "made_by.json")
    assert checked.stdout.splitlines() == [f"{name}: OK" for name in names]
    with (folder / "park_1.bag").open("r+b") as bag:
        bag.seek(-1, 2)
        last = bag.read(1)[0]
        bag.seek(-1, 2)
        bag.write(bytes([last ^ 1]))
    assert subprocess.run(command, cwd=folder, capture_output=True, check=False).returncode == 1
    assert read_checksums(folder)["park_1.bag"] != sha256_of(folder / "park_1.bag")


def test_checksums_of_files_outside_the_folder_are_refused(tmp_path: Path) -> None:
    assert read_checksums(tmp_path) == {}
    for line in ("0" * 64 + "  ../secret", "0" * 64 + "  /etc/passwd", "0" * 63 + "  a", "0" * 64 + " a", "\xff"):
        (tmp_path / CHECKSUMS).write_text(line + "\n", encoding="utf-8")
        with pytest.raises(BagError, match="line 1: "):
            read_checksums(tmp_path)
