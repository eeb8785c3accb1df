# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""An experiment in the small park, and a plain."""

from dataclasses import replace

import numpy as np
from small_park import RIG, in_small_park, small_park

from fieldtruth.world.model import Heightfield, Raster, World

EXPERIMENT = in_small_park(
    name="small_1", rig=RIG, route={"metres": {"start": [-8.0, 0.0], "waypoints": [[0.0, 0.0], [8.0, 0.0]]}}
)


def plain(side: float = 8000.0, *, height: float = 0.0, trail_north_of_0: bool = False) -> World:
    """Flat ground without objects; optionally, everything north of x = 0 is trail."""
    park, half = small_park(), side / 2
    x = np.array([half, -half] if trail_north_of_0 else [1.0, 1.0], np.float32)
    ground = Heightfield(heights=np.full((2, 2), height, np.float32), spacing=side, x0=-half, y0=-half)
    trail = Raster(values=np.column_stack([x, x]), spacing=side, x0=-half, y0=-half)
    terrain = replace(park.terrain, field=ground, layer=None, trail_distance=trail)
    return replace(park, size=(side, side), terrain=terrain, meshes={}, instances=(), swarms=(), backdrop=None)
