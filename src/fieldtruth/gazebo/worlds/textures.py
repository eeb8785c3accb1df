# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Image files of a world's materials and of the tiles of its ground."""

from collections.abc import Set
from pathlib import Path

from fieldtruth.interchange.ground import ground_images, ground_tiles
from fieldtruth.interchange.surfaces import encode_image, material_image
from fieldtruth.world.model import World


def texture_file(world: World, material: str) -> str:
    """Name of the image of a material, or of a tile of the ground.

    It starts with the world's name, because Gazebo 11 finds textures by name in all folders of models.
    """
    return f"{world.name}_{material}.jpg"


def write_textures(folder: Path, world: World, materials: Set[str]) -> None:
    """Write the images of these materials; those that are not the world's are tiles of its ground."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in sorted(materials & world.materials.keys()):
        (folder / texture_file(world, name)).write_bytes(encode_image(material_image(world, name)))
    tiles = [tile for tile in ground_tiles(world) if tile.name in materials]
    for tile, jpeg in zip(tiles, ground_images(world, tiles), strict=True):
        (folder / texture_file(world, tile.name)).write_bytes(jpeg)
