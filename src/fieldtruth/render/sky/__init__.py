# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The light of sun, sky and clouds: an atmosphere, clouds in it, and both as an image of the dome."""
