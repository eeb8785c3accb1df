# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The worlds, the robot and its ROS nodes for Gazebo."""
