# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A receiver in small worlds and in forest and park: fixes, status, messages, and what checks say of them."""

import copy
from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from sense_worlds import at, box, make_world

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.geodesy import PAPER_ORIGIN, geodetic_from_world, world_from_geodetic
from fieldtruth.experiment.files import dump_experiment, parse_experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.gnss.check import FIXES, Fixes
from fieldtruth.sensors.gnss.config import GnssConfig
from fieldtruth.sensors.gnss.sensing import GnssErrors, GnssReadings
from fieldtruth.sensors.gnss.sensor import Gnss, _line, navsat
from fieldtruth.sensors.kind import At, Movement, SensorWorld
from fieldtruth.validation.check import Tally
from fieldtruth.world.build import load_world

OPEN = Scene(make_world(side=100.0, spacing=10.0))


def _readings(count: int = 60, x: float = 0.0, y: float = 0.0, z: float = 1.0) -> GnssReadings:
    """A robot that goes north at 0.5 m a reading of 2 Hz."""
    position = np.stack([x + 0.5 * np.arange(count), np.full(count, y), np.full(count, z)], axis=-1)
    return GnssReadings(stamps_ns=np.arange(1, count + 1) * 500_000_000, geodetic=geodetic_from_world(position))


def _config(**signal: Any) -> GnssConfig:
    return GnssConfig(signal=signal)  # type: ignore[arg-type]


def measure(scene: Scene | None, true: GnssReadings, config: GnssConfig, seed: int) -> GnssReadings:
    """Readings of a receiver along a whole drive."""
    assert config.signal is not None
    return GnssErrors(config, config.signal, seed).extend(true, scene)


def test_ideal_and_without_figures_the_message_is_the_same() -> None:
    true = _readings()
    same = measure(OPEN, true, _config(), 1)
    assert same.fixes is not None
    sensor, (output,) = Gnss(GnssConfig(), SensorWorld(OPEN.world, Rig())), GnssConfig().outputs()
    for k in range(60):
        at_k = At(k, k, k, Movement(lambda _: np.eye(4)))
        first, second = (navsat(k, sensor.reading(output, at_k, series)) for series in (same, true))
        assert first == second


@pytest.mark.parametrize("cuts", [(1, 2, 3), (20,), range(1, 60)])
def test_fixes_do_not_depend_on_how_a_drive_is_cut(cuts: Iterable[int]) -> None:
    config = GnssConfig(model="zed_f9p", signal="datasheet")  # type: ignore[arg-type]
    assert config.signal is not None
    true = _readings()
    whole = GnssErrors(config, config.signal, 4).extend(true, OPEN).fixes
    receiver, parts = GnssErrors(config, config.signal, 4), list[Any]()
    for rows in np.split(np.arange(60), list(cuts)):
        receiver = copy.deepcopy(receiver)  # a copy goes on as well
        part = GnssReadings(stamps_ns=true.stamps_ns[rows], geodetic=true.geodetic[rows])
        parts.append(receiver.extend(part, OPEN).fixes)
    for name in ("geodetic", "covariance", "status", "state", "satellites", "dop"):
        np.testing.assert_array_equal(np.concatenate([getattr(part, name) for part in parts]), getattr(whole, name))


def test_a_longer_drive_begins_with_a_shorter_one_and_receivers_differ() -> None:
    config = GnssConfig(signal="datasheet")  # type: ignore[arg-type]
    long, short = (measure(OPEN, _readings(count), config, 4).fixes for count in (60, 20))
    assert long is not None
    assert short is not None
    assert np.array_equal(long.geodetic[:20], short.geodetic)
    assert np.array_equal(long.covariance[:20], short.covariance)
    other = measure(OPEN, _readings(20), config.model_copy(update={"name": "other"}), 4).fixes
    seeded = measure(OPEN, _readings(20), config, 5).fixes
    assert other is not None
    assert seeded is not None
    assert not np.isclose(other.geodetic, short.geodetic, rtol=0.0, atol=1e-10).any()
    assert not np.isclose(seeded.geodetic, short.geodetic, rtol=0.0, atol=1e-10).any()


def test_walls_on_two_sides_raise_error_and_dilution() -> None:
    street = Scene(make_world(
        [(box("west", (60.0, 0.5, 20.0)), at(0, 5, 0)), (box("east", (60.0, 0.5, 20.0)), at(0, -5, 0))], side=140.0
    ))  # fmt: skip
    config = GnssConfig(signal="datasheet", model="neo_m8n")  # type: ignore[arg-type]
    free, walled = (measure(scene, _readings(), config, 2).fixes for scene in (OPEN, street))
    assert free is not None
    assert walled is not None
    assert free.satellites.min() > walled.satellites.max()
    assert (walled.dop[:, 1] > 1.3 * free.dop[:, 1]).all()
    assert (walled.covariance[:, 0, 0] > 1.5 * free.covariance[:, 0, 0]).all()


def test_a_box_around_the_antenna_takes_every_fix() -> None:
    closed = Scene(make_world([(box("box", (90.0, 3.0, 3.0)), at(0, 0, 0))], side=100.0))
    config = GnssConfig(signal="datasheet")  # type: ignore[arg-type]
    fixes = measure(closed, _readings(), config, 1).fixes
    assert fixes is not None
    assert (fixes.status == -1).all()
    assert (fixes.satellites == 0).all()
    assert np.isnan(fixes.geodetic).all()
    assert not fixes.covariance.any()


def test_status_and_service() -> None:
    for mode, status in (("single", 0), ("sbas", 1), ("rtk", 2)):
        fixes = measure(None, _readings(4), _config(mode=mode, constellations=["gps", "galileo"]), 1).fixes
        assert fixes is not None
        assert (fixes.status == status).all()
        assert fixes.service == 9
    alone = measure(None, _readings(40), _config(mode="rtk", link_losses_per_hour=3600.0, link_loss_s=1e6), 1).fixes
    assert alone is not None
    assert set(alone.status.tolist()) <= {0, 2}
    assert alone.status[-1] == 0


@pytest.mark.slow
def test_the_forest_has_the_larger_error() -> None:
    """In the middle of the forest against the middle of the park, at the same time."""
    config = GnssConfig(signal="datasheet", model="neo_m8n")  # type: ignore[arg-type]
    found = {}
    for name in ("park", "forest"):
        world = load_world(name, 0)
        x = -10.0 + 0.5 * np.arange(40)
        position = np.stack([x, np.zeros(40), world.terrain.surface.height_at(x, np.zeros(40)) + 1.0], axis=-1)
        true = GnssReadings(stamps_ns=np.arange(1, 41) * 500_000_000, geodetic=geodetic_from_world(position))
        fixes = measure(Scene(world), true, config, 3).fixes
        assert fixes is not None
        found[name] = fixes
    park, forest = found["park"], found["forest"]
    assert np.median(forest.satellites) < np.median(park.satellites) - 3
    assert np.median(forest.dop[:, 1]) > 1.2 * np.median(park.dop[:, 1])
    assert np.median(forest.covariance[:, 0, 0]) > 1.2 * np.median(park.covariance[:, 0, 0])


@pytest.mark.parametrize(
    ("signal", "line"),
    [
        ("{utc: 2020-01-01T00:00:00Z}", r"signal\.utc: must .*180 days of the almanac, 2026-07-26"),
        ("{utc: noon}", r"signal\.utc must be a time with its zone, like 2026-07-27T08:20:00Z"),
        ("{constellations: [glonass]}", r"signal\.constellations\[0\] must be gps or galileo, got 'glonass'"),
        ("{constellations: [gps, gps]}", r"constellations must differ"),
        ("{mode: ppp}", r"signal\.mode must be"),
        ("{range_sigma: 2.0}", r"unknown key 'rig\.sensors\[0\]\.signal\.range_sigma'; did you mean"),
    ],
)
def test_what_is_refused_is_one_line(signal: str, line: str) -> None:
    text = f"name: x\nenvironment: park\nframes: {{count: 1}}\nrig: {{sensors: [{{kind: gnss, signal: {signal}}}]}}\n"
    with pytest.raises(ConfigurationError, match=line) as caught:
        parse_experiment(text)
    assert "\n" not in str(caught.value)


def test_a_stored_experiment_is_read_again() -> None:
    text = "name: x\nenvironment: park\nframes: {count: 1}\nrig: {sensors: [{kind: gnss, signal: datasheet}]}\n"
    experiment = parse_experiment(text)
    assert parse_experiment(dump_experiment(experiment)) == experiment


def _checked(fixes: Any, true: GnssReadings, config: GnssConfig) -> Any:
    position = world_from_geodetic(true.geodetic) - np.array(config.mount.xyz)
    poses = {int(stamp): np.eye(4) for stamp in true.stamps_ns}
    for stamp, place in zip(true.stamps_ns, position, strict=True):
        poses[int(stamp)][:3, 3] = place
    motion = SimpleNamespace(
        when_known=lambda _, action: action(), state=lambda stamp: SimpleNamespace(world_from_base=poses[stamp])
    )
    rig = SimpleNamespace(enabled=lambda _: (config,))
    context: Any = SimpleNamespace(motion=motion, tally=Tally, rig=rig, origin=PAPER_ORIGIN)
    checker = Fixes(context)
    for k, stamp in enumerate(true.stamps_ns):
        has = fixes.covariance[k].any()
        message = SimpleNamespace(
            status=SimpleNamespace(status=fixes.status[k], STATUS_FIX=0),
            position_covariance=fixes.covariance[k].ravel(),
            position_covariance_type=3 if has else 0,
            COVARIANCE_TYPE_KNOWN=3,
            **dict(zip(("latitude", "longitude", "altitude"), fixes.geodetic[k], strict=True)),
        )
        checker.see(SimpleNamespace(topic=config.topic, stamp_ns=int(stamp)), message)  # type: ignore[arg-type]
    checker.finish()
    return checker.tallies[0].result()


def test_checks_of_measured_fixes() -> None:
    config = GnssConfig(signal="datasheet", model="neo_m8n")  # type: ignore[arg-type]
    true = _readings()
    fixes: Any = measure(OPEN, true, config, 6).fixes
    assert _checked(fixes, true, config).passed
    assert FIXES.name == "gnss noise"

    def changed(**values: Any) -> Any:
        return SimpleNamespace(**{**vars(fixes), **values})

    assert "allows" in _checked(changed(covariance=fixes.covariance * 1e-3), true, config).text
    assert "as large as" in _checked(changed(covariance=fixes.covariance * 1e6), true, config).text
    assert "without a position" in _checked(changed(status=np.full(60, -1)), true, config).text
    assert "if there are errors" in _checked(changed(covariance=fixes.covariance * 0.0), true, config).text


def test_a_run_that_ends_before_the_first_reading_has_a_line_of_the_card() -> None:
    nothing = SimpleNamespace(status=np.zeros(0, np.int8), satellites=np.zeros(0, np.int64))
    assert _line("gnss", nothing) == "- GNSS receiver `gnss`: no reading was due."  # type: ignore[arg-type]
