# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Campaigns as YAML files, those of the package among them: recognise, load, check, override, write the effective one.

A campaign is checked before it starts: names, both ends of every distribution against what experiments allow, and
whether the folder holds another campaign.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import fieldtruth
from fieldtruth.campaign.config import BUILT_IN, ROUTES, Campaign, Integers, Tree, axis, entries, extremes
from fieldtruth.campaign.draw import PlannedRun, changed_values, draw
from fieldtruth.core.errors import ConfigurationError, FieldtruthError, OutputError, UnknownNameError
from fieldtruth.core.files import output_errors, remove_abandoned, write_atomically
from fieldtruth.core.registry import Registry
from fieldtruth.core.yaml_io import parse_mapping, read_text, write_mapping
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.environment_file import Chosen, is_environment_file, with_paths
from fieldtruth.experiment.fields import LocatedError, Mount, dotted, shortened, validated_as
from fieldtruth.experiment.files import VERSION_KEY, check_version, load_experiment, looks_like_path
from fieldtruth.experiment.names import EXPERIMENTS, campaign_experiments
from fieldtruth.experiment.rig import MODELS
from fieldtruth.experiment.sensor_config import known_extras, known_switches, with_signal_files
from fieldtruth.experiment.urdf import KEY as URDF
from fieldtruth.experiment.urdf import with_urdf_mounts
from fieldtruth.world.build import check_experiment, check_layout

ALL: Final = "all"
"""Name of the campaign of the paper's experiments and of added ones."""
EVERY: Final = "every"
"""Name of the campaign of every experiment."""
CAMPAIGNS: Final[Registry[Path]] = Registry(
    "campaign", "campaigns", ".yaml", lambda _, given: Path(given), Path(__file__).parent / "builtin"
)
"""Files of campaigns by name: the standard training sets, and those in folders ``campaigns`` of FIELDTRUTH_PATH."""
CAMPAIGN: Final = "campaign.yaml"
"""The effective campaign in the folder of its runs."""
HEADER: Final = """\
# The whole input of these data sets. What is missing, and the rest:
#   fieldtruth status FOLDER
#   fieldtruth generate FOLDER/campaign.yaml --out FOLDER
"""
_OWN_KEYS: Final = frozenset(Campaign.model_fields) - frozenset(Experiment.model_fields)


def is_campaign(name_or_path: str) -> bool:
    """Return whether this is the name of a campaign, or a YAML file with a key that only campaigns have."""
    if name_or_path in EXPERIMENTS:
        return False
    if name_or_path in (ALL, EVERY, *CAMPAIGNS):
        return True
    path = Path(name_or_path)
    if not path.is_file():
        return False
    try:
        return not _OWN_KEYS.isdisjoint(parse_mapping(read_text(path), name_or_path))
    except FieldtruthError:
        return False  # loading it as an experiment says why


def check_known(name_or_path: str) -> None:
    """Check that this is a path, or the name of an experiment or a campaign.

    Raises:
        UnknownNameError: it is not; the text has the names of both.
    """
    names = (*EXPERIMENTS, ALL, EVERY, *CAMPAIGNS)
    if name_or_path not in names and not looks_like_path(name_or_path) and not Path(name_or_path).is_file():
        raise UnknownNameError("experiment", name_or_path, names)


def load_campaign(name_or_path: str | Path) -> Campaign:
    """Load a campaign from a YAML file, or one with a name: ``all``, ``every``, or one of ``CAMPAIGNS``.

    Paths of experiments, environments, track files and URDFs may be relative to the file.

    Raises:
        ConfigurationError: unreadable or invalid file, unknown key, value that is not allowed.
        UnknownNameError: an unknown experiment.
    """
    if str(name_or_path) in (ALL, EVERY):
        every = str(name_or_path) == EVERY
        experiments = tuple(load_experiment(name) for name in campaign_experiments(every=every))
        what = f"the built-in experiments{' of every environment' if every else ''}"
        return Campaign(name=str(name_or_path), description=what, experiments=experiments)
    path = CAMPAIGNS.get(str(name_or_path), Path(name_or_path))
    data = parse_mapping(read_text(path), str(path))
    check_version(data.pop(VERSION_KEY, None), str(path))
    listed = data.get("experiments")
    if isinstance(listed, list):
        data["experiments"] = [_experiment(entry, path) for entry in listed]
    data |= _environments(data, path.parent)
    if "rigs" in data:
        data["rigs"] = _mounted(data["rigs"], path)
    return validated_as(Campaign, data, str(path))


def _environments(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return environments and layouts with the paths of environments that are files, from a folder."""

    def made(value: Any) -> Any:
        if isinstance(value, list):
            return [made(each) for each in value]
        if isinstance(value, dict):
            return {key: made(each) for key, each in value.items()}
        return str((folder / Path(value).expanduser()).absolute()) if is_environment_file(value) else value

    found = {"environments": made(data["environments"])} if "environments" in data else {}
    if isinstance(layouts := data.get("layouts"), dict):
        found["layouts"] = {made(key): tree for key, tree in with_paths(layouts, folder).items()}
    return found


def _mounted(rigs: Any, path: Path) -> Any:
    """Return entries of ``rigs`` with what their URDFs and signals say, so that the campaign needs no other file."""
    if isinstance(rigs, list):
        return [_mounted(entry, path) for entry in rigs]
    rigs = with_signal_files(rigs, path.parent)
    if not isinstance(rigs, dict) or not isinstance(rigs.get(URDF), str):
        return rigs
    try:
        return _plain(with_urdf_mounts({**rigs, URDF: str(path.parent / rigs[URDF])}))
    except LocatedError as error:
        raise ConfigurationError(f"{path}: rigs: {dotted(error.at)} {error}") from error


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return value.model_dump(mode="json") if isinstance(value, Mount) else value


def list_campaigns() -> dict[str, str]:
    """Name and one-line description of each campaign that has a name."""
    names = (ALL, EVERY)
    return {name: load_campaign(name).description for name in names} | {
        name: str(parse_mapping(read_text(path), str(path)).get("description") or "")
        for name, path in CAMPAIGNS.items()
    }


def dump_campaign(campaign: Campaign) -> str:
    """Return the campaign as YAML with the version that wrote it; listed experiments are written in full."""
    values = campaign.model_dump(mode="json", exclude_defaults=True)
    for experiment, written in zip(campaign.experiments, values.get("experiments", ()), strict=True):
        if "rig" in written:  # the defaults of a sensor depend on its kind, name and model
            written["rig"]["sensors"] = [sensor.model_dump(mode="json") for sensor in experiment.rig.sensors]
            written["rig"][MODELS] = experiment.rig.models()
    values |= values.pop("switches", {})
    return HEADER + write_mapping({VERSION_KEY: fieldtruth.__version__, **values})


def with_changes(
    campaign: Campaign,
    *,
    runs: int | None = None,
    seconds: float | None = None,
    seed: int | None = None,
    extras: Sequence[str] | None = None,
    signal: str | Mapping[str, Any] | None = None,
    light: str | None = None,
    **switches: bool | None,
) -> Campaign:
    """Return a copy whose runs have other values; None keeps those of the campaign.

    ``seed`` is the root of what is drawn, or the seed of every listed experiment. Fewer ``runs`` are the first of more.

    Raises:
        ConfigurationError: a value that is not allowed, or ``runs`` of a campaign without a number of runs.
    """
    if runs is not None and not isinstance(campaign.runs, int):
        raise ConfigurationError(f"--runs is for campaigns with a number of runs; {campaign.name} has none")
    changes = {"runs": runs, "seconds": seconds, "extras": extras, "signal": signal, "lights": light, **switches}
    changes["seeds" if campaign.experiments else "seed"] = seed
    values: dict[str, Any] = {name: getattr(campaign, name) for name in campaign.model_fields_set}
    return validated_as(Campaign, values | {key: value for key, value in changes.items() if value is not None})


def _experiment(entry: object, file: Path) -> object:
    if not isinstance(entry, str):
        return entry  # in full
    if entry not in EXPERIMENTS and entry.endswith((".yaml", ".yml")):
        return load_experiment(file.parent / entry)
    try:
        return load_experiment(entry)
    except UnknownNameError:
        raise UnknownNameError("experiment", entry, EXPERIMENTS, str(file)) from None


def check_campaign(campaign: Campaign, source: str) -> None:
    """Check names, layouts and the ends of distributions; ``source``, a file for example, is put in front of errors.

    Raises:
        UnknownNameError: unknown environment, extra or switch.
        ConfigurationError: a value that is not allowed.
    """
    for experiment in campaign.experiments:
        check_experiment(experiment, f"{source}: {experiment.name}")
    for environment in () if campaign.experiments else entries(campaign.environments):
        check_layout(environment, {}, source)
    for environment, tree in campaign.layouts.items():
        for position, end in _ends(f"layouts.{environment}", tree):
            check_layout(*_with_layout(campaign, environment, end), f"{source}: {position}")
    _check_routes(campaign.routes, source)
    for key, name in (("seeds", "seed"), ("lights", "light"), ("weathers", "weather"), ("rigs", "rig")):
        for position, end in _ends(key, getattr(campaign, key)):
            for experiment in campaign.experiments:
                _check_values(changed_values(experiment, {name: end}), f"{source}: {position}: {experiment.name}")
            if not campaign.experiments:
                _check_values({name: end}, f"{source}: {position}")
    named = [("extra", name, known_extras()) for name in campaign.extras or ()]
    named += [("switch", name, known_switches()) for name in campaign.switches]
    for what, name, known in named:
        if name not in known:
            raise UnknownNameError(what, name, known, source)
    runs = campaign.experiments or (() if campaign.routes == BUILT_IN else entries(campaign.routes))
    if campaign.seconds is not None and runs and all(map(_has_frames, runs)):
        raise ConfigurationError(f"{source}: seconds is for drives; of frames, frames.count says how many there are")
    for end in extremes(campaign.seconds):
        _check_values({"seconds": end}, source)


def _with_layout(campaign: Campaign, name: str, layout: Mapping[str, Any]) -> Chosen:
    """Return an environment of ``layouts`` with a layout; of listed experiments in a site over theirs."""
    listed = next((each for each in campaign.experiments if each.world_name == name != each.environment), None)
    return Chosen(name, dict(layout)) if listed is None else Chosen(listed.environment, {**listed.layout, **layout})


def _has_frames(run: Experiment | Tree) -> bool:
    return run.frames is not None if isinstance(run, Experiment) else isinstance(run, Mapping) and "frames" in run


def _check_routes(tree: Tree, source: str) -> None:
    for position, end in _ends("routes", tree):
        if end == BUILT_IN:
            continue
        if isinstance(end, str) or end.keys() not in ({"random"}, {"frames"}, {"metres"}):
            raise ConfigurationError(f"{source}: {position} must be {ROUTES}, got {shortened(end)}")
        if "frames" in end:
            _check_values({"route": None, "frames": end["frames"]}, f"{source}: {position}")
            continue
        if isinstance(values := end.get("random"), dict):
            end = {"random": {"seed": 0} | values}
        _check_values({"route": end}, f"{source}: {position}")


def _ends(key: str, tree: Tree) -> Iterator[tuple[str, Any]]:
    """Entries of an axis at the ends of their distributions, each with its position in the file."""
    if tree is None:
        return
    found = axis(tree)
    rows = found.integers if isinstance(found, Integers) else found.choice
    for i, entry in enumerate(rows):
        yield from ((f"{key}[{i}]" if len(rows) > 1 else key, end) for end in extremes(entry))


def _check_values(values: dict[str, Any], source: str) -> None:
    base = {"name": "x", "environment": "x", "route": {"random": {"length_m": 100, "seed": 0}}}
    validated_as(Experiment, base | values, source)


def check_folder(campaign: Campaign, runs: tuple[PlannedRun, ...], out: Path) -> None:
    """Check that a folder holds no other campaign; one that has every run of the stored one continues it.

    Raises:
        OutputError: the folder holds another campaign.
    """
    path = out / CAMPAIGN
    if not path.exists():
        return
    try:
        stored = load_campaign(path)
        other = "" if stored == campaign or _has_every(runs, draw(stored)) else _differences(stored, campaign)
    except FieldtruthError as error:
        other = f"its {CAMPAIGN} cannot be read: {error}"
    if other:
        raise OutputError(
            f"{out} holds another campaign ({other}); choose another --out, or replace it with --overwrite"
        )


def write_campaign(campaign: Campaign, out: Path) -> None:
    """Write campaign.yaml; raises OutputError if that is not possible."""
    path, text = out / CAMPAIGN, dump_campaign(campaign)
    remove_abandoned(path)
    with output_errors(path):
        if not path.exists() or path.read_bytes() != text.encode():
            write_atomically(path, text)


def _has_every(runs: tuple[PlannedRun, ...], stored: tuple[PlannedRun, ...]) -> bool:
    by_name = {run.name: run for run in runs}
    return all(by_name.get(run.name) == run for run in stored)


def _differences(stored: Campaign, campaign: Campaign) -> str:
    keys = [key for key in type(campaign).model_fields if getattr(stored, key) != getattr(campaign, key)]
    return f"different: {', '.join(keys) or 'built-in experiments of this version'}"
