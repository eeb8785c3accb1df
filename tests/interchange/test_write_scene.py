# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bad input to scenes: one line, and neither a half-written nor a lost file."""

import errno
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from interchange_worlds import small_world

from fieldtruth import cli
from fieldtruth.core import parallel
from fieldtruth.core.errors import OutputError, UnknownNameError
from fieldtruth.interchange import FORMATS, write_scene
from fieldtruth.world import build
from fieldtruth.world.model import World

pytestmark = pytest.mark.usefixtures("small_ground_images")


@pytest.fixture(autouse=True)
def _empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def world() -> World:
    return small_world()


def test_an_unknown_form_is_named(world: World) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown format 'gltff'; did you mean 'gltf'\? Available: gltf, "):
        write_scene(world, to="gltff")


def test_the_document_and_the_help_list_every_format(capsys: pytest.CaptureFixture[str]) -> None:
    text = (Path(__file__).parents[2] / "docs/scene.md").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.startswith("| `") and "ENV_SEED" in line]
    rows = {name: cells for name, *cells, _ in (line.strip("| ").split(" | ") for line in lines)}
    defaults = {name: f"ENV_SEED{row.suffix}{'/' * bool(row.holds)}" for name, row in FORMATS.items()}
    assert rows == {f"`{name}`": [f"`{defaults[name]}`", row.description] for name, row in FORMATS.items()}
    with pytest.raises(SystemExit):
        cli.main(["scene", "--help"])
    assert set(FORMATS) <= set(capsys.readouterr().out.replace(",", " ").split())


def test_the_default_name_is_the_worlds(world: World) -> None:
    assert write_scene(replace(world, name="tiny", seed=7), to="inventory") == Path("tiny_7_inventory")
    assert Path("tiny_7_inventory/inventory.csv").is_file()


@pytest.mark.parametrize("to", FORMATS)
def test_an_existing_output_is_kept(world: World, to: str) -> None:
    Path("there").write_text("precious")
    with pytest.raises(OutputError, match=r"^there already exists; choose another --out, or use --overwrite"):
        write_scene(world, "there", to=to)
    assert Path("there").read_text() == "precious"


@pytest.mark.parametrize("to", FORMATS)
def test_a_folder_of_something_else_is_never_replaced(world: World, to: str) -> None:
    Path("home").mkdir()
    Path("home/thesis.tex").write_text("precious")
    with pytest.raises(OutputError, match=r"^(cannot write )?home:? .*is a folder"):
        write_scene(world, "home", to=to, overwrite=True)
    assert Path("home/thesis.tex").read_text() == "precious"


def test_overwrite_replaces_an_older_output(world: World) -> None:
    write_scene(world, "out", to="inventory")
    Path("out/old.txt").write_text("")
    write_scene(world, "out", to="inventory", overwrite=True)
    assert not Path("out/old.txt").exists()
    assert [p.name for p in Path().iterdir()] == ["out"]


@pytest.mark.parametrize(("to", "last_step"), [("gltf", "gltf.Glb.save"), ("obj", "obj._write_materials")])
def test_a_full_disk_leaves_nothing(world: World, monkeypatch: pytest.MonkeyPatch, to: str, last_step: str) -> None:
    def fill(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(f"fieldtruth.interchange.{last_step}", fill)
    with pytest.raises(OutputError, match=r"^cannot write new: no space left"):
        write_scene(world, "new", to=to)
    assert list(Path().iterdir()) == []


def test_a_scene_larger_than_the_memory_is_refused(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "available_memory", lambda: 50_000_000)
    expected = r"^format 'gltf' of tiny needs about 0\.\d GB of memory, but 0\.1 GB are available; .*--no-beyond"
    with pytest.raises(OutputError, match=expected):
        write_scene(world, "new.glb", to="gltf")
    assert list(Path().iterdir()) == []


def test_a_form_names_the_extra_of_a_missing_library(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith("fieldtruth.interchange.usd")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(OutputError, match=r"^format 'usd' needs .*; run: pip install 'fieldtruth\[usd\]'$"):
        write_scene(world, "new", to="usd")
    assert list(Path().iterdir()) == []


def test_a_scene_larger_than_a_glb_file_can_be_is_refused(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fieldtruth.interchange.gltf.LARGEST", 500_000)
    with pytest.raises(OutputError, match=r"^the scene is larger than a GLB file can be .*; use --no-beyond$"):
        write_scene(world, "new.glb", to="gltf")
    assert list(Path().iterdir()) == []


def test_available_memory_is_that_of_the_system_or_the_container(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    files = {"_SYSTEM": "MemTotal: 9 kB\nMemAvailable:    2000 kB\n", "_LIMIT": "900000\n", "_USED": "100000\n"}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
        monkeypatch.setattr(parallel, name, tmp_path / name)
    assert parallel.available_memory() == 800_000
    (tmp_path / "_LIMIT").write_text("max\n")
    assert parallel.available_memory() == 2_048_000
    (tmp_path / "_SYSTEM").unlink()
    assert parallel.available_memory() is None


# ---------------------------------------------------------------------------------------------------------------------
# The command

ERRORS = [
    (["park"], "the following arguments are required: --to"),
    (["prak", "--to", "gltf"], "unknown environment 'prak'; did you mean 'park'? Available: forest, hillside, lake, "),
    (["park", "--to", "gtlf"], "unknown format 'gtlf'; did you mean 'gltf'? Available: gltf, "),
    (["park", "--to", "obj", "--out", "taken"], "taken already exists; choose another --out, or use --overwrite"),
    (["park", "--to", "obj", "--layout", "none.yaml"], "cannot read none.yaml: No such file or directory"),
    (["park", "--to", "obj", "--layout", "list.yaml"], "list.yaml: must be a mapping of keys to values (key: value)"),
    (
        ["park", "--to", "obj", "--layout", "bad.yaml"],
        "bad.yaml: layout: unknown key 'large_tres'; did you mean 'lar",
    ),
]


@pytest.mark.parametrize(("arguments", "message"), ERRORS)
def test_an_error_is_one_line(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    files = {"taken": "", "list.yaml": "[1]", "bad.yaml": "large_tres: 3"}
    for name, text in files.items():
        Path(name).write_text(text)
    assert cli.main(["scene", *arguments]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.startswith(f"error: {message}")
    assert output.err.count("\n") == 1
    assert {p.name for p in Path().iterdir()} == set(files)


def test_the_command_writes_the_world_that_it_names(
    world: World, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calls = SimpleNamespace(world=())

    def load_world(*arguments: object) -> World:
        calls.world = arguments
        return world

    monkeypatch.setattr(build, "load_world", load_world)
    Path("few.yaml").write_text("large_trees: 3")
    assert cli.main(["scene", "park", "--to", "inventory", "--seed", "4", "--layout", "few.yaml", "--no-beyond"]) == 0
    assert calls.world == ("park", 4, {"large_trees": 3})
    assert len(Path("park_4_inventory/swarm_members.csv").read_text().splitlines()) == 31  # 30 of 40 are inside
    assert capsys.readouterr().out.startswith("park_4_inventory: 3 files, ")
