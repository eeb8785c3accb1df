# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Blender renders a glTF scene from a pose of our camera. Run by a Python that has bpy: blender_render.py JOB.json.

The job has ``scene`` (glTF file), ``world_from_optical`` (4 x 4), ``fx``, ``fy`` [pixel], ``width``, ``height``,
``far`` [m] and one or both of
``ids``: a .npy file for (height, width, 3) float32: instance id, class id, depth [m] of each pixel's centre;
``picture``: a .png file, with ``samples`` per pixel and the sun at ``azimuth_deg`` and ``elevation_deg``.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

import bpy
import mathutils
import numpy as np


def load(path: str) -> None:
    """Import the scene and give objects and materials their ids as pass indices."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=path, import_shading="NORMALS")
    for item in bpy.data.objects:
        if item.type == "MESH":
            owner = item
            while "instance_id" not in owner:
                owner = owner.parent
            item.pass_index = owner["instance_id"]
    for material in bpy.data.materials:
        material.pass_index = material["class_id"]


def let_light_through_leaves() -> None:
    """Mix the shaders of leaves and blades with a translucent one: core glTF has no light from behind a surface."""
    for material in bpy.data.materials:
        if material["translucency"] > 0:
            nodes, links = material.node_tree.nodes, material.node_tree.links
            front = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
            output = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
            behind, both = nodes.new("ShaderNodeBsdfTranslucent"), nodes.new("ShaderNodeMixShader")
            links.new(front.inputs["Base Color"].links[0].from_socket, behind.inputs["Color"])
            both.inputs["Fac"].default_value = material["translucency"]
            links.new(front.outputs[0], both.inputs[1])
            links.new(behind.outputs[0], both.inputs[2])
            links.new(both.outputs[0], output.inputs["Surface"])


def add_camera(job: dict[str, Any]) -> None:
    """Add our pinhole camera: Blender's looks along -z with y up; its pixels are square by default."""
    scene = bpy.context.scene
    camera = bpy.data.objects.new("left_camera", bpy.data.cameras.new("left_camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.matrix_world = mathutils.Matrix(job["world_from_optical"]) @ mathutils.Matrix.Diagonal((1, -1, -1, 1))
    camera.data.sensor_fit = "HORIZONTAL"
    camera.data.sensor_width = 36.0
    camera.data.lens = job["fx"] * 36.0 / job["width"]
    camera.data.clip_start, camera.data.clip_end = 0.01, job["far"]
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = job["width"], job["height"], 100
    # A pixel's width over its height is fy / fx; Blender takes factors of at least 1.
    aspect = job["fy"] / job["fx"]
    render.pixel_aspect_x, render.pixel_aspect_y = max(aspect, 1.0), max(1 / aspect, 1.0)


def render_ids(path: str) -> None:
    """Render one ray per pixel, through its centre, and save what it hit."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.max_bounces = 1, 0
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01  # [pixel]
    layer.use_pass_object_index = layer.use_pass_material_index = layer.use_pass_z = True
    tree = bpy.data.node_groups.new("ids", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    passes = tree.nodes.new("CompositorNodeRLayers")
    both, output = tree.nodes.new("CompositorNodeCombineColor"), tree.nodes.new("NodeGroupOutput")
    for row, name in enumerate(("Object Index", "Material Index", "Depth")):
        tree.links.new(passes.outputs[name], both.inputs[row])
    tree.links.new(both.outputs[0], output.inputs[0])
    scene.compositing_node_group = tree
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGB"
    exr = str(Path(path).with_suffix(".exr"))
    scene.render.filepath = exr
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(exr)
    image.colorspace_settings.name = "Non-Color"
    values = np.empty(image.size[0] * image.size[1] * image.channels, np.float32)
    image.pixels.foreach_get(values)
    rows = values.reshape(image.size[1], image.size[0], image.channels)  # Blender's first row is the lowest
    np.save(path, rows[::-1, :, :3])
    scene.compositing_node_group = None


def render_picture(job: dict[str, Any]) -> None:
    """Render a photograph with the sun and a clear sky."""
    let_light_through_leaves()
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.max_bounces = job["samples"], 6
    scene.cycles.use_denoising = True
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 1.5
    sky = bpy.data.worlds.new("sky")
    nodes = sky.node_tree.nodes
    texture = nodes.new("ShaderNodeTexSky")
    texture.sun_elevation = math.radians(job["elevation_deg"])
    texture.sun_rotation = math.radians(90.0 + job["azimuth_deg"])  # anticlockwise from +y
    sky.node_tree.links.new(texture.outputs[0], nodes["Background"].inputs["Color"])
    nodes["Background"].inputs["Strength"].default_value = 0.06
    scene.world = sky
    scene.view_settings.view_transform, scene.view_settings.look = "AgX", "AgX - Medium High Contrast"
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.color_mode = "PNG", "8", "RGB"
    scene.render.filepath = job["picture"]
    bpy.ops.render.render(write_still=True)


def main(path: Path) -> None:
    """Do a job."""
    job = json.loads(path.read_text(encoding="utf-8"))
    load(job["scene"])
    add_camera(job)
    if "ids" in job:
        render_ids(job["ids"])
    if "picture" in job:
        render_picture(job)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
