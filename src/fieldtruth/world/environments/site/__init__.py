# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A place of your own: ground, trees, paths and surfaces from maps."""
