# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Environments that are files: an experiment or campaign holds what they say, with absolute paths."""

from pathlib import Path

import pytest
import yaml

from fieldtruth.campaign.draw import draw
from fieldtruth.campaign.files import load_campaign
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.drive.plan import expected_seconds
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.environment_file import environment_of, files_of, resolved
from fieldtruth.experiment.files import dump_experiment, load_experiment, parse_experiment
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.report.card import conditions_of

SITE = {"centre": [-33.87, -70.65], "elevation": {"file": "maps/dem.tif"}, "objects": [{"file": "~/barrel.glb"}]}


@pytest.fixture
def site(tmp_path: Path) -> Path:
    path = tmp_path / "quinta.yaml"
    path.write_text(yaml.safe_dump(SITE))
    return path


def written(path: Path, **values: object) -> Path:
    path.write_text(yaml.safe_dump(values))
    return path


def test_an_experiment_holds_what_the_file_says(site: Path) -> None:
    route = {"start": [-33.87, -70.65], "waypoints": [[-33.8699, -70.65]]}
    layout = {"size": [30, 20], "trees": {"file": "own.csv"}}
    path = written(site.parent / "e.yaml", name="e", environment="quinta.yaml", layout=layout, route=route)
    experiment = load_experiment(path)
    assert (experiment.environment, experiment.world_name) == ("site", "quinta")
    assert environment_of(experiment.world_name, experiment.layout) == "site"
    assert experiment.layout["elevation"] == {"file": str(site.parent / "maps/dem.tif")}
    assert experiment.layout["trees"] == {"file": str(site.parent / "own.csv")}
    assert experiment.layout["size"] == [30, 20]
    assert experiment.origin == (-33.87, -70.65, 0.0)
    assert parse_experiment(dump_experiment(experiment)) == experiment
    metres = 0.0001 * 110_917.0  # length of a degree of latitude at 33.87 degrees on WGS 84, by its series
    assert expected_seconds(experiment) == pytest.approx(metres / 0.3, rel=2e-4)


def test_files_are_those_of_the_key_file_wherever_it_is(site: Path) -> None:
    named = list(files_of(resolved(str(site)).layout))
    assert named == [
        ("elevation.file", site.parent / "maps/dem.tif"),
        ("objects[0].file", Path("~/barrel.glb").expanduser()),
    ]


def test_the_sun_is_that_of_the_site_unless_it_is_given(site: Path) -> None:
    noon = {"date": "2026-06-21", "time": "16:43"}  # UTC of the sun's transit at 70.65 deg W, by the almanac
    given = {"name": "e", "environment": str(site), "light": noon}
    light = Experiment.model_validate(given).light
    assert (light.latitude, light.longitude) == (-33.87, -70.65)
    assert light.values.elevation_deg == pytest.approx(90 - 33.87 - 23.44, abs=0.1)
    assert abs((light.values.azimuth_deg + 180) % 360 - 180) < 1.0  # in the north
    elsewhere = Experiment.model_validate(given | {"light": {"latitude": 10.0}}).light
    assert (elsewhere.latitude, elsewhere.longitude) == (10.0, -70.65)
    assert Experiment.model_validate(given | {"light": "overcast"}).light.latitude == -33.87
    made = Experiment.model_validate(given | {"light": LightConfig.model_validate(noon)})
    assert made.light == light
    there = Experiment.model_validate(given | {"light": LightConfig(latitude=10.0, longitude=20.0)}).light
    assert (there.latitude, there.longitude) == (10.0, 20.0)


def test_a_missing_route_is_a_random_one(site: Path) -> None:
    experiment = Experiment.model_validate({"name": "e", "environment": str(site)})
    assert experiment.route is not None
    assert experiment.route.model_dump() == {"random": {"length_m": 100.0, "seed": 0}}
    framed = Experiment.model_validate({"name": "e", "environment": str(site), "frames": {"count": 3}})
    assert framed.route is None


def test_a_campaign_draws_runs_in_a_file(site: Path) -> None:
    campaign = written(
        site.parent / "c.yaml", name="c", runs=12, environments=["quinta.yaml", "park"], seeds=[1, 2],
        layouts={"quinta.yaml": {"size": [30, 20]}}, routes={"random": {"length_m": 40}},
    )  # fmt: skip
    runs = [run.experiment for run in draw(load_campaign(campaign))]
    inside = [each for each in runs if each.world_name == "quinta"]
    assert {each.world_name for each in runs} == {"quinta", "park"}
    assert all(each.layout["size"] == [30, 20] and each.layout["centre"] == SITE["centre"] for each in inside)
    assert all("size" not in each.layout for each in runs if each not in inside)
    moved = site.parent / "moved"
    moved.mkdir()
    for path in (site, campaign):
        path.rename(moved / path.name)
    again = [run.experiment for run in draw(load_campaign(moved / "c.yaml"))]
    assert [(each.world_name, each.seed, each.route) for each in again] == [
        (each.world_name, each.seed, each.route) for each in runs
    ]  # what is drawn does not depend on where the files are


def test_a_campaign_without_routes_draws_random_ones_in_a_file(site: Path) -> None:
    campaign = written(site.parent / "c.yaml", name="c", runs=3, environments=str(site))
    routes = [run.experiment.model_dump()["route"]["random"] for run in draw(load_campaign(campaign))]
    assert {each["length_m"] for each in routes} == {100.0}
    assert len({each["seed"] for each in routes}) == 3


def test_a_site_is_one_world_for_the_split_and_another_site_another(site: Path) -> None:
    other = site.with_name("granja.yaml")
    other.write_text(site.read_text())
    campaign = written(
        site.parent / "c.yaml", name="c", runs="product", environments=["quinta.yaml", "granja.yaml"],
        seeds={"integers": [0, 3]}, split={"train": 0.5, "val": 0.25, "test": 0.25},
    )  # fmt: skip
    runs = draw(load_campaign(campaign))
    assert len({(run.experiment.world_name, run.experiment.seed) for run in runs}) == 8
    assert {run.split for run in runs} == {"train", "val", "test"}


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("a.yaml", "surface: lawn", r"a\.yaml: no site, which has the key centre"),
        ("my site.yaml", "centre: [0, 0]", "rename the file"),
        ("a.yaml", "- 1", r"a\.yaml: must be a mapping"),
        ("a.yaml", None, r"cannot read .*a\.yaml: No such file"),
        ("a.yaml", "centre: somewhere", r"layout\.centre must be \[latitude, .* got 'somewhere'"),
        ("a.yaml", "centre: [-118.2, 34.1]", r"layout\.centre must be \[latitude, .* from -85 to 85 .* got \[-118"),
        ("a.yaml", "centre: [.nan, 34.1]", r"layout\.centre must be \[latitude, .* got \[nan, 34"),
        ("a.yaml", "centre: [true, 34.1]", r"layout\.centre must be \[latitude, .* got \[True, 34"),
    ],
)
def test_what_is_no_environment_is_one_line(tmp_path: Path, name: str, content: str | None, text: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_text(content)
    with pytest.raises(ConfigurationError, match=text):
        Experiment.model_validate({"name": "e", "environment": str(path)})


def test_a_site_is_not_taken_for_an_experiment(site: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"quinta\.yaml: a site, not an experiment; name it in one, as env"):
        load_experiment(site)


def test_a_data_card_names_the_maps_of_a_site_and_their_source(site: Path) -> None:
    given = {"name": "e", "environment": str(site), "layout": {"map": {"file": "area.osm"}}}
    words = conditions_of([Experiment.model_validate(given), load_experiment("park_1")])
    assert "landscapes: quinta and park, in summer, with light of preset summer_day and clear air" in words
    assert words.endswith(
        " Sites follow maps of real landscapes (dem.tif, barrel.glb and area.osm)."
        " Parts are © OpenStreetMap contributors, under the ODbL."
    )
    assert "Sites" not in conditions_of([load_experiment("park_1")])
