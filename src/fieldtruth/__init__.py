# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Automatically annotated data sets of a ground robot in natural environments."""

from importlib.metadata import version

__version__ = version("fieldtruth")
