# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a real sensor adds to ideal readings: a word, a YAML file, or figures of one's own."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.yaml_io import parse_mapping, read_text
from fieldtruth.experiment.fields import Frozen
from fieldtruth.experiment.problems import LocatedError, shortened
from fieldtruth.experiment.sensor_models import datasheet_of, preset_of

KEY: Final = "signal"
IDEAL: Final = "ideal"
DATASHEET: Final = "datasheet"
CLEAN: Final = "clean"
"""Another word for ideal."""
ROBOT: Final = "robot"
"""The signal of photographs as robots take them; of sensors that are no cameras, that of the data sheet."""
WORDS: Final = (IDEAL, DATASHEET, CLEAN, ROBOT)
FORMS: Final = f"{', '.join(WORDS)}, the path of a YAML file, or a mapping"
_ENDINGS: Final = (".yaml", ".yml")


class SignalConfig(Frozen):
    """Figures of a real sensor; each kind has a subclass. Without any value given, nothing differs from ideal."""


def signal_values(given: Any, kind: str, model: str) -> Any:
    """Return the figures that ``signal`` of a sensor means: a mapping, or None for ideal.

    Args:
        given: value of the key.
        kind: kind of sensor.
        model: whose data sheet ``datasheet`` means.

    Raises:
        LocatedError: not one of the forms, or a file that cannot be read.
    """
    if given is None or given in (IDEAL, CLEAN):
        return None
    if given == ROBOT and (preset := preset_of(kind, ROBOT)):
        return preset
    if given in (DATASHEET, ROBOT):
        if not model:
            raise LocatedError("must be ideal: this kind of sensor has no data sheet", [KEY])
        return datasheet_of(kind, model)
    if not isinstance(given, str):
        return given
    if not given.endswith(_ENDINGS):
        raise LocatedError(f"must be {FORMS}; got {shortened(given)}", [KEY])
    try:
        return parse_mapping(read_text(Path(given)), given)
    except ConfigurationError as error:
        raise LocatedError(f"cannot be used: {error}", [KEY]) from error


def with_signal_files(rig: Any, folder: Path) -> Any:
    """Return the values of a rig with the figures that are in files, whose paths may be relative to ``folder``.

    Raises:
        ConfigurationError: a file that cannot be read.
    """
    if not isinstance(rig, Mapping):
        return rig
    changed = {key: _with_file(value, folder) if key != "sensors" else value for key, value in rig.items()}
    if isinstance(rig.get("sensors"), list | tuple):
        changed["sensors"] = [_with_file(item, folder) for item in rig["sensors"]]
    return changed


def _with_file(sensor: Any, folder: Path) -> Any:
    given = sensor.get(KEY) if isinstance(sensor, Mapping) else None
    if not isinstance(given, str) or not given.endswith(_ENDINGS):
        return sensor
    path = folder / given
    return {**sensor, KEY: parse_mapping(read_text(path), str(path))}
