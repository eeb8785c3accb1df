# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Recording a run: its output folder, its time slices, and the streams of messages in them."""
