# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From samples to a batch of tensors. The one place that needs PyTorch."""

from collections.abc import Sequence
from typing import Any

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.datasets.items import RAGGED, Sample


def collate(samples: Sequence[Sample]) -> dict[str, Any]:
    """Make a batch for ``DataLoader(ds, collate_fn=collate)``.

    What has one shape in all frames is stacked to a tensor, (batch, 3, h, w) for ``image``; stamps become a tensor,
    names a list. Cloud, labels, instances and rays, whose length differs, become a list of tensors, one a frame:
    nothing is padded and nothing thrown away. ``torch.cat(batch["cloud"])`` or
    ``torch.nn.utils.rnn.pad_sequence(batch["cloud"], batch_first=True)`` make one tensor of them.

    Raises:
        ConfigurationError: PyTorch is not installed.
    """
    try:
        import torch
        from torch.utils.data import default_collate
    except ImportError as error:
        raise ConfigurationError("collate makes tensors: it needs PyTorch (pip install torch)") from error
    batch: dict[str, Any] = {}
    for key in samples[0]:
        values = [sample[key] for sample in samples]  # type: ignore[literal-required]
        batch[key] = [torch.as_tensor(value) for value in values] if key in RAGGED else default_collate(values)
    return batch
