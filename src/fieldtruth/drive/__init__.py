# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated drive of a Husky in MuJoCo: physics, waypoint follower, route planning, IMU, GNSS and tachometers."""
