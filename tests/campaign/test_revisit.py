# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The campaign of places that are seen again: every season, direction and light once, in one world."""

from fieldtruth.campaign.draw import draw, world_of_run
from fieldtruth.campaign.files import check_campaign, load_campaign
from fieldtruth.experiment.config import MetresRouteConfig


def test_each_season_direction_and_light_is_once_on_one_trail() -> None:
    campaign = load_campaign("revisit")
    check_campaign(campaign, "revisit")
    experiments = [run.experiment for run in draw(campaign)]
    routes = [each.route for each in experiments if isinstance(each.route, MetresRouteConfig)]
    ways = {(route.metres.start, *route.metres.waypoints) for route in routes}
    there, back = ways
    assert there == back[::-1]
    combinations = {(str(each.layout["season"]), str(each.route), str(each.light)) for each in experiments}
    assert len(combinations) == len(experiments) == 4 * 2 * 2
    assert {world_of_run(each) for each in experiments} == {("forest", 0)}
