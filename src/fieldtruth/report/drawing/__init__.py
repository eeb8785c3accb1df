# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parts that page, sheets and pictures share: aerial view, labelled cloud, paper, colours, text, small images."""
