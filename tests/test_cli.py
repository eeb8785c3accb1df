# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The command line: an error is one line and exit code 2, and each command is one call of the library."""

import json
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import simplejpeg
from rosbags.rosbag1 import Writer

import fieldtruth
from fieldtruth import cli
from fieldtruth.core.classes import CLASSES
from fieldtruth.core.errors import OutputError
from fieldtruth.core.parallel import cpu_count
from fieldtruth.experiment.catalogue import list_models

CLOCK = "rosgraph_msgs/msg/Clock"


@pytest.fixture(autouse=True)
def _empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


class Recorder:
    """Replaces the pipeline: records its calls and writes a bag of three messages of two topics."""

    def __init__(self, error: BaseException | None = None) -> None:
        self.error = error
        self.calls: list[tuple[fieldtruth.Experiment, str, dict[str, Any]]] = []

    def generate_by(self, engine: object, experiment: fieldtruth.Experiment, out: str, **options: Any) -> Path:
        assert engine is None
        self.calls.append((experiment, out, options))
        if self.error is not None:
            raise self.error
        bag = Path(out) / experiment.name / f"{experiment.name}.bag"
        bag.parent.mkdir(parents=True)
        with Writer(bag) as writer:
            clock, tick = (writer.add_connection(topic, CLOCK, msgdef="time clock", md5sum="0" * 32) for topic in "ab")
            for connection in (clock, tick, tick):
                writer.write(connection, 1, bytes(8))
        return bag


BENCH = SimpleNamespace(
    settings_of=lambda name: name,
    measure=lambda settings, progress: {settings: 2.5},
    table=str,
)


def with_pipeline(monkeypatch: pytest.MonkeyPatch, recorder: Recorder) -> Recorder:
    monkeypatch.setitem(sys.modules, "fieldtruth.pipeline", recorder)
    monkeypatch.setitem(sys.modules, "fieldtruth.bench", BENCH)
    return recorder


ERRORS = [
    ([], "no command given; see fieldtruth --help. Available: generate, degrade, preview, shares, list, bench, "),
    (["generat"], "unknown command 'generat'; did you mean 'generate'? Available: generate, degrade, "),
    (["--versoin"], "unknown option '--versoin'; did you mean '--version'? Available: --help, --version"),
    (["list", "--jsn"], "unknown option '--jsn'; Available: --help"),
    (["bench", "--jsn"], "unknown option '--jsn'; did you mean '--json'? Available: --help, --environment, --json"),
    (["preview"], "the following arguments are required: ENVIRONMENT"),
    (["preview", "prak"], "unknown environment 'prak'; did you mean 'park'? Available: forest, hillside, lake, park"),
    (["preview", "park", "--seed", "-1"], f"--seed must be an integer between 0 and {2**63 - 1}, got '-1'"),
    (["preview", "park", "--seed", "one"], f"--seed must be an integer between 0 and {2**63 - 1}, got 'one'"),
    (["preview", "park", "--out", "park.bmp"], "cannot write park.bmp: its name must end in .png, .jpg or .jpeg"),
    (["preview", "park", "--out", "no/park.png"], "cannot write no/park.png: "),
    (["preview", "park", "forest"], "unexpected argument 'forest'"),
    (["shares"], "give experiments, all or every. Available: forest_1, "),
    (["shares", "park_1", "all"], "unknown experiment 'all'; "),
    (["shares", "park1"], "unknown experiment 'park1'; did you mean 'park_1'? Available: forest_1, "),
    (["shares", "all", "--seed", "x"], "--seed must be an integer between 0 and "),
    (["bench", "--environment", "prak"], "unknown environment 'prak'; did you mean 'park'? Available: "),
    (["list", "park_1"], "unknown list 'park_1'; Available: experiments, environments, campaigns, sensors"),
    (["list", "sensor"], "unknown list 'sensor'; did you mean 'sensors'? Available: experiments, environments, "),
    (["list", "sensors", "lidar"], "unexpected argument 'lidar'"),
    (["generate"], "the following arguments are required: EXPERIMENT"),
    (
        ["generate", "standard-image"],
        "unknown experiment 'standard-image'; did you mean 'standard-images'? Available: ",
    ),
    (["generate", "park1"], "unknown experiment 'park1'; did you mean 'park_1'? Available: forest_1, "),
    (["generate", "park_1", "park_2"], "unexpected argument 'park_2'"),
    (["generate", "park_1", "--sec=5"], "unknown option '--sec'; did you mean '--seed'? Available: --help, --out, "),
    (["generate", "park_1", "--seconds", "five"], "--seconds must be a number, got 'five'"),
    (["generate", "park_1", "--seconds", "-5"], "seconds must be a number between 0.001 and 86400, got -5.0"),
    (["generate", "park_1", "--seconds", "nan"], "seconds must be a number between 0.001 and 86400, got nan"),
    (["generate", "park_1", "--seconds"], "--seconds: expected one argument"),
    (["generate", "park_1", "--seed", "1.5"], "--seed must be an integer between 0 and "),
    (["generate", "park_1", "--workers", "0"], "--workers must be an integer of at least 1, got '0'"),
    (["generate", "park_1", "--extras", "depht"], "unknown extra 'depht'; did you mean 'depth'? Available: depth, "),
    (["generate", "park_1", "--extras", "flow,normls"], "unknown extra 'normls'; did you mean 'normals'? Available: "),
    (["generate", "park_1", "--light", "sunny"], "light.preset must be summer_day, clear_morning, noon, "),
    (["generate", "park_1", "--signal", "robt"], "signal must be ideal, datasheet, clean, robot or the path of a "),
    (["export", "run", "--to", "occupancy", "--voxel", "x"], "--voxel must be a number, got 'x'"),
    (["generate", "run.yaml"], "cannot read run.yaml: No such file or directory"),
    (
        ["gazebo", "prak", "--flavour", "gz", "--out", "x"],
        "unknown environment 'prak'; did you mean 'park'? Available: ",
    ),
    (["gazebo", "park", "--flavour", "ros2", "--out", "x"], "unknown flavour 'ros2'; Available: classic, gz, both"),
    (["gazebo", "park", "--flavour", "gz"], "the following arguments are required: --out"),
    (["gazebo", "park", "--flavour", "gz", "--out", "x", "--layout", "l.yaml"], "cannot read l.yaml: No such file "),
    (["generate", "two\nlines"], "unknown experiment 'two\\nlines'; Available: "),
]


@pytest.mark.parametrize(("argv", "line"), ERRORS, ids=[" ".join(argv) for argv, _ in ERRORS])
def test_error_is_one_line_and_nothing_is_written(
    argv: list[str], line: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert cli.main(argv) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"error: {line}")
    assert err.count("\n") == 1
    assert not any(tmp_path.iterdir())


def test_generate_passes_all_options_to_one_call(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    pipeline = with_pipeline(monkeypatch, Recorder())
    words = "generate park_1 --out sets --seconds 5 --seed 7 --workers 3 --no-cameras --no-lidar --overwrite"
    assert cli.main(words.split()) == 0
    [(experiment, out, options)] = pipeline.calls
    assert (experiment.name, experiment.seconds, experiment.seed) == ("park_1", 5.0, 7)
    assert not experiment.rig.stereo.enabled
    assert not experiment.rig.lidar.enabled
    assert out == "sets"
    assert (options["workers"], options["overwrite"]) == (3, True)
    text = capsys.readouterr().out
    size = (tmp_path / "sets/park_1/park_1.bag").stat().st_size / 1e6
    expected = rf"sets/park_1/park_1\.bag: 3 messages of 2 topics, {size:.1f} MB; this run took \d+ s\n"
    assert re.fullmatch(expected, text)


def test_generate_defaults_to_the_unchanged_experiment_and_all_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    pipeline = with_pipeline(monkeypatch, Recorder())
    assert cli.main(["generate", "park_2"]) == 0
    [(experiment, out, options)] = pipeline.calls
    assert experiment == fieldtruth.load_experiment("park_2")
    assert out == "data"
    assert (options["workers"], options["overwrite"]) == (cpu_count(), False)


def test_library_error_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    with_pipeline(monkeypatch, Recorder(OutputError("data/park_1 holds a finished run;\nsay --overwrite")))
    assert cli.main(["generate", "park_1"]) == 2
    assert capsys.readouterr().err == "error: data/park_1 holds a finished run; say --overwrite\n"


def test_interrupt_prints_how_to_resume(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    with_pipeline(monkeypatch, Recorder(KeyboardInterrupt()))
    assert cli.main(["generate", "park_1", "--out", "my sets", "--overwrite"]) == 130
    err = capsys.readouterr().err
    assert err.endswith(" resume with: fieldtruth generate park_1 --out 'my sets'\n")
    assert err.count("\n") == 1


def test_unexpected_exception_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    with_pipeline(monkeypatch, Recorder(ZeroDivisionError()))
    with pytest.raises(ZeroDivisionError):
        cli.main(["generate", "park_1"])


def test_bench_prints_a_table_or_one_json_object(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with_pipeline(monkeypatch, Recorder())
    assert cli.main(["bench", "--json"]) == 0
    assert capsys.readouterr().out == '{"park": 2.5}\n'
    assert cli.main(["bench", "--environment", "forest"]) == 0
    assert capsys.readouterr().out == "{'forest': 2.5}\n"
    assert cli.main(["bench", "--environment", "all", "--json"]) == 0
    assert list(json.loads(capsys.readouterr().out)) == list(fieldtruth.list_environments())
    assert cli.main(["bench", "--env", "lake"]) == 0
    assert capsys.readouterr() == ("{'lake': 2.5}\n", "warning: --env is now called --environment\n")


def test_preview_writes_the_sheet(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    calls: list[tuple[Any, ...]] = []

    def draw(environment: str, seed: int, *, layout: Any, width: int, workers: int, progress: object) -> Any:
        calls.append((environment, seed, layout, width, workers))
        return np.full((30, 20, 3), 100 + len(calls), np.uint8)

    monkeypatch.setattr("fieldtruth.report.preview.preview", draw)
    assert cli.main(["preview", "park"]) == 0
    assert capsys.readouterr().out == "park_0_preview.png: 20 x 30 pixels, 0.0 MB\n"
    assert cli.main(["preview", "park", "--seed", "7", "--out", "a.jpg", "--workers", "3"]) == 0
    assert calls == [("park", 0, {}, 2400, cpu_count()), ("park", 7, {}, 1400, 3)]
    assert (simplejpeg.decode_jpeg((tmp_path / "a.jpg").read_bytes()) == 102).all()
    capsys.readouterr()
    before = (tmp_path / "a.jpg").read_bytes()
    assert cli.main(["preview", "park", "--out", "a.jpg"]) == 2
    expected = "error: a.jpg already exists; choose another --out, or use --overwrite to replace it\n"
    assert capsys.readouterr().err == expected
    assert (tmp_path / "a.jpg").read_bytes() == before
    assert len(calls) == 2
    assert cli.main(["preview", "park", "--out", "a.jpg", "--overwrite"]) == 0
    assert (simplejpeg.decode_jpeg((tmp_path / "a.jpg").read_bytes()) == 103).all()
    (tmp_path / "layout.yaml").write_text("season: winter\n")
    assert cli.main(["preview", "forest", "--layout", "layout.yaml"]) == 0
    assert calls[-1][:3] == ("forest", 0, {"season": "winter"})
    (tmp_path / "layout.yaml").write_text("seasons: winter\n")
    capsys.readouterr()
    assert cli.main(["preview", "forest", "--layout", "layout.yaml", "--overwrite"]) == 2
    assert capsys.readouterr().err.startswith("error: layout.yaml: ")


def test_shares_counts_the_given_experiments(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calls: list[tuple[list[tuple[str, int]], int]] = []

    def count(experiments: list[fieldtruth.Experiment], *, workers: int, progress: object) -> dict[str, Any]:
        calls.append(([(experiment.name, experiment.seed) for experiment in experiments], workers))
        row = np.zeros((1, len(CLASSES)), np.int64)
        row[0, [1, 15]] = 3, 1
        return {experiment.name: fieldtruth.ClassShares(pixels=row, points=row) for experiment in experiments}

    monkeypatch.setattr("fieldtruth.report.shares.shares_of", count)
    assert cli.main(["shares", "park_2", "--seed", "5", "--workers", "2", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found == {"park_2": {"poses": 1, "pixels": {"ground": 3, "sky": 1}, "points": {"ground": 3, "sky": 1}}}
    assert cli.main(["shares", "all"]) == 0
    header, ground, *_ = capsys.readouterr().out.splitlines()
    names = list(fieldtruth.list_experiments())[:8]  # those of the paper
    assert header.split()[2:] == names
    assert ground.split() == ["ground", *["75.00"] * 8]
    cores = cpu_count()
    assert calls == [([("park_2", 5)], 2), ([(name, 0) for name in names], cores)]


def test_list_shows_every_experiment_and_environment(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["list"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    shown = [words[0] for words in lines]
    assert shown == ["experiments:", *fieldtruth.list_experiments(), "environments:", *fieldtruth.list_environments()]
    assert all(len(words) > 1 for words in lines if words[0] in fieldtruth.list_experiments())


def test_list_sensors_shows_every_model(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["list", "sensors"]) == 0
    printed = capsys.readouterr().out
    titles = {
        "lidar": "LiDARs (kind lidar)",
        "camera": "cameras (kinds camera and stereo)",
        "imu": "IMUs (kind imu)",
        "gnss": "GNSS receivers (kind gnss)",
        "wheel_odometry": "wheel encoders (kind wheel_odometry)",
    }
    for kind, title in titles.items():
        section = re.search(rf"^{re.escape(title)}:\n((?:  .*\n)+)", printed, re.M)
        assert section
        names = [line.split()[0] for line in section[1].splitlines()]
        assert names == list(list_models(kind))
        assert all(description in section[1] for description in list_models(kind).values())
    assert {"vlp_16", "os1_64_gen1", "pandar64"} < set(list_models("lidar"))


@pytest.mark.parametrize("argv", [["--help"], ["generate", "--help"]])
def test_examples_of_the_help_parse(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        cli.main(argv)
    assert end.value.code == 0
    examples = [line.split("  ")[1].split() for line in capsys.readouterr().out.splitlines() if "  fieldtruth" in line]
    assert len(examples) == 7
    for words in examples:
        assert callable(cli._parse(words[1:])[0])


def run_cli(*argv: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "fieldtruth.cli", *argv], capture_output=True, text=True, check=False)


def test_process_exits_with_code_and_message() -> None:
    version = run_cli("--version")
    assert (version.returncode, version.stdout) == (0, f"fieldtruth {fieldtruth.__version__}\n")
    mistake = run_cli("generate", "no_such", "--out", "x")
    assert (mistake.returncode, mistake.stdout, mistake.stderr.count("\n")) == (2, "", 1)
    assert mistake.stderr.startswith("error: unknown experiment 'no_such'; Available: ")


def modules_after(*argv: str) -> set[str]:
    """Names of the modules that are loaded after a command."""
    code = f"import sys; from fieldtruth import cli; cli.main({list(argv)!r}); print(*sys.modules, file=sys.stderr)"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(ended.stderr.splitlines()[-1].split())


def test_light_commands_import_no_heavy_modules() -> None:
    assert modules_after("nonsense").isdisjoint({"numpy", "scipy", "pydantic", "numba", "mujoco"})
    assert modules_after("preview", "prak").isdisjoint({"numba", "mujoco", "rosbags", "rich", "matplotlib"})
    assert modules_after("list", "sensors").isdisjoint({"numba", "mujoco", "rosbags", "rich", "matplotlib"})
    assert modules_after("list").isdisjoint({"pydantic", "numba", "mujoco", "rosbags", "rich", "matplotlib"})


def test_import_and_help_need_no_linux_only_module() -> None:
    assert modules_after("nonsense").isdisjoint({"fcntl", "resource", "termios"})
