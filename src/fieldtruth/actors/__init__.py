# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Actors: bodies of people, animals and vehicles, how they move their limbs, and where they go."""
