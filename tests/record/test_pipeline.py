# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The whole pipeline with fake sensors: what it writes, what it refuses, and that interruptions leave no trace."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest
from record_fakes import FakeEngine, make_experiment, make_world

from fieldtruth import pipeline
from fieldtruth.bag.writer import GrowingBag
from fieldtruth.core import cache
from fieldtruth.core.errors import DriveError, FieldtruthWarning, OutputError
from fieldtruth.core.locks import locked
from fieldtruth.drive.track import Track
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.light_config import WeatherConfig
from fieldtruth.pipeline import generate_by
from fieldtruth.record.slices import Slices, slices_key

generate = partial(generate_by, FakeEngine())
FILES = ["DATASET.md", "SHA256SUMS", "experiment.yaml", "made_by.json", "tiny.bag"]


def listing(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_a_run_is_bag_experiment_card_and_checksums(tmp_path: Path) -> None:
    bag = generate(make_experiment(0.5), tmp_path / "data", workers=2)
    assert bag == tmp_path / "data" / "tiny" / "tiny.bag"
    assert listing(tmp_path) == [f"data/tiny/{name}" for name in FILES]
    assert not (bag.parent / ".slices").exists()


def test_the_written_experiment_gives_the_same_bag(tmp_path: Path) -> None:
    first = generate(make_experiment(0.5, seed=7), tmp_path / "one", workers=1)
    again = load_experiment(first.with_name("experiment.yaml"))
    assert again == make_experiment(0.5, seed=7)
    assert generate(again, tmp_path / "two", workers=2).read_bytes() == first.read_bytes()


def test_weather_that_no_lidar_sees_is_a_warning(tmp_path: Path) -> None:
    foggy = make_experiment(0.2).model_copy(update={"weather": WeatherConfig(fog_visibility_m=50.0)})
    with pytest.warns(FieldtruthWarning, match=r"no effect on ideal LiDARs \(lidar\); give them a signal"):
        generate(foggy, tmp_path, workers=1)


def test_another_seed_gives_another_bag(tmp_path: Path) -> None:
    one, two = (generate(make_experiment(0.5, seed=s), tmp_path / str(s), workers=1) for s in (0, 1))
    assert one.read_bytes() != two.read_bytes()


def joined_lines(out: Path) -> int:
    """Number of slices that are joined, and safe in the unfinished bag."""
    return sum(len(path.read_bytes().splitlines()) for path in out.glob("tiny/.slices/*/whole.bag.journal"))


def start(out: Path) -> subprocess.Popen[bytes]:
    """Start a run of 2.5 s that takes about 2.5 s, and wait until it has joined its first slice."""
    script = Path(__file__).with_name("slow_run.py")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, str(script), str(out), "2.5", "0.04"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, env=environment)
    end = time.monotonic() + 60
    while not joined_lines(out):
        assert process.poll() is None, process.communicate()[1].decode()
        assert time.monotonic() < end
        time.sleep(0.01)
    return process


@pytest.mark.slow
@pytest.mark.parametrize("sign", [signal.SIGKILL, signal.SIGINT])
def test_an_interrupted_run_resumes_and_ends_with_the_same_bytes(tmp_path: Path, sign: signal.Signals) -> None:
    whole = generate(make_experiment(2.5), tmp_path / "whole", workers=1).read_bytes()
    process = start(tmp_path)
    process.send_signal(sign)
    process.communicate()
    assert process.returncode != 0
    joined = joined_lines(tmp_path)
    assert 0 < joined < 25
    assert not (tmp_path / "tiny" / "tiny.bag").exists()
    if sign == signal.SIGINT:  # a killed process cannot clean up
        assert not list(tmp_path.glob("tiny/.slices/*/*.part"))

    notes = Notes()
    bag = generate(make_experiment(2.5), tmp_path, workers=2, progress=notes)
    assert bag.read_bytes() == whole
    assert listing(tmp_path / "tiny") == FILES
    assert notes.stages["sense and label"][1] >= joined / 10 - 1e-9


def test_slices_of_another_world_are_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = generate(make_experiment(0.5), tmp_path / "whole", workers=1).read_bytes()

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    for objects in (9, 10):
        engine = FakeEngine(lambda _, n=objects: make_world(objects=n))  # type: ignore[misc]
        with monkeypatch.context() as patch:
            patch.setattr(pipeline, "count_messages", stop)
            with pytest.raises(KeyboardInterrupt):
                generate_by(engine, make_experiment(0.5), tmp_path, workers=1)
        assert len(list(tmp_path.glob("tiny/.slices/*"))) == 1  # the earlier ones are removed
    assert generate(make_experiment(0.5), tmp_path, workers=1).read_bytes() == whole


def test_a_finished_bag_is_kept_without_overwrite(tmp_path: Path) -> None:
    bag = generate(make_experiment(0.5), tmp_path, workers=1)
    before = bag.stat().st_mtime_ns
    with pytest.raises(OutputError, match=r"tiny\.bag is already finished; .*--overwrite"):
        generate(make_experiment(0.5), tmp_path, workers=1)
    assert bag.stat().st_mtime_ns == before
    content = bag.read_bytes()
    assert generate(make_experiment(0.5), tmp_path, workers=1, overwrite=True).read_bytes() == content
    assert bag.stat().st_mtime_ns != before


def test_another_experiment_is_kept_without_overwrite(tmp_path: Path) -> None:
    bag = generate(make_experiment(0.5), tmp_path, workers=1)
    before = {path: path.read_bytes() for path in bag.parent.iterdir()}
    other = make_experiment(0.6, seed=4)
    with pytest.raises(OutputError, match=r"another experiment \(different: seed, seconds\).*--overwrite"):
        generate(other, tmp_path, workers=1)
    assert {path: path.read_bytes() for path in bag.parent.iterdir()} == before
    generate(other, tmp_path, workers=1, overwrite=True)
    assert load_experiment(bag.with_name("experiment.yaml")) == other
    assert bag.read_bytes() == generate(other, tmp_path / "fresh", workers=1).read_bytes()


def test_a_broken_experiment_file_is_kept_without_overwrite(tmp_path: Path) -> None:
    folder = tmp_path / "tiny"
    folder.mkdir()
    (folder / "experiment.yaml").write_text("seed: [")
    with pytest.raises(OutputError, match="cannot be read"):
        generate(make_experiment(0.5), tmp_path, workers=1)
    assert (folder / "experiment.yaml").read_text() == "seed: ["


def test_files_of_the_user_are_never_touched(tmp_path: Path) -> None:
    (tmp_path / "tiny" / "mine").mkdir(parents=True)
    (tmp_path / "tiny" / "mine" / "notes.txt").write_text("keep")
    generate(make_experiment(0.5), tmp_path, workers=1)
    generate(make_experiment(0.6), tmp_path, workers=1, overwrite=True)
    assert (tmp_path / "tiny" / "mine" / "notes.txt").read_text() == "keep"


def test_file_in_the_output_path_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "data").write_text("")
    with pytest.raises(OutputError, match=r"cannot write .*tiny: a (part of the path is a file|file exists)"):
        generate(make_experiment(0.5), tmp_path / "data", workers=1)
    (tmp_path / "tiny").write_text("")
    with pytest.raises(OutputError, match=r"cannot write .*tiny: a part of the path is a file, not a folder"):
        generate(make_experiment(0.5), tmp_path, workers=1)


def refuse(*_: object, **__: object) -> None:
    raise PermissionError(13, "Permission denied")


@pytest.mark.parametrize("method", ["mkdir", "write_bytes"])
def test_unwritable_folder_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    monkeypatch.setattr(Path, method, refuse)  # root may write anywhere
    with pytest.raises(OutputError, match=r"cannot write .*tiny: permission denied$"):
        generate(make_experiment(0.5), tmp_path, workers=1)


def test_no_link_leads_out_of_the_output_folder(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "tiny").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match="leads out of"):
        generate(make_experiment(0.5), tmp_path / "data", workers=1)
    (tmp_path / "data" / "tiny").unlink()
    (tmp_path / "data" / "tiny").mkdir()
    (tmp_path / "data" / "tiny" / ".slices").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match="leads out of"):
        generate(make_experiment(0.5), tmp_path / "data", workers=1)
    assert not list((tmp_path / "elsewhere").iterdir())


def test_the_output_folder_itself_may_be_a_link(tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    (tmp_path / "data").symlink_to(tmp_path / "disk")
    generate(make_experiment(0.5), tmp_path / "data", workers=1)
    assert listing(tmp_path / "disk") == [f"tiny/{name}" for name in FILES]


def test_two_runs_do_not_share_a_folder(tmp_path: Path) -> None:
    (tmp_path / "tiny").mkdir()
    with locked(tmp_path / "tiny"), pytest.raises(OutputError, match="is in use"):
        generate(make_experiment(0.5), tmp_path, workers=1)
    generate(make_experiment(0.5), tmp_path, workers=1)


def test_a_failed_drive_leaves_the_folder_as_it_was(tmp_path: Path) -> None:
    def stuck(*_: object) -> Track:
        raise DriveError("stuck at 3 s before waypoint 1")

    fails = partial(generate_by, FakeEngine(track=stuck))
    with pytest.raises(DriveError):
        fails(make_experiment(0.5), tmp_path / "new" / "folder", workers=1)
    assert list(tmp_path.iterdir()) == []  # nothing is written
    bag = generate(make_experiment(0.5), tmp_path, workers=1)
    content = bag.read_bytes()
    with pytest.raises(DriveError):
        fails(make_experiment(1.5), tmp_path, workers=1, overwrite=True)
    assert bag.read_bytes() == content  # nothing is lost
    with pytest.raises(OutputError, match="already finished"):
        generate(make_experiment(0.5), tmp_path, workers=1)


class Notes:
    """Records the progress of a run."""

    def __init__(self) -> None:
        self.stages: dict[str, tuple[float | None, float]] = {}
        self.done: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str, total: float | None = None, done: float = 0.0) -> Iterator[Callable[[float], None]]:
        self.stages[name] = (total, done)
        self.done[name] = 0.0

        def advance(amount: float) -> None:
            self.done[name] += amount

        yield advance


def test_progress_is_reported_by_stage(tmp_path: Path) -> None:
    notes = Notes()
    generate(make_experiment(2.5), tmp_path, workers=1, progress=notes)
    assert list(notes.stages) == [
        "build the world",
        "drive",
        "prepare the scene",
        "sense and label",
        "card and checksums",
    ]
    assert notes.stages["sense and label"] == (2.5, 0.0)
    assert notes.done["sense and label"] == pytest.approx(2.5)


def test_progress_counts_the_slices_of_an_earlier_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    join = Slices._join

    def stop_at_the_second(slices: Slices, bag: GrowingBag) -> None:
        if slices.joined:
            raise KeyboardInterrupt
        join(slices, bag)

    with monkeypatch.context() as patch:
        patch.setattr(Slices, "_join", stop_at_the_second)
        with pytest.raises(KeyboardInterrupt):
            generate(make_experiment(2.5), tmp_path, workers=1)
    notes = Notes()
    generate(make_experiment(2.5), tmp_path, workers=1, progress=notes)
    seconds, done = notes.stages["sense and label"]
    assert seconds == 2.5
    assert 0.2 <= done <= 2.5
    assert notes.done["sense and label"] == pytest.approx(2.5 - done)


def test_the_key_of_slices_depends_on_every_input_value() -> None:
    world = make_world()
    assert slices_key(world, 1) == slices_key(make_world(), 1)
    assert slices_key(world, 1) != slices_key(world, 2)
    changed = make_world()
    changed.terrain.field.heights[1, 1] += 1e-6
    assert slices_key(changed, 1) != slices_key(world, 1)


SHAPES_SLICES = (
    "core/classes",
    "sensors/lidar/sensing",
    "sensors/camera/sensing",
    "world/model",
    "sensors/lidar/sensor",
    "sensors/camera/sensor",
    "sensors/imu/sensor",
    "record/streams",
)
LEAVES_SLICES = ("report/card", "exporters/pcd", "validation/check", "degradation", "cli/__main__")


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A copy of the package's sources."""
    source = Path(pipeline.__file__).parent
    shutil.copytree(source, tmp_path / "fieldtruth", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def test_only_edits_of_code_that_makes_slices_change_their_key(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "_ROOT", sources)

    def key_after(*modules: str) -> str:
        for module in modules:
            with (sources / "fieldtruth" / f"{module}.py").open("a") as file:
                file.write("# edited\n")
        cache._sources_digest.cache_clear()
        return slices_key()

    keys = [key_after(), *(key_after(module) for module in SHAPES_SLICES)]
    assert len({*keys}) == len(keys)
    assert key_after(*LEAVES_SLICES) == keys[-1]
    cache._sources_digest.cache_clear()
