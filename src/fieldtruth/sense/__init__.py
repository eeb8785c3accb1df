# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ray tracing: the scene that all sensors share, single rays, the robot in front of its own sensors, lenses and air.

Imports nothing, so that light is baked again only after an edit of a module that shapes it.
"""
