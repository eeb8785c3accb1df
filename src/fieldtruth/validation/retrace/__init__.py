# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Labels, geometry, clouds and images, compared with each other and with the world, built and measured again."""
