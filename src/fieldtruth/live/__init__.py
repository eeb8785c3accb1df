# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""An experiment that runs live: paced by the wall clock, heard and driven through ROS 2, ROS 1 or Foxglove."""
