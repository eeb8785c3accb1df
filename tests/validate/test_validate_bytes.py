# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A flipped byte anywhere in a run's files is found: by the checksums, and in the bag by its structure alone."""

import re
import shutil
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
from validate_bags import bag_in, failures, quick_failures

from fieldtruth.bag.checksums import CHECKSUMS
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.progress import Silent
from fieldtruth.validation import validate
from fieldtruth.validation.bagfile import BagFile
from fieldtruth.validation.files import checksums_check
from fieldtruth.validation.records import Record, StructureError, unpack

PARTS = ("magic", "header", "padding", "chunks", "packed", "index records", "index")


@pytest.fixture
def copy(lean_run: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(lean_run, tmp_path / lean_run.name))


def places(data: bytes, part: str, rng: np.random.Generator) -> list[int]:
    """Bytes in a part of a bag, found without reading it as a bag."""
    index_at = int.from_bytes(data[data.index(b"index_pos=") + 10 :][:8], "little")
    first = data.index(b"compression=lz4")
    words = {"chunks": b"compression=lz4", "index records": b"count="}
    if part in words:  # a word that stands there, a few bytes before it, its value
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


@pytest.mark.parametrize("part", PARTS)
def test_a_flipped_bit_is_found_by_the_structure_alone(lean_run: Path, tmp_path: Path, part: str) -> None:
    rng = np.random.default_rng(PARTS.index(part))
    data, target = bytearray(bag_in(lean_run).read_bytes()), tmp_path / "flipped.bag"
    for at in places(bytes(data), part, rng):
        bit = 1 << int(rng.integers(8))
        data[at] ^= bit
        target.write_bytes(data)
        data[at] ^= bit
        bag = BagFile(target)
        for _ in bag.messages(2):
            pass
        assert bag.result().passed is False, f"bit {bit} of byte {at}"


def test_the_structure_of_an_intact_bag_is_sound(lean_run: Path) -> None:
    """The guard of the test above: the reader finds every message, in time order, and no fault."""
    bag = BagFile(bag_in(lean_run))
    stamps = [raw.stamp_ns for raw in bag.messages(2)]
    assert bag.result().passed is True
    assert len(stamps) == sum(bag.counts.values()) > 1000
    assert stamps == sorted(stamps)


def test_a_chunk_that_goes_on_behind_what_is_packed_in_it_is_a_fault() -> None:
    """LZ4 unpacks it without a word."""
    packed = lz4.frame.compress(b"twelve bytes", content_checksum=True)
    fields = {"op": b"\5", "compression": b"lz4", "size": (12).to_bytes(4, "little")}
    assert unpack(Record(0, fields, packed)) == b"twelve bytes"
    for data, size in [(packed + b"x", 12), (packed[:-1], 12), (packed, 13)]:
        with pytest.raises(StructureError, match="chunk at byte 0"):
            unpack(Record(0, {**fields, "size": size.to_bytes(4, "little")}, data))


@pytest.mark.parametrize("name", ["park_1.bag", "experiment.yaml", "DATASET.md"])
def test_a_flipped_byte_is_found_by_the_checksums(copy: Path, name: str) -> None:
    assert checksums_check(bag_in(copy), Silent()).passed is True
    data = bytearray((copy / name).read_bytes())
    data[len(data) // 3] ^= 1
    (copy / name).write_bytes(data)
    check = checksums_check(bag_in(copy), Silent())
    assert check.passed is False
    assert name in check.text


def test_a_damaged_bag_fails_and_what_was_not_read_is_not_called_right(copy: Path) -> None:
    data = bytearray(bag_in(copy).read_bytes())
    data[len(data) // 2] ^= 8
    bag_in(copy).write_bytes(data)
    checks = {check.name: check.passed for check in validate(copy, quick=True)}
    assert {name for name, passed in checks.items() if passed is False} >= {"checksums", "structure"}
    assert True not in [passed for name, passed in checks.items() if name not in ("experiment", "checksums")]


@pytest.mark.parametrize("share", [0.0005, 0.5, 0.9999])
def test_a_bag_that_was_cut_off_fails(copy: Path, share: float) -> None:
    data = bag_in(copy).read_bytes()
    bag_in(copy).write_bytes(data[: int(share * len(data))])
    assert set(quick_failures(copy)) >= {"checksums", "structure"}
    (copy / CHECKSUMS).unlink()
    assert "structure" in quick_failures(copy)


def test_without_checksums_this_check_is_skipped(copy: Path) -> None:
    (copy / CHECKSUMS).unlink()
    checks = {check.name: check for check in validate(copy, quick=True)}
    assert checks["checksums"].passed is None
    assert CHECKSUMS in checks["checksums"].text
    assert not failures(list(checks.values()))


def test_checksums_that_are_none_and_files_that_are_gone_fail(copy: Path) -> None:
    (copy / "DATASET.md").unlink()
    assert "DATASET.md is missing" in quick_failures(copy)["checksums"]
    (copy / CHECKSUMS).write_text("not a checksum\n")
    assert "line 1" in quick_failures(copy)["checksums"]


def test_an_experiment_that_cannot_be_read_fails_and_the_rest_is_checked(copy: Path) -> None:
    (copy / CHECKSUMS).unlink()
    path = copy / "experiment.yaml"
    path.write_text(path.read_text().replace("seed:", "sead:"))
    checks = {check.name: check.passed for check in validate(copy, quick=True)}
    assert checks["experiment"] is False
    assert checks["motion"] is checks["labels"] is True


@pytest.mark.parametrize("content", [b"", b"no bag at all\n" * 100])
def test_what_never_was_a_bag_is_an_error(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.bag").write_bytes(content)
    with pytest.raises(FieldtruthError, match=r"x\.bag"):
        validate(tmp_path / "x.bag")
    with pytest.raises(FieldtruthError, match="nowhere"):
        validate(tmp_path / "nowhere")
