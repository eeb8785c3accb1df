# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""An experiment that is stepped: robot and sensors in a world, whose readings come as arrays."""
