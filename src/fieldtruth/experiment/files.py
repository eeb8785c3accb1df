# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Experiments as files: read one, change a value, write down the effective whole so that it can be run again."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

import fieldtruth
from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.experiment.catalogue import experiment_names, experiment_text
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.problems import configuration_error, shortened
from fieldtruth.experiment.yaml_io import parse_mapping, write_mapping

VERSION_KEY: Final = "fieldtruth"
"""Key of the version that wrote a file; a file written by hand need not have it."""

LARGEST_FILE: Final = 4 << 20  # [byte]; 50,000 way-points, and no bag read by mistake

EXTRAS: Final = ("depth", "instances")
"""What a camera can publish beside photograph and tag."""

HEADER: Final = """\
# The whole input of this data set: running it again gives the same bag.
#   fieldtruth generate experiment.yaml
"""


def load_experiment(name_or_path: str | Path) -> Experiment:
    """Read an experiment that ships with the package by its name, or any other by the path of its YAML file.

    What holds a slash or ends in .yaml or .yml is a path; a bare word is a name first, and a file if one is called so.
    Environment and layout are checked by the world (``fieldtruth.check_experiment``), not here.

    Raises:
        UnknownNameError: neither an experiment nor a file.
        ConfigurationError: unreadable or broken file, unknown key, value that is not allowed, file of a newer version.
    """
    text = str(name_or_path)
    if text not in experiment_names() and (_looks_like_path(name_or_path) or Path(text).is_file()):
        return parse_experiment(_read(Path(name_or_path)), text)
    return parse_experiment(experiment_text(text), f"experiment {text}")


def parse_experiment(text: str, source: str = "") -> Experiment:
    """Read an experiment from YAML text; what is wrong with it is told as in load_experiment, behind ``source``."""
    data = parse_mapping(text, source or "experiment")
    _check_version(data.pop(VERSION_KEY, None), source)
    return _validated(data, source)


def dump_experiment(experiment: Experiment) -> str:
    """Write the effective configuration as YAML: every value, in a fixed order, with the version that wrote it.

    Loading it gives an equal experiment; floats keep every bit.
    """
    values = experiment.model_dump(mode="json")
    return HEADER + write_mapping({VERSION_KEY: fieldtruth.__version__, **values})


def with_overrides(
    experiment: Experiment,
    *,
    seconds: float | None = None,
    seed: int | None = None,
    cameras: bool | None = None,
    lidar: bool | None = None,
    extras: Sequence[str] | None = None,
) -> Experiment:
    """Return a copy with other values, checked anew; None keeps what the experiment says.

    Args:
        experiment: stays as it is.
        seconds: end after this much simulated time [s].
        seed: of everything random.
        cameras: whether the stereo pair is there.
        lidar: whether the LiDAR is there.
        extras: what each camera publishes beside photograph and tag, of ``EXTRAS``; the others are off.

    Raises:
        ConfigurationError: a value that is not allowed.
        UnknownNameError: an extra that there is not.
    """
    values: dict[str, Any] = experiment.model_dump()
    values |= {key: value for key, value in (("seconds", seconds), ("seed", seed)) if value is not None}
    for sensor, enabled in (("cameras", cameras), ("lidar", lidar)):
        if enabled is not None:
            values["rig"][sensor]["enabled"] = enabled
    if extras is not None:
        for name in extras:
            if name not in EXTRAS:
                raise UnknownNameError("extra", name, EXTRAS)
        values["rig"]["cameras"] |= {name: name in extras for name in EXTRAS}
    return _validated(values, "")


def _looks_like_path(name: str | Path) -> bool:
    return isinstance(name, Path) or "/" in name or name.endswith((".yaml", ".yml"))


def _read(path: Path) -> str:
    try:
        if path.is_dir():
            raise ConfigurationError(f"{path} is a folder; needed is the experiment's YAML file in it")
        if path.stat().st_size > LARGEST_FILE:
            raise ConfigurationError(f"{path} is no experiment: larger than {LARGEST_FILE >> 20} MiB")
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigurationError(f"cannot read {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path}: broken YAML: byte {error.start} is no UTF-8") from error
    except ValueError as error:  # a path that holds a zero byte
        raise ConfigurationError(f"cannot read {str(path)!r}: {error}") from error


def _validated(data: dict[str, Any], source: str) -> Experiment:
    try:
        return Experiment.model_validate(data)
    except ValidationError as report:
        raise configuration_error(Experiment, report, source) from report


def _check_version(written_by: object, source: str) -> None:
    if written_by is None:
        return
    theirs, ours = _release(str(written_by)), _release(fieldtruth.__version__)
    where = f"{source}: " if source else ""
    if theirs is None or ours is None:
        raise ConfigurationError(f"{where}{VERSION_KEY} is {shortened(written_by)}; allowed is a version such as 0.1.0")
    if theirs > ours:
        raise ConfigurationError(
            f"{where}written by fieldtruth {written_by}, this is {fieldtruth.__version__}; "
            f"run: pip install 'fieldtruth>={written_by}'"
        )


def _release(version: str) -> tuple[int, int, int] | None:
    match = re.match(r"(\d{1,9})\.(\d{1,9})(?:\.(\d{1,9}))?(?!\d)", version)
    return (int(match[1]), int(match[2]), int(match[3] or 0)) if match else None
