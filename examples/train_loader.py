# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A batch of labelled frames in PyTorch, and its loss: python train_loader.py RUN."""

import sys

import torch
from torch.utils.data import DataLoader

import fieldtruth as ft


def main(run: str) -> None:
    """Print the shapes of a batch and the loss of an untrained network of one layer."""
    dataset = ft.RunDataset(run, items=("image", "mask", "cloud", "labels", "pose", "calibration"))
    loader = DataLoader(dataset, batch_size=4, shuffle=True, num_workers=2, collate_fn=ft.collate)
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
    main(*sys.argv[1:])
