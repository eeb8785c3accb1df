# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The kinds of sensors, one package each; their modules have layers of their own (pyproject.toml)."""
