# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Species as data, and habits of individuals: trees and bushes of stems and leaves, grasses and herbs of blades.

The parameters are those of Weber and Penn, "Creation and Rendering of Realistic Trees" (SIGGRAPH 1995), reduced to what
these plants need. They count branches per stem; here, counts are of the whole plant, and each stem gets a share by its
length, so that the number of triangles hardly differs between individuals. Forms follow field guides; the numbers were
set by eye. Leaves have their real size.

A habit changes for an individual, for a tree in a stand, and for a plant with fewer triangles. Blades of grass are up
to twice as wide as in nature, and fewer by the same factor.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import Field

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.world import materials  # noqa: F401  (reads the materials and textures of added files)
from fieldtruth.world.library import Entry, Library, validated

Outline = Literal["conical", "spherical", "hemispherical", "flame", "domed", "spire", "flat"]
GrownIn = Literal["open", "stand", "exposed"]
"""Surroundings of a growing tree: in the open, in a forest stand, or on a windy, stony slope."""
OUTLINES: Final[Mapping[Outline, Callable[[Array], Array]]] = {
    "conical": lambda r: 0.2 + 0.8 * r,
    "spherical": lambda r: 0.2 + 0.8 * np.sin(np.pi * r),
    "hemispherical": lambda r: 0.2 + 0.8 * np.sin(0.5 * np.pi * r),
    "flame": lambda r: 0.5 + 0.5 * np.where(r <= 0.7, r / 0.7, (1 - r) / 0.3),
    "domed": lambda r: 0.3 + 0.7 * np.sin(np.pi * (0.12 + 0.68 * r)),
    "spire": lambda r: 0.06 + 0.94 * r**0.8,
    "flat": lambda r: 0.35 + 0.65 * np.sin(np.pi * np.minimum(0.2 + 0.9 * r, 1.0)),
}
"""Length of a limb relative to the longest, at a share of the crown's depth: 1 at its base, 0 at its top.

Weber and Penn's ShapeRatio (section 4.3; "flame" is their "tend flame"). "domed" (tall round crowns), "spire" (spruce)
and "flat" (old pine) are our additions.
"""


@dataclass(frozen=True, kw_only=True)
class Order:
    """Growth of the stems of one order on those of the order before: order 1 on the trunk, order 2 on the limbs, ...

    Pairs are (value at the base, value at the tip): of the parent for ``angle``, of the stem itself for ``lift``.
    """

    number: int  # stems of this order on the whole plant before pruning, each parent's share by its length
    start: float = 0.0  # lowest position on the parent, fraction of its length (order 1: see Habit.crown_base)
    length: float  # of the longest, relative to the parent's length (order 1: to the plant's height)
    length_spread: float = 0.15  # standard deviation of the logarithm
    angle: tuple[float, float]  # [deg] from the parent's axis
    angle_spread: float = 8.0  # [deg] standard deviation
    divergence: float = 137.5  # [deg] about the parent from one sibling to the next; 180: two ranks, left and right
    divergence_spread: float = 15.0  # [deg] standard deviation
    whorl: int = 1  # shoots that sprout at one height, as in a year's growth of most conifers
    lift: tuple[float, float] = (0.0, 0.0)  # [rad per stem length] upward bending (down if negative)
    bend: float = 0.2  # [rad per stem length] standard deviation of one steady bend in any direction
    wander: float = 0.2  # [rad per stem length] standard deviation of the random walk of the direction
    thickness: float = 1.1  # radius relative to the parent's is the length relative to the parent's to this power
    collar: float = 0.25  # widening at the base relative to the rest
    taper: float = 1.0  # radius as this power of the distance from the tip: 1 is a cone, 0.5 a paraboloid
    segments: int = 4  # per stem
    sides: int = 4  # of the tube
    foliage: float = 0.0  # leaves per length relative to other orders; 0: none
    leaf_start: float = 0.0  # lowest leaf, fraction of the stem's length
    drawn: float = 1.0  # share of the stems that get a surface: the thinnest twigs are hidden by large leaves


@dataclass(frozen=True, kw_only=True)
class Leaf:
    """The form of a leaf: a folded blade of two or, ``rounded``, four triangles, or a spray of needles.

    A spray is a small twig with its needles and side shoots as a fan of triangles: single needles would be a million
    triangles.
    """

    number: int  # on a plant of ``Habit.height`` before pruning; in proportion to the height on others
    length: float  # [m] of the blade
    width: float  # relative to the length
    size_spread: float = 0.18  # standard deviation of the logarithm
    widest: float = 0.4  # position of the greatest width, fraction of the length
    fold: float = 20.0  # [deg] by which each half rises from the plane
    stalk: float = 0.03  # [m]
    arrangement: float = 180.0  # [deg] about the twig from one leaf to the next
    droop: float = 0.5  # weight of "down" in the midrib's direction
    flatness: float = 1.0  # weight of "up" in the upper side's direction, against 1 for outwards
    forward: float = 0.5  # weight of the twig's direction in the midrib's, against 1 for sideways
    rounded: bool = False  # six corners instead of a kite's four
    prongs: int = 0  # of a spray of needles, each a pointed triangle; 0: a blade
    splay: float = 40.0  # [deg] between the prongs
    stands_for: float = 1.0  # real leaves that one of these replaces, where there is less detail
    stagger: float = 0.0  # where the outer prongs leave the middle one, fraction of the length


@dataclass(frozen=True, kw_only=True)
class Habit:
    """The form of a plant at one age in one kind of surroundings."""

    height: float  # [m] of an individual with ``leaf.number`` leaves
    trunk_radius: float  # relative to the plant's height, at the ground without the root flare
    leader: float = 0.9  # length of the trunk relative to the plant's height
    clear: float  # [m] height of the bare trunk: lower branches are pruned
    crown_base: float  # height of the lowest limb's base relative to the plant's height
    outline: Outline
    lopsided: float = 0.15  # how much longer limbs are on the side of the light, relative
    vigour: tuple[float, float] = (1.0, 1.0)  # least and most leaves of an individual, relative to ``leaf.number``
    dead_limbs: float = 0.0  # share of the limbs without leaves
    dead: Order | None = None  # dry branches on the trunk below the crown; ``start`` is the height of the lowest
    trunk_lean: float = 2.0  # [deg] standard deviation
    lean_limit: float = 6.0  # [deg] greatest angle between the vertical and the line from the base to the top
    trunk_wander: float = 0.12  # [rad per length]
    trunk_taper: float = 1.0  # as ``Order.taper``
    trunk_segments: int = 20
    trunk_sides: int = 14
    flare: float = 0.6  # widening at the ground relative to the trunk's radius
    stems: int = 1  # trunks from one root
    stem_splay: float = 0.0  # [deg] from vertical of the outermost of several stems
    stem_circle: float = 0.0  # [m] radius of the circle that several stems start from
    stem_lift: tuple[float, float] = (0.2, -0.1)  # [rad per stem length] of several stems, as ``Order.lift``
    sheared: float = 0.0  # radius, relative to the height, of the dome to which it is clipped; 0: not clipped
    orders: tuple[Order, ...]
    leaf: Leaf


@dataclass(frozen=True, kw_only=True)
class Stand:
    """Differences of a tree in a forest stand from one in the open; the last three replace values of the habit.

    ``slim`` and ``reach`` were set so that the trees have a height of 65 to 95 diameters, as in yield tables for dense
    stands, and crowns as narrow as there (tests/world/test_forest_inventory.py has ranges and sources).
    """

    crown_base: float  # height of the lowest limb's base relative to the tree's height
    reach: float  # of the limbs, relative
    slim: float  # radius of the trunk at the ground, relative
    taper: float = 0.65  # of the trunk, as ``Order.taper``: form factor 0.49, between cone and cylinder
    leaves: float  # number of leaves, relative
    clear: float  # [m], as in `Habit`
    height: float = 13.0  # [m], as in `Habit`
    dead: Order | None = None
    dead_limbs: float | None = None
    trunk_wander: float | None = None


Yields = Literal["solid", "flexible", "passable"]
"""Effect of a plant on a robot that drives against it: it stops it, bends, or lets it pass."""


@dataclass(frozen=True, kw_only=True)
class Stems:
    """Stems of a tuft or bush that a robot pushes over: equal upright rods that are clamped in the ground.

    Rigidity and strength hold at the mean height of a grass, or the usual height of a bush, and grow with the square of
    the height, as a stem's diameter grows with its root here (``grasses.grow_tuft``).
    """

    number: Annotated[int, Field(ge=1, le=200)]
    rigidity: Annotated[float, Field(gt=0, le=1e4)]  # EI [N m^2] of one stem near the ground
    breaks: Annotated[float, Field(gt=0)] | None = None  # bending moment at the ground [N m]; None: it never breaks
    recovers: Annotated[float, Field(ge=0, le=1)] = 0.5  # share of its lean that is gone long after it was pressed down
    seconds: Annotated[float, Field(gt=0)] = 20.0  # in which 63 % of that share are gone


@dataclass(frozen=True, kw_only=True)
class Species:
    """A species of tree or bush: its materials, and its habits by age and surroundings."""

    name: str
    latin: str
    wood: str  # material
    foliage: str  # material
    upper_wood: str | None = None  # material of the bark above ``upper_from``, if it differs from the bark below
    upper_from: float = 0.5  # of the height
    bloom: str | None = None  # material of the flowers; None: not in bloom
    bloom_share: float = 0.1  # of the leaves that are flowers
    hidden_twigs: Annotated[float, Field(ge=0, le=1)] = 0.6  # that show for each leaf that is gone; 0: pruned ones
    grown: Habit
    young: Habit | None = None
    young_below: float = 6.5  # [m] height below which the young habit applies
    stand: Habit | None = None  # in a forest stand: a long clear trunk and a narrow crown; None: as ``grown``
    exposed: Habit | None = None  # stunted by wind and drought, at any age; None: as elsewhere
    yields: Yields = "solid"
    stems: Stems | None = None  # of a flexible one

    def __str__(self) -> str:
        return self.name

    def habit(self, height: float, grown_in: GrownIn = "open") -> Habit:
        """The habit of an individual of this height [m]."""
        if grown_in == "exposed" and self.exposed is not None:
            return self.exposed
        if self.young is not None and height < self.young_below:
            return self.young
        return self.stand if grown_in == "stand" and self.stand is not None else self.grown


@dataclass(frozen=True, kw_only=True)
class Leaves:
    """Leaves or spikelets along a blade or stalk; sizes [m] hold at the species' mean height."""

    kind: Literal["leaves"] = "leaves"
    material: str
    number: int  # on each stalk
    length: float
    width: float
    start: float  # position of the lowest, fraction of the stalk
    end: float = 1.0  # position of the highest
    angle: float = 60.0  # [deg] from the stalk
    droop: float = 0.3  # weight of "down" in their direction
    arrangement: Literal["spiral", "pairs", "one side"] = "spiral"
    smallest: float = 0.5  # length of the highest relative to the lowest
    widest: float = 0.35  # position of the greatest width, fraction of the length
    broad: bool = False  # six triangles instead of two
    spikelets: bool = False  # they are flowers or fruits, and no leaves


@dataclass(frozen=True, kw_only=True)
class Frond:
    """Pinnae that make a blade a fern's frond."""

    kind: Literal["frond"] = "frond"
    material: str
    pairs: int
    length: float  # of the longest pinna, relative to the frond's
    start: float = 0.16  # position of the lowest pair, fraction of the frond


@dataclass(frozen=True, kw_only=True)
class Flower:
    """A disc at the tip of a stalk."""

    kind: Literal["flower"] = "flower"
    material: str
    radius: float  # [m]


@dataclass(frozen=True, kw_only=True)
class Spike:
    """A spindle about a stalk."""

    kind: Literal["spike"] = "spike"
    material: str
    radius: float  # [m]
    start: float  # fraction of the stalk
    end: float


Organ = Annotated[Leaves | Frond | Flower | Spike, Field(discriminator="kind")]


@dataclass(frozen=True, kw_only=True)
class Blades:
    """One kind of blades or stalks in a tuft; pairs of numbers are least and most."""

    material: str
    number: int
    length: tuple[float, float]  # along the midrib, relative to other kinds
    width: float  # [m] greatest, at the species' mean height
    lean: tuple[float, float]  # [deg] from vertical at the root, in the middle and at the rim of the tuft
    bend: tuple[float, float]  # [deg] by which the tip leans further than the root
    drift: float = 25.0  # [deg] standard deviation of the sweep to the side from root to tip
    roll: float = 40.0  # [deg] standard deviation of the turn about the midrib
    twist: float = 60.0  # [deg] standard deviation of the further turn from root to tip
    rim: float = 1.0  # radius, relative to the tuft's, within which they root
    kite: bool = False  # two triangles instead of six, for thin or short blades
    organs: tuple[Organ, ...] = ()


@dataclass(frozen=True, kw_only=True)
class GrassSpecies:
    """A species of grass or herb."""

    name: str
    latin: str
    height: tuple[float, float]  # [m] usual range
    radius: float  # [m] of the disc that a tuft roots in, at the mean height
    lopsided: float = 0.5  # weight of the direction in which a whole tuft leans, against 1 for outwards
    blades: tuple[Blades, ...]
    yields: Yields = "passable"
    stems: Stems | None = None  # None: too soft to resist

    def __str__(self) -> str:
        return self.name


def heights_of(species: Species | GrassSpecies, height: float, grown_in: GrownIn = "open") -> tuple[float, float]:
    """Least and greatest height [m] of a species' individuals, by the habit that it has at ``height``."""
    if isinstance(species, GrassSpecies):
        return 0.5 * species.height[0], 1.5 * species.height[1]
    usual = species.habit(height, grown_in).height
    return 0.5 * usual, 2.0 * usual


SIDE_PRONG: Final = 0.8  # length of a spray's outer prongs relative to the middle one
FINE_LEAVES: Final = 0.45  # detail below which a leaf is a kite
SIMPLE_LEAVES: Final = 0.2  # detail below which it is a triangle, and there are twice as many


def individual(habit: Habit, rng: np.random.Generator) -> Habit:
    """The habit of one individual, with random crown base, density, curvature and asymmetry."""
    first, *others = habit.orders
    steeper = float(rng.normal(0, 4))
    first = replace(
        first,
        length=first.length * float(np.exp(np.clip(rng.normal(0, 0.1), -0.15, 0.15))),
        angle=(first.angle[0] + steeper, first.angle[1] + 0.5 * steeper),
    )
    return replace(
        habit,
        trunk_radius=habit.trunk_radius * float(rng.uniform(0.88, 1.12)),
        crown_base=habit.crown_base * float(rng.uniform(0.85, 1.15)),
        lopsided=habit.lopsided * float(rng.uniform(0.5, 1.6)),
        trunk_wander=habit.trunk_wander * float(rng.uniform(0.5, 1.4)),
        leaf=replace(habit.leaf, number=round(habit.leaf.number * float(rng.uniform(*habit.vigour)))),
        orders=(first, *others),
    )


def in_stand(habit: Habit, stand: Stand) -> Habit:
    """The habit of a tree that grew up in a forest stand.

    Light comes through gaps between the neighbours, so crowns are more one-sided than in the open.
    """
    first, *others = habit.orders
    return replace(
        habit,
        height=stand.height,
        trunk_radius=habit.trunk_radius * stand.slim,
        trunk_taper=stand.taper,
        leader=max(habit.leader, 0.93),
        clear=stand.clear,
        crown_base=stand.crown_base,
        lopsided=1.6 * habit.lopsided,
        dead_limbs=habit.dead_limbs + 0.05 if stand.dead_limbs is None else stand.dead_limbs,
        dead=habit.dead if stand.dead is None else stand.dead,
        trunk_wander=0.7 * habit.trunk_wander if stand.trunk_wander is None else stand.trunk_wander,
        flare=0.8 * habit.flare,
        vigour=(0.75, 1.0),
        leaf=replace(habit.leaf, number=round(stand.leaves * habit.leaf.number)),
        orders=(
            replace(first, length=stand.reach * first.length, angle=(0.85 * first.angle[0], first.angle[1])),
            *others,
        ),
    )


def at_detail(habit: Habit, detail: float) -> Habit:
    """The habit to draw with: about ``detail`` times the triangles of leaves, which are larger, of the same total area.

    Stems get fewer sides and segments, trunk and limbs only below a detail of 0.4, and most of the thinnest twigs have
    leaves but no surface. What grows is the same at each detail.
    """
    *others, last = habit.orders
    thick = min(1.0, 2.5 * detail)
    middle = [_coarser(order, detail, min(1.0, 2.5 * detail**0.7)) for order in others[1:]]
    return replace(
        habit,
        trunk_sides=max(5, round(habit.trunk_sides * thick**0.3)),
        trunk_segments=max(6, round(habit.trunk_segments * thick**0.3)),
        leaf=_fewer(habit.leaf, detail),
        orders=(_coarser(others[0], thick, 1.0), *middle, _coarser(last, detail, detail if detail > 0.12 else 0.0)),
        dead=None if habit.dead is None else _coarser(habit.dead, detail, min(1.0, 1.5 * detail**0.5)),
    )


def _fewer(leaf: Leaf, detail: float) -> Leaf:
    """Fewer leaves with the same total area."""
    share = leaf_share(leaf, detail)
    simple = not leaf.prongs and detail < SIMPLE_LEAVES
    prongs = 1 if simple else leaf.prongs
    coarse = replace(leaf, rounded=leaf.rounded and detail > FINE_LEAVES, prongs=prongs)
    growth = np.sqrt(outline_area(leaf) / outline_area(coarse) / share)
    number = max(1, round(leaf.number * share))
    return replace(coarse, number=number, length=leaf.length * float(growth), stands_for=1 / share)


def leaf_share(leaf: Leaf, detail: float) -> float:
    """Share of the leaves that there are with a detail."""
    return detail if leaf.prongs or detail >= SIMPLE_LEAVES else 2 * detail


def _coarser(order: Order, detail: float, drawn: float) -> Order:
    return replace(
        order,
        segments=max(1, round(order.segments * detail**0.3)),
        sides=max(3, round(order.sides * detail**0.25)),
        drawn=order.drawn * drawn,
    )


def outline_corners(leaf: Leaf) -> list[tuple[float, float]]:
    """Corners of the blade's left half between base and tip: (along the midrib, half width / width)."""
    if not leaf.rounded:
        return [(leaf.widest, 0.5)]
    return [(0.5 * leaf.widest, 0.4), (leaf.widest + 0.3 * (1 - leaf.widest), 0.46)]


def outline_area(leaf: Leaf) -> float:
    """Area of a leaf relative to length times width, unfolded; the width of a spray is that of one prong."""
    if leaf.prongs:
        return 0.5 * (1 + SIDE_PRONG * (leaf.prongs - 1))
    along, half = np.array([(0.0, 0.0), *outline_corners(leaf), (1.0, 0.0)]).T
    return float(np.sum(np.diff(along) * (half[:-1] + half[1:])))


def _species(name: str, content: Entry, path: Path) -> Species:
    values = {"name": name, **content}
    stand = values.pop("stand", None)
    for form in ("young", "exposed"):
        if form in values:
            values[form] = _merged(values.get("grown"), values[form])
    species = validated(Species, values, str(path))
    if (species.yields == "flexible") != (species.stems is not None):
        raise ConfigurationError(f"{path}: stems are of a species that is flexible, and of no other")
    if stand is None:
        return species
    return replace(species, stand=in_stand(species.grown, validated(Stand, stand, f"{path}: stand")))


def _merged(base: Any, changes: Any) -> Any:
    """``base`` with ``changes``: mappings key by key, lists of mappings item by item and as long as the changes."""
    if isinstance(base, Mapping) and isinstance(changes, Mapping):
        return {**base, **{key: _merged(base.get(key), value) for key, value in changes.items()}}
    if isinstance(base, list) and isinstance(changes, list) and all(isinstance(item, Mapping) for item in changes):
        return [_merged(base[k] if k < len(base) else None, item) for k, item in enumerate(changes)]
    return changes


def _grass(name: str, content: Entry, path: Path) -> GrassSpecies:
    species = validated(GrassSpecies, {"name": name, **content}, str(path))
    if species.yields == "solid":
        raise ConfigurationError(f"{path}: yields must be flexible or passable of a grass, which has no collider")
    if species.yields == "flexible" and species.stems is None:
        raise ConfigurationError(f"{path}: a grass that is flexible needs stems")
    return species


def _materials(species: Species) -> list[str | None]:
    return [species.wood, species.foliage, species.upper_wood, species.bloom]


def _grass_materials(species: GrassSpecies) -> list[str | None]:
    return [part.material for blades in species.blades for part in (blades, *blades.organs)]


TREES: Final = Library("trees", _species, _materials)
"""Trees by name."""
BUSHES: Final = Library("bushes", _species, _materials)
"""Bushes by name."""
GRASSES: Final = Library("grasses", _grass, _grass_materials)
"""Grasses and herbs by name, class high grass."""
