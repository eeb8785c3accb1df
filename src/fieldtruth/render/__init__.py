# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Photographs: light is baked once per scene, then shading and tonemapping turn ray hits into colours."""

from fieldtruth.render.camera import Camera, CameraImages
from fieldtruth.render.shading import BakedScene, bake

__all__ = ["BakedScene", "Camera", "CameraImages", "bake"]
