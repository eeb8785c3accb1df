# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parts that page and preview sheet share: aerial view, labelled cloud, colours, text of numbers, small images."""
