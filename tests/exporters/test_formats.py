# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Properties of all formats: names, errors, no partial output; each format through the command line."""

import hashlib
import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from export_bags import without

from fieldtruth import cli
from fieldtruth.bag.file import BagError
from fieldtruth.bag.reader import open_bag
from fieldtruth.core.errors import OutputError, UnknownNameError
from fieldtruth.exporters import FORMATS, MapOptions, Options, export
from fieldtruth.ontology import LABEL_MAPS


def digest(path: Path) -> dict[str, str]:
    """Hash of each file below a path."""
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    return {str(p.relative_to(path)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


NEED_CAMERAS = ("kitti", "coco", "mmseg", "stereo-depth", "image-cost", "video", "webp")
OF_WORLDS = ("kitti-object", "occupancy", "local-maps", "local-maps-bag", "image-cost", "scene-completion")
"""Formats that build the world of experiment.yaml."""
OF_MOVERS = ("kitti-tracking", "mot")
"""Formats of runs in which something moves."""
pytestmark = pytest.mark.usefixtures("in_park")


@pytest.fixture(autouse=True)
def few_voxels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Volumes of 12.8 m by 25.6 m: those of the full size, two million voxels for each cloud, take seconds."""
    monkeypatch.setattr("fieldtruth.exporters.scene_completion.SHAPE", (64, 128, 32))


@pytest.fixture(scope="module")
def blind_bag(brief_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Bag without the topics of cameras."""
    bag = brief_run / "park_1.bag"
    with open_bag(bag) as stored:
        cameras = [topic for topic in stored.counts if topic.startswith("/stereo/")]
    return without(bag, tmp_path_factory.mktemp("blind") / "park_1.bag", *cameras)


@pytest.mark.parametrize("to", [name for name in FORMATS if name not in OF_MOVERS])
def test_default_output_and_bytes_for_any_workers(
    to: str, brief_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = shutil.copy(brief_run / "park_1.bag", tmp_path)
    if to in OF_WORLDS:
        shutil.copy(brief_run / "experiment.yaml", tmp_path)
    before, files = digest(Path(bag)), [path.name for path in tmp_path.iterdir()]
    rough = {"occupancy": "--voxel", **dict.fromkeys(("local-maps", "local-maps-bag", "image-cost"), "--resolution")}
    coarse = [rough[to], "0.5"] if to in rough else []
    assert cli.main(["export", str(bag), "--to", to, "--workers", "1", *coarse]) == 0
    made = tmp_path / f"park_1{FORMATS[to].suffix}"
    assert capsys.readouterr().out.startswith(f"{made}: ")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([made.name, *files])
    voxel_m = 0.5 if to == "occupancy" else None
    maps = MapOptions(resolution=0.5) if coarse and voxel_m is None else None
    other = export(Path(bag), to, out=tmp_path / "other" / made.name, workers=2, voxel_m=voxel_m, maps=maps)
    assert digest(other) == digest(made)
    assert digest(Path(bag)) == before

    again = cli.main(["export", str(bag), "--to", to])
    assert again == 2
    assert (
        capsys.readouterr().err.splitlines()[-1] == f"error: {made} already exists; remove it, or choose another --out"
    )
    assert digest(other) == digest(made)


@pytest.mark.parametrize("to", [name for name, row in FORMATS.items() if row.relabels])
def test_formats_with_labels_take_a_label_map(to: str, brief_run: Path, tmp_path: Path) -> None:
    ours = export(brief_run, to, out=tmp_path / "ours")
    theirs = export(brief_run, to, out=tmp_path / "theirs", label_map="rellis")
    assert digest(ours) != digest(theirs)


@pytest.mark.parametrize("to", FORMATS)
def test_run_without_cameras_is_exported_or_refused_in_one_line(
    to: str, blind_bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code = cli.main(["export", str(blind_bag), "--to", to, "--out", str(tmp_path / "out")])
    error = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert (code, len(error)) == ((2, 1) if to in (*NEED_CAMERAS, *OF_WORLDS, *OF_MOVERS) else (0, 0)), error
    assert [path.name for path in tmp_path.iterdir()] == ([] if code else ["out"])


def test_wrong_arguments_are_one_line_and_write_nothing(
    small_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run, none, out = str(small_run), str(tmp_path / "no"), ["--out", str(tmp_path / "out")]
    again = str(small_run / "park_1.bag")
    for words, line in (
        ([run, "--to", "kiti"], "unknown format 'kiti'; did you mean 'kitti'? Available: files, "),
        (
            [run, "--to", "files", "--label-map", "relis"],
            "unknown label map 'relis'; did you mean 'rellis'? Available: ",
        ),
        (
            [run, "--to", "zip", "--label-map", "rellis"],
            "format 'zip' has no labels to map; formats with labels: ",
        ),
        ([run, run, "--to", "tum"], "format 'tum' takes one run, got 2; formats that join several: "),
        ([none, "--to", "tum"], f"{none} does not exist; a run must be the folder of a run, or a bag"),
        ([run, again, "--to", "kitti"], f"{again} is given twice; each run can be one sequence"),
        ([run], "the following arguments are required: --to"),
    ):
        assert cli.main(["export", *words, *out]) == 2
        assert capsys.readouterr().err.startswith(f"error: {line}")
    assert not list(tmp_path.iterdir())


def test_damage_in_the_middle_of_a_bag_leaves_no_output(brief_run: Path, tmp_path: Path) -> None:
    """The index is intact, but a byte in the middle is not: the error occurs when half is written."""
    data = bytearray((brief_run / "park_1.bag").read_bytes())
    data[len(data) // 2] ^= 1
    bag = tmp_path / "flipped.bag"
    bag.write_bytes(data)
    for name, row in FORMATS.items():
        if name == "zip":  # packs any bytes
            continue
        try:
            export(bag, name)
        except BagError as error:
            assert "\n" not in str(error)  # noqa: PT017
            assert not (tmp_path / f"flipped{row.suffix}").exists()
    assert not [path for path in tmp_path.iterdir() if path.name.endswith(".part")]


def test_missing_library_is_one_line_and_writes_nothing(
    small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    monkeypatch.delitem(sys.modules, "fieldtruth.exporters.mcap", raising=False)
    with pytest.raises(OutputError, match=r"the mcap library is not installed; run: pip install 'fieldtruth\[mcap\]'"):
        export(small_run, "mcap", out=tmp_path / "folder" / "x.mcap")
    assert not any(tmp_path.iterdir())


def test_leftovers_of_a_killed_export_are_removed(small_run: Path, tmp_path: Path) -> None:
    stale = tmp_path / ".t.tum.part" / "t.tum"
    stale.mkdir(parents=True)
    (stale / "x").write_text("old")
    assert export(small_run, "tum", out=tmp_path / "t.tum").is_file()
    assert [path.name for path in tmp_path.iterdir()] == ["t.tum"]


def test_a_second_export_to_the_same_output_says_who_makes_it(
    small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second begins when the first has written half; another output does not wait."""
    out = tmp_path / "t.tum"

    def half(runs: Any, target: Path, options: Options) -> None:
        target.write_text("half")
        with pytest.raises(OutputError, match=rf"t\.tum\.part is in use by process {os.getpid()} on "):
            export(small_run, "tum", out=out)
        assert target.read_text() == "half"
        monkeypatch.undo()
        export(small_run, "tum", out=tmp_path / "other.tum")

    monkeypatch.setattr("fieldtruth.exporters.tum.write", half)
    export(small_run, "tum", out=out)
    assert out.read_text() == "half"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other.tum", "t.tum"]


def test_failed_export_removes_only_its_own_files(
    small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def breaks(runs: Any, target: Path, options: Options) -> None:
        target.mkdir()
        (target / "half").write_text("half")
        raise OSError(28, "No space left on device")

    (tmp_path / "mine.txt").write_text("mine")
    monkeypatch.setattr("fieldtruth.exporters.pcd.write", breaks)
    with pytest.raises(OutputError, match=r"cannot write .*: no space left"):
        export(small_run, "pcd", out=tmp_path / "clouds")
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_read_only_folder_is_reported(small_run: Path, tmp_path: Path) -> None:
    tmp_path.chmod(stat.S_IRUSR | stat.S_IXUSR)
    with pytest.raises(OutputError, match="permission denied"):
        export(small_run, "tum", out=tmp_path / "t.tum")


def test_existing_link_is_refused(small_run: Path, tmp_path: Path) -> None:
    (tmp_path / "out.tum").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match=" already exists; remove it"):
        export(small_run, "tum", out=tmp_path / "out.tum")
    assert not (tmp_path / "elsewhere").exists()


def test_help_lists_formats_and_label_maps(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main(["export", "--help"])
    text = "".join(capsys.readouterr().out.split())  # lines end within names with a hyphen
    *most, last = FORMATS
    assert f"{','.join(most)}or{last}" in text
    *most, last = LABEL_MAPS
    assert f"{','.join(most)}or{last}" in text
    with pytest.raises(UnknownNameError):
        export(Path("x"), "bag")


def test_importing_the_table_loads_no_format() -> None:
    code = """
import sys, fieldtruth.exporters as e
print([row.module for row in e.FORMATS.values() if f"{e.__name__}.{row.module}" in sys.modules])
"""
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert shown == "[]\n"
