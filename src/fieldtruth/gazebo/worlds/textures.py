# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Image files of a world's materials and of the tiles of its ground."""

from pathlib import Path
from typing import Final

from fieldtruth.interchange.ground import ground_tiles
from fieldtruth.interchange.ground_image import ground_image
from fieldtruth.interchange.images import encode_image, material_image
from fieldtruth.render.materials import material_table
from fieldtruth.world.model import World

GROUND_PIXELS_PER_METRE: Final = 80.0


def write_textures(folder: Path, world: World, prefix: str) -> dict[str, str]:
    """Write an image per material and per tile of the ground; return the files' names, which start with ``prefix``."""
    folder.mkdir(parents=True)
    images = {name: material_image(world, name) for name in world.materials}
    table = material_table(world)
    names = {}
    for tile in ground_tiles(world):
        images[tile.name] = ground_image(world, tile, GROUND_PIXELS_PER_METRE, table)
    for name, image in images.items():
        names[name] = f"{prefix}{name}.jpg"
        (folder / names[name]).write_bytes(encode_image(image))
    return names
