# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wheel encoders and odometry: configuration, what it senses, messages and checks."""
