# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Label maps: the classes of other data sets, and which of them each of ours becomes."""
