# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Experiments: configuration as frozen data, built-in experiments, YAML files, forms of a route."""
