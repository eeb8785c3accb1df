# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A name that no output can have is one line before any work, in every command with an output; nothing is written."""

import os
from pathlib import Path

import pytest

from fieldtruth import cli
from fieldtruth.core.errors import OutputError
from fieldtruth.core.files import output_folder, output_path

RUN = "run"
LONG = 250 * "x"

FILES = {
    "export": ["export", RUN, "--to", "tum", "--out"],
    "annotate": ["annotate", RUN, "--environment", "park", "--out"],
    "report": ["report", RUN, "--out"],
    "preview": ["preview", "park", "--out"],
    "scene": ["scene", "park", "--to", "gltf", "--out"],
    "view": ["view", RUN, "--save"],
    "rig": ["rig", "park_1", "--to", "urdf", "--out"],
    "rig preview": ["rig", "park_1", "--preview", "--out"],
}
ENDINGS = {"report": ".html", "preview": ".png", "view": ".rrd", "rig": ".urdf", "rig preview": ".png"}
FOLDERS = {
    "generate": ["generate", "park_1", "--out"],
    "campaign": ["generate", "all", "--out"],
    "export": ["export", RUN, "--to", "pcd", "--out"],
    "scene": ["scene", "park", "--to", "obj", "--out"],
    "gazebo": ["gazebo", "park", "--flavour", "gz", "--out"],
}


@pytest.fixture(autouse=True)
def _folder_with_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The run does not exist, so that an output that is looked at too late gives another line."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_bytes(b"old")


def refused(argv: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    assert cli.main(argv) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("error: cannot write ")
    assert [path.name for path in Path().iterdir()] == ["file"]
    assert Path("file").read_bytes() == b"old"
    return err


@pytest.mark.parametrize("command", FILES)
def test_no_command_takes_a_name_that_no_file_can_have(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    ending = ENDINGS.get(command, "")
    for name in ("", ".", "..", "/", "../"):
        assert f"{name!r}: it must be the name of a new file or folder" in refused([*FILES[command], name], capsys)
    taken = "a part of the path is a file, not a folder"
    for name, reason in {
        LONG + ending: "the path is too long",
        f"a\nb{ending}": "its name must not have control characters",
        f"a\0b{ending}": "no file can have this name",
        f"new{ending}/": "it is a folder",
        f"file/new{ending}": taken,
        f"file/folder/new{ending}": taken if command in (*FOLDERS, "annotate", "view") else "does not exist",
        f"/proc/new{ending}": "",
        f"{300 * 'folder/' * 3}new{ending}": "the path is too long",
    }.items():
        assert reason in refused([*FILES[command], name], capsys), name


@pytest.mark.parametrize("command", FOLDERS)
def test_no_command_takes_a_name_that_no_folder_can_have(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    for name, reason in {
        "": "it must be",
        "/": "it must be",
        LONG: "the path is too long",
        f"{LONG}/new": "the path is too long",
        "a\nb": "its name must not have control characters",
        "a\0b": "no file can have this name",
        "file/new": "a part of the path is a file, not a folder",
        "/proc/new": "",
    }.items():
        assert reason in refused([*FOLDERS[command], name], capsys), name


def test_what_exists_is_kept_or_replaced(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    for name in ("file", "folder", "pipe"):
        with pytest.raises(OutputError, match=f"{name} already exists; remove it, or choose another --save"):
            output_path(name, option="--save")
        with pytest.raises(OutputError, match=f"{name} already exists; choose another --out, or use --overwrite"):
            output_path(name, overwrite=False)
    assert output_path("file", overwrite=True) == Path("file")
    assert output_path("folder/", overwrite=True) == Path("folder")
    with pytest.raises(OutputError, match="pipe: it is neither a file nor a folder"):
        output_path("pipe", overwrite=True)


def test_a_good_name_is_returned_and_leaves_nothing_behind(tmp_path: Path) -> None:
    assert output_path("new/folder/a.TXT", endings=(".txt",)) == Path("new/folder/a.TXT")
    assert output_path(tmp_path / "数据.tum", single=True) == tmp_path / "数据.tum"
    for folder in (".", "..", "new/folder/"):
        assert output_folder(folder) == Path(folder)
    with pytest.raises(OutputError, match="the folder new does not exist"):
        output_path("new/a.txt", parents=False)
    with pytest.raises(OutputError, match="no file can have this name"):
        output_path("\ud800")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_folder_with_an_odd_name_that_exists_is_used(tmp_path: Path) -> None:
    (tmp_path / "odd\nname").mkdir()
    assert output_path("odd\nname/a.tum").name == "a.tum"
    assert output_folder("odd\nname", "run") == Path("odd\nname")
