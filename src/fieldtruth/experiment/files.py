# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Experiments as YAML files: load, override values, and write the complete effective configuration."""

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
from fieldtruth.experiment.urdf import KEY as URDF
from fieldtruth.experiment.yaml_io import parse_mapping, write_mapping
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.lidar.config import LidarConfig

VERSION_KEY: Final = "fieldtruth"
"""Key of the version that wrote a file; optional in files written by hand."""

MAX_FILE_SIZE: Final = 4 << 20  # [byte]; enough for 50,000 waypoints, and keeps bags from being parsed

EXTRAS: Final = ("depth", "instances")
"""Optional image streams of a camera, besides photograph and tag."""

HEADER: Final = """\
# The whole input of this data set: running it again gives the same bag.
#   fieldtruth generate experiment.yaml
"""


def load_experiment(name_or_path: str | Path) -> Experiment:
    """Load a built-in experiment by its name, or any other by the path of its YAML file.

    A string with a slash or ending in .yaml or .yml is a path; any other is a name first, then a file in the current
    folder. Environment and layout are checked by the world (``fieldtruth.check_experiment``), not here. Paths of a
    track file and of a URDF may be relative to the YAML file.

    Raises:
        UnknownNameError: neither a built-in experiment nor a file.
        ConfigurationError: unreadable or invalid file, unknown key, value that is not allowed, file of a newer version.
    """
    text = str(name_or_path)
    if text not in experiment_names() and (_looks_like_path(name_or_path) or Path(text).is_file()):
        folder = Path(name_or_path).parent
        return _beside(parse_experiment(read_text(Path(name_or_path)), text, folder), folder)
    return parse_experiment(experiment_text(text), f"experiment {text}")


def parse_experiment(text: str, source: str = "", folder: Path | None = None) -> Experiment:
    """Parse an experiment from YAML text; errors as in load_experiment, with ``source`` in front.

    The path of a URDF may be relative to ``folder``, by default the current one.
    """
    data = parse_mapping(text, source or "experiment")
    check_version(data.pop(VERSION_KEY, None), source)
    rig = data.get("rig")
    if folder is not None and isinstance(rig, dict) and isinstance(rig.get(URDF), str) and rig[URDF]:
        data["rig"] = rig | {URDF: str(folder / rig[URDF])}
    return _validated(data, source)


def load_layout(path: Path) -> dict[str, Any]:
    """Read a YAML file with changes to an environment's layout, for example ``old_trees: 60``.

    The world checks keys and values (``world.build.check_layout``), not this.

    Raises:
        ConfigurationError: unreadable or invalid file.
    """
    return parse_mapping(read_text(path), str(path))


def dump_experiment(experiment: Experiment) -> str:
    """Return the effective configuration as YAML: every value, in a fixed order, with the version that wrote it.

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
    """Return a validated copy with other values; None keeps the experiment's value.

    Args:
        experiment: not changed.
        seconds: end after this simulated time [s].
        seed: root of all randomness.
        cameras: whether the cameras are simulated.
        lidar: whether the LiDARs are simulated.
        extras: image streams of ``EXTRAS`` that cameras publish besides photograph and tag; the others are off.

    Raises:
        ConfigurationError: a value that is not allowed.
        UnknownNameError: an unknown extra.
    """
    values: dict[str, Any] = experiment.model_dump()
    values |= {key: value for key, value in (("seconds", seconds), ("seed", seed)) if value is not None}
    rig = experiment.rig
    for config, enabled in ((CameraConfig, cameras), (LidarConfig, lidar)):
        if enabled is not None:
            rig = rig.with_sensors(config, enabled=enabled)
    if extras is not None:
        for name in extras:
            if name not in EXTRAS:
                raise UnknownNameError("extra", name, EXTRAS)
        rig = rig.with_sensors(CameraConfig, **{name: name in extras for name in EXTRAS})
    return _validated(values | {"rig": rig.model_dump()}, "")


def _beside(experiment: Experiment, folder: Path) -> Experiment:
    """Return the experiment with its track file, which may be relative to the folder of the YAML file."""
    if experiment.drive is None:
        return experiment
    found = experiment.drive.model_copy(update={"track": str(folder / experiment.drive.track)})
    return experiment.model_copy(update={"drive": found})


def _looks_like_path(name: str | Path) -> bool:
    return isinstance(name, Path) or "/" in name or name.endswith((".yaml", ".yml"))


def read_text(path: Path) -> str:
    """Read a configuration file.

    Raises:
        ConfigurationError: it cannot be read, is not UTF-8, or is too large for a configuration.
    """
    try:
        if path.is_dir():
            raise ConfigurationError(f"{path} is a folder; give a YAML file in it")
        if path.stat().st_size > MAX_FILE_SIZE:
            raise ConfigurationError(f"{path} is too large for a configuration: more than {MAX_FILE_SIZE >> 20} MiB")
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigurationError(f"cannot read {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"cannot read {path}: byte {error.start} is not UTF-8") from error
    except ValueError as error:  # a path with a null byte
        raise ConfigurationError(f"cannot read {str(path)!r}: {error}") from error


def _validated(data: dict[str, Any], source: str) -> Experiment:
    try:
        return Experiment.model_validate(data)
    except ValidationError as report:
        raise configuration_error(Experiment, report, source) from report


def check_version(written_by: object, source: str) -> None:
    """Check the version that wrote a file; None, of a file written by hand, passes.

    Raises:
        ConfigurationError: not a version, or a newer one than that installed.
    """
    if written_by is None:
        return
    theirs, ours = _release(str(written_by)), _release(fieldtruth.__version__)
    where = f"{source}: " if source else ""
    if theirs is None or ours is None:
        raise ConfigurationError(f"{where}{VERSION_KEY} must be a version such as 0.1.0, got {shortened(written_by)}")
    if theirs > ours:
        raise ConfigurationError(
            f"{where}written by fieldtruth {written_by}, but version {fieldtruth.__version__} is installed; "
            f"run: pip install 'fieldtruth>={written_by}'"
        )


def _release(version: str) -> tuple[int, int, int] | None:
    match = re.match(r"(\d{1,9})\.(\d{1,9})(?:\.(\d{1,9}))?(?!\d)", version)
    return (int(match[1]), int(match[2]), int(match[3] or 0)) if match else None
