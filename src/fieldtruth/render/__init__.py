# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rendering: light, sky, water, shading and tonemapping of what the camera's rays hit."""

from fieldtruth.render.camera import Camera, LabelImage, Picture, tag_image

__all__ = ["Camera", "LabelImage", "Picture", "tag_image"]
