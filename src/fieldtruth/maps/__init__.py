# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Maps of real places in the frame of a world: elevation, trees, OpenStreetMap (pip install 'fieldtruth[maps]')."""
