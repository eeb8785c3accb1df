# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs of a campaign: drawn as the file says, the same every time, and split by world."""

from collections import Counter
from itertools import product
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from many_sensors import many_rig, many_sensors
from record_fakes import make_experiment

from fieldtruth.campaign.config import Campaign
from fieldtruth.campaign.draw import PlannedRun, draw, simulated_s
from fieldtruth.campaign.files import ALL, EVERY, dump_campaign, load_campaign, with_changes
from fieldtruth.campaign.state import digest_of
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.config import RandomRouteConfig
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.experiment.names import EXPERIMENTS, campaign_experiments
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.lidar.config import LidarConfig

ENVIRONMENTS = ["forest", "hillside", "lake", "park"]


def campaign(**values: Any) -> Campaign:
    return Campaign.model_validate({"name": "c", "runs": 20, "environments": ENVIRONMENTS} | values)


def world(run: PlannedRun) -> tuple[str, int, str]:
    experiment = run.experiment
    return experiment.environment, experiment.seed, repr(experiment.layout)


splits = st.sampled_from(
    [
        {"train": 1.0},
        {"train": 0.8, "val": 0.1, "test": 0.1},
        {"train": 0.5, "test": 0.5},
        {"val": 0.02, "test": 0.98},
    ]
)
campaigns: st.SearchStrategy[dict[str, Any]] = st.fixed_dictionaries(
    {
        "name": st.just("c"),
        "seed": st.integers(0, 2**63 - 1),
        "runs": st.integers(1, 20) | st.just("product"),
        "environments": st.lists(st.sampled_from(ENVIRONMENTS), min_size=1, max_size=4, unique=True),
        "seeds": st.lists(st.integers(0, 20), min_size=1, max_size=6, unique=True) | st.just({"integers": [0, 9]}),
        "lights": st.sampled_from([{}, [{}, {"sun_elevation_deg": 20}], {"sun_azimuth_deg": {"uniform": [0, 360]}}]),
        "routes": st.sampled_from(["built-in", ["built-in", {"random": {"length_m": {"uniform": [50, 90]}}}]]),
        "split": splits,
    }
)
with_layouts: st.SearchStrategy[dict[str, Any]] = campaigns.map(
    lambda values: (
        values | {"layouts": {values["environments"][0]: [{}, {"relief": 0.5}, {"relief": {"uniform": [0.1, 0.3]}}]}}
    )
)


@given(campaigns | with_layouts)
@settings(max_examples=5, deadline=None)
def test_a_world_is_in_one_split_and_every_split_has_its_share(values: dict[str, Any]) -> None:
    planned = Campaign.model_validate(values)
    shares = values["split"]
    loose = draw(planned.model_copy(update={"split": None}))
    if len({(run.experiment.environment, run.experiment.seed) for run in loose}) < len(shares):
        with pytest.raises(ConfigurationError, match="would be empty, because the runs have"):
            draw(planned)
        return
    runs = draw(planned)
    where: dict[tuple[str, int], set[str]] = {}
    for run in runs:
        where.setdefault((run.experiment.environment, run.experiment.seed), set()).add(run.split)
    assert all(len(found) == 1 for found in where.values())
    assert all(len({run.split for run in runs if world(run) == one}) == 1 for one in {world(run) for run in runs})
    counts = Counter(split for found in where.values() for split in found)
    assert counts.keys() == shares.keys()
    assert all(counts[name] < share * len(where) + 1 + 1e-9 for name, share in shares.items())
    assert len({run.experiment.name for run in runs}) == len(runs)


@given(campaigns.filter(lambda values: values["runs"] != "product"), st.integers(1, 30))
@settings(max_examples=5, deadline=None)
def test_more_runs_keep_the_earlier_ones(values: dict[str, Any], more: int) -> None:
    values = values | {"seeds": {"integers": [0, 9]}, "split": {"train": 1.0}}
    first = draw(Campaign.model_validate(values))
    longer = draw(Campaign.model_validate(values | {"runs": values["runs"] + more}))
    assert longer[: len(first)] == first
    assert len(longer) == len(first) + more


def test_more_runs_keep_the_splits_of_the_earlier_ones() -> None:
    shares = {"train": 0.6, "val": 0.2, "test": 0.2}
    first, longer = (draw(campaign(seeds={"integers": [0, 99]}, runs=n, split=shares)) for n in (10, 40))
    assert longer[:10] == first


def test_the_same_file_gives_the_same_runs_and_another_seed_others() -> None:
    one, two, other = (draw(campaign(seeds={"integers": [0, 99]}, seed=s)) for s in (5, 5, 6))
    assert one == two
    assert [world(run) for run in one] != [world(run) for run in other]


def test_another_axis_does_not_move_the_rest() -> None:
    route = {"random": {"length_m": {"uniform": [50, 200]}}}
    plain = draw(campaign(routes=route))
    lit = draw(campaign(routes=route, lights={"sun_elevation_deg": {"uniform": [10, 80]}}))
    assert [run.experiment.route for run in plain] == [run.experiment.route for run in lit]
    assert all(before.experiment.light != after.experiment.light for before, after in zip(plain, lit, strict=True))


def test_the_product_has_every_combination_once() -> None:
    seeds, lights, rings = (3, 5), (20.0, 40.0), (32, 64, 128)
    runs = draw(
        campaign(
            runs="product",
            seeds=list(seeds),
            lights=[{"sun_elevation_deg": e} for e in lights],
            rigs=[{"lidar": {"rings": r}} for r in rings],
        )
    )
    names = {name: load_experiment(name) for name in campaign_experiments(every=False)}
    expected = Counter(product((e.route for e in names.values()), seeds, lights, rings))
    assert expected == Counter(
        (e.route, e.seed, e.light.sun_elevation_deg, e.rig.lidar.rings) for e in (run.experiment for run in runs)
    )
    assert all(names[f"{e.environment}_1"].environment == e.environment for e in (run.experiment for run in runs))


def test_a_listed_experiment_takes_a_lidar_by_its_model() -> None:
    """Values that the experiment does not set are the model's, not the defaults."""
    listed = {"name": "c", "experiments": [load_experiment("park_1")], "rigs": {"lidar": {"model": "vlp_16"}}}
    [run] = draw(Campaign.model_validate(listed))
    lidar = run.experiment.rig.lidar
    assert (lidar.model, lidar.rings, lidar.columns, lidar.spinning) == ("vlp_16", 16, 1808, True)


def of_many_sensors(**rig: Any) -> Campaign:
    listed = make_experiment(rig=many_rig())
    return Campaign.model_validate({"name": "c", "experiments": [listed], "rigs": rig})


def test_a_section_changes_the_first_sensor_of_its_kind_in_a_listed_rig() -> None:
    changes = {"lidar": {"rate_hz": {"uniform": [12, 15]}}, "cameras": {"mount": {"rpy_deg": [0, 5, 0]}}}
    before, [run] = many_rig(), draw(of_many_sensors(**changes))
    after = run.experiment.rig
    assert 12 <= after.lidar.rate_hz <= 15
    assert after.stereo.mount == before.stereo.mount.model_copy(update={"rpy_deg": (0.0, 5.0, 0.0)})
    changed = [old.name for old, new in zip(before.sensors, after.sensors, strict=True) if old != new]
    assert changed == ["top", "pair"]


def test_a_rig_that_was_made_in_python_can_be_changed() -> None:
    top = LidarConfig(name="top", mount=Mount(xyz=(0.0, 0.0, 1.0)), rings=16)
    listed = make_experiment(rig=Rig(sensors=(top,)))
    [run] = draw(Campaign.model_validate({"name": "c", "experiments": [listed], "rigs": {"lidar": {"rate_hz": 5}}}))
    assert run.experiment.rig.sensors == (top.model_copy(update={"rate_hz": 5.0}),)


def test_the_list_of_sensors_can_be_drawn() -> None:
    sensors = [
        {"kind": "lidar", "name": "top", "mount": {"xyz": [0, 0, {"uniform": [0.9, 1.2]}]}},
        {"choice": [{"kind": "camera", "name": "eye", "mount": {"xyz": [0.5, 0, 0.5]}, "width": 64}, {"kind": "imu"}]},
    ]
    rigs = [run.experiment.rig for run in draw(campaign(runs=30, rigs={"sensors": sensors}))]
    heights = {rig.lidar.mount.xyz[2] for rig in rigs}
    assert len(heights) == 30
    assert 0.9 <= min(heights) < max(heights) <= 1.2
    assert {tuple(sensor.name for sensor in rig.sensors) for rig in rigs} == {("top", "eye"), ("top", "imu")}


def test_overrides_apply_to_all_sensors_of_a_kind() -> None:
    def rig_of(**values: Any) -> Rig:
        [run] = draw(with_changes(of_many_sensors(), **values))
        return run.experiment.rig

    assert not rig_of(cameras=False).enabled(CameraConfig)
    assert len(rig_of(cameras=False).enabled(LidarConfig)) == 2
    assert not rig_of(lidar=False).enabled(LidarConfig)
    assert all((c.depth, c.instances) == (True, False) for c in rig_of(extras=("depth",)).enabled(CameraConfig))


def test_the_digest_of_a_run_follows_every_sensor() -> None:
    experiments = [make_experiment(rig=many_rig())]
    for k in range(len(many_rig().sensors)):
        sensors = many_sensors()
        sensors[k]["rate_hz"] = 9.0
        experiments.append(make_experiment(rig=Rig.model_validate({"sensors": sensors})))
    assert len({digest_of(experiment) for experiment in experiments}) == len(experiments) == 13


def test_draws_follow_their_distributions() -> None:
    runs = draw(
        campaign(
            runs=400,
            environments={"choice": ["park", "lake"], "weights": [3, 1]},
            seeds={"integers": [0, 3]},
            routes={"random": {"length_m": {"uniform": [100, 300]}}},
            layouts={"park": {"old_trees": {"integers": [20, 24]}}},
        )
    )
    experiments = [run.experiment for run in runs]
    count = sum(e.environment == "park" for e in experiments)
    assert abs(count - 300) < 5 * np.sqrt(400 * 0.75 * 0.25)
    seeds = Counter(e.seed for e in experiments)
    assert seeds.keys() == {0, 1, 2, 3}
    assert max(abs(n - 100) for n in seeds.values()) < 5 * np.sqrt(400 * 0.25 * 0.75)
    routes = [e.route for e in experiments]
    lengths = [r.random.length_m for r in routes if isinstance(r, RandomRouteConfig)]
    assert len(lengths) == 400
    assert 100 <= min(lengths) < 105
    assert 295 < max(lengths) <= 300
    assert abs(np.mean(lengths) - 200) < 5 * 200 / np.sqrt(12 * 400)
    assert len({r.random.seed for r in routes if isinstance(r, RandomRouteConfig)}) > 395
    layouts = {(e.seed, e.layout["old_trees"]) for e in experiments if e.environment == "park"}
    assert len(layouts) == 4, "one layout for each world"
    assert {trees for _, trees in layouts} <= set(range(20, 25))


def test_runs_of_frames_have_seeds_lights_and_a_length_of_their_own() -> None:
    lights = {"sun_elevation_deg": {"uniform": [10, 70]}}
    routes = {"frames": {"count": {"integers": [50, 150]}}}
    runs = [run.experiment for run in draw(campaign(routes=routes, lights=lights))]
    frames = [experiment.frames for experiment in runs if experiment.frames is not None]
    assert len(frames) == len({each.seed for each in frames}) == 20
    assert len({experiment.light for experiment in runs}) == 20
    assert [simulated_s(experiment) for experiment in runs] == [each.count / 10 for each in frames]
    mixed = [run.experiment for run in draw(campaign(routes=["built-in", routes], seconds=3))]
    assert {e.seconds for e in mixed if e.frames is None} == {3}
    assert {e.seconds for e in mixed if e.frames is not None} == {None}


def test_all_is_the_built_in_experiments_as_they_are() -> None:
    runs = draw(load_campaign(ALL))
    names = campaign_experiments(every=False)
    assert [run.name for run in runs] == names
    assert len(names) == 8
    assert [run.experiment for run in runs] == [load_experiment(name) for name in names]
    assert [run.name for run in draw(load_campaign(EVERY))] == list(EXPERIMENTS)
    assert list(EXPERIMENTS)[:8] == names
    shorter = draw(with_changes(load_campaign(ALL), seconds=5, cameras=False, extras=("depth",), seed=4))
    expected = [
        with_overrides(load_experiment(name), seconds=5, cameras=False, extras=("depth",), seed=4) for name in names
    ]
    assert [run.experiment for run in shorter] == expected


def test_a_written_campaign_keeps_sensors_whose_values_are_defaults_of_others() -> None:
    sensors = [
        {"kind": "lidar", "name": "top", "topic": "/os1_cloud_node/points", "mount": {"xyz": [0, 0, 1]}},
        {"kind": "lidar", "model": "vlp_16", "name": "low", "mount": {"xyz": [0.6, 0, 0.2]}, "spinning": False},
    ]
    rigs = [many_rig(), Rig.model_validate({"sensors": sensors}), paper_rig(lidar=LidarConfig(rings=16))]
    listed = [make_experiment(rig=rig, name=f"e_{k}") for k, rig in enumerate(rigs)]
    planned = Campaign.model_validate({"name": "c", "experiments": listed})
    text = yaml.safe_load(dump_campaign(planned))
    text.pop("fieldtruth")
    assert Campaign.model_validate(text) == planned


@given(campaigns | with_layouts)
@settings(max_examples=5, deadline=None)
def test_a_written_campaign_is_read_back(values: dict[str, Any]) -> None:
    planned = Campaign.model_validate(values)
    text = yaml.safe_load(dump_campaign(planned))
    text.pop("fieldtruth")
    assert Campaign.model_validate(text) == planned
