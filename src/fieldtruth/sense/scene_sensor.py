# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Kinds of sensors that are added to those of the package: what they sense, their messages and their check."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar, Final

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.sensor_config import KINDS, MountedConfig
from fieldtruth.sense.scene import Scene

SCENE_SENSORS: Final[dict[str, type["SceneSensor"]]] = {}
"""By kind. Another package adds its own with the entry point ``fieldtruth.sensors``, a module that defines it."""


class SceneSensor(ABC):
    """A sensor in a scene, one per thread. A subclass that sets ``config_type`` makes its kind known.

    Args:
        config: of type ``config_type``.
        scene: shared by all sensors.
    """

    config_type: ClassVar[type[MountedConfig]]

    def __init__(self, config: Any, scene: Scene) -> None:
        self.config = config
        self.scene = scene

    def __init_subclass__(cls) -> None:
        """Make the kind known."""
        super().__init_subclass__()
        kind = str(cls.config_type.model_fields["kind"].default)
        assert KINDS[kind] is cls.config_type
        SCENE_SENSORS[kind] = cls

    @abstractmethod
    def read(self, world_from_sensor: Array) -> Any:
        """Return what it senses from a pose (4, 4)."""

    @abstractmethod
    def messages(self, k: int, stamp_ns: int, reading: Any) -> Iterable[bytes]:
        """Serialise reading ``k``: a message for each topic of the configuration."""

    @abstractmethod
    def difference(self, reading: Any, messages: Sequence[Any]) -> str:
        """State in what the messages of a bag, decoded, differ from a reading from the same pose; empty: in nothing."""
