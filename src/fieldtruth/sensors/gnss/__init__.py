# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""GNSS receiver: configuration, what it senses, messages and checks."""
