# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Experiments as YAML files: load, override values, and write the complete effective configuration."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import fieldtruth
from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.core.yaml_io import parse_mapping, read_text, write_mapping
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.environment_file import CENTRE, is_environment_file, with_paths
from fieldtruth.experiment.fields import shortened, validated_as
from fieldtruth.experiment.names import EXPERIMENTS
from fieldtruth.experiment.rig import MODELS, Rig
from fieldtruth.experiment.sensor_config import SIGNAL, WORDS, SensorConfig, known_extras, with_signal_files
from fieldtruth.experiment.urdf import KEY as URDF

VERSION_KEY: Final = "fieldtruth"
"""Key of the version that wrote a file; optional in files written by hand."""
HEADER: Final = """\
# The whole input of this data set: running it again gives the same bag.
#   fieldtruth generate experiment.yaml
"""


def load_experiment(name_or_path: str | Path) -> Experiment:
    """Load a built-in experiment by its name, or any other by the path of its YAML file.

    A string with a slash or ending in .yaml or .yml is a path; any other is a name first, then a file in the current
    folder. Environment and layout are checked by the world (``fieldtruth.check_experiment``), not here. Paths of a
    track file, of a URDF, of the figures of a signal, of an environment and of its maps may be relative to the YAML
    file.

    Raises:
        UnknownNameError: neither a built-in experiment nor a file.
        ConfigurationError: unreadable or invalid file, unknown key, value that is not allowed, file of a newer version.
    """
    text = str(name_or_path)
    if text not in EXPERIMENTS and (looks_like_path(name_or_path) or Path(text).is_file()):
        folder = Path(name_or_path).parent
        return _beside(parse_experiment(read_text(Path(name_or_path)), text, folder), folder)
    return parse_experiment(EXPERIMENTS.find(text), f"experiment {text}")


def parse_experiment(text: str, source: str = "", folder: Path | None = None) -> Experiment:
    """Parse an experiment from YAML text; errors as in load_experiment, with ``source`` in front.

    Paths of a URDF and of signals may be relative to ``folder``, by default the current one.
    """
    data = parse_mapping(text, source or "experiment")
    check_version(data.pop(VERSION_KEY, None), source)
    if CENTRE in data and "environment" not in data:
        raise ConfigurationError(f"{source}: a site, not an experiment; name it in one, as environment: {source}")
    rig, environment, layout = data.get("rig"), data.get("environment"), data.get("layout")
    if folder is not None and is_environment_file(environment):
        data["environment"] = str(folder / Path(str(environment)).expanduser())
    if folder is not None and isinstance(layout, dict):
        data["layout"] = with_paths(layout, folder)
    if folder is not None and rig is not None:
        data["rig"] = _rig_beside(rig, folder)
    if folder is not None and isinstance(robots := data.get("robots"), dict):
        data["robots"] = {
            name: own | {"rig": _rig_beside(own["rig"], folder)} if isinstance(own, dict) and "rig" in own else own
            for name, own in robots.items()
        }
    return validated(data, source)


def _rig_beside(rig: Any, folder: Path) -> Any:
    """Return the values of a rig whose URDF and signals may be in files relative to a folder."""
    if isinstance(rig, dict) and isinstance(rig.get(URDF), str) and rig[URDF]:
        rig = rig | {URDF: str(folder / rig[URDF])}
    return with_signal_files(rig, folder)


def dump_experiment(experiment: Experiment) -> str:
    """Return the effective configuration as YAML: every value, in a fixed order, with the version that wrote it.

    Loading it gives an equal experiment; floats keep every bit. ``rig.models`` says whose figures each sensor has.
    """
    values = experiment.model_dump(mode="json")
    values["rig"][MODELS] = experiment.rig.models()
    if not experiment.robots:
        del values["robots"], values["namespace"]
    for key in ("actors", "ground", "plan", "plants", "wind"):
        if not values[key] or getattr(experiment, key) == Experiment.model_fields[key].default:
            del values[key]
    for name, own in experiment.robots.items():
        if own.rig is not None:
            values["robots"][name]["rig"][MODELS] = own.rig.models()
    for each in (values, *values.get("robots", {}).values()):
        if each["control"] is not None and each["control"]["yield_to"] is None:
            del each["control"]["yield_to"]
        for sensor in (each["rig"] or {}).get("sensors", ()):
            for key in ("parts", "passability"):
                if not sensor.get(key, True):
                    del sensor[key]
    return HEADER + write_mapping({VERSION_KEY: fieldtruth.__version__, **values})


def with_overrides(
    experiment: Experiment,
    *,
    seconds: float | None = None,
    seed: int | None = None,
    extras: Sequence[str] | None = None,
    signal: str | Mapping[str, Any] | None = None,
    light: str | None = None,
    **switches: bool | None,
) -> Experiment:
    """Return a validated copy with other values; None keeps the experiment's value.

    Args:
        experiment: not changed.
        seconds: end after this simulated time [s].
        seed: root of all randomness.
        extras: ``extras`` that cameras publish besides photograph and tag; the others are off.
        signal: of every sensor whose kind has one: ``ideal``, ``datasheet``, ``robot``, or a mapping of names or
            kinds of sensors to their ``signal``; see ``read_signal``.
        light: preset that replaces all of ``light``.
        switches: whether all sensors with a switch are simulated: ``cameras`` and ``lidar``, or that of an added kind.

    Raises:
        ConfigurationError: a value that is not allowed.
        UnknownNameError: an unknown extra or switch.
    """
    values: dict[str, Any] = experiment.model_dump()
    values |= {
        key: value for key, value in (("seconds", seconds), ("seed", seed), ("light", light)) if value is not None
    }
    for name in extras or ():
        if name not in (known := known_extras()):
            raise UnknownNameError("extra", name, known)

    def changed(rig: Rig) -> dict[str, Any]:
        rig = rig.switched(**switches)
        if extras is not None:
            rig = rig.with_each(lambda each: {name: name in extras for name in each.extras})
        dumped = rig.model_dump()
        if signal is not None:
            signals = _signals(signal, rig.sensors)
            dumped["sensors"] = [item | signals.get(item["name"], {}) for item in dumped["sensors"]]
        return dumped

    for name, own in experiment.robots.items():
        if own.rig is not None:
            values["robots"][name]["rig"] = changed(own.rig)
    return validated(values | {"rig": changed(experiment.rig)}, "")


def read_signal(given: str) -> str | dict[str, Any]:
    """Return one of the words of ``signal``, or a YAML file's mapping of names or kinds of sensors to ``signal``.

    Raises:
        ConfigurationError: none of them, or a file that cannot be read.
    """
    if given in WORDS:
        return given
    if not looks_like_path(given):
        raise ConfigurationError(f"{SIGNAL} must be {', '.join(WORDS)} or the path of a YAML file, got {given!r}")
    return parse_mapping(read_text(Path(given)), given)


def _signals(given: str | Mapping[str, Any], sensors: Sequence[SensorConfig]) -> dict[str, dict[str, Any]]:
    """Value of ``signal`` by name of the sensor; those whose kind has no signal, or that are not given, have none.

    Raises:
        ConfigurationError: a key that is no sensor of the rig.
    """
    noisy = [sensor for sensor in sensors if sensor.datasheet]
    if isinstance(given, str):
        return {sensor.name: {SIGNAL: given} for sensor in noisy}
    known = [*dict.fromkeys(each for sensor in noisy for each in (sensor.name, sensor.kind))]
    if unknown := [key for key in given if key not in known]:
        raise ConfigurationError(
            f"{SIGNAL}: {unknown[0]!r} must be a sensor of the rig or its kind: {', '.join(known)}"
        )
    chosen = {sensor.name: given.get(sensor.name, given.get(sensor.kind)) for sensor in noisy}
    return {name: {SIGNAL: value} for name, value in chosen.items() if value is not None}


def _beside(experiment: Experiment, folder: Path) -> Experiment:
    """Return the experiment with its track file, which may be relative to the folder of the YAML file."""
    if experiment.drive is None:
        return experiment
    found = experiment.drive.model_copy(update={"track": str(folder / experiment.drive.track)})
    return experiment.model_copy(update={"drive": found})


def looks_like_path(name: str | Path) -> bool:
    """Return whether this is a path whether or not there is a file: it has a slash, or the ending of YAML."""
    return isinstance(name, Path) or "/" in name or name.endswith((".yaml", ".yml"))


def validated(data: dict[str, Any], source: str) -> Experiment:
    """Return an experiment of values as in a file; ConfigurationError begins with ``source``."""
    return validated_as(Experiment, data, source)


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
