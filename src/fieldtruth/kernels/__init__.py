# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Every compiled function, and the tables that they read: numbers and arrays only; nothing but ``core`` is imported."""
