# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The lake's own classes by LiDAR and camera: wires and poles are hit where they are, water is seen and never hit."""

from dataclasses import replace

import numpy as np
import pytest
from sense_worlds import make_world, trace_rays

from fieldtruth.classes import Label
from fieldtruth.sense import Scene
from fieldtruth.world.furniture import hang, make_cable, make_power_pole
from fieldtruth.world.materials import MATERIALS


def test_rays_at_a_wire_and_a_pole() -> None:
    wire = hang((-20.0, 6.0, 8.0), (20.0, 9.0, 8.6), sag=0.7)
    mesh, pose = make_cable("wire", wire)
    pole = make_power_pole(0)
    standing = np.eye(4)
    standing[:3, 3] = 5.0, -8.0, 0.0
    world = make_world([(mesh, pose), (pole, standing)])
    world = replace(
        world,
        materials={
            **world.materials,
            **{n: replace(MATERIALS[n], texture="grey") for n in (*mesh.materials, *pole.materials)},
        },
    )
    scene = Scene(world)
    eye = np.array([0.0, 0.0, 0.9])
    targets = wire.points(np.linspace(2.0, wire.span - 2.0, 40))
    seen = trace_rays(scene, np.tile(eye, (40, 1)), targets - eye)
    assert set(seen.label) == {Label.CABLE}
    assert set(seen.instance) == {2}
    assert seen.range_m == pytest.approx(np.linalg.norm(targets - eye, axis=1), abs=0.02)
    beside = trace_rays(scene, np.tile(eye, (40, 1)), targets + np.array([0.0, 0.0, 0.05]) - eye)
    assert set(beside.label) == {0}
    up = np.array([[5.0, -8.0, z] for z in (0.5, 2.0, 5.0, 8.0)])
    posts = trace_rays(scene, np.tile(eye, (4, 1)), up - eye)
    assert set(posts.label) == {Label.POST}
