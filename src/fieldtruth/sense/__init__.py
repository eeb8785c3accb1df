# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ray tracing and the sensors that need no light: LiDAR, and label, instance and depth images.

Imports nothing, so that a kernel is compiled again only after an edit of a module that it uses.
"""
