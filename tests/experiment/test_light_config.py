# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Light in words: presets, the sun from date and time against published positions, and mistakes."""

from datetime import date
from typing import Any, get_args

import pytest

from fieldtruth.campaign.config import Campaign
from fieldtruth.campaign.draw import draw
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, load_experiment, parse_experiment, with_overrides
from fieldtruth.experiment.light_config import PRESETS, LightConfig, Preset, sun_position

BASE = "name: a\nenvironment: park\nroute: {random: {length_m: 50, seed: 1}}\n"


def lit(light: str) -> LightConfig:
    return parse_experiment(f"{BASE}light: {light}\n").light


@pytest.mark.parametrize(
    ("day", "hours", "latitude", "longitude", "azimuth", "elevation"),
    [
        # Reda and Andreas (2004), NREL/TP-560-34302, table A5.1: at 12:30:30, 7 h behind UTC.
        (date(2003, 10, 17), 19 + 30.5 / 60, 39.742476, -105.1786, 194.34024, 90 - 50.11162),
        # Solstice of June 2026 (08:24 UTC), on the tropic where the sun passes the meridian 1 min 54 s after 12 h.
        (date(2026, 6, 21), 12.0 + 1.9 / 60 - 8.9 / 15, 49.9, 8.9, 180.0, 90 - 49.9 + 23.436 + 0.015),
        # Equinox of March 2026 (14:46 UTC) at the north pole: the centre on the horizon, raised by refraction of 0.48.
        (date(2026, 3, 20), 14.0 + 46 / 60, 90.0, 0.0, 180.0 + 15 * 2.766 - 1.9, 0.48),
    ],
)
def test_sun_is_where_almanacs_have_it(
    day: date, hours: float, latitude: float, longitude: float, azimuth: float, elevation: float
) -> None:
    found = sun_position(day, hours, latitude, longitude)
    assert found[1] == pytest.approx(elevation, abs=0.05)
    assert found[0] == pytest.approx(azimuth, abs=0.1)


def test_sun_rises_in_the_east_and_is_higher_in_summer() -> None:
    morning, evening = (LightConfig(date="2026-06-21", time=hour).values for hour in (6.0, 17.0))
    assert 60 < morning.azimuth_deg < 120 < 240 < evening.azimuth_deg < 300
    winter = LightConfig(date="2026-12-21", time=11.4).values.elevation_deg
    assert winter == pytest.approx(90 - 49.9 - 23.44, abs=0.1)


@pytest.mark.parametrize("text", ["15:30+02:00", "13:30", "13.5", "'13:30'", "08:00-05:30"])
def test_times_of_day_are_hours_of_utc(text: str) -> None:
    assert lit(f"{{date: 2026-06-21, time: {text}}}").time == 13.5


def test_a_word_is_a_preset_and_given_values_replace_its_own() -> None:
    assert lit("low_sun") == lit("{preset: low_sun}")
    assert lit("low_sun").values == PRESETS["low_sun"]
    assert lit("{preset: dusk, clouds: none}").values == PRESETS["dusk"]._replace(clouds="none", cover=0.0)
    assert lit("{sun_elevation_deg: -6}").values.elevation_deg == -6.0
    assert set(PRESETS) == set(get_args(Preset))


def test_light_is_dumped_and_replaced_as_a_whole() -> None:
    experiment = parse_experiment(f"{BASE}light: {{date: 2026-06-21, time: '15:30+02:00', clouds: broken}}\n")
    assert parse_experiment(dump_experiment(experiment)) == experiment
    assert with_overrides(load_experiment("park_1"), light="overcast").light == LightConfig(preset="overcast")


@pytest.mark.parametrize(
    ("light", "message"),
    [
        ("sunny", "light.preset must be summer_day, clear_morning, .* or fog, got 'sunny'"),
        ("{clouds: fluffy}", "light.clouds must be none, cumulus, .* or overcast, got 'fluffy'"),
        ("{sun_elevation_deg: -7}", r"light.sun_elevation_deg must be a number between -6 and 90, got -7"),
        ("{date: 2026-06-21}", "light: date and time need each other"),
        ("{date: 2026-06-21, time: 12.0, sun_azimuth_deg: 3}", "light: date and time exclude sun_azimuth_deg"),
        ("{date: 2026-06-21, time: 0.0}", r"light.time must be one with the sun at -6 deg or higher; it is at -1\d"),
        ("{date: '2026-02-30', time: 9.0}", "light.date must be a date such as 2026-06-21, got '2026-02-30'"),
        ("{date: 2026-06-21, time: noon}", "light.time must be hours of UTC such as 13.5, or .*, got 'noon'"),
        ("{date: 2026-06-21, time: '12:75'}", "light.time must be hours of UTC such as 13.5, or .*, got '12:75'"),
        ("{date: 2026-06-21, time: '25:00'}", "light.time must be hours of UTC such as 13.5, or .*, got '25:00'"),
        ("{turbidity: 0.5}", "light.turbidity must be a number between 1.2 and 10, got 0.5"),
    ],
)
def test_mistakes_are_one_line_that_names_the_key(light: str, message: str) -> None:
    with pytest.raises(ConfigurationError, match=f"^{message}") as error:
        lit(light)
    assert "\n" not in str(error.value)


def test_campaigns_draw_presets_and_values() -> None:
    values: dict[str, Any] = {
        "name": "c",
        "runs": 40,
        "environments": ["park"],
        "lights": ["dusk", {"preset": {"choice": ["noon", "overcast"]}, "cover": {"uniform": [0.1, 0.9]}}],
    }
    runs = [run.experiment for run in draw(Campaign.model_validate(values))]
    assert {run.light.preset for run in runs} == {"dusk", "noon", "overcast"}
    assert all(0.1 <= run.light.values.cover <= 0.9 for run in runs if run.light.preset == "noon")
    assert all(isinstance(run, Experiment) for run in runs)
