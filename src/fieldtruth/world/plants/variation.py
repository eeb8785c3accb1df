# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Habits of individuals of a species, of trees in a stand, and of plants with fewer triangles."""

from dataclasses import replace
from typing import Final

import numpy as np

from fieldtruth.world.plants.species import Habit, Leaf, Order, Stand

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
