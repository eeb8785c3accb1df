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

from fieldtruth.cli.arguments import AddCommand, Parser, UsageError, add_workers, changes, count, number, seed, words
from fieldtruth.cli.terminal import print_line, print_output
from fieldtruth.core.errors import FieldtruthWarning, UnknownNameError
from fieldtruth.core.files import output_folder, output_path
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import show_progress

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from contextlib import AbstractContextManager

    from fieldtruth.campaign.state import State
    from fieldtruth.cluster.engine import ClusterEngine
    from fieldtruth.experiment.config import Experiment

FAILED: Final = 1
"""Exit code of a campaign with runs that failed."""
_STATUS_FORMATS: Final = ("text", "json", "lines", "slurm")
_ONLY_CAMPAIGNS: Final = {"jobs": None, "shard": None, "no_estimate": False}
EXAMPLES: Final = """\
examples:
  fieldtruth list                                  experiments and environments
  fieldtruth generate park_1 --seconds 5           five seconds of park_1, in data/park_1
  fieldtruth generate park_1 --no-cameras          only LiDAR, IMU, GNSS and tachometers: minutes, not hours
  fieldtruth generate all --jobs 2 --seconds 60    a minute of each experiment, in data/all, two at a time
  fieldtruth generate data/park_1/experiment.yaml --out again     the same bag again
  fieldtruth preview park --seed 7                 a sheet: map, routes, views, point cloud and classes
"""


def _refuse_campaign_options(options: argparse.Namespace) -> None:
    """Refuse the options of campaigns; raises UsageError."""
    for name, default in _ONLY_CAMPAIGNS.items():
        if getattr(options, name) != default:
            raise UsageError(f"--{name.replace('_', '-')} is for campaigns; {options.experiment} is one experiment")


def _generate_campaign(options: argparse.Namespace, cluster: "AbstractContextManager[ClusterEngine | None]") -> int:
    """Make a campaign, or what is left of it, on a cluster if it is one; the exit code says whether runs failed."""
    from fieldtruth.campaign.draw import Shard, parse_shard
    from fieldtruth.campaign.files import check_campaign, load_campaign, with_changes

    campaign = with_changes(load_campaign(options.experiment), **changes(options))
    check_campaign(campaign, options.experiment)
    shard = Shard(1, 1) if options.shard is None else parse_shard(options.shard)
    # After the checks: compiled kernels and physics take a second to load.
    from fieldtruth import pipeline
    from fieldtruth.campaign.state import Kind
    from fieldtruth.campaign.task import Options, generate_campaign
    from fieldtruth.core.progress import show_progress

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
    from fieldtruth.campaign.draw import Shard, draw
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
    print(_TEXTS[options.format](options.folder, [state for state, _ in shown], [i for _, i in shown]))


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


def _text(folder: Path, states: "Sequence[State]", _: Sequence[int]) -> str:
    from fieldtruth.campaign.state import Kind, clock, counts, size, time_left_s

    running = sum(state.kind is Kind.RUNNING for state in states)
    left_s = time_left_s(states, running)
    left = f"; about {clock(left_s)} left with {max(1, running)} at a time" if left_s else ""
    made = sum(state.manifest.bytes for state in states if state.manifest is not None)
    head = f"{folder}: {counts(states)}; {size(made)}{left}"
    rows = [f"  {s.kind:<7}  {s.run.name}{': ' * bool(s.reason)}{s.reason}" for s in states if s.kind is not Kind.DONE]
    return "\n".join([head, *rows])


def _json(folder: Path, states: "Sequence[State]", _: Sequence[int]) -> str:
    return json.dumps([{"run": s.run.name, "state": s.kind, "reason": s.reason} for s in states])


def _lines(folder: Path, states: "Sequence[State]", _: Sequence[int]) -> str:
    return "\n".join(state.run.name for state in states)


def _slurm(folder: Path, states: "Sequence[State]", shards: Sequence[int]) -> str:
    from fieldtruth.campaign.draw import ranges

    return ranges(shards)


_TEXTS: Final = {"text": _text, "json": _json, "lines": _lines, "slurm": _slurm}


def _checked_experiment(name_or_path: str) -> "Experiment":
    from fieldtruth.experiment.files import load_experiment
    from fieldtruth.world.build import check_experiment

    experiment = load_experiment(name_or_path)
    check_experiment(experiment, name_or_path)
    return experiment


def _generate(options: argparse.Namespace) -> int | None:
    from fieldtruth.campaign.files import is_campaign

    if is_campaign(options.experiment):
        return _generate_campaign(options, _engine(options))
    _refuse_campaign_options(options)
    _generate_one(options)
    return None


def _generate_one(options: argparse.Namespace) -> None:
    from fieldtruth.experiment.files import with_overrides

    experiment = with_overrides(_checked_experiment(options.experiment), **changes(options))
    start = time.monotonic()
    # After the checks: compiled kernels and physics take a second to load.
    from fieldtruth.pipeline import generate_by

    with _engine(options) as engine, show_progress() as progress:
        bag = generate_by(
            engine,
            experiment,
            "data" if options.out is None else options.out,
            workers=options.workers or cpu_count(),
            overwrite=options.overwrite,
            progress=progress,
        )
    _print_bag(bag, start)


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

    lists: dict[str, Callable[[], Mapping[str, Mapping[str, str]]]] = {
        "experiments": lambda: {"experiments": list_experiments()},
        "environments": lambda: {"environments": list_environments()},
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
    from fieldtruth.world.environments import ENVIRONMENTS

    ENVIRONMENTS.find(options.environment)
    path = f"{options.environment}_{options.seed}_preview.png" if options.out is None else options.out
    path = output_path(path, endings=IMAGE_ENDINGS, parents=False, overwrite=options.overwrite)
    # After the checks: physics, compiled kernels and the drawing library take seconds to load.
    from fieldtruth.report.preview import WIDTH, WIDTH_IN_DOCUMENTS, preview

    width = WIDTH_IN_DOCUMENTS if is_jpeg(path) else WIDTH
    with show_progress() as progress:
        sheet = preview(options.environment, options.seed, width=width, workers=options.workers, progress=progress)
    write_image(path, sheet, overwrite=options.overwrite)
    print_output(path, f"{sheet.shape[1]} x {sheet.shape[0]} pixels")


def _shares(options: argparse.Namespace) -> None:
    from fieldtruth.experiment.files import with_overrides
    from fieldtruth.experiment.names import EXPERIMENTS

    if not options.experiments:
        raise UsageError(f"give experiments, or all. Available: {', '.join(EXPERIMENTS)}")
    names = list(EXPERIMENTS) if options.experiments == ["all"] else options.experiments
    experiments = [with_overrides(_checked_experiment(name), seed=options.seed) for name in names]
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


# ---------------------------------------------------------------------------------------------------------------------
# Arguments


def add_commands(command: AddCommand) -> None:
    """Add the sub-commands."""
    _add_generate(command("generate", _generate, "Simulate an experiment and write the bag.", EXAMPLES))
    degrade = command("degrade", _degrade, "Add to a finished run what real sensors add: the bag of generate --signal.")
    degrade.add_argument("run_path", metavar="RUN", type=Path, help="folder of a run, or its bag")
    degrade.add_argument("--signal", metavar="SIGNAL", default="datasheet", help="datasheet (default) or a YAML FILE")
    degrade.add_argument("--out", metavar="DIR", required=True, help="folder of data sets")
    degrade.add_argument("--overwrite", action="store_true", help="discard an existing run in the output folder")
    add_workers(degrade, "the bag")

    _add_preview(command("preview", _preview, "Draw an overview sheet of an environment."))
    _add_shares(command("shares", _shares, "Count the pixels and points of each class."))
    lists = command(
        "list",
        _list,
        "List the experiments and environments, or the sensors, robots, label maps or formats that have a name.",
    )
    lists.add_argument(
        "what",
        metavar="LIST",
        nargs="?",
        help="experiments, environments (these two), sensors, robots, label-maps or formats",
    )
    time = "It takes about a minute; the first run adds up to three, to build world and light and to compile kernels."
    bench = command("bench", _bench, "Measure the speed of this machine.", time)
    bench.add_argument(
        "--environment", metavar="ENVIRONMENT", default="park", help="name from `fieldtruth list`, or all (park)"
    )
    bench.add_argument("--json", action="store_true", help="JSON instead of a table")
    _add_status(command("status", _status, "Show which runs of a campaign are done."))


def _add_generate(generate: Parser) -> None:
    generate.add_argument(
        "experiment", metavar="EXPERIMENT", help="name from `fieldtruth list`, all, or a YAML file, also of a campaign"
    )
    generate.add_argument("--out", metavar="DIR", help="folder for data sets (data), or of the campaign (data/NAME)")
    generate.add_argument("--seconds", metavar="S", type=number, help="end after this simulated time")
    generate.add_argument("--seed", metavar="N", type=seed, help="root of all randomness")
    add_workers(generate, "the bag")
    generate.set_defaults(workers=None)  # all cores, shared by the jobs of a campaign
    generate.add_argument(
        "--scheduler", metavar="ADDRESS", help="make it on a Dask cluster: tcp://host:8786, or a scheduler file"
    )
    generate.add_argument("--local-cluster", metavar="N", type=count, help="make it in N processes of this machine")
    generate.add_argument("--no-cameras", action="store_true", help="without the stereo pair")
    generate.add_argument("--no-lidar", action="store_true", help="without the LiDAR")
    generate.add_argument(
        "--extras",
        metavar="LIST",
        type=words,
        help="more images of each camera, separated by commas: depth, instances, normals, flow",
    )
    generate.add_argument(
        "--signal", metavar="SIGNAL", help="ideal, datasheet, robot or FILE: readings as of real sensors"
    )
    generate.add_argument("--light", metavar="NAME", help="preset of the light, such as overcast; see docs/light.md")
    generate.add_argument("--overwrite", action="store_true", help="discard an existing run in the output folder")
    _add_campaign_arguments(generate)


def _add_preview(preview: Parser) -> None:
    preview.add_argument("environment", metavar="ENVIRONMENT", help="name from `fieldtruth list`")
    preview.add_argument("--seed", metavar="N", type=seed, default=0, help="root of all randomness (0)")
    preview.add_argument("--out", metavar="FILE", help=".png file, or .jpg below 400 kB (ENVIRONMENT_SEED_preview.png)")
    preview.add_argument("--overwrite", action="store_true", help="replace an existing file")
    add_workers(preview, "the sheet")


def _add_shares(shares: Parser) -> None:
    shares.add_argument(
        "experiments", metavar="EXPERIMENT", nargs="*", help="names from `fieldtruth list`, all, or YAML files"
    )
    shares.add_argument("--seed", metavar="N", type=seed, help="root of all randomness")
    shares.add_argument("--json", action="store_true", help="counts as JSON instead of tables in percent")
    add_workers(shares, "the result")


def _add_campaign_arguments(generate: Parser) -> None:
    """Add the options of ``generate`` that are for campaigns only."""
    group = generate.add_argument_group("campaigns")
    group.add_argument(
        "--jobs", metavar="N", type=count, help="runs side by side, each in a process (1), or on a cluster"
    )
    group.add_argument("--shard", metavar="I/N", help="only part I of N, counted from 1")
    group.add_argument("--no-estimate", action="store_true", help="start without measuring time, bytes and memory")


def _add_status(status: Parser) -> None:
    status.add_argument("folder", metavar="DIR", type=Path, help="folder of the campaign")
    status.add_argument("--missing", action="store_true", help="only runs that the same command would make")
    status.add_argument(
        "--format", metavar="NAME", default="text", help="text or json; with --missing also lines or slurm"
    )
    status.add_argument(
        "--shards", metavar="N", type=count, help="number of shards to which slurm's array refers (one per run)"
    )
    status.add_argument("--checksums", action="store_true", help="read all bags instead of their size and index")
