# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of a campaign: its effective file, with which it can be continued and extended."""

from pathlib import Path

from fieldtruth.campaign.config import Campaign
from fieldtruth.campaign.draw import PlannedRun, draw
from fieldtruth.campaign.files import CAMPAIGN, dump_campaign, load_campaign
from fieldtruth.core.errors import FieldtruthError, OutputError
from fieldtruth.core.files import output_errors, remove_abandoned, write_atomically


def check_folder(campaign: Campaign, runs: tuple[PlannedRun, ...], out: Path) -> None:
    """Check that a folder holds no other campaign; one that has every run of the stored one continues it.

    Raises:
        OutputError: the folder holds another campaign.
    """
    path = out / CAMPAIGN
    if not path.exists():
        return
    try:
        stored = load_campaign(path)
        other = "" if stored == campaign or _has_every(runs, draw(stored)) else _differences(stored, campaign)
    except FieldtruthError as error:
        other = f"its {CAMPAIGN} cannot be read: {error}"
    if other:
        raise OutputError(
            f"{out} holds another campaign ({other}); choose another --out, or replace it with --overwrite"
        )


def write_campaign(campaign: Campaign, out: Path) -> None:
    """Write campaign.yaml; raises OutputError if that is not possible."""
    path, text = out / CAMPAIGN, dump_campaign(campaign)
    remove_abandoned(path)
    with output_errors(path):
        if not path.exists() or path.read_bytes() != text.encode():
            write_atomically(path, text)


def _has_every(runs: tuple[PlannedRun, ...], stored: tuple[PlannedRun, ...]) -> bool:
    by_name = {run.name: run for run in runs}
    return all(by_name.get(run.name) == run for run in stored)


def _differences(stored: Campaign, campaign: Campaign) -> str:
    keys = [key for key in type(campaign).model_fields if getattr(stored, key) != getattr(campaign, key)]
    return f"different: {', '.join(keys) or 'built-in experiments of this version'}"
