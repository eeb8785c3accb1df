# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cost of each step of a photograph, in milliseconds and beside the tracing of the rays through its pixels.

Run: python benchmarks/photograph.py [--views N] [park ...]. One thread; steps are added one after another, and each
figure is the difference to the image before, of the least of three tries. Docs: docs/benchmarks.md.
"""

import argparse
from collections.abc import Callable
from time import perf_counter
from typing import Any, Final

import numpy as np
from numba import njit
from views import poses_on_route

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.files import load_experiment
from fieldtruth.kernels.camera_rays import BLOCK_HEIGHT, BLOCK_WIDTH, View, label_pixels, set_pixel_block, trace
from fieldtruth.kernels.light import Shading, dim
from fieldtruth.kernels.packets import LabelBuffers
from fieldtruth.kernels.photograph import Framebuffer, find_edges, store
from fieldtruth.kernels.shading import PASSES, shade_hits
from fieldtruth.kernels.tone_curve import tonemap
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.sensing import Camera
from fieldtruth.world.build import world_of

ENVIRONMENTS: Final = ("park", "lake", "forest", "hillside")
TRIES: Final = 3
_ALL: Final = len(PASSES)
STEPS: Final = ("rays through the pixels", "labels", *PASSES, "air")


def render_until(shading: Shading, framebuffer: Framebuffer, view: View, labels: LabelBuffers, last: int) -> None:
    """Render the pixels' centres with the first steps of ``STEPS``, up to number ``last``; without water and wires."""
    buffers, linear, _ = framebuffer
    height, width, _ = linear.shape
    batch, pixel = buffers.batch, 1.0 / view.intrinsics.fx
    for upper in range(0, height, BLOCK_HEIGHT):
        for left in range(0, width, BLOCK_WIDTH):
            count = set_pixel_block(upper, left, height, width, batch.image)
            trace(shading.scene, shading.hits.geometry_top, buffers.packet, view, batch, count)
            if last >= 1:
                label_pixels(shading.hits, batch, count, labels)
            if last >= 2:
                passes, out = min(last - 1, _ALL), (buffers.gbuffer, buffers.colour)
                shade_hits(shading, buffers, batch, count, pixel, out, passes)
            if last > 1 + _ALL:
                dim(shading, batch, count, buffers.colour)
                store(batch.image, buffers.colour, count, linear)


_njit: Any = njit
_compiled = _njit(nogil=True, error_model="numpy", _nrt=False)(render_until)


def seconds_of(baked: BakedScene, camera: Camera, pose: Array) -> list[float]:
    """Time [s] with one step, with two, ... with all, with the search for edges; of a whole image, of its tones."""
    images, view = camera._own_images(), camera._view(pose)
    labels, framebuffer = camera._buffers(images), camera._framebuffer

    def timed(what: Callable[..., object], *given: object) -> float:
        start = perf_counter()
        what(*given)
        return perf_counter() - start

    found = [timed(_compiled, baked.shading, framebuffer, view, labels, k) for k in range(len(STEPS))]
    edges = timed(find_edges, framebuffer.linear, labels, framebuffer.edges, BLOCK_HEIGHT)
    whole = timed(camera.render, pose)
    return [*found, found[-1] + edges, whole, timed(tonemap, framebuffer.linear, images.photo)]


def main() -> None:
    """Print a table per environment."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("environments", nargs="*", default=ENVIRONMENTS)
    parser.add_argument("--views", type=int, default=6)
    options = parser.parse_args()
    for environment in options.environments:
        experiment = load_experiment(f"{environment}_1")
        world = world_of(experiment)
        baked = bake(Scene(world), experiment.light)
        config = experiment.rig.enabled(CameraConfig)[0]
        camera, imager = Camera(config, baked), config.imagers()[0]
        poses = [
            p @ imager.base_from_optical for p in poses_on_route(experiment.route, world, experiment.rig, options.views)
        ]
        tries = np.array([[seconds_of(baked, camera, pose) for pose in poses] for _ in range(TRIES + 1)])[1:]
        *sums, whole, tones = 1e3 * tries.min(axis=0).mean(axis=0)
        steps = dict(zip((*STEPS, "search for edges"), np.diff([0.0, *sums]), strict=True))
        steps["water, wires, rays and shading at edges"] = whole - sums[-1] - tones
        steps["tones"] = tones
        print(f"\n{environment}: {whole:.0f} ms, {whole / sums[0]:.2f} of the rays through the pixels")
        for name, cost in steps.items():
            print(f"{name:64}{cost:7.1f} ms {cost / sums[0]:6.2f}")


if __name__ == "__main__":
    main()
