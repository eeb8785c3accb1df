# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""LiDARs by name: every figure of a model is allowed; what a user gives stays."""

import re

import pytest

from fieldtruth import ConfigurationError
from fieldtruth.experiment.catalogue import figures_of, list_models
from fieldtruth.experiment.files import dump_experiment, parse_experiment
from fieldtruth.sensors.lidar.config import LidarConfig

LIDARS = list_models("lidar")


def lidar(text: str) -> LidarConfig:
    """The LiDAR of an experiment whose file has ``text`` at ``rig.lidar``."""
    route = "route: {start: [49.9, 8.9], waypoints: [[49.9001, 8.9]]}"
    return parse_experiment(f"{{name: a, environment: park, {route}, rig: {{lidar: {text}}}}}", "a.yaml").rig.lidar


@pytest.mark.parametrize("name", LIDARS)
def test_every_model_is_allowed_and_complete(name: str) -> None:
    config, figures = LidarConfig(model=name), figures_of("lidar", name)
    for key in figures.keys() - {"firing_cycle_ns"}:
        value = getattr(config, key)
        assert (list(value) if isinstance(value, tuple) else value) == figures[key]
    beams = {"pattern", "rings", "columns"} if config.pattern else {"elevations_deg"}
    assert figures.keys() >= {"rate_hz", "min_range", "max_range"} | beams
    elevations = list(config.elevations_deg or ())
    assert elevations in (sorted(elevations), sorted(elevations, reverse=True))
    assert min(config.firing_offsets_ns or (0,)) == 0
    assert config.spinning
    [stated] = re.findall(r": (\d+) (?:beams|lines),", LIDARS[name])
    assert config.rings == int(stated)


def test_the_default_is_the_papers_lidar() -> None:
    assert LidarConfig() == lidar("{}") == lidar("{model: null}")
    assert (LidarConfig().model, LidarConfig().elevations_deg, LidarConfig().spinning) == (None, None, False)


def test_what_a_file_gives_replaces_the_figures_of_its_model() -> None:
    config = lidar("{model: vlp_16, spinning: false, max_range: 40, mount: {xyz: [0, 0, 1]}}")
    assert (config.spinning, config.max_range, config.min_range, config.mount.xyz[2]) == (False, 40.0, 1.0, 1.0)
    assert (config.rings, config.columns, config.vertical_fov_deg) == (16, 1808, 30.0)


def test_columns_follow_the_rate_where_the_sensor_fires_in_cycles() -> None:
    assert lidar("{model: vlp_16, rate_hz: 20}").columns == 904  # 0.05 s of 55.296 us: 904.2
    assert lidar("{model: xt32, rate_hz: 20}").columns == 1000  # 0.36 deg, as in its manual
    assert lidar("{model: os1_128, rate_hz: 20}").columns == 1024  # a mode of its own
    assert lidar("{model: vlp_16, columns: 512}").columns == 512


def test_elevations_give_the_rings_and_their_span() -> None:
    config = lidar("{elevations_deg: [10, 2, -3.5]}")
    assert (config.rings, config.vertical_fov_deg) == (3, 13.5)


@pytest.mark.parametrize("text", ["{model: pandar64, rate_hz: 20}", "{elevations_deg: [3, 1.0]}"])
def test_a_stored_experiment_loads_equal(text: str) -> None:
    route = "route: {start: [49.9, 8.9], waypoints: [[49.9001, 8.9]]}"
    experiment = parse_experiment(f"{{name: a, environment: park, {route}, rig: {{lidar: {text}}}}}")
    assert parse_experiment(dump_experiment(experiment)) == experiment


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{model: vlp16}", "rig.lidar.model must be a model of kind lidar, nearest first: vlp_16, vlp_32c, "),
        ("{model: 3}", "rig.lidar.model must be a name from `fieldtruth list sensors`, got 3"),
        (
            "{model: vlp_16, rings: 8}",
            "rig.lidar: rings must be 16, the number of elevations_deg of the model vlp_16, got 8",
        ),
        ("{model: vlp_16, rate_hz: fast}", "rig.lidar.rate_hz must be a number between 0.01 and 1000, got 'fast'"),
        (
            "{model: vlp_16, columns: 4000}",
            "rig.lidar: firing_offsets_ns must be below the time of a column, 25000 ns at 10 Hz and 4000 columns, "
            "got 34560",
        ),
        ("{elevations_deg: []}", "rig.lidar.elevations_deg must be a list of angles between -90 and 90, one per ring"),
        ("{elevations_deg: [1, x]}", "rig.lidar.elevations_deg[1] must be a number above -90 and below 90, got 'x'"),
        ("{elevations_deg: [.nan, 1]}", "rig.lidar.elevations_deg[0] must be a number above -90 and below 90, got nan"),
        ("{elevations_deg: [1, 1]}", "rig.lidar: elevations_deg must differ, got 2 times 1.0"),
        ("{elevations_deg: [3, 1], rings: 3}", "rig.lidar: rings must be 2, the number of elevations_deg, got 3"),
        (
            "{elevations_deg: [3, 1], vertical_fov_deg: 5}",
            "rig.lidar: vertical_fov_deg must be 2.0, as of elevations_deg, got 5.0",
        ),
        (
            "{elevations_deg: [3, 1], azimuth_offsets_deg: [1]}",
            "rig.lidar: azimuth_offsets_deg must have a value for each of 2 rings, got 1",
        ),
        ("{firing_offsets_ns: [1.5]}", "rig.lidar.firing_offsets_ns[0] must be an integer between 0 and 100000000, "),
    ],
)
def test_mistakes_are_one_line(text: str, message: str) -> None:
    with pytest.raises(ConfigurationError) as caught:
        lidar(text)
    assert str(caught.value).startswith(f"a.yaml: {message}")
    assert "\n" not in str(caught.value)
