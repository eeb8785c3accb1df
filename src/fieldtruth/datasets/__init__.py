# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs as data sets for training: frames by index, in any order, from any process. Only ``collate`` needs PyTorch.

parts = ft.split(ft.open_runs("data", items=("image", "mask")), train=["park_1", "lake_1"], val=["forest_1"])
loader = DataLoader(parts["train"], batch_size=8, shuffle=True, num_workers=4, collate_fn=ft.collate)
"""

from fieldtruth.datasets.collate import collate
from fieldtruth.datasets.folder import Runs, open_runs
from fieldtruth.datasets.items import GEOMETRY, ITEMS, RAGGED, Sample
from fieldtruth.datasets.parts import split
from fieldtruth.datasets.run import RunDataset

__all__ = ["GEOMETRY", "ITEMS", "RAGGED", "RunDataset", "Runs", "Sample", "collate", "open_runs", "split"]
