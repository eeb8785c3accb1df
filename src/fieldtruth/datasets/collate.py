# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Collate samples to a batch of tensors; the only module that needs PyTorch."""

from collections.abc import Sequence
from typing import Any

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.datasets.items import RAGGED, Sample


def collate(samples: Sequence[Sample]) -> dict[str, Any]:
    """Make a batch, for ``DataLoader(ds, collate_fn=collate)``.

    Arrays with the same shape in all frames are stacked to a tensor, (batch, 3, h, w) for ``image``; stamps become a
    tensor, names a list. Cloud, labels, instances and rays differ in length and become a list of tensors, one per
    frame, without padding. ``torch.cat(batch["cloud"])`` or
    ``torch.nn.utils.rnn.pad_sequence(batch["cloud"], batch_first=True)`` make one tensor of them.

    Raises:
        ConfigurationError: PyTorch is not installed.
    """
    try:
        import torch
        from torch.utils.data import default_collate
    except ImportError as error:
        raise ConfigurationError("collate needs PyTorch (pip install torch)") from error
    batch: dict[str, Any] = {}
    for key in samples[0]:
        values = [sample[key] for sample in samples]  # type: ignore[literal-required]
        batch[key] = [torch.as_tensor(value) for value in values] if key in RAGGED else default_collate(values)
    return batch
