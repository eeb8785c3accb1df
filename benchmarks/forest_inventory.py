# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The trees of an environment as a forest inventory has them, measured from the meshes.

    python benchmarks/forest_inventory.py [ENVIRONMENT] [SEED]

docs/environments.md compares the figures of the forest with published ones.
"""

import argparse
from typing import Final

import numpy as np

from fieldtruth.interchange.inventory import COLUMNS, inventory, swarm_members
from fieldtruth.world.build import load_world
from fieldtruth.world.model import World
from fieldtruth.world.plants import TREES

THICK: Final = 0.07  # [m], least diameter of a stem at 1.3 m
TALL: Final = 7.0  # [m]
DEAD: Final = ("fallen_trunk", "snag", "stump")


def volume(world: World, kind: str) -> float:
    """Volume of the objects of a kind [m3]."""
    total = 0.0
    for instance in world.instances:
        if instance.kind == kind:
            mesh = world.meshes[instance.mesh]
            own = np.linalg.det(mesh.vertices[mesh.faces].astype(np.float64)).sum() / 6
            total += float(own * np.linalg.det(instance.world_from_object[:3, :3]))
    return total


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("environment", nargs="?", default="forest")
    parser.add_argument("seed", nargs="?", type=int, default=0)
    world = load_world(**vars(parser.parse_args()))
    hectares = world.size[0] * world.size[1] / 1e4
    rows = [dict(zip(COLUMNS, row, strict=True)) for row in inventory(world)]
    names = np.array([str(row["species"]) for row in rows])
    tree = np.array([row["species"] in TREES and row["kind"] not in DEAD for row in rows])
    height, diameter, base, crown, leaves = (
        np.array([row[key] for row in rows], np.float64)
        for key in ("height_m", "trunk_diameter_m", "crown_base_m", "crown_diameter_m", "leaf_area_m2")
    )
    stems = diameter >= THICK
    print(f"stems of 7 cm and more, snags included: {stems.sum() / hectares:.0f} per ha")
    print(f"basal area: {np.pi / 4 * (diameter[stems] ** 2).sum() / hectares:.1f} m2/ha")
    print(f"mean diameter (of the mean basal area): {100 * np.sqrt((diameter[stems] ** 2).mean()):.1f} cm")
    print(f"leaf area index, without swarms: {np.nansum(leaves) / hectares / 1e4:.1f}")
    for name in sorted(set(names[tree])):
        own = tree & (names == name) & (height > TALL)
        if own.any():
            ratio = np.percentile(height[own] / diameter[own], (10, 50, 90))
            print(
                f"{name}: {own.sum()} trees of {height[own].min():.0f} to {height[own].max():.0f} m, height over "
                f"diameter {ratio[1]:.0f} ({ratio[0]:.0f} to {ratio[2]:.0f}), crown base at "
                f"{np.nanmedian(base[own] / height[own]):.2f} of the height, crown {np.nanmedian(crown[own]):.1f} m"
            )
    print(", ".join(f"{kind}: {volume(world, kind) / hectares:.1f} m3/ha" for kind in DEAD))
    inside = [item for item in swarm_members(world) if not item.beyond]
    for swarm in world.swarms:
        count = sum(item.object_id == swarm.object_id for item in inside)
        print(f"{swarm.name}: {count / hectares:.0f} members per ha" if count else f"{swarm.name}: beyond the edge")


if __name__ == "__main__":
    main()
