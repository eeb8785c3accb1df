# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The world in the formats of other tools: meshes of one class each, glTF, USD, OBJ, inventory."""
