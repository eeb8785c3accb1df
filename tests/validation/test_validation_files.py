# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A flipped byte anywhere in a run's files is found: by the checksums, and in the bag by its structure alone."""

import hashlib
import re
import shutil
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
from changed_bags import bag_in, failures
from rosbags.rosbag1 import ReaderError

from fieldtruth.bag.provenance import CHECKSUMS
from fieldtruth.bag.reader import open_bag
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.progress import Silent
from fieldtruth.validation.files import BagFile, check_checksums, unpack
from fieldtruth.validation.runner import validate

PARTS = ("magic", "header", "padding", "chunks", "packed", "index records", "index")


@pytest.fixture
def copy(lean_run: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(lean_run, tmp_path / lean_run.name))


def offsets(data: bytes, part: str, rng: np.random.Generator) -> list[int]:
    """Bytes in a part of a bag, found without reading it as a bag."""
    index_at = int.from_bytes(data[data.index(b"index_pos=") + 10 :][:8], "little")
    first = data.index(b"compression=lz4")
    words = {"chunks": b"compression=lz4", "index records": b"count="}
    if part in words:  # the word, a few bytes before it, its value
        found = [match.start() for match in re.finditer(words[part], data[:index_at]) if match.start() >= first]
        return [int(k) + int(rng.integers(-4, len(words[part]) + 4)) for k in rng.choice(found, 4, replace=False)]
    bounds = {
        "magic": (0, 13),
        "header": (13, 86),
        "padding": (100, first - 30),
        "packed": (first + 50, index_at),
        "index": (index_at, len(data)),
    }
    return [int(k) for k in (*rng.integers(*bounds[part], 5), bounds[part][1] - 1)]


def read_through(path: Path, good: Path) -> tuple[bool | None, str]:
    """Result of reading a bag front to back with the topics of the intact one, and a digest of its messages."""
    digest = hashlib.sha256()
    with open_bag(good) as stored:
        bag = BagFile(path, stored.connections)
    for raw in bag.messages():
        digest.update(f"{raw.stamp_ns}{raw.topic}".encode() + raw.data)
    return bag.result().passed, digest.hexdigest()


@pytest.mark.parametrize("part", PARTS)
def test_flipped_bit_is_found_by_the_structure_alone(lean_run: Path, tmp_path: Path, part: str) -> None:
    rng = np.random.default_rng(PARTS.index(part))
    data, target = bytearray(bag_in(lean_run).read_bytes()), tmp_path / "flipped.bag"
    intact = read_through(bag_in(lean_run), bag_in(lean_run))
    for at in offsets(bytes(data), part, rng):
        bit = 1 << int(rng.integers(8))
        data[at] ^= bit
        target.write_bytes(data)
        data[at] ^= bit
        passed, content = read_through(target, bag_in(lean_run))
        # LZ4 refers back to equal bytes: a changed reference may find equal ones elsewhere, and nothing has changed.
        same = part == "packed" and (passed, content) == intact
        assert passed is False or same, f"bit {bit} of byte {at}"


def test_structure_of_an_intact_bag_passes(lean_run: Path) -> None:
    """Guard of the test above: all messages are read, in time order, without a mismatch."""
    path = bag_in(lean_run)
    with open_bag(path) as stored:
        bag, counts = BagFile(path, stored.connections), stored.counts
    messages = list(bag.messages())
    assert bag.result().passed is True
    assert len(messages) == sum(counts.values()) > 1000
    stamps = [raw.stamp_ns for raw in messages]
    assert stamps == sorted(stamps)


def test_bytes_behind_the_compressed_data_of_a_chunk_are_an_error() -> None:
    """LZ4 itself ignores them."""
    packed = lz4.frame.compress(b"twelve bytes", content_checksum=True)
    assert unpack("lz4", packed) == b"twelve bytes"
    with pytest.raises(ReaderError, match="behind its LZ4 frame"):
        unpack("lz4", packed + b"x")
    with pytest.raises(RuntimeError):
        unpack("lz4", packed[:-1])


@pytest.mark.parametrize("name", ["park_1.bag", "experiment.yaml", "DATASET.md"])
def test_flipped_byte_is_found_by_the_checksums(copy: Path, name: str) -> None:
    assert check_checksums(bag_in(copy), Silent()).passed is True
    data = bytearray((copy / name).read_bytes())
    data[len(data) // 3] ^= 1
    (copy / name).write_bytes(data)
    check = check_checksums(bag_in(copy), Silent())
    assert check.passed is False
    assert name in check.text


def test_checks_of_a_damaged_bag_do_not_pass(copy: Path) -> None:
    data = bytearray(bag_in(copy).read_bytes())
    data[len(data) // 2] ^= 8
    bag_in(copy).write_bytes(data)
    checks = {check.name: check.passed for check in validate(copy, quick=True)}
    assert {name for name, passed in checks.items() if passed is False} >= {"checksums", "structure"}
    assert True not in [passed for name, passed in checks.items() if name not in ("experiment", "checksums")]


@pytest.mark.parametrize("share", [0.0005, 0.5, 0.9999])
def test_truncated_bag_fails(copy: Path, share: float) -> None:
    data = bag_in(copy).read_bytes()
    bag_in(copy).write_bytes(data[: int(share * len(data))])
    assert set(failures(validate(copy, quick=True))) >= {"checksums", "structure"}
    (copy / CHECKSUMS).unlink()
    assert "structure" in failures(validate(copy, quick=True))


def test_missing_checksums_are_skipped_and_an_unreadable_experiment_fails(copy: Path) -> None:
    (copy / CHECKSUMS).unlink()
    path = copy / "experiment.yaml"
    path.write_text(path.read_text().replace("seed:", "sead:"))
    checks = {check.name: check for check in validate(copy, quick=True)}
    assert checks["checksums"].passed is None
    assert CHECKSUMS in checks["checksums"].text
    assert list(failures(list(checks.values()))) == ["experiment"]
    assert checks["motion"].passed is checks["labels"].passed is True


def test_missing_files_and_malformed_checksums_fail(copy: Path) -> None:
    (copy / "DATASET.md").unlink()
    assert "DATASET.md is missing" in check_checksums(bag_in(copy), Silent()).text
    (copy / CHECKSUMS).write_text("not a checksum\n")
    check = check_checksums(bag_in(copy), Silent())
    assert check.passed is False
    assert "line 1" in check.text


@pytest.mark.parametrize("content", [b"", b"not a bag\n" * 100])
def test_file_that_never_was_a_bag_is_an_error(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.bag").write_bytes(content)
    with pytest.raises(FieldtruthError, match=r"x\.bag"):
        validate(tmp_path / "x.bag")
    with pytest.raises(FieldtruthError, match="nowhere"):
        validate(tmp_path / "nowhere")
