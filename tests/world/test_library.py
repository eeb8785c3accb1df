# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A species or a rock type is one file: the examples of docs/extending.md work, and mistakes are reported."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
import yaml

from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.world import furniture  # noqa: F401  (checks its section)
from fieldtruth.world.build import world_key
from fieldtruth.world.environments.layout import PLANTINGS
from fieldtruth.world.library import SHARED, data_files
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.plants import BUSHES, GRASSES, TREES, grow_snag, grow_tree
from fieldtruth.world.rocks import ROCK_TYPES, make_rock
from fieldtruth.world.textures import TEXTURES, make_texture

DOCUMENT = Path(__file__).parents[2] / "docs" / "extending.md"
EXAMPLES = {
    name: next(
        block for block in re.findall(r"```yaml[^\n]*\n(.*?)```", DOCUMENT.read_text(), re.DOTALL) if key in block
    )
    for name, key in (("rowan", "Sorbus"), ("basalt", "rock_basalt"))
}


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / f"{name}.yaml"
    path.write_text(text)
    return path


@pytest.fixture
def rowan(tmp_path: Path) -> Iterator[str]:
    TREES.add(write(tmp_path, "rowan", EXAMPLES["rowan"]))
    yield "rowan"
    TREES.remove("rowan")


@pytest.fixture
def basalt(tmp_path: Path) -> Iterator[str]:
    ROCK_TYPES.add(write(tmp_path, "basalt", EXAMPLES["basalt"]))
    yield "basalt"
    ROCK_TYPES.remove("basalt")


@pytest.mark.parametrize(("height", "grown_in"), [(3.0, "open"), (9.0, "open"), (11.0, "stand")])
def test_species_added_from_one_file_grows_with_its_own_materials(rowan: str, height: float, grown_in: str) -> None:
    tree = grow_tree(
        TREES[rowan],
        name="tree",
        height=height,
        rng=np.random.default_rng(1),
        grown_in="stand" if grown_in == "stand" else "open",
    )
    assert tree.vertices[:, 2].max() == pytest.approx(height, rel=0.15)
    assert tree.materials == ("bark_rowan", "leaf_rowan")
    assert [MATERIALS[name].label for name in tree.materials] == [Label.TRUNK, Label.TREETOP]
    snag = grow_snag(TREES[rowan], name="snag", height=4.0, rng=np.random.default_rng(2))
    assert "bark_rowan" in snag.materials


def test_materials_and_textures_of_an_added_file_follow_those_of_the_package(rowan: str) -> None:
    assert list(MATERIALS)[-2:] == ["bark_rowan", "leaf_rowan"]
    image = make_texture("leaf_rowan", np.random.SeedSequence(1))
    assert image.shape == (256, 256, 3)
    assert rowan in TREES
    assert any(path.stem == rowan for path in data_files())


def test_added_species_changes_the_cache_key_of_worlds(tmp_path: Path) -> None:
    before = world_key("forest")
    TREES.add(write(tmp_path, "rowan", EXAMPLES["rowan"]))
    changed = world_key("forest")
    TREES.remove("rowan")
    assert changed != before == world_key("forest")


def test_added_species_changes_no_texture_of_the_package(tmp_path: Path) -> None:
    before = make_texture("leaf_lime", np.random.SeedSequence(5)).tobytes()
    TREES.add(write(tmp_path, "rowan", EXAMPLES["rowan"]))
    TREES.remove("rowan")
    assert make_texture("leaf_lime", np.random.SeedSequence(5)).tobytes() == before
    assert "rowan" not in TREES
    assert "leaf_rowan" not in MATERIALS


def test_rock_type_added_from_one_file_makes_rocks(basalt: str) -> None:
    rock = make_rock(ROCK_TYPES[basalt], name="rock", size=1.0, rng=np.random.default_rng(1))
    assert rock.materials == ("rock_basalt",)
    assert MATERIALS["rock_basalt"].label == Label.ROCK
    assert make_texture("rock_basalt", np.random.SeedSequence(1)).mean() < 128


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("outline: spherical", "outline: cube", r"rowan\.yaml: grown\.outline must be 'conical', .* got 'cube'"),
        ("crown_base: 0.25", "crown_bass: 0.25", r"rowan\.yaml: unknown key 'grown\.crown_bass'"),
        ("latin: Sorbus aucuparia", "", r"rowan\.yaml: latin is missing"),
        ("slim: 0.8", "slim: thin", r"rowan\.yaml: stand: slim must be a valid number.*got 'thin'"),
        ("label: treetop", "label: leaf", r"materials\.leaf_rowan: label must be one of .* got 'leaf'"),
        ("pairs: 12", "pears: 12", r"textures\.leaf_rowan: veined_leaf: .*pears"),
        ("pairs: 12", "pairs: twelve", r"leaf_rowan: veined_leaf: pairs must be a valid number.*got 'twelve'"),
        ("[66, 90, 42]", "[66, 90]", r"textures\.leaf_rowan: veined_leaf: tones\.0\.2 is missing"),
        ("draw: smooth_bark", "draw: smoth_bark", r"textures\.bark_rowan: unknown drawing 'smoth_bark'; did you mean"),
        ("foliage: leaf_rowan", "foliage: leaf_rown", r"rowan\.yaml: unknown material 'leaf_rown'; did you mean"),
        ("  bark_rowan: {label", "  bark_lime: {label", r"materials\.bark_lime is already defined in .*lime\.yaml"),
        (
            "  bark_rowan: {label: trunk, furrows: 0.006, weathering: 0.7}",
            "  bark_rowan: trunk",
            r"rowan\.yaml: materials must be a mapping of mappings",
        ),
        ("orders: ", "orders: [", r"rowan\.yaml: broken YAML: "),
    ],
)
def test_mistake_in_a_species_is_reported_with_file_key_and_value(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    assert EXAMPLES["rowan"].count(old) >= 1
    with pytest.raises(ConfigurationError, match=message):
        TREES.add(write(tmp_path, "rowan", EXAMPLES["rowan"].replace(old, new, 1)))
    assert "rowan" not in TREES
    assert "bark_rowan" not in MATERIALS


@pytest.mark.parametrize(
    ("drawing", "same"),
    [
        ("velvet, tones: [[58, 38, 26], [86, 58, 38], [112, 80, 54]]", "spike_cattail"),
        ("opal_glass", "glass"),
        ("murky_water", "water"),
    ],
)
def test_drawings_by_their_names_in_earlier_files_are_the_same(tmp_path: Path, drawing: str, same: str) -> None:
    entry = f"{{draw: {drawing}, albedo: {list(TEXTURES[same].albedo)}}}"
    text = EXAMPLES["rowan"].replace("textures:\n", f"textures:\n  earlier: {entry}\n")
    TREES.add(write(tmp_path, "rowan", text))
    found = TEXTURES["earlier"]
    TREES.remove("rowan")
    assert found == TEXTURES[same]


STREWN = "soil: {tones: [[9, 9, 9]], by: {middle: 0}}, height: {middle: 0}"
GRIT = "grit: {shape: stones, count: 9, radius: [1, 2], tones: [[90, 90, 90], [140, 140, 140]]}"


@pytest.mark.parametrize(
    ("pieces", "message"),
    [
        ("steps: {}, laid: []", r"rowan\.yaml: textures\.ground: strewn: laid .* at least 1 item"),
        (f"steps: {{{GRIT}}}, laid: [grid]", r"^textures\.ground: unknown pieces 'grid'; did you mean 'grit'"),
        (
            f"steps: {{{GRIT.replace('[1, 2]', '[0, 2]')}}}, laid: [grit]",
            r"steps\.grit.*radius.* greater than 0, got 0",
        ),
        (f"steps: {{{GRIT.replace('stones', 'stone')}}}, laid: [grit]", r"steps\.grit .*'noise', 'blades', 'stones'"),
    ],
)
def test_mistake_in_strewn_ground_is_reported(tmp_path: Path, pieces: str, message: str) -> None:
    entry = f"{{draw: strewn, albedo: [0.1, 0.1, 0.1], {pieces}, {STREWN}}}"
    path = write(tmp_path, "rowan", EXAMPLES["rowan"].replace("textures:\n", f"textures:\n  ground: {entry}\n"))
    with pytest.raises(ConfigurationError, match=message):
        draw_ground_of(path)


def draw_ground_of(path: Path) -> None:
    TREES.add(path)
    try:
        make_texture("ground", np.random.SeedSequence(1))
    finally:
        TREES.remove("rowan")


def stool(part: str) -> str:
    return f"furniture: {{stool: {{footprint: 1, colliders: [], parts: [{{{part}}}]}}}}\n"


@pytest.mark.parametrize(
    ("section", "message"),
    [
        (
            stool("shape: box, material: bench_wood, size: [1, 2]"),
            r"rowan\.yaml: furniture\.stool: parts\.0: box must have size .*, got 0 points, size \[1\.0, 2\.0\]",
        ),
        (
            stool("parts: [{shape: lathe, material: bench_wood, points: [[0, 0, 1], [1, 0, 1]]}]"),
            r"furniture\.stool: parts\.0\.parts\.0: lathe must have points \(radius, height\), got 2 points",
        ),
        (
            stool("shape: slats, material: bench_wood, points: [[0, 0], [1, 0]], size: [1, 1, 0]"),
            "and count, got .* count 0",
        ),
        (stool("shape: ball, material: bench_wod, size: [1]"), r"parts\.0: unknown material 'bench_wod'; did you mean"),
        (stool("at: [1, 2, 3, 4]"), r"parts\.0: a pose must have 2, 3 or 6 numbers, got \[1\.0, 2\.0, 3\.0, 4\.0\]"),
        (
            "litter: {paving: {patches: [{per_m2: -1, items: []}]}}",
            r"litter\.paving\.patches\[0\]: per_m2 must be greater",
        ),
        ("seasons: {leaf_rowan: {dry: {kept: 1}}}", r"rowan\.yaml: seasons\.leaf_rowan\.dry: colours is missing"),
        ("seasons: {leaf_rowan: {dry: 1}}", r"seasons\.leaf_rowan\.dry: must be a dictionary"),
        (stool("shape: cone"), r"furniture\.stool: parts\.0\.shape must be 'box', .*got 'cone'"),
    ],
)
def test_mistake_in_a_section_is_reported_with_file_and_key(tmp_path: Path, section: str, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        TREES.add(write(tmp_path, "rowan", EXAMPLES["rowan"] + section))


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("yields: solid\n", r"mine\.yaml: yields must be flexible or passable of a grass, which has no collider"),
        ("yields: flexible\n", r"mine\.yaml: a grass that is flexible needs stems"),
    ],
)
def test_a_grass_that_cannot_yield_so_is_refused(tmp_path: Path, lines: str, message: str) -> None:
    file = next(path for path in data_files() if path.parent.name == "grasses" and path.stem == "bent")
    assert "yields" not in file.read_text()
    with pytest.raises(ConfigurationError, match=message):
        GRASSES.add(write(tmp_path, "mine", lines + file.read_text()))


def test_name_in_use_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"the name 'oak' is already used by .*oak\.yaml"):
        TREES.add(write(tmp_path, "oak", EXAMPLES["rowan"]))


def test_unknown_section_of_a_file_of_materials_is_refused(tmp_path: Path) -> None:
    (tmp_path / "materials").mkdir()
    write(tmp_path / "materials", "mine", "texture: {}\n")
    code = "from fieldtruth.world.materials import MATERIALS; list(MATERIALS)"
    environment = {**os.environ, "FIELDTRUTH_PATH": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert "mine.yaml: unknown section 'texture'; did you mean 'textures'?" in done.stderr


def test_every_data_file_is_read_and_has_a_comment_on_top() -> None:
    folders: dict[str, Mapping[str, object]] = {
        "trees": TREES,
        "bushes": BUSHES,
        "grasses": GRASSES,
        "rocks": ROCK_TYPES,
        "environments": PLANTINGS,
    }
    for path in data_files():
        assert path.read_text().startswith("# ")
        if path.parent.name == "materials":
            assert set(yaml.safe_load(path.read_text())) <= set(SHARED)
        else:
            assert path.stem in folders[path.parent.name]
    mappings: list[Mapping[str, object]] = [*folders.values(), MATERIALS, TEXTURES]
    for mapping in mappings:
        assert len(list(mapping.values())) == len(mapping) > 0


def test_importing_the_package_reads_no_data() -> None:
    code = (
        "import fieldtruth, sys; assert not [m for m in sys.modules if m.startswith('fieldtruth.world.')], sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    code = (
        "import fieldtruth.world.plants, fieldtruth.world.library as l; assert l._document.cache_info().currsize == 0"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
