# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A batch of labelled frames in PyTorch, and its loss; give it the folder of a run."""

import sys
from pathlib import Path

import torch
from torch.utils.data import DataLoader

from fieldtruth.datasets import RunDataset, collate


def main() -> None:
    """Show a batch, and how little a network of one layer knows of it."""
    dataset = RunDataset(Path(sys.argv[1]), items=("image", "mask", "cloud", "labels", "pose", "calibration"))
    loader = DataLoader(dataset, batch_size=4, shuffle=True, num_workers=2, collate_fn=collate)
    print(f"{len(dataset)} frames")

    batch = next(iter(loader))
    for key, value in batch.items():
        if isinstance(value, torch.Tensor):
            print(key, tuple(value.shape), value.dtype)
        else:
            print(key, [tuple(each.shape) if isinstance(each, torch.Tensor) else each for each in value])

    model = torch.nn.Conv2d(3, max(dataset.classes) + 1, kernel_size=1)
    loss = torch.nn.functional.cross_entropy(model(batch["image"] / 255.0), batch["mask"])
    print(f"loss {loss:.3f}")


if __name__ == "__main__":
    main()
