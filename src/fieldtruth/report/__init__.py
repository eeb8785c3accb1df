# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Reports for people: the HTML page of a run, preview sheets of environments, class shares, data card, viewer."""

from fieldtruth.core.cache_folder import keep_temporary_files_in_memory

keep_temporary_files_in_memory()  # before matplotlib is imported, which needs a folder for its list of fonts
