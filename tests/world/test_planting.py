# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Plants of the environments as data: other species by a layout, and from a user's folder."""

import os
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sense_worlds import without_textures

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.world.build import build_world, check_layout
from fieldtruth.world.environments.layout import PLANTINGS, Planter
from fieldtruth.world.plants import BUSHES, GRASSES, TREES
from fieldtruth.world.plants.species import heights_of
from fieldtruth.world.rocks import ROCK_TYPES

LAYOUTS = {
    "park": {"large_tree": ["alder"], "bed_bush": ["gorse"], "bed_flower": ["anemone"]},
    "lake": {"meadow_tree": ["beech"], "meadow_bush": ["juniper"], "sedge_3": ["bent"]},
    "hillside": {"pine": ["spruce"], "gorse": ["box"], "grass": ["dry"], "boulder": ["limestone"]},
    "forest": {"bush": ["box"], "ferns": ["nettle"]},
}


def often(environments: Iterable[str]) -> list[Any]:
    """The park in every run of the tests, the others with the slow ones."""
    return [name if name == "park" else pytest.param(name, marks=pytest.mark.slow) for name in environments]


FEW: dict[str, dict[str, object]] = {  # quick to build
    "park": {"size": [50, 40], "bushes": 8, "large_trees": 3, "small_trees": 2, "beyond": 0},
    "lake": {"waterside_trees": 2, "meadow_trees": 3, "grass": 0.2},
    "hillside": {"size": [50, 40], "grass": 1, "stones": 0, "pebbles": 0},
    "forest": {"size": [40, 30], "old_trees": 6, "grown_trees": 4, "young_trees": 4},
}


@pytest.mark.parametrize("environment", often(LAYOUTS))
def test_a_layout_plants_other_species_in_every_environment(environment: str) -> None:
    plants = LAYOUTS[environment]
    size = {} if environment == "lake" else {"size": [70, 45]}
    with without_textures():
        world = build_world(
            environment, 0, {"plants": plants, "litter": 0, "individuals": 1, **size, **FEW[environment]}
        )
    inside = {name for i in world.instances for name in world.meshes[i.mesh].species}
    inside |= {s for swarm in world.swarms for mesh in swarm.meshes for s in world.meshes[mesh].species}
    assert {name for names in plants.values() for name in names} <= inside


@pytest.mark.parametrize(
    ("plants", "message"),
    [
        ({"larg_tree": ["lime"]}, "unknown group 'larg_tree'; did you mean 'large_tree'"),
        ({"large_tree": ["limes"]}, "large_tree: unknown species 'limes'; did you mean 'lime'"),
        ({"large_tree": ["box"]}, "large_tree: unknown species 'box'"),
        ({"bed_bush": []}, "bed_bush must name one species at least. Available: blackthorn"),
    ],
)
def test_mistakes_in_a_layout_are_said(plants: dict[str, list[str]], message: str) -> None:
    with pytest.raises(ConfigurationError, match=re.escape(message)):
        check_layout("park", {"plants": plants})


@pytest.mark.parametrize(
    ("group", "message"),
    [
        ("{form: tree, name: tree}", "species or heights is missing"),
        ('{form: tree, name: "{kind}", heights: 3}', "name may have {species} and {k}, got '{kind}'"),
        ("{form: tree, name: tree, species: {limes: 3}}", "unknown species 'limes'; did you mean 'lime'"),
    ],
)
def test_mistakes_in_a_file_of_plants_are_said(tmp_path: Path, group: str, message: str) -> None:
    path = tmp_path / "meadow.yaml"
    path.write_text(f"groups: {{trees: {group}}}\nswarms: {{}}\n")
    with pytest.raises(ConfigurationError, match=re.escape(f"{path}: groups.trees: {message}")):
        PLANTINGS.add(path)


def test_a_species_that_is_not_listed_is_as_high_as_it_can_be() -> None:
    meshes = Planter("park", {"bed_grass": ["anemone"]}).grow("bed_grass", np.random.default_rng(0))
    highest = 1.5 * GRASSES["anemone"].height[1]
    assert [mesh.vertices[:, 2].max() for mesh in meshes] == pytest.approx([highest] * 3, rel=0.05)


def test_a_group_is_counted_by_a_key_of_the_layout_and_smaller_individuals_have_fewer_leaves(tmp_path: Path) -> None:
    path = tmp_path / "meadow.yaml"
    tree = "form: tree, heights: 2.2, species: {beech: 2.2}"
    path.write_text(
        f"groups:\n  whole: {{{tree}, name: 'w_{{k}}', count: few, solid: false}}\n"
        f"  small: {{{tree}, name: 's_{{k}}', count: few, scaled: [0.7, 0.9]}}\n"
    )
    PLANTINGS.add(path)
    try:
        planter = Planter("meadow", {}, {"few": 3})
        whole, small = (planter.grow(group, np.random.default_rng(0)) for group in ("whole", "small"))
    finally:
        PLANTINGS.remove("meadow")
    assert not any(mesh.colliders for mesh in (*whole, *small))
    heights = [np.mean([mesh.vertices[:, 2].max() for mesh in meshes]) for meshes in (whole, small)]
    assert len(whole) == len(small) == 3
    assert 0.7 < heights[1] / heights[0] < 0.9
    assert small[0].vertices[:, 2].max() / small[2].vertices[:, 2].max() == pytest.approx(7 / 9, rel=0.1)
    sides = []
    for mesh in (whole[0], small[0]):  # of the leaves, whose materials follow that of the bark
        corner = mesh.vertices[mesh.faces[mesh.material > 0]].astype(np.float64)
        area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1) / 2
        sides.append(np.sqrt(area.mean()))
    assert sides[1] == pytest.approx(sides[0], rel=0.1)  # 0.7 times as long if all were smaller


@pytest.mark.parametrize("environment", often(PLANTINGS))
def test_every_group_grows(environment: str) -> None:
    for group in PLANTINGS[environment].groups:
        planter = Planter(environment, {})
        names = planter.species(group) or ("oak",)
        meshes = planter.grow(group, np.random.default_rng(0), count=1, species=names)
        assert {s for mesh in meshes for s in mesh.species} <= set(names)
        assert set(names) <= {*TREES, *BUSHES, *GRASSES, *ROCK_TYPES}


@pytest.mark.slow
def test_a_species_in_a_users_folder_is_planted(tmp_path: Path) -> None:
    (tmp_path / "trees").mkdir()
    lime = Path(sys.modules[Planter.__module__].__file__ or "").parents[1] / "data/trees/lime.yaml"
    text = re.sub(r"(?ms)^(materials|textures):.*?(?=^\S|\Z)", "", lime.read_text())
    (tmp_path / "trees/rowan.yaml").write_text(text)
    code = (
        "from fieldtruth.world.environments.layout import Planter; import numpy as np; rng = np.random.default_rng(0);"
        "print(Planter('park', {'small_tree': ['rowan']}).grow('small_tree', rng, count=1)[0].species)"
    )
    environment = {**os.environ, "FIELDTRUTH_PATH": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "('rowan',)"
    (tmp_path / "trees/rowan.yaml").rename(tmp_path / "trees/oak.yaml")
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert "the name 'oak' is already used by" in done.stderr


@pytest.mark.parametrize("environment", PLANTINGS)
def test_no_seed_draws_a_height_that_a_species_cannot_have(environment: str) -> None:
    """The least and the greatest height of each group are allowed, so that all between them are."""
    libraries: dict[str, Any] = {"tree": TREES, "snag": TREES, "bush": BUSHES, "tuft": GRASSES}
    for name, group in PLANTINGS[environment].groups.items():
        for species in group.species if group.form in libraries else ():
            kind = libraries[group.form][species]
            for height in np.ravel(group.value(species)) * (kind.grown.height if group.relative else 1.0):
                low, high = heights_of(kind, height, group.grown_in)
                assert low <= height <= high, (name, species)
