# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds: terrain, plants, furniture, materials, and the environments that put them together.

Imports nothing, so that the list of environments (``world.environments``) is quick.
"""
