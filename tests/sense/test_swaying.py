# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Instances that are placed per packet (``kernels.swaying``) against Embree's own motion of instances."""

import ctypes as c

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import box, driven
from test_leaning import SPINNING, STAMP, leaning, world  # noqa: F401 (a fixture)

from fieldtruth.core import transforms
from fieldtruth.kernels import packets
from fieldtruth.kernels.packets import LANES
from fieldtruth.sense import embree
from fieldtruth.sense.embree import Engine, RayScene, native_packet
from fieldtruth.sense.interval import Moving
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.lidar.sensing import IdealLidar
from fieldtruth.world.model import World

pytestmark = pytest.mark.skipif(
    native_packet() != LANES, reason="Embree has no packets here, and moves instances itself"
)
COUNT = 300


def swaying(monkeypatch: pytest.MonkeyPatch, own: bool) -> RayScene:
    """Crates at random poses that turn by 10 deg and move by 0.3 m: placed per packet, or by Embree."""
    monkeypatch.setattr(embree, "native_packet", lambda: LANES if own else 1)
    engine, rng, crate = Engine(), np.random.default_rng(4), box("crate", (0.3, 0.2, 0.6), "wood")
    part, scene, columns = RayScene(engine), RayScene(engine), np.empty((2, COUNT, 12), np.float32)
    part.add_mesh(crate.vertices, crate.faces)
    for element in range(COUNT):
        pose = transforms.pose(tuple(rng.uniform(-8, 8, 3)), tuple(rng.uniform(-180, 180, 3)))
        for step in range(2):
            columns[step, element] = pose[:3].T.ravel()
            pose = pose @ transforms.pose(tuple(rng.uniform(-0.2, 0.2, 3)), (0, 10, 0))
    scene.add_instances([part.commit()], np.zeros(COUNT, np.uint32), columns, number=0)
    return scene.commit()


def traced(scene: RayScene, query: str) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Distances of hits, -inf of blocked rays, and ids of elements, of random rays at random times."""
    rng, api = np.random.default_rng(5), embree._library()
    function, far, element = getattr(api, f"rtc{query}{LANES}"), [], []
    function.restype, function.argtypes = None, (c.c_void_p,) * 4
    for _ in range(200):
        ray, words, valid, arguments = packets.new_packet(coherent=False)
        valid[:] = np.where(rng.random(LANES) < 0.9, -1, 0)
        fields = ray.reshape(-1, LANES)
        fields[:3], fields[4:7] = rng.uniform(-10, 10, (3, LANES)), rng.normal(size=(3, LANES))
        fields[7], fields[8], words[packets.MASK : packets.MASK + LANES] = rng.random(LANES), 40.0, packets.MISS
        words.reshape(-1, LANES)[18:] = packets.MISS
        function(valid.ctypes.data, scene._pointer, ray.ctypes.data, arguments.ctypes.data)
        far.append(fields[8].copy())
        element.append(words.reshape(-1, LANES)[20].copy())
    return np.concatenate(far), np.concatenate(element)


def test_rays_meet_the_same_elements_at_the_same_distances(monkeypatch: pytest.MonkeyPatch) -> None:
    for query in ("Intersect", "Occluded"):
        (mine, own), (theirs, other) = (traced(swaying(monkeypatch, each), query) for each in (True, False))
        same = own == other
        assert same.mean() > 0.999
        assert 0.1 < (mine < 40.0).mean() < 0.9
        assert ((mine < 40.0) == (theirs < 40.0)).mean() > 0.999
        near = same & np.isfinite(mine) & np.isfinite(theirs)
        assert np.abs(mine[near] - theirs[near]).max() < 1e-4


def test_a_spinning_scan_has_the_ranges_of_embrees_own_motion(
    world: World,  # noqa: F811 (the fixture)
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scans = []
    for lanes in (LANES, 1):
        monkeypatch.setattr(embree, "native_packet", lambda lanes=lanes: lanes)
        lidar = IdealLidar(SPINNING, Scene(world, Moving(leaning=leaning(world))))
        lidar.scan(driven(SPINNING.columns), STAMP)
        scans.append(lidar._echoes.depth[0].copy())
    assert (np.abs(scans[0] - scans[1]) < 1e-4).mean() > 0.999
