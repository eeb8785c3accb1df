# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Photographs: light is baked once per scene; shading and tonemapping turn ray hits into colours.

Imports nothing, so that light is baked again only after an edit of a module that shapes it.
"""
