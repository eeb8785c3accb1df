# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The terrain of the physics is that of the sensors: same corners, same triangles, same heights."""

from typing import Any

import mujoco
import numpy as np
import pytest
from drive_worlds import F8, HeightFunction, hills, make_field, obstacle, tilted
from drive_worlds import make_world as make_world_of

from fieldtruth.drive.physics import add_terrain, build_physics
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.model import Heightfield

RADIUS = 0.001


def probe_model(field: Heightfield) -> tuple[Any, Any]:
    """A model of the terrain and one small ball that can be moved anywhere."""
    spec = mujoco.MjSpec()
    add_terrain(spec, field)
    body = spec.worldbody.add_body(name="probe")
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0], contype=1, conaffinity=0, margin=0.05)
    model = spec.compile()
    return model, mujoco.MjData(model)


def contact_height(model: Any, data: Any, x: float, y: float, guess: float, normal: F8) -> float:
    """Height of the ground at x, y from the contact of a ball just above it, on a facet with this ``normal``."""
    lift = 0.003
    data.qpos[:3] = (x, y, guess + lift)
    mujoco.mj_forward(model, data)
    distance = min(contact.dist for contact in data.contact)
    return guess + lift - (float(distance) + RADIUS) / float(normal[2])


def bump(x: F8, y: F8) -> F8:
    return np.asarray(0.8 * np.exp(-((x - 1.0) ** 2 + (y + 2.0) ** 2) / 2) + 0.05 * x - 0.03 * y - 2.0)


def ridge(x: F8, y: F8) -> F8:
    return np.asarray(np.where((np.rint(x / 0.2) + 2 * np.rint(y / 0.2)) % 3 == 0, 0.05, 0.0))


@pytest.mark.parametrize("height", [tilted(10.0, -7.0), bump, hills, ridge])
def test_contact_heights_are_those_of_the_heightfield(height: HeightFunction) -> None:
    field = make_field(height, size=(8.0, 6.0))
    model, data = probe_model(field)
    rng = np.random.default_rng(3)
    nx, ny = field.heights.shape
    h = field.heights.astype(float)
    for _ in range(150):
        i, j = int(rng.integers(nx - 1)), int(rng.integers(ny - 1))
        along = bool(rng.integers(2))  # which of the cell's two triangles
        # Well inside the triangle, so that no other facet is nearer.
        u, v = (0.6, 0.25) if along else (0.25, 0.6)
        x, y = field.x0 + (i + u) * field.spacing, field.y0 + (j + v) * field.spacing
        corner = h[i + 1, j] if along else h[i, j + 1]
        first, second = corner - h[i, j], h[i + 1, j + 1] - corner
        slope = np.array([first, second] if along else [second, first]) / field.spacing
        normal = np.array([-slope[0], -slope[1], 1.0]) / np.sqrt(1 + slope @ slope)
        expected = float(field.height_at(x, y))
        assert contact_height(model, data, x, y, expected, normal) == pytest.approx(expected, abs=2e-6)


def test_obstacles_have_the_poses_and_sizes_of_the_objects() -> None:
    world = make_world_of(
        obstacles=[
            obstacle("lamp", "cylinder", (0.1, 3.0), 4.0, -2.0, scale=2.0),
            obstacle("bench", "box", (2.0, 0.5, 0.8), -3.0, 5.0, yaw=90.0),
        ]
    )
    model, names = build_physics(world, Rig())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lamp, bench = (next(g for g, name in names.items() if name == name_wanted) for name_wanted in ("lamp", "bench"))
    np.testing.assert_allclose(data.geom_xpos[lamp], (4.0, -2.0, 3.0))
    np.testing.assert_allclose(model.geom_size[lamp][:2], (0.2, 3.0))
    np.testing.assert_allclose(data.geom_xpos[bench], (-3.0, 5.0, 0.4))
    np.testing.assert_allclose(model.geom_size[bench], (1.0, 0.25, 0.4))
    np.testing.assert_allclose(data.geom_xmat[bench].reshape(3, 3)[:, 0], (0, 1, 0), atol=1e-12)
