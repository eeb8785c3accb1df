# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What page and preview share: aerial view, labelled cloud, colours, numbers as text, images of limited size."""
