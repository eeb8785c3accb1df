# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
import errno
import shutil
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from record_fakes import FakeCamera, make_experiment, make_slices
from rosbags.rosbag1 import Writer

from fieldtruth.bag.writer import GrowingBag
from fieldtruth.core.errors import OutputError, SliceError
from fieldtruth.core.progress import Silent
from fieldtruth.record.slices import Slices, ignore

EXPERIMENT = make_experiment(3.2)


def joined(folder: Path, workers: int, seed: int = 0) -> bytes:
    folder.mkdir()
    slices = make_slices(folder, make_experiment(3.2, seed))
    slices.record(folder / "x.bag", workers, Silent())
    return (folder / "x.bag").read_bytes()


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The recording, made without a fault."""
    return joined(tmp_path_factory.mktemp("slices") / "whole", 2)


def test_bytes_depend_on_the_seed_and_not_on_the_number_of_workers(whole: bytes, tmp_path: Path) -> None:
    alone = joined(tmp_path / "one", 1)
    assert whole == alone
    assert joined(tmp_path / "three", 3) == alone
    assert joined(tmp_path / "other", 2, seed=1) != alone


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of all slices of the recording, none of them joined; its name is part of their seals."""
    folder = tmp_path_factory.mktemp("made") / "again"
    folder.mkdir()
    make_slices(folder, EXPERIMENT).make(1)
    return folder


@pytest.fixture
def slices(made: Path, tmp_path: Path) -> Slices:
    """All slices of the recording, in a folder of their own."""
    shutil.copytree(made, tmp_path / "again")
    return make_slices(tmp_path / "again", EXPERIMENT)


def test_only_missing_slices_are_made(whole: bytes, slices: Slices) -> None:
    kept = slices.path(0).stat().st_mtime_ns
    slices.path(2).unlink()
    slices.path(1).rename(slices.path(1).with_suffix(".bag.part"))  # the state after a kill
    assert slices.missing() == [1, 2]
    slices.make(2)
    assert slices.path(0).stat().st_mtime_ns == kept
    assert sorted(p.name for p in slices.folder.iterdir()) == [slices.path(k).name for k in range(4)]
    slices.record(slices.folder / "x.bag", 1, Silent())
    assert (slices.folder / "x.bag").read_bytes() == whole


def test_a_slice_is_removed_when_it_is_joined(tmp_path: Path) -> None:
    slices = make_slices(tmp_path, EXPERIMENT)
    files = []

    def note(path: Path) -> None:
        files.append(sorted(p.name for p in tmp_path.glob("*.bag")))
        add(path)

    with GrowingBag(tmp_path / "x.bag", slices.topics) as bag:
        add, bag.add = bag.add, note  # type: ignore[method-assign]
        for _ in slices.made(1, ignore):
            slices._join(bag)
    assert files == [[slices.path(k).name, "x.bag"] for k in range(4)]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["x.bag", "x.bag.journal"]


def flip(path: Path, at: int) -> None:
    """Change one bit of a file."""
    data = bytearray(path.read_bytes())
    data[at] ^= 4
    path.write_bytes(data)


def of_another_seed(path: Path) -> None:
    (path.parent / "other").mkdir()
    other = make_slices(path.parent / "other", make_experiment(3.2, seed=1))
    other.make_one(2)
    other.path(2).replace(path)


DAMAGE: dict[str, Callable[[Path], object]] = {
    "truncated": lambda path: path.write_bytes(path.read_bytes()[:-4096]),
    "zero length": lambda path: path.write_bytes(b""),
    "zeros": lambda path: path.write_bytes(bytes(path.stat().st_size)),
    "a bit of a message": lambda path: flip(path, path.stat().st_size // 2),
    "a bit of the seal": lambda path: flip(path, -1),
    "another slice": lambda path: path.write_bytes(path.with_name("000001.bag").read_bytes()),
    "another seed": of_another_seed,
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE.keys())
def test_a_damaged_slice_is_made_again(whole: bytes, slices: Slices, damage: Callable[[Path], object]) -> None:
    assert slices.is_intact(2)
    damage(slices.path(2))
    assert not slices.is_intact(2)
    slices.record(slices.folder / "x.bag", 1, Silent())
    assert (slices.folder / "x.bag").read_bytes() == whole


def test_a_slice_that_is_damaged_before_it_is_joined_is_one_line(whole: bytes, slices: Slices) -> None:
    with GrowingBag(slices.folder / "x.bag", slices.topics) as bag:
        flip(slices.path(1), 5000)
        with pytest.raises(OutputError, match=r"000001\.bag was damaged on the disk; run the same command again"):
            slices._join(bag)
    again = make_slices(slices.folder, EXPERIMENT)
    again.record(slices.folder / "x.bag", 1, Silent())
    assert (slices.folder / "x.bag").read_bytes() == whole


def stop_after(slices: Slices, count: int) -> None:
    """Join until ``count`` slices are joined, and stop there as a kill would."""
    bag = GrowingBag(slices.folder / "x.bag", slices.topics)
    bag.__enter__()
    for k in range(count):
        bag.add(slices.path(k))
        if k < count - 1:  # the last one is added, and not yet removed
            slices.path(k).unlink()


@pytest.mark.parametrize("change", [None, 200, 3_000_000, -70, "journal", "torn journal", "index"])
def test_joining_goes_on_after_a_crash_with_the_same_bytes(whole: bytes, slices: Slices, change: object) -> None:
    bag, journal = slices.folder / "x.bag", slices.folder / "x.bag.journal"
    stop_after(slices, 3)
    if isinstance(change, int):
        flip(bag, change % bag.stat().st_size)
    elif change == "journal":
        flip(journal, 300)
    elif change == "torn journal":
        journal.write_bytes(journal.read_bytes()[:-40])
    elif change == "index":  # all was joined, and the index written
        slices.record(bag, 1, Silent())
    with bag.open("ab") as file:
        file.write(b"of a copy that was not finished")
    again = make_slices(slices.folder, EXPERIMENT)
    again.record(bag, 1, Silent())
    assert bag.read_bytes() == whole
    assert not list(slices.folder.glob("0*"))


def test_progress_adds_up_to_the_simulated_time(tmp_path: Path) -> None:
    reported: list[float] = []
    slices = make_slices(tmp_path, EXPERIMENT, 10**8)
    slices.make(2, reported.append)
    assert sum(reported) == pytest.approx(3.2, abs=1e-9)
    assert len(reported) == 32


def test_every_worker_has_its_own_sensors(tmp_path: Path) -> None:
    owners: dict[int, set[int]] = {}

    class Watch(FakeCamera):
        pause = 0.001

        def render(self, world_from_optical, robot=None, stamp_ns=0):  # type: ignore[no-untyped-def]
            owners.setdefault(id(self), set()).add(threading.get_ident())
            return super().render(world_from_optical)

    slices = make_slices(tmp_path, EXPERIMENT)
    make = slices._make_sensors
    cameras = []

    def sensors():  # type: ignore[no-untyped-def]
        found: Any = make()
        cameras.append(Watch(EXPERIMENT.rig.stereo, None))  # type: ignore[arg-type]
        found["stereo"]._camera = cameras[-1]
        return found

    slices._make_sensors = sensors
    slices.make(2)
    assert len(cameras) == 2
    assert all(len(threads) == 1 for threads in owners.values())


def test_an_error_in_one_worker_stops_all_and_keeps_finished_slices(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slices = make_slices(tmp_path, EXPERIMENT)
    write_chunk = Writer.write_chunk

    def full(self: Writer, chunk: object) -> None:
        if self.path.name.startswith("000001"):
            raise OSError(errno.ENOSPC, "No space left on device")
        write_chunk(self, chunk)  # type: ignore[arg-type]

    monkeypatch.setattr(Writer, "write_chunk", full)
    with pytest.raises(
        OutputError, match=r"cannot write .*000001\.bag: no space left; free some space and run the same"
    ):
        slices.make(1)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["000000.bag"]


def test_an_unexpected_error_in_a_worker_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    slices = make_slices(tmp_path, EXPERIMENT)

    def fail(self: FakeCamera, world_from_optical: object, robot: object, stamp_ns: int) -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(FakeCamera, "render", fail)
    place = r"ZeroDivisionError: division by zero \(test_slices\.py, line \d+\); the rest is kept$"
    with pytest.raises(SliceError, match=r"^between 0 and 1 s of the recording: " + place):
        slices.make(1)


def test_no_space_for_the_joined_bag(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    slices = make_slices(tmp_path, make_experiment(0.2))

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("fieldtruth.bag.writer._copy", full)
    with pytest.raises(OutputError, match=r"x\.bag: no space left"):
        slices.record(tmp_path / "x.bag", 1, Silent())
    assert sorted(p.name for p in tmp_path.iterdir()) == ["000000.bag", "x.bag", "x.bag.journal"]
