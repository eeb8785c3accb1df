# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ray tracing: the scene that all sensors share, kernels that trace rays of LiDARs and pixels, and single rays.

Imports nothing, so that a kernel is compiled again only after an edit of a module that it uses.
"""
