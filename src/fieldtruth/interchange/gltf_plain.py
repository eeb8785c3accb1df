# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The world as glTF 2.0 without extensions, for readers that do not know ``EXT_mesh_gpu_instancing``."""

from pathlib import Path

from fieldtruth.interchange import gltf
from fieldtruth.world.model import World


def write(world: World, target: Path, *, beyond: bool) -> None:
    """Write the file ``target``, with a node for each member of a swarm."""
    gltf.write(world, target, beyond=beyond, instancing=False)
