# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The command ``fieldtruth``: a thin coat. Each sub-command is one call of the library; a user's mistake is one line.

Exit codes: 0 done; 2 something the user can repair; 130 interrupted. Only light modules are imported at the top, so
that ``--help``, ``list`` and every mistake answer at once.
"""

import argparse
import os
import shlex
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NoReturn

import fieldtruth
from fieldtruth.errors import FieldtruthError, UnknownNameError, nearest_first

INTERRUPTED: Final = 130
MISTAKE: Final = 2

EXAMPLES: Final = """\
examples:
  fieldtruth list                                  what there is
  fieldtruth generate park_1 --seconds 5           five seconds of the first experiment, in data/park_1
  fieldtruth generate park_1 --no-cameras          LiDAR, IMU, GNSS and tachometers alone: minutes, not hours
  fieldtruth generate data/park_1/experiment.yaml --out again     the same bag once more
  fieldtruth preview park --seed 7                 one picture of the place, its routes, views, cloud and classes
"""


class UsageError(FieldtruthError):
    """The command line itself is wrong."""


class _Parser(argparse.ArgumentParser):
    """Reports a mistake as an exception instead of printing its usage and ending the process."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(message)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line (by default the process's) and return its exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        command, options = _parse(arguments)
        command(options)
    except FieldtruthError as error:
        return _fail(str(error), MISTAKE)
    except KeyboardInterrupt:
        return _fail(_how_to_resume(arguments), INTERRUPTED)
    return 0


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _fail(message: str, code: int) -> int:
    print("fieldtruth:", " ".join(message.split()), file=sys.stderr)
    return code


def _how_to_resume(arguments: Sequence[str]) -> str:
    if arguments[:1] != ["generate"]:
        return "interrupted"
    # --overwrite would throw away what is to be kept.
    again = shlex.join(["fieldtruth", *(a for a in arguments if a != "--overwrite")])
    return f"interrupted; what is finished is kept, the same command goes on from there: {again}"


# ---------------------------------------------------------------------------------------------------------------------
# Sub-commands


def _generate(options: argparse.Namespace) -> None:
    from fieldtruth.experiment.files import load_experiment, with_overrides

    experiment = with_overrides(
        load_experiment(options.experiment),
        seconds=options.seconds,
        seed=options.seed,
        cameras=False if options.no_cameras else None,
        lidar=False if options.no_lidar else None,
    )
    start = time.monotonic()
    # After the checks: compiled kernels and physics take a second to load.
    from fieldtruth.pipeline import generate
    from fieldtruth.record.read import count_messages
    from fieldtruth.report.progress import show_progress

    with show_progress() as progress:
        bag = generate(experiment, options.out, workers=options.workers, overwrite=options.overwrite, progress=progress)
    took = time.monotonic() - start
    counts = count_messages(bag)
    print(
        f"{bag}: {sum(counts.values())} messages of {len(counts)} topics, {bag.stat().st_size / 1e6:.1f} MB; "
        f"this run took {took:.0f} s"
    )


def _list(options: argparse.Namespace) -> None:
    from fieldtruth.experiment.catalogue import list_environments, list_experiments

    for title, entries in (("experiments", list_experiments()), ("environments", list_environments())):
        width = max(map(len, entries), default=0)
        print(f"{title}:")
        for name, description in entries.items():
            print(f"  {name:<{width}}  {description}".rstrip())


def _preview(options: argparse.Namespace) -> None:
    from fieldtruth.experiment.catalogue import environment_names
    from fieldtruth.report.image_file import check_image_path, is_jpeg, write_image

    if options.environment not in environment_names():
        raise UnknownNameError("environment", options.environment, environment_names())
    path = options.out if options.out is not None else Path(f"{options.environment}_{options.seed}_preview.png")
    check_image_path(path, overwrite=options.overwrite)
    # After the checks: physics, compiled kernels and the drawing library take seconds to load.
    from fieldtruth.report.preview import WIDTH, WIDTH_IN_DOCUMENTS, preview
    from fieldtruth.report.progress import show_progress

    width = WIDTH_IN_DOCUMENTS if is_jpeg(path) else WIDTH
    with show_progress() as progress:
        sheet = preview(options.environment, options.seed, width=width, workers=options.workers, progress=progress)
    write_image(path, sheet, overwrite=options.overwrite)
    print(f"{path}: {sheet.shape[1]} x {sheet.shape[0]} pixels, {path.stat().st_size / 1e6:.1f} MB")


def _shares(options: argparse.Namespace) -> None:
    import json

    from fieldtruth.experiment.catalogue import experiment_names
    from fieldtruth.experiment.files import load_experiment, with_overrides

    if options.all == bool(options.experiments):
        raise UsageError(f"needed is --all or at least one experiment; there is: {', '.join(experiment_names())}")
    names = experiment_names() if options.all else options.experiments
    experiments = [with_overrides(load_experiment(name), seed=options.seed) for name in names]
    from fieldtruth.report.progress import show_progress
    from fieldtruth.report.shares import shares_of, shares_table

    with show_progress() as progress:
        shares = shares_of(experiments, workers=options.workers, progress=progress)
    counts = {name: found.as_dict() for name, found in shares.items()}
    print(json.dumps(counts) if options.json else shares_table(shares))


def _bench(options: argparse.Namespace) -> None:
    import json

    from fieldtruth.bench import run, run_all, settings_of, table, table_of_all
    from fieldtruth.report.progress import show_progress

    if options.env == "all":
        with show_progress() as progress:
            everything = run_all(progress)
        print(json.dumps(everything) if options.json else table_of_all(everything))
        return
    settings = settings_of(options.env)
    with show_progress() as progress:
        figures = run(settings, progress)
    print(json.dumps(figures) if options.json else table(figures))


# ---------------------------------------------------------------------------------------------------------------------
# Arguments

Command = Callable[[argparse.Namespace], None]


def _parse(arguments: Sequence[str]) -> tuple[Command, argparse.Namespace]:
    parser, commands = _build_parser()
    if not arguments:
        raise UsageError(f"no command; there is: {', '.join(commands)} (fieldtruth --help tells more)")
    if not arguments[0].startswith("-") and arguments[0] not in commands:
        raise UnknownNameError("command", arguments[0], commands)
    options, unknown = parser.parse_known_args(arguments)
    if unknown:
        _refuse(unknown[0], commands.get(arguments[0], parser))
    run: Command = options.run
    return run, options


def _refuse(argument: str, parser: argparse.ArgumentParser) -> NoReturn:
    if argument.startswith("-"):
        name = argument.partition("=")[0]
        known = [o for action in parser._actions for o in action.option_strings if o.startswith("--")]
        raise UsageError(f"no option {name!r}; there is: {', '.join(nearest_first(name, known))}")
    raise UsageError(f"one argument too many: {argument!r}")


def _build_parser() -> tuple[_Parser, dict[str, _Parser]]:
    layout = argparse.RawDescriptionHelpFormatter
    parser = _Parser(
        prog="fieldtruth",
        description="Make automatically annotated data sets of a ground robot in natural environments.",
        epilog=EXAMPLES,
        formatter_class=layout,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action=_Version)
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND")

    def command(name: str, run: Command, help_text: str, epilog: str | None = None) -> _Parser:
        made: _Parser = subparsers.add_parser(
            name, help=help_text, description=help_text, epilog=epilog, formatter_class=layout, allow_abbrev=False
        )
        made.set_defaults(run=run)
        return made

    generate = command("generate", _generate, "Drive, sense, label and write the bag.", EXAMPLES)
    generate.add_argument(
        "experiment", metavar="EXPERIMENT", help="a name that `fieldtruth list` shows, or a YAML file"
    )
    generate.add_argument("--out", metavar="DIR", type=Path, default=Path("data"), help="folder of data sets (data)")
    generate.add_argument("--seconds", metavar="S", type=_number, help="end after this much simulated time")
    generate.add_argument(
        "--seed", metavar="N", type=_whole_number, help="of everything random; another seed, another world"
    )
    _add_workers(generate, "threads (all cores); the bag is the same")
    generate.add_argument("--no-cameras", action="store_true", help="leave the stereo pair out")
    generate.add_argument("--no-lidar", action="store_true", help="leave the LiDAR out")
    generate.add_argument(
        "--overwrite", action="store_true", help="throw away what the output folder holds of this run"
    )

    _add_preview(command("preview", _preview, "Draw one sheet that shows an environment."))
    _add_shares(command("shares", _shares, "Count which class how many pixels and points belong to."))
    command("list", _list, "Show the experiments and the environments.")
    bench = command("bench", _bench, "Measure the speed on this machine.")
    bench.add_argument("--env", metavar="NAME", default="park", help="environment (park), or all of them: all")
    bench.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    return parser, dict(subparsers.choices)


def _add_preview(preview: _Parser) -> None:
    preview.add_argument("environment", metavar="ENV", help="a name that `fieldtruth list` shows")
    preview.add_argument("--seed", metavar="N", type=_seed, default=0, help="of everything random (0)")
    preview.add_argument(
        "--out", metavar="FILE", type=Path, help="a .png, or a .jpg below 400 kB (ENV_SEED_preview.png)"
    )
    preview.add_argument("--overwrite", action="store_true", help="replace the file if it is there")
    _add_workers(preview, "threads (all cores); the sheet is the same")


def _add_shares(shares: _Parser) -> None:
    shares.add_argument(
        "experiments", metavar="EXPERIMENT", nargs="*", help="names that `fieldtruth list` shows, or YAML files"
    )
    shares.add_argument("--all", action="store_true", help="every experiment that ships with the package")
    shares.add_argument("--seed", metavar="N", type=_seed, help="of everything random; another seed, another world")
    shares.add_argument("--json", action="store_true", help="counts as one JSON object instead of tables in percent")
    _add_workers(shares, "threads (all cores); the counts are the same")


def _add_workers(parser: _Parser, help_text: str) -> None:
    parser.add_argument("--workers", metavar="N", type=_count, default=available_cores(), help=help_text)


class _Version(argparse.Action):
    """Prints the version; asks for it late, because the metadata take time to read."""

    def __init__(self, option_strings: Sequence[str], dest: str) -> None:
        super().__init__(option_strings, dest, nargs=0, help="show the version and exit")

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(f"fieldtruth {fieldtruth.__version__}")
        parser.exit()


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no number") from None


def _whole_number(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number") from None


def _seed(text: str) -> int:
    number = _whole_number(text)
    if not 0 <= number < 2**63:
        raise argparse.ArgumentTypeError(f"{text} is not allowed; allowed is a whole number from 0 up to 2^63 - 1")
    return number


def _count(text: str) -> int:
    number = _whole_number(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} is below 1")
    return number


if __name__ == "__main__":
    sys.exit(main())
