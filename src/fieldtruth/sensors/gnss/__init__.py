# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""GNSS receivers: satellites, obstacles of their signals, and errors of the position."""
