# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Reports for people: the HTML page of a run, preview sheets of environments, class shares, data card, viewer."""
