# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The forest measured as an inventory measures it, against published figures of dense Central European stands.

Measured from meshes (``interchange.inventory``), not from the layout. Sources of the ranges are at each test; those
that are quoted from memory say so.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import kstest, weibull_min
from sense_worlds import trace_rays

from fieldtruth.interchange.inventory import BREAST_HEIGHT, COLUMNS, inventory, measure, moved, trunk_diameter
from fieldtruth.sense.scene import Scene
from fieldtruth.world.build import load_world
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import World
from fieldtruth.world.plants import TREES, GrownIn, grow_tree
from fieldtruth.world.plants.species import Species
from fieldtruth.world.stems import SAPLING, species_of, yields_of

F8 = NDArray[np.float64]
HECTARE = 10_000.0
THICK = 0.07  # [m], least diameter at 1.3 m of the trees that inventories call stems
SLENDER = {"spruce": (70, 100), "pine": (65, 95), "beech": (65, 100), "birch": (70, 105), "oak": (60, 90)}
"""Height over diameter of trees above 9 m, median. Dense stands exceed 80 (Wonn and O'Hara 2001); 6,070 trees of the
upper storey in Niepołomice: 77 for pine, which has the least of eight species, 105 for ash, oak and birch in between
(Orzeł 2007, abstract). Spruce and beech of 20 m: 85 to 100 in yield tables (Assmann and Franz 1963, Schober 1967; from
memory)."""


@dataclass(frozen=True)
class Forest:
    """A forest and its inventory, one dictionary per named object."""

    world: World
    rows: list[dict[str, object]]

    @property
    def hectares(self) -> float:
        return self.world.size[0] * self.world.size[1] / HECTARE

    def column(self, name: str, *, living: bool = True) -> F8:
        """Values of the living trees, or of all objects, NaN where they lack it."""
        rows = [row for row in self.rows if row["kind"] in TREES or not living]
        return np.array([row[name] for row in rows], float)

    def species(self) -> NDArray[np.str_]:
        return np.array([row["species"] for row in self.rows if row["kind"] in TREES])

    def volume(self, kind: str) -> float:
        """Volume of the objects of a kind [m3]; what is in the soil counts."""
        total = 0.0
        for instance in self.world.instances:
            if instance.kind == kind:
                mesh = self.world.meshes[instance.mesh]
                volume = np.linalg.det(mesh.vertices[mesh.faces].astype(float)).sum() / 6
                total += float(volume * np.linalg.det(instance.world_from_object[:3, :3]))
        return total


@pytest.fixture(scope="module")
def forest() -> Forest:
    world = load_world("forest")
    return Forest(world, [dict(zip(COLUMNS, row, strict=True)) for row in inventory(world)])


@pytest.mark.slow
def test_stems_and_basal_area(forest: Forest) -> None:
    """Fully stocked stands of 20 to 25 m: 30 to 45 m2/ha and 450 to 1,000 stems (yield tables of Schober 1967 for
    beech, Assmann and Franz 1963 for spruce; from memory)."""
    diameter = forest.column("trunk_diameter_m")
    thick = diameter[diameter >= THICK]
    assert 500 <= len(thick) / forest.hectares <= 800
    assert 28.0 <= np.pi / 4 * (thick**2).sum() / forest.hectares <= 42.0
    assert 0.22 <= np.sqrt((thick**2).mean()) <= 0.30


@pytest.mark.slow
def test_height_over_diameter_of_each_species(forest: Forest) -> None:
    height, diameter, species = forest.column("height_m"), forest.column("trunk_diameter_m"), forest.species()
    for name, (low, high) in SLENDER.items():
        tall = (species == name) & (height > 9.0)
        assert tall.sum() > 15
        assert low <= np.median(height[tall] / diameter[tall]) <= high, name


@pytest.mark.slow
def test_diameters_follow_a_weibull_distribution(forest: Forest) -> None:
    """Bailey and Dell 1973; shapes of 2 to 5 in stands of few storeys (from memory)."""
    diameter = forest.column("trunk_diameter_m")
    thick = diameter[diameter >= THICK]
    shape, _, scale = weibull_min.fit(thick, floc=0.0)
    assert 2.0 <= shape <= 5.0
    assert kstest(thick, weibull_min(shape, 0.0, scale).cdf).statistic < 0.15


@pytest.mark.slow
def test_crowns(forest: Forest) -> None:
    """Crown bases at 0.35 to 0.7 of the height, crowns of 3 to 9 m, leaf area index of 5 to 7 (Asner, Scurlock and
    Hicke 2003: 5.1 to 6.7 in evergreen temperate forests)."""
    height, base = forest.column("height_m"), forest.column("crown_base_m")
    width, tall = forest.column("crown_diameter_m"), forest.column("height_m") > 14.5
    assert 0.35 <= np.median(base[tall] / height[tall]) <= 0.65
    assert (width[tall] / height[tall]).max() < 0.55
    assert 4.0 <= np.median(width[tall]) <= 7.5
    leaves = np.nansum(forest.column("leaf_area_m2", living=False)) / (forest.hectares * HECTARE)
    assert 5.0 <= leaves <= 7.0


@pytest.mark.slow
def test_trunks_taper_between_cone_and_cylinder(forest: Forest) -> None:
    """Diameter at half the height over that at 1.3 m: 0.65 to 0.75 in stands (Assmann 1970; from memory).

    A cone through the same diameter at 1.3 m has 0.53 at 20 m of height, a paraboloid 0.73.
    """
    quotients = []
    for instance in forest.world.instances:
        if instance.kind == "spruce" and "_old_" in instance.mesh:
            measures = measure(forest.world.meshes[instance.mesh], forest.world.materials)
            pose = instance.world_from_object
            wood, foot = moved(pose, measures.wood), pose[:3, 3]
            middle = foot[2] + 0.5 * (moved(pose, measures.corners)[:, 2].max() - foot[2])
            at_breast, at_half = (trunk_diameter(wood, z, foot[:2]) for z in (foot[2] + BREAST_HEIGHT, middle))
            quotients.append(at_half / at_breast)
    assert len(quotients) > 50
    assert 0.6 <= np.nanmedian(quotients) <= 0.8


@pytest.mark.slow
def test_dead_wood(forest: Forest) -> None:
    """German National Forest Inventory 2012: 20.6 m3/ha, of which 49 % lies, 23 % stands and 28 % are stumps."""
    lying, standing, stumps = (forest.volume(k) / forest.hectares for k in ("fallen_trunk", "snag", "stump"))
    assert 12.0 <= lying + standing + stumps <= 30.0
    assert lying > standing > stumps > 1.0


def members(world: World, name: str) -> tuple[list[str], F8, F8]:
    """Mesh, scale and x, y [m] of the members of a swarm."""
    [swarm] = [swarm for swarm in world.swarms if swarm.name == name]
    scale = np.cbrt(np.linalg.det(swarm.world_from_object[:, :3, :3]))
    return [swarm.meshes[row] for row in swarm.mesh], scale, swarm.world_from_object[:, :2, 3]


@pytest.mark.slow
def test_natural_regeneration(forest: Forest) -> None:
    """Thousands of seedlings of 10 to 50 cm and hundreds of saplings per hectare, beech before spruce, in groups.

    Below old stands in conversion: up to several thousand, with a clumped pattern (Dobrovolny 2016 for beech below
    spruce; Axer, Kluckow and Wagner 2022; figures from memory).
    """
    names, scale, xy = members(forest.world, "seedlings")
    roots = {name: int((forest.world.meshes[name].vertices[:, 2] < -0.05).sum()) for name in set(names)}  # one a stem
    count = np.array([roots[name] for name in names])
    assert 3000 <= count.sum() / forest.hectares <= 8000
    height = scale * [forest.world.meshes[name].vertices[:, 2].max() for name in names]
    assert 0.1 < height.min() < height.max() < 0.6
    x, y = np.floor(xy / 5.0).astype(int).T
    quadrats = np.bincount(10 * (x + 10) + y + 5, count, 200)  # 5 m square
    assert quadrats.var() / quadrats.mean() > 5.0  # 1 where positions are random
    names, scale, _ = members(forest.world, "saplings")
    assert 300 <= len(names) / forest.hectares <= 1500
    height = scale * [forest.world.meshes[name].vertices[:, 2].max() for name in names]
    assert 0.4 < height.min() < height.max() < 2.3
    assert np.mean(["beech" in name for name in names]) > np.mean(["spruce" in name for name in names]) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("environment", ["park", "lake", "forest", "hillside"])
def test_whatever_is_solid_in_a_world_has_a_collider(environment: str) -> None:
    world = load_world(environment, 0)
    half = np.array(world.size) / 2
    inside = {each.mesh for each in world.instances}
    for swarm in world.swarms:
        near = (np.abs(swarm.world_from_object[:, :2, 3]) < half).all(axis=1)
        inside |= {swarm.meshes[row] for row in swarm.mesh[near]}
    plants = [world.meshes[name] for name in inside if world.meshes[name].species and world.meshes[name].tufts is None]
    plants = [mesh for mesh in plants if any(species_of(mesh))]  # without rocks
    assert len(plants) > 3
    for mesh in plants:
        assert (yields_of(mesh) == "solid") <= bool(mesh.colliders), mesh.name
        if (
            any(isinstance(each, Species) and each.yields == "solid" for each in species_of(mesh))
            and not mesh.colliders
        ):
            assert mesh.vertices[:, 2].max() < SAPLING


@pytest.mark.slow
def test_cover_of_the_ground_vegetation(forest: Forest) -> None:
    """Woodrush beech forests have a sparse herb layer, 5 to 40 % with dwarf shrubs and ferns (Ellenberg and Leuschner
    2010; from memory): share of the ground outside trails that is hidden from above."""
    world, rng = forest.world, np.random.default_rng(5)
    xy = rng.uniform(-0.98, 0.98, (20_000, 2)) * np.array(world.size) / 2
    xy = xy[world.terrain.trail_distance.at(*xy.T) > 0.3]
    origins = np.column_stack([xy, world.terrain.field.height_at(*xy.T) + BREAST_HEIGHT])
    seen = trace_rays(Scene(world), origins, np.tile([[0.0, 0.0, -1.0]], (len(xy), 1)), max_range=2.0)
    names = np.array(world.object_names)[seen.instance]
    share = {name: float((names == name).mean()) for name in ("forest_grass", "ferns", "seedlings", "bilberries")}
    assert 0.08 <= sum(share.values()) <= 0.40
    assert all(0.001 < value < 0.25 for value in share.values()), share


@pytest.mark.parametrize("name", ["oak", "beech", "lime", "spruce", "pine", "birch", "alder", "willow"])
def test_trees_of_the_open_are_half_as_slender(name: str) -> None:
    """At the greatest density a trunk is about half as thick as in the open (Sterba 1975, cited by Vospernik et al.
    2010); open-grown spruce and pine of 10 cm have 64 and 56 diameters, thicker ones fewer (Stampfer 1995, ibid.)."""
    ratio: dict[str, float] = {}
    kinds: tuple[GrownIn, ...] = ("open", "stand")
    for grown_in in kinds:
        rng = np.random.default_rng(3)
        tree = grow_tree(TREES[name], name=name, height=12.0, rng=rng, detail=0.05, grown_in=grown_in)
        wood = measure(tree, MATERIALS).wood
        ratio[grown_in] = 12.0 / trunk_diameter(wood, BREAST_HEIGHT, np.zeros(2))
    assert 25.0 <= ratio["open"] <= 60.0
    assert 1.35 <= ratio["stand"] / ratio["open"] <= 2.6
