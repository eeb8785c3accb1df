# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""ZIP archives read by `unzip`, `sha256sum` and zipfile."""

import hashlib
import shutil
import struct
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from zipfile import ZipFile

import pytest
from export_bags import peak_memory
from isal import isal_zlib

from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import open_run
from fieldtruth.core.errors import OutputError
from fieldtruth.core.progress import Silent
from fieldtruth.exporters import Options, export, zipped

BESIDE = ("experiment.yaml", "DATASET.md", "made_by.json", "SHA256SUMS")


@pytest.fixture(scope="module")
def packed(exported: Callable[[str], Path]) -> Path:
    return exported("zip")


@pytest.fixture
def alone(small_run: Path, tmp_path: Path) -> Path:
    """Copy of the bag in an empty folder, under another name."""
    bag = tmp_path / "elsewhere" / "drive.bag"
    bag.parent.mkdir()
    shutil.copy(small_run / "park_1.bag", bag)
    return bag


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def read_so_far() -> int:
    """Bytes that this process has read from files."""
    return int(Path("/proc/self/io").read_text().split()[1])


def test_unzip_and_sha256sum_accept_the_archive(small_run: Path, packed: Path, tmp_path: Path) -> None:
    if shutil.which("unzip") is None:
        pytest.skip("unzip is not installed")
    subprocess.run(["unzip", "-q", packed, "-d", tmp_path], check=True)
    for sums in ("park_1.sha256", "SHA256SUMS"):
        told = subprocess.run(["sha256sum", "--strict", "-c", sums], cwd=tmp_path, capture_output=True, text=True)
        assert told.returncode == 0, told.stderr
        assert "park_1.bag: OK" in told.stdout
    assert {path.name for path in tmp_path.iterdir()} == {"park_1.bag", "park_1.sha256", *BESIDE}
    for name in ("park_1.bag", *BESIDE):
        assert digest(tmp_path / name) == digest(small_run / name)
    assert (tmp_path / "park_1.sha256").read_text() == f"{digest(small_run / 'park_1.bag')}  park_1.bag\n"


def test_crc_detects_a_flipped_byte(packed: Path) -> None:
    with ZipFile(packed) as archive:
        assert archive.testzip() is None
    data = bytearray(packed.read_bytes())
    data[len(data) // 2] ^= 1
    with ZipFile(BytesIO(data)) as archive:
        assert archive.testzip() == "park_1.bag"


@pytest.mark.parametrize("workers", [1, 3])
def test_zip_is_reproducible_with_any_workers(small_run: Path, packed: Path, tmp_path: Path, workers: int) -> None:
    again = export(small_run, "zip", out=tmp_path / "again.zip", workers=workers)
    assert digest(again) == digest(packed)


@pytest.mark.skipif(sys.version_info < (3, 11, 4), reason="its zipfile writes sizes beside the ZIP64 field: gh-103861")
def test_local_headers_are_zip64_without_dates(packed: Path) -> None:
    data, full = packed.read_bytes(), 2**32 - 1
    with ZipFile(packed) as archive:
        for entry in archive.infolist():
            assert struct.unpack_from("<2L", data, entry.header_offset + 18) == (full, full)
            at = entry.header_offset + 30 + len(entry.filename)
            assert struct.unpack_from("<2H2Q", data, at) == (1, 16, entry.file_size, entry.compress_size)
            assert entry.date_time == (1980, 1, 1, 0, 0, 0)
            assert entry.external_attr >> 16 == 0o100644


def test_unzip_reads_a_bag_above_the_zip64_limit(
    small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a lower limit, so that the test need not write 4 GB."""
    monkeypatch.setattr(zipfile, "ZIP64_LIMIT", 1000)
    packed = export(small_run, "zip", out=tmp_path / "run.zip")
    monkeypatch.undo()
    data = packed.read_bytes()
    assert data[-42:-38] == b"PK\x06\x07"
    (end,) = struct.unpack_from("<Q", data, len(data) - 34)
    assert data[end : end + 4] == b"PK\x06\x06"
    with ZipFile(packed) as archive:
        assert archive.testzip() is None
        assert archive.getinfo("park_1.bag").file_size == (small_run / "park_1.bag").stat().st_size
    if shutil.which("unzip") is not None:
        subprocess.run(["unzip", "-tq", packed], check=True)


def test_isa_l_packs_the_bag(small_run: Path, packed: Path) -> None:
    packer = isal_zlib.compressobj(1, isal_zlib.DEFLATED, -15)
    data = (small_run / "park_1.bag").read_bytes()
    size = sum(len(packer.compress(data[at : at + 2**20])) for at in range(0, len(data), 2**20)) + len(packer.flush())
    with ZipFile(packed) as archive:
        assert archive.getinfo("park_1.bag").compress_size == size


def test_the_bag_is_read_once(small_run: Path, tmp_path: Path) -> None:
    run, before = open_run(small_run), read_so_far()
    zipped.write([run], tmp_path / "run.zip", Options(None, 2, Silent()))
    size = run.bag.stat().st_size
    assert size < read_so_far() - before < 1.02 * size


def test_memory_does_not_grow_with_duration(tmp_path: Path) -> None:
    blocks = 192

    def made() -> Iterator[bytes]:
        for number in range(blocks):
            yield bytes([number]) * 2**20

    with ZipFile(tmp_path / "blocks.zip", "w") as archive:
        most = peak_memory(lambda: zipped.add_member(archive, "blocks", made()))
    assert most < blocks * 2**20 / 12
    with ZipFile(tmp_path / "blocks.zip") as whole:
        assert whole.infolist()[0].file_size == blocks * 2**20
        assert whole.testzip() is None


def test_foreign_bag_is_packed_without_unrelated_files(small_run: Path, alone: Path) -> None:
    (alone.parent / "README.md").write_text("About the drive.\n")
    shutil.copy(small_run / "experiment.yaml", alone.parent)  # of park_1, so not of this bag
    (alone.parent / "other.bag").write_bytes(b"")
    with ZipFile(export(alone, "zip")) as archive:
        assert archive.namelist() == ["drive.bag", "drive.sha256"]
    (alone.parent / "other.bag").unlink()
    with ZipFile(export(alone, "zip", out=alone.parent / "second.zip")) as archive:
        assert archive.namelist() == ["drive.bag", "drive.sha256", "README.md"]
        assert archive.read("README.md") == b"About the drive.\n"


def test_bag_that_differs_from_its_checksum_is_refused(alone: Path) -> None:
    (alone.parent / "SHA256SUMS").write_text(f"{digest(alone)}  drive.bag\n")
    export(alone, "zip", out=alone.parent / "whole.zip")
    data = bytearray(alone.read_bytes())
    data[len(data) // 3] ^= 1
    alone.write_bytes(data)
    with pytest.raises(BagError, match=r"drive\.bag has changed since SHA256SUMS"):
        export(alone, "zip")
    assert not list(alone.parent.glob("*drive.zip*"))


def test_truncated_bag_is_refused(alone: Path) -> None:
    alone.write_bytes(alone.read_bytes()[:1_000_000])
    with pytest.raises(BagError, match=r"cannot read .*drive\.bag"):
        export(alone, "zip")
    assert [path.name for path in alone.parent.iterdir()] == ["drive.bag"]


def test_existing_archive_is_kept(alone: Path) -> None:
    there = alone.with_suffix(".zip")
    there.write_text("mine")
    with pytest.raises(OutputError, match=" already exists; remove it"):
        export(alone, "zip")
    assert there.read_text() == "mine"
