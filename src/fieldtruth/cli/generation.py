# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sub-commands for making data sets: generate (also of campaigns), degrade, preview, shares, list, bench, status."""

import argparse
import json
import time
import warnings
from collections.abc import Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fieldtruth.cli.arguments import UsageError, changes, chosen
from fieldtruth.cli.terminal import print_line, print_output
from fieldtruth.core.errors import FieldtruthWarning, UnknownNameError
from fieldtruth.core.files import output_folder, output_path
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import show_progress
from fieldtruth.experiment.environment_file import world_name

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from contextlib import AbstractContextManager

    from fieldtruth.campaign.state import State
    from fieldtruth.cluster.engine import ClusterEngine
    from fieldtruth.experiment.config import Experiment

FAILED: Final = 1
"""Exit code of a campaign with runs that failed."""
_STATUS_FORMATS: Final = ("text", "json", "lines", "slurm")
_ONLY_CAMPAIGNS: Final = {"runs": None, "jobs": None, "shard": None, "no_estimate": False}


def _refuse_campaign_options(options: argparse.Namespace) -> None:
    """Refuse the options of campaigns; raises UsageError."""
    for name, default in _ONLY_CAMPAIGNS.items():
        if getattr(options, name) != default:
            raise UsageError(f"--{name.replace('_', '-')} is for campaigns; {options.experiment} is one experiment")


def _generate_campaign(options: argparse.Namespace, cluster: "AbstractContextManager[ClusterEngine | None]") -> int:
    """Make a campaign, or what is left of it, on a cluster if it is one; the exit code says whether runs failed."""
    from fieldtruth.campaign.draw import Shard, parse_shard
    from fieldtruth.campaign.files import check_campaign, load_campaign, with_changes

    campaign = with_changes(load_campaign(options.experiment), runs=options.runs, **changes(options))
    check_campaign(campaign, options.experiment)
    shard = Shard(1, 1) if options.shard is None else parse_shard(options.shard)
    # After the checks: compiled kernels and physics take a second to load.
    from fieldtruth import pipeline
    from fieldtruth.campaign.state import Kind
    from fieldtruth.campaign.task import Options, generate_campaign

    out = Path("data") / campaign.name if options.out is None else output_folder(options.out)
    with cluster as engine:
        task = Options(
            jobs=options.jobs or (1 if engine is None else engine.runs_at_once()),
            workers=options.workers,
            shard=shard,
            overwrite=options.overwrite,
            measure=not options.no_estimate and engine is None,
            generate=None if engine is None else partial(pipeline.generate_by, engine),
        )
        states = generate_campaign(campaign, out, task, source=options.experiment, shows=show_progress, say=print_line)
    return FAILED if any(state.kind is Kind.FAILED for state in states) else 0


def _status(options: argparse.Namespace) -> None:
    from fieldtruth.campaign.draw import Shard, draw, ranges
    from fieldtruth.campaign.files import CAMPAIGN, load_campaign
    from fieldtruth.campaign.state import state_of

    known = _STATUS_FORMATS if options.missing else _STATUS_FORMATS[:2]
    if options.format not in known:
        raise UnknownNameError("format" if options.missing else "format without --missing", options.format, known)
    runs = draw(load_campaign(options.folder / CAMPAIGN))
    states = [state_of(run, options.folder, checksums=options.checksums) for run in runs]
    parts = len(runs) if options.shards is None else options.shards
    shards = [next(i for i in range(1, parts + 1) if Shard(i, parts).has(k)) for k in range(len(runs))]
    shown = [(state, i) for state, i in zip(states, shards, strict=True) if state.is_left or not options.missing]
    chosen = [state for state, _ in shown]
    if options.format == "json":
        print(json.dumps([{"run": s.run.name, "state": s.kind, "reason": s.reason} for s in chosen]))
    elif options.format == "lines":
        print("\n".join(state.run.name for state in chosen))
    elif options.format == "slurm":
        print(ranges(i for _, i in shown))
    else:
        print(_status_text(options.folder, chosen))


def warn_of_missing(folder: Path) -> None:
    """Warn if a folder is that of a campaign whose runs are not all done; do nothing for other folders."""
    from fieldtruth.campaign.draw import draw
    from fieldtruth.campaign.files import CAMPAIGN, load_campaign
    from fieldtruth.campaign.state import Kind, state_of

    if not (folder / CAMPAIGN).is_file():
        return
    states = [state_of(run, folder) for run in draw(load_campaign(folder / CAMPAIGN))]
    if left := sum(state.kind is not Kind.DONE for state in states):
        text = f"{left} of {len(states)} runs of {folder} are not done, see `fieldtruth status {folder}`"
        warnings.warn(text, FieldtruthWarning, stacklevel=2)


def _status_text(folder: Path, states: "Sequence[State]") -> str:
    from fieldtruth.campaign.state import Kind, clock, counts, size, time_left_s

    running = sum(state.kind is Kind.RUNNING for state in states)
    left_s = time_left_s(states, running)
    left = f"; about {clock(left_s)} left with {max(1, running)} at a time" if left_s else ""
    made = sum(state.manifest.bytes for state in states if state.manifest is not None)
    head = f"{folder}: {counts(states)}; {size(made)}{left}"
    rows = [f"  {s.kind:<7}  {s.run.name}{': ' * bool(s.reason)}{s.reason}" for s in states if s.kind is not Kind.DONE]
    return "\n".join([head, *rows])


def checked_experiment(name_or_path: str) -> "Experiment":
    """Return an experiment by its name or file; raises as ``load_experiment`` and ``check_experiment``."""
    from fieldtruth.experiment.files import load_experiment
    from fieldtruth.world.build import check_experiment

    experiment = load_experiment(name_or_path)
    check_experiment(experiment, name_or_path)
    return experiment


def _generate(options: argparse.Namespace) -> int | None:
    from fieldtruth.campaign.files import check_known, is_campaign
    from fieldtruth.experiment.files import with_overrides

    if is_campaign(options.experiment):
        return _generate_campaign(options, _engine(options))
    check_known(options.experiment)
    _refuse_campaign_options(options)
    experiment = with_overrides(checked_experiment(options.experiment), **changes(options))
    start = time.monotonic()
    # After the checks: compiled kernels and physics take a second to load.
    from fieldtruth.bag.file import find_bag, runs_of_robots
    from fieldtruth.pipeline import generate_by

    with _engine(options) as engine, show_progress(title=_title(experiment)) as progress:
        made = generate_by(
            engine,
            experiment,
            "data" if options.out is None else options.out,
            workers=options.workers or cpu_count(),
            overwrite=options.overwrite,
            progress=progress,
        )
    for bag in [made] if made.is_file() else map(find_bag, runs_of_robots(made)):
        _print_bag(bag, start)
    return None


def _title(experiment: "Experiment") -> str:
    """Say what is simulated, and how much longer a first run takes."""
    from fieldtruth.simulation.first_run import lacks_kernels

    frames, seconds, robots = experiment.frames, experiment.seconds, experiment.robots
    what = f"{seconds:g} s" if seconds else "the route" if frames is None else f"{frames.count} frames"
    rigs = [experiment.of_robot(name).rig for name in robots] or [experiment.rig]
    count = f"{sum(len(rig.in_order()) for rig in rigs)} sensors{f' of {len(robots)} robots' * bool(robots)}"
    sensors = f"{count} in {experiment.world_name}, seed {experiment.seed}"
    first = "; the first run compiles, too, and takes a minute or two longer than later ones"
    return f"{experiment.name}: {what} with {sensors}{first * lacks_kernels(experiment)}"


def _print_bag(bag: Path, start: float) -> None:
    from fieldtruth.bag.decode import count_messages

    took = time.monotonic() - start
    counts = count_messages(bag)
    print_line(
        f"{bag}: {sum(counts.values())} messages of {len(counts)} topics, {bag.stat().st_size / 1e6:.1f} MB; "
        f"this run took {took:.0f} s"
    )


def _degrade(options: argparse.Namespace) -> None:
    from fieldtruth.degradation import degrade
    from fieldtruth.experiment.files import read_signal

    start, signal = time.monotonic(), read_signal(options.signal)
    with show_progress() as progress:
        bag = degrade(
            options.run_path,
            options.out,
            signal=signal,
            workers=options.workers,
            overwrite=options.overwrite,
            progress=progress,
        )
    _print_bag(bag, start)


@contextmanager
def _engine(options: argparse.Namespace) -> "Iterator[ClusterEngine | None]":
    """Yield the cluster that is asked for; None for this process."""
    scheduler, processes = options.scheduler, options.local_cluster
    if scheduler is not None and processes is not None:
        raise UsageError("give either --scheduler or --local-cluster")
    if scheduler is None and processes is None:
        yield None
        return
    from fieldtruth.cluster import cluster_engine

    with cluster_engine(scheduler, processes) as engine:
        yield engine


def _list(options: argparse.Namespace) -> None:
    from fieldtruth.experiment.catalogue import list_robots
    from fieldtruth.experiment.names import list_experiments
    from fieldtruth.ontology import LABEL_MAPS
    from fieldtruth.world.environments import list_environments

    def sensors() -> dict[str, dict[str, str]]:
        from fieldtruth.sensors.configs import list_sensors  # its classes take half a second to load

        return list_sensors()

    def formats() -> dict[str, dict[str, str]]:
        from fieldtruth.exporters import FORMATS  # its readers of bags take half a second to load

        return {"export formats": {name: row.description for name, row in FORMATS.items()}}

    def campaigns() -> dict[str, dict[str, str]]:
        from fieldtruth.campaign.files import list_campaigns

        return {"campaigns": list_campaigns()}

    lists: dict[str, Callable[[], Mapping[str, Mapping[str, str]]]] = {
        "experiments": lambda: {"experiments": list_experiments()},
        "environments": lambda: {"environments": list_environments()},
        "campaigns": campaigns,
        "sensors": sensors,
        "robots": lambda: {"robots (rig.robot)": list_robots()},
        "label-maps": lambda: {"label maps": {name: f"{len(m.classes)} classes" for name, m in LABEL_MAPS.items()}},
        "formats": formats,
    }
    if options.what not in (None, *lists):
        raise UnknownNameError("list", options.what, lists)
    chosen = ("experiments", "environments") if options.what is None else (options.what,)
    for title, entries in (entry for name in chosen for entry in lists[name]().items()):
        if not entries:
            continue
        width = max(map(len, entries))
        print(f"{title}:")
        for name, description in entries.items():
            print(f"  {name:<{width}}  {description}".rstrip())


def _preview(options: argparse.Namespace) -> None:
    from fieldtruth.report.drawing.images import IMAGE_ENDINGS, is_jpeg, write_image

    environment, layout = chosen(options)
    path = f"{world_name(options.environment)}_{options.seed}_preview.png" if options.out is None else options.out
    path = output_path(path, endings=IMAGE_ENDINGS, parents=False, overwrite=options.overwrite)
    # After the checks: physics, compiled kernels and the drawing library take seconds to load.
    from fieldtruth.report.preview import WIDTH, WIDTH_IN_DOCUMENTS, preview

    with show_progress() as progress:
        sheet = preview(
            environment,
            options.seed,
            layout=layout,
            width=WIDTH_IN_DOCUMENTS if is_jpeg(path) else WIDTH,
            workers=options.workers,
            progress=progress,
        )
    write_image(path, sheet, overwrite=options.overwrite)
    print_output(path, f"{sheet.shape[1]} x {sheet.shape[0]} pixels")


def _shares(options: argparse.Namespace) -> None:
    from fieldtruth.experiment.files import with_overrides
    from fieldtruth.experiment.names import EXPERIMENTS, campaign_experiments

    if not options.experiments:
        raise UsageError(f"give experiments, all or every. Available: {', '.join(EXPERIMENTS)}")
    names = options.experiments
    if names in (["all"], ["every"]):
        names = campaign_experiments(every=names == ["every"])
    given = [with_overrides(checked_experiment(name), seed=options.seed) for name in names]
    experiments = [own for each in given for own in (list(map(each.of_robot, each.robots)) or [each])]
    from fieldtruth.report.shares import shares_of, shares_table

    with show_progress() as progress:
        shares = shares_of(experiments, workers=options.workers, progress=progress)
    counts = {name: found.as_dict() for name, found in shares.items()}
    print(json.dumps(counts) if options.json else shares_table(shares))


def _bench(options: argparse.Namespace) -> None:
    from fieldtruth.bench import measure, settings_of, table
    from fieldtruth.world.environments import ENVIRONMENTS

    names = list(ENVIRONMENTS) if options.environment == "all" else [options.environment]
    chosen = {name: settings_of(name) for name in names}
    with show_progress() as progress:
        found = {name: measure(settings, progress) for name, settings in chosen.items()}
    if options.environment != "all":
        (figures,) = found.values()
        print(json.dumps(figures) if options.json else table(figures))
    elif options.json:
        print(json.dumps(found))
    else:
        print("\n\n".join(f"{name}\n{table(figures)}" for name, figures in found.items()))


COMMANDS: Final = {
    "generate": _generate,
    "degrade": _degrade,
    "preview": _preview,
    "shares": _shares,
    "list": _list,
    "bench": _bench,
    "status": _status,
}
"""Sub-commands by name."""
