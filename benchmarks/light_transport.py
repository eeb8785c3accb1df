# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Light of photographs beside that of a path tracer: Mitsuba 3 (pip install mitsuba), which shares no code with ours.

Run: python benchmarks/light_transport.py FOLDER [--samples N] [--save] [park ...]

Both render the same triangles and instances, the same albedos, normals, sun and dome; paths have up to 12 vertices.
Textures are replaced by their mean colour, and tints, highlights, the layer of short grass, water and haze are left
out, in both: what remains is how light travels. References are kept in FOLDER and used again; --save adds pictures.

Printed per environment, first with an even light in place of the volume (the sky's mean from above, from below what
level ground reflects of it and of the sun), then with the volume, of pixels (mean of 2 x 2) nearer than 40 m that are
neither sky nor water: bias (ratio of the sums of luminance), relative error of luminance (median and mean), the same in
the shade (where the reference has less than a fourth of its sunlit luminance), SSIM of the square root of luminance
(Wang et al. 2004), and distance in chromaticity (mean of |r - r'| + |b - b'| with r = R / (R + G + B)).
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from views import poses_on_route

import fieldtruth as ft
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.kernels.light import EXPOSURE, LightTable, sky_radiance
from fieldtruth.kernels.textures import linear_from_srgb, srgb_from_linear
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.render.materials import material_table
from fieldtruth.sense.scene import Scene, terrain_nodes
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.world.build import world_of
from fieldtruth.world.model import Material, Mesh, Raster, World

ENVIRONMENTS: Final = ("park", "lake", "forest", "hillside")
FIELD: Final = 69.0  # [deg] across
CONFIG: Final = StereoConfig(
    width=160,
    height=88,
    horizontal_fov_deg=FIELD,
    vertical_fov_deg=2 * float(np.degrees(np.arctan(88 / 160 * np.tan(np.radians(FIELD / 2))))),
)
VIEWS: Final = 4
FAR: Final = 40.0  # [m]
GLOW: Final = (2.6, 2.8, 1.0)
"""Light through a leaf over light from it, by channel, for a translucency of 1: as in ``kernels.shading``."""
MOST: Final = 0.9
"""Of what falls on a leaf, the share that it reflects and transmits at most."""
LUMINANCE: Final = np.array([0.2126, 0.7152, 0.0722])
VERTICES: Final = 12

Image = NDArray[np.float64]


def plain(world: World) -> World:
    """The world with one colour per material, and without what the benchmark leaves out."""

    def mean(texture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        colour = srgb_from_linear(linear_from_srgb(texture[..., :3] / 255.0).mean(axis=(0, 1)))
        return np.tile(np.rint(255 * colour).astype(np.uint8), (512, 512, 1))

    dry = tuple(i for i in world.instances if i.kind != "water")
    return replace(
        world,
        textures={name: mean(texture) for name, texture in world.textures.items()},
        materials={name: replace(material, gloss=0.0) for name, material in world.materials.items()},
        instances=tuple(replace(i, tint=(1.0, 1.0, 1.0)) for i in dry),
        swarms=tuple(replace(s, tint=np.ones_like(s.tint)) for s in world.swarms),
        terrain=replace(world.terrain, layer=None),
    )


def viewpoints(environment: str, world: World) -> list[Image]:
    """Poses world_from_optical (4, 4)."""
    experiment = load_experiment(f"{environment}_1")
    poses = poses_on_route(experiment.route, world, experiment.rig, VIEWS)
    return [pose @ ft.transforms.pose(CONFIG.left.xyz) @ OPTICAL for pose in poses]


def ours(baked: BakedScene, poses: list[Image]) -> tuple[Image, Image]:
    """Radiance (n, h, w, 3), without haze, and depth (n, h, w) [m]."""
    camera, light = ft.Camera(CONFIG, baked), []
    depths = []
    for pose in poses:
        images = camera.render(pose)
        scale = EXPOSURE * float(baked.shading.exposure)
        depth = images.depth.astype(float)
        linear = camera._framebuffer.linear / scale
        left = np.exp(-np.where(np.isfinite(depth), depth, 0.0)[..., None] * baked.shading.air.clear)
        horizon = baked.shading.air.light.mean(axis=0) / float(baked.shading.exposure)
        light.append((linear - horizon * (1.0 - left)) / left)
        depths.append(depth)
    return np.stack(light), np.stack(depths)


def evenly_lit(baked: BakedScene) -> BakedScene:
    """The scene with the same light everywhere in the air: what the light volume is to be better than."""
    light, colour = baked.shading.light, baked.shading.materials.ground[..., :3].mean(axis=(0, 1))
    above = np.asarray(light.dome.mean, float)
    below = colour * (above + light.sun_rgb * max(float(light.sun[2]), 0.0) / np.pi)
    probe = np.zeros(light.volume.shape[-1], np.float32)
    probe[0:12:4], probe[3:12:4] = (above + below) / 2, (above - below) / 2
    even = light._replace(volume=np.ascontiguousarray(np.broadcast_to(probe, light.volume.shape)))
    return replace(baked, shading=baked.shading._replace(light=even))


def _write_ply(path: Path, vertices: Any, faces: Any, normals: Any = None, colours: Any = None) -> None:
    parts = [("x y z", vertices), ("nx ny nz", normals), ("r g b", colours)]
    header = "".join(f"property float {n}\n" for names, given in parts if given is not None for n in names.split())
    rows = np.concatenate([np.asarray(given, "<f4") for _, given in parts if given is not None], axis=1)
    triangles = np.empty(len(faces), [("n", "u1"), ("v", "<i4", 3)])
    triangles["n"], triangles["v"] = 3, faces
    with path.open("wb") as stream:
        stream.write(
            f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{header}"
            f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n".encode()
        )
        stream.write(np.ascontiguousarray(rows, "<f4").tobytes() + triangles.tobytes())


def _surface(mi: Any, material: Material, colour: Image) -> Any:
    """A BSDF: matt, or a thin leaf that reflects and transmits diffusely."""

    def rgb(value: Any) -> dict[str, Any]:
        return {"type": "rgb", "value": [min(float(v), 1.0) for v in value]}

    if material.translucency == 0.0:
        return mi.load_dict({"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(colour)}})
    through = np.minimum(colour * material.translucency * np.array(GLOW), np.maximum(MOST - colour, 0.0))
    share = float(through.max() / (through.max() + colour.max()))
    leaf = {"type": "principledthin", "base_color": rgb(through / share), "diff_trans": 2.0, "spec_trans": 0.0}
    front = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(colour / (1 - share))}}
    return mi.load_dict({"type": "blendbsdf", "weight": share, "front": front, "through": leaf})


def _mesh_shapes(mi: Any, mesh: Mesh, surfaces: dict[str, Any], folder: Path) -> dict[str, Any]:
    shapes = {}
    for row, name in enumerate(mesh.materials):
        faces = mesh.faces[mesh.material == row]
        if len(faces):
            used, index = np.unique(faces, return_inverse=True)
            path = folder / f"{mesh.name}_{row}.ply"
            _write_ply(path, mesh.vertices[used], index.reshape(-1, 3), mesh.normals[used])
            shapes[f"part_{row}"] = {"type": "ply", "filename": str(path), "bsdf": surfaces[name]}
    return shapes


def _terrain_shape(world: World, folder: Path) -> dict[str, Any]:
    terrain, table = world.terrain, material_table(world)
    nodes = terrain_nodes(terrain.surface)
    x, y = nodes[..., 0], nodes[..., 1]
    cover = terrain.cover
    colour = Raster(values=table.ground[..., :3], spacing=cover.spacing, x0=cover.x0, y0=cover.y0).at(x, y)
    mean, edge = table.atlas.mean[table.texture] * table.tint, terrain.trail_distance.at(x, y)[..., None]
    colour = np.where(edge < 0, np.where(edge > -terrain.border_width, mean[table.border], mean[table.trail]), colour)
    row = np.arange(nodes.shape[0] * nodes.shape[1]).reshape(nodes.shape[:2])
    a, b, c, d = row[:-1, :-1].ravel(), row[1:, :-1].ravel(), row[1:, 1:].ravel(), row[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
    path = folder / "terrain.ply"
    _write_ply(path, nodes.reshape(-1, 3), faces, None, colour.reshape(-1, 3))
    bsdf = {"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": "vertex_color"}}
    return {"type": "ply", "filename": str(path), "bsdf": {"type": "twosided", "bsdf": bsdf}}


def _sky(mi: Any, light: LightTable) -> dict[str, Any]:
    """Dome and sun; the map's rows are elevation from the zenith, its columns azimuth."""
    height, width = 512, 1024
    theta, phi = np.meshgrid((np.arange(height) + 0.5) * np.pi / height, (np.arange(width) + 0.5) * 2 * np.pi / width)
    # Mitsuba: direction (sin phi sin theta, cos theta, -cos phi sin theta), y up; turned so that z is up.
    x, up, side = np.sin(phi) * np.sin(theta), np.cos(theta), -np.cos(phi) * np.sin(theta)
    rgb = np.zeros((width, height, 3), np.float32)
    for index in np.ndindex(width, height // 2):
        rgb[index] = sky_radiance(light.dome.rgb, float(x[index]), float(-side[index]), float(up[index]))
    turn = mi.ScalarTransform4f().rotate([1, 0, 0], 90)
    image = mi.Bitmap(np.ascontiguousarray(rgb.transpose(1, 0, 2)))
    sun = {"type": "rgb", "value": [float(v) for v in light.sun_rgb]}
    return {
        "dome": {"type": "envmap", "bitmap": image, "to_world": turn},
        "sun": {"type": "directional", "direction": [-float(v) for v in light.sun], "irradiance": sun},
    }


def reference(world: World, light: LightTable, poses: list[Image], samples: int) -> Image:
    """Radiance (n, h, w, 3) by Mitsuba."""
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    mean = {n: linear_from_srgb(texture[0, 0, :3] / 255.0) for n, texture in world.textures.items()}
    surfaces = {n: _surface(mi, m, mean[m.texture] * np.array(m.tint)) for n, m in world.materials.items()}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        shapes: dict[str, Any] = {"terrain": _terrain_shape(world, folder)}
        for mesh in world.meshes.values():
            shapes[f"group_{mesh.name}"] = {"type": "shapegroup", **_mesh_shapes(mi, mesh, surfaces, folder)}
        for top, (mesh_of, pose, *_) in enumerate(Scene(world).top_levels):
            if mesh_of is world.backdrop and mesh_of is not None:
                parts = _mesh_shapes(mi, mesh_of, surfaces, folder)
                shapes |= {f"backdrop_{k}": part for k, part in parts.items()}
            elif mesh_of is not None:
                turn = mi.ScalarTransform4f(np.asarray(pose, np.float64))
                group = {"type": "ref", "id": f"group_{mesh_of.name}"}
                shapes[f"top_{top}"] = {"type": "instance", "group": group, "to_world": turn}
        integrator = {"type": "path", "max_depth": VERTICES, "rr_depth": 4}
        scene = mi.load_dict({"type": "scene", "integrator": integrator, **_sky(mi, light), **shapes})
    images = []
    for pose in poses:
        images.append(np.array(mi.render(scene, sensor=_sensor(mi, pose), spp=samples))[..., :3])
        print("    a view of the reference is done", flush=True)
    return np.stack(images)


def _sensor(mi: Any, pose: Image) -> Any:
    flip = np.diag([-1.0, -1.0, 1.0, 1.0])  # Mitsuba's camera looks along z with x to the left and y up
    film = {"type": "hdrfilm", "width": CONFIG.width, "height": CONFIG.height, "rfilter": {"type": "box"}}
    turn = mi.ScalarTransform4f(np.asarray(pose @ flip, np.float64))
    return mi.load_dict({"type": "perspective", "fov": FIELD, "fov_axis": "x", "to_world": turn, "film": film})


def _halved(image: Image) -> Image:
    return np.asarray((image[:, ::2, ::2] + image[:, 1::2, ::2] + image[:, ::2, 1::2] + image[:, 1::2, 1::2]) / 4)


def _ssim(a: Image, b: Image, kept: NDArray[np.bool_]) -> float:
    """Mean SSIM of images (n, h, w) where ``kept``, with a Gaussian window of 1.5 pixels."""
    top = float(np.percentile(a[kept], 99))
    total: list[Image] = []
    for x, y, mask in zip(a / top, b / top, kept, strict=True):
        mx, my = gaussian_filter(x, 1.5), gaussian_filter(y, 1.5)
        vx, vy, vxy = (gaussian_filter(p, 1.5) - q for p, q in ((x * x, mx * mx), (y * y, my * my), (x * y, mx * my)))
        s = (2 * mx * my + 1e-4) * (2 * vxy + 9e-4) / ((mx * mx + my * my + 1e-4) * (vx + vy + 9e-4))
        total.append(s[mask])
    return float(np.concatenate(total).mean())


def compare(truth: Image, found: Image, depth: Image) -> str:
    """One line of figures."""
    near = (depth > 0) & (depth < FAR)
    kept = _halved(near.astype(float)) == 1.0
    truth, found = _halved(truth), _halved(found)
    a, b = truth @ LUMINANCE, found @ LUMINANCE
    error = np.abs(b - a) / np.maximum(a, 1e-5)
    shade = kept & (a < np.percentile(a[kept], 95) / 4)
    chroma = np.abs(truth / truth.sum(-1, keepdims=True) - found / found.sum(-1, keepdims=True))[..., [0, 2]].sum(-1)
    return (
        f"bias {b[kept].sum() / a[kept].sum():.2f}  error median {np.median(error[kept]):.2f} mean "
        f"{error[kept].mean():.2f}  shade: bias {b[shade].sum() / a[shade].sum():.2f} median "
        f"{np.median(error[shade]):.2f} ({shade.sum() / kept.sum():.0%})  SSIM "
        f"{_ssim(np.sqrt(a.clip(0)), np.sqrt(b.clip(0)), kept):.3f}  chroma {chroma[kept].mean():.3f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("environments", nargs="*", default=ENVIRONMENTS)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--save", action="store_true")
    arguments = parser.parse_intermixed_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    for environment in arguments.environments:
        experiment = load_experiment(f"{environment}_1")
        world = plain(world_of(experiment))
        poses = viewpoints(environment, world)
        baked = bake(Scene(world), experiment.light)
        found, depth = ours(baked, poses)
        path = arguments.folder / f"{environment}.npy"
        if not path.exists():
            np.save(path, reference(world, baked.shading.light, poses, arguments.samples))
        truth = np.load(path)
        print(f"{environment:9} even   {compare(truth, ours(evenly_lit(baked), poses)[0], depth)}", flush=True)
        print(f"{environment:9} volume {compare(truth, found, depth)}", flush=True)
        if arguments.save:
            _save(arguments.folder / f"{environment}.png", truth, found)


def _save(path: Path, truth: Image, found: Image) -> None:
    """Reference above, ours below, in sRGB with the reference's 97th percentile of luminance at 0.7."""
    import cv2

    scale = 0.7 / np.percentile(truth @ LUMINANCE, 90)
    rows = [np.concatenate(list(srgb_from_linear(image * scale)), axis=1) for image in (truth, found)]
    cv2.imwrite(str(path), np.rint(255 * np.concatenate(rows)).astype(np.uint8)[..., ::-1])


if __name__ == "__main__":
    main()
