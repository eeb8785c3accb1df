# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Campaigns: many runs from one file, drawn from distributions, split by world, made by many processes and machines."""
