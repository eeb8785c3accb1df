# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Weather in words: mistakes are one line that names the key."""

import pytest

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.files import parse_experiment


@pytest.mark.parametrize(
    ("weather", "message"),
    [
        ("fog", "weather must be a mapping with the keys visibility_m, .*, got 'fog'"),
        ("{visibility_m: 100}", "weather.visibility_m must be a number between 5000 and 300000, got 100"),
        ("{visibility_m: .nan}", "weather.visibility_m must be a number between 5000 and 300000, got nan"),
        ("{visibility: 9000}", "unknown key 'weather.visibility'; did you mean 'weather.visibility_m'"),
        ("{fog_visibility_m: 9000}", "weather.fog_visibility_m must be a number between 10 and 5000, got 9000"),
        ("{fog_height_m: 5}", "weather: fog_visibility_m is required with fog_height_m"),
        ("{fog_visibility_m: 50, fog_height_m: 0}", "weather.fog_height_m must be a number between 1 and 500, got 0"),
    ],
)
def test_mistakes_are_one_line_that_names_the_key(weather: str, message: str) -> None:
    base = "name: a\nenvironment: park\nroute: {random: {length_m: 50, seed: 1}}\n"
    with pytest.raises(ConfigurationError, match=f"^{message}") as error:
        parse_experiment(f"{base}weather: {weather}\n")
    assert "\n" not in str(error.value)
