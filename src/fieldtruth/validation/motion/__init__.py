# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Frames and motion: calibration, true motion, and the sensors that measure it."""
