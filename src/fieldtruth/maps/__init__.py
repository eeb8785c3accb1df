# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Maps of real places: elevation, trees, and OpenStreetMap, in the frame of a world (pip install 'fieldtruth[maps]')."""
