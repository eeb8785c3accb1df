# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
import errno
import threading
from pathlib import Path

import pytest
from record_fakes import FakeCamera, make_experiment, make_slices
from rosbags.rosbag1 import Writer

from fieldtruth.core.errors import OutputError

EXPERIMENT = make_experiment(3.2)


def joined(folder: Path, workers: int, seed: int = 0) -> bytes:
    folder.mkdir()
    slices = make_slices(folder, make_experiment(3.2, seed))
    slices.make(workers)
    slices.join(folder / "x.bag")
    return (folder / "x.bag").read_bytes()


def test_bytes_depend_on_the_seed_and_not_on_the_number_of_workers(tmp_path: Path) -> None:
    alone = joined(tmp_path / "one", 1)
    assert joined(tmp_path / "two", 2) == alone
    assert joined(tmp_path / "three", 3) == alone
    assert joined(tmp_path / "other", 2, seed=1) != alone


def test_only_missing_slices_are_made(tmp_path: Path) -> None:
    whole = joined(tmp_path / "whole", 2)
    slices = make_slices(tmp_path / "again", EXPERIMENT)
    slices.folder.mkdir()
    slices.make(1)
    kept = slices.path(0).stat().st_mtime_ns
    slices.path(2).unlink()
    slices.path(1).rename(slices.path(1).with_suffix(".bag.part"))  # the state after a kill
    assert slices.missing() == [1, 2]
    slices.make(2)
    assert slices.path(0).stat().st_mtime_ns == kept
    slices.join(tmp_path / "again.bag")
    assert (tmp_path / "again.bag").read_bytes() == whole
    assert sorted(p.name for p in slices.folder.iterdir()) == [slices.path(k).name for k in range(4)]


def test_progress_adds_up_to_the_simulated_time(tmp_path: Path) -> None:
    reported: list[float] = []
    slices = make_slices(tmp_path, EXPERIMENT)
    slices.make(2, reported.append)
    assert sum(reported) == pytest.approx(3.2, abs=1e-9)
    assert len(reported) > 20
    reported.clear()
    slices.join(tmp_path / "x.bag", reported.append)
    assert sum(reported) == pytest.approx(3.2, abs=1e-9)


def test_every_worker_has_its_own_sensors(tmp_path: Path) -> None:
    owners: dict[int, set[int]] = {}

    class Watch(FakeCamera):
        pause = 0.001

        def render(self, world_from_optical):  # type: ignore[no-untyped-def]
            owners.setdefault(id(self), set()).add(threading.get_ident())
            return super().render(world_from_optical)

    slices = make_slices(tmp_path, EXPERIMENT)
    make = slices._make_sensors
    cameras = []

    def sensors():  # type: ignore[no-untyped-def]
        cameras.append(Watch(EXPERIMENT.rig.cameras, None))  # type: ignore[arg-type]
        return make()._replace(camera=cameras[-1])

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


def test_no_space_for_the_joined_bag(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    slices = make_slices(tmp_path, make_experiment(0.2))
    slices.make(1)

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("fieldtruth.bag.writer._copy", full)
    with pytest.raises(OutputError, match=r"x\.bag: no space left"):
        slices.join(tmp_path / "x.bag")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["000000.bag"]
