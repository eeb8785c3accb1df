# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a bag says of its own sensors: rates, sizes and frames, and whether the experiment beside it fits."""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any, Final

from fieldtruth.bag import topics as table
from fieldtruth.bag.bag_file import BagFile
from fieldtruth.bag.decode import points, stamp_ns
from fieldtruth.bag.errors import BagError
from fieldtruth.bag.reader import decoder, open_bag
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.stereo_config import StereoConfig
from fieldtruth.sensors.lidar.config import LidarConfig

_TOLERANCE: Final = 0.2
"""Relative difference of a rate from which on it is another."""
_SHOWN: Final = 4
"""Misfits that are listed."""


def measured_rig(run: BagFile) -> Rig:
    """Return the paper's rig with the rates, sizes and frames that a bag without an experiment has.

    What cannot be measured, because a message is missing or odd, stays as in the paper.
    """
    rig = paper_rig(stereo=StereoConfig(depth=True, instances=True))  # that of PAPER_TOPICS
    first = _first_messages(run, [topic.name for sensor in rig.sensors for topic in sensor.topics()])
    sensors = tuple(_measured(sensor, run, first) for sensor in rig.sensors)
    return rig.model_copy(update={"sensors": sensors})


def misfits(run: BagFile) -> list[str]:
    """What of the experiment beside a bag does not fit it, as one line; nothing for a bag that it fits."""
    if run.experiment is None:
        return []
    topics = table.topics_of_run(run.experiment, latched=table.STATIC_MODEL_STATES in run.counts)
    found = []
    for topic in topics:
        due = 1.0 if topic.rate_hz is None else topic.rate_hz * run.duration_s / 2.0
        if topic.name not in run.counts and due >= 1.0:
            found.append(f"no {topic.name}")
        rate = _rate(run, topic.name)
        if rate and topic.rate_hz and abs(rate - topic.rate_hz) > _TOLERANCE * topic.rate_hz + 1.0 / run.duration_s:
            found.append(f"{topic.name} has {rate:.3g} Hz, not {topic.rate_hz:g} Hz")
    if not found:
        return []
    more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    return [f"experiment.yaml beside {run.bag} does not fit the bag: {'; '.join(found[:_SHOWN])}{more}"]


def _rate(run: BagFile, topic: str) -> float | None:
    """Mean rate [Hz] of a topic; None of fewer than three messages."""
    count = run.counts.get(topic, 0)
    return (count - 1) / run.duration_s if count > 2 and run.duration_s > 0.0 else None


def _measured_rate(run: BagFile, topic: str) -> float | None:
    """Rate [Hz] between the first and the last stamp of a topic, those of headers if it has; three digits."""
    if run.counts.get(topic, 0) < 3:
        return None
    with open_bag(run.bag) as bag, suppress(BagError, AttributeError):
        index, decode = bag.index([topic])[topic], decoder(bag)
        ends = [bag.message(bag.chunk(int(index.chunk[k])), int(index.offset[k])) for k in (0, -1)]
        first, last = (stamp_ns(m.header) if hasattr(m := decode(raw), "header") else raw.stamp_ns for raw in ends)
        return float(f"{(len(index.stamps_ns) - 1) / ((last - first) / 1e9):.3g}") if last > first else None
    return None


def _measured(sensor: SensorConfig, run: BagFile, first: Mapping[str, Any]) -> SensorConfig:
    message = next((first[t.name] for t in sensor.topics() if t.name in first), None)
    names = [topic.name for topic in sensor.topics()]
    main = sensor.topic if sensor.topic in names else next((name for name in names if name in first), sensor.topic)
    values: dict[str, Any] = {}
    if rate := _measured_rate(run, main):
        values["rate_hz"] = rate
    with suppress(FieldtruthError, AttributeError, ValueError, TypeError, KeyError, IndexError):
        values |= _sizes(sensor, message)
    return sensor.model_copy(update=values)


def _sizes(sensor: SensorConfig, message: Any) -> dict[str, Any]:
    """Size of a camera's images by its CameraInfo, rays and frame of a LiDAR by a cloud."""
    if isinstance(sensor, CameraConfig) and message is not None:
        return {"width": int(message.width), "height": int(message.height)} if message.width > 0 else {}
    if not isinstance(sensor, LidarConfig) or message is None:
        return {}
    values: dict[str, Any] = {"frame": str(message.header.frame_id)} if message.header.frame_id else {}
    rows = points(message)
    names = rows.dtype.names or ()
    if message.height > 1:
        values |= {"rings": int(message.height), "columns": int(message.width)}
    for key, field in (("rings", "ring"), ("columns", "column")):
        if field in names and len(rows):
            values[key] = int(rows[field].max()) + 1
    return values


def _first_messages(run: BagFile, topics: Iterable[str]) -> dict[str, Any]:
    """Return the first message of topics that can be decoded, by topic."""
    found = {}
    with open_bag(run.bag) as bag:
        decode = decoder(bag)
        for topic in topics:
            if topic in run.counts:
                with suppress(BagError):
                    found[topic] = decode(next(bag.messages([topic])))
    return found
