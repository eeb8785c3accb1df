# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""``python -m fieldtruth.cli`` is the command ``fieldtruth``."""

import sys

from fieldtruth.cli import main

sys.exit(main())
