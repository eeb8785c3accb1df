# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The page on campaigns: its files can be drawn, and its table has every key."""

import re
from pathlib import Path

from fieldtruth.campaign.config import Campaign
from fieldtruth.campaign.draw import draw
from fieldtruth.campaign.files import check_campaign, load_campaign

PAGE = (Path(__file__).parents[2] / "docs" / "campaigns.md").read_text(encoding="utf-8")


def test_fifteen_lines_are_enough(tmp_path: Path) -> None:
    [text] = re.findall(r"```yaml\n(.*?)```", PAGE, flags=re.S)
    assert len(text.splitlines()) <= 15
    path = tmp_path / "campaign.yaml"
    path.write_text(text)
    campaign = load_campaign(path)
    check_campaign(campaign, "campaign.yaml")
    runs = draw(campaign)
    assert len(runs) == 200
    assert {run.split for run in runs} == {"train", "val", "test"}
    assert runs[0].name == "train/autumn_00001"
    assert runs[1].name == "val/autumn_00002"


def test_the_table_has_every_key() -> None:
    described = re.findall(r"^\| ((?:`\w+`(?:, )?)+) \|", PAGE, flags=re.M)
    assert [key for cell in described for key in re.findall(r"\w+", cell)] == [
        *(key for key in Campaign.model_fields if key != "experiments"),
        "experiments",
    ]
