# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Objects of a user's own, from files of meshes: read, checked, repaired and placed in a world."""
