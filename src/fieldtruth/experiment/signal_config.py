# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What the figures of all kinds of sensors have in common that make their readings real ones."""

from fieldtruth.experiment.fields import Frozen


class SignalConfig(Frozen):
    """Figures of a real sensor. Each has a default that means "no such effect"."""
