# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The short form of a rig: a key for each sensor of the paper, such as ``lidar: {rate_hz: 20}``.

A section changes the first sensor of its kind in ``sensors``, or adds the paper's; ``wheels`` and ``base_footprint``
change the robot.
"""

from collections.abc import Mapping
from typing import Any, Final

from fieldtruth.experiment.fields import Frozen, Mount
from fieldtruth.experiment.robot_config import RobotConfig, WheelConfig
from fieldtruth.experiment.sensor_config import KINDS, SensorConfig, part
from fieldtruth.sensors.configs import CONFIGS

_OF_PAPER: Final = tuple(config for config in CONFIGS if "sections" in vars(config))
"""The sensors of the paper, in the order of the topics in a bag."""
_SECTIONS: Final = {key: (config, each) for config in _OF_PAPER for key, each in config.sections.items()}
SECTIONS: Final[dict[str, type[Frozen]]] = {key: each.config or config for key, (config, each) in _SECTIONS.items()}
"""What each section may have."""

ROBOT_SECTIONS: Final[dict[str, type[Frozen]]] = {"wheels": WheelConfig, "base_footprint": Mount}
"""Keys of a rig that change the part of ``robot`` with the same name."""


def with_robot(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a rig with its sections of the robot as parts of ``robot``.

    Raises:
        PartError: a value that is not allowed.
    """
    rest = {key: value for key, value in given.items() if key not in ROBOT_SECTIONS}
    if len(rest) == len(given):
        return rest
    robot = part(RobotConfig, rest.get("robot", {}), "robot").model_dump()
    for key, config in ROBOT_SECTIONS.items():
        if key in given:
            value = {**robot[key], **given[key]} if _is_change(given[key], robot[key]) else given[key]
            robot[key] = part(config, value, key).model_dump()
    return {**rest, "robot": part(RobotConfig, robot)}


def _is_change(value: Any, known: Any) -> bool:
    return isinstance(value, Mapping) and isinstance(known, Mapping)


_OWN: Final = ("kind", "name", "enabled", "topic", "frame", "forward", "mount", "sampling", "far", "depth", "instances",
               "normals", "flow", "jpeg_quality", "tachometer_rate_hz")  # fmt: skip
"""What of a sensor no model says."""


def with_sections(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a rig with its sections as items of ``sensors``; without ``sensors`` these are the paper's.

    Raises:
        PartError: a value of a section that is not allowed.
    """
    rest = {key: value for key, value in given.items() if key not in SECTIONS}
    sections = {key: given[key] for key in SECTIONS if key in given}
    items = rest.get("sensors", [{"kind": config.model_fields["kind"].default} for config in _OF_PAPER])
    if not isinstance(items, list | tuple):
        return rest  # the field reports it
    for key, section in sections.items():
        items = _changed(list(items), key, section)
    return {**rest, "sensors": items}


def _changed(items: list[Any], key: str, section: Any) -> list[Any]:
    kind, change = _item(key, section)
    at = next((i for i, item in enumerate(items) if _kind(item) == kind), None)
    if at is None:
        return [*items, part(KINDS[kind], {"kind": kind, **change}, key)]
    if isinstance(section, SensorConfig):
        return [*items[:at], section, *items[at + 1 :]]
    own = items[at].model_dump(exclude_unset=True) if isinstance(items[at], SensorConfig) else items[at]
    if change.get("model") is not None:  # its figures replace those of the item
        own = {name: value for name, value in own.items() if name in _OWN}
    return [*items[:at], part(KINDS[kind], {**own, **change}, key), *items[at + 1 :]]


def _item(key: str, section: Any) -> tuple[str, dict[str, Any]]:
    """Kind of sensor that a section changes, and its values by the names that they have in an item."""
    config, own = _SECTIONS[key]
    if own.config is not None or not isinstance(section, Mapping):
        section = part(own.config or config, section, key).model_dump(exclude_unset=True)
    return str(config.model_fields["kind"].default), {
        own.keys.get(name, name): value for name, value in section.items()
    }


def _kind(item: Any) -> Any:
    return item.get("kind") if isinstance(item, Mapping) else getattr(item, "kind", None)


PAPER_SENSORS: Final[tuple[SensorConfig, ...]] = tuple(config.model_validate({}) for config in _OF_PAPER)
