# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The command ``fieldtruth``. Each sub-command is one call of the library; an error is one line.

Exit codes: 0 done; 1 a run that fails validation, or runs of a campaign that failed; 2 an error that the user can
correct; 130 interrupted. Only light modules are imported at the top, so that ``--help``, ``list`` and errors are
immediate.
"""

import argparse
import shlex
import sys
import tomllib
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import resources
from typing import Any, Final, NoReturn

import fieldtruth
from fieldtruth.cli import generation, learning, live, processing, worlds
from fieldtruth.cli.arguments import Command, Parser, UsageError, add_arguments
from fieldtruth.cli.terminal import INTERRUPTED, interrupts, standard_streams
from fieldtruth.core.errors import FieldtruthError, FieldtruthWarning, UnknownNameError, warnings_in_one_line

USER_ERROR: Final = 2
_COMMANDS: Final[Mapping[str, Command]] = {
    **generation.COMMANDS,
    **live.COMMANDS,
    **learning.COMMANDS,
    **processing.COMMANDS,
    **worlds.COMMANDS,
}
RENAMED: Final = {
    ("bench", "--env"): "--environment",
    ("annotate", "--world"): "--environment",
    ("degrade", "--model"): "--signal",
    ("shares", "--all"): "all",
}
"""Present name of an option by command and earlier name."""
RESUMABLE: Final = ("generate", "annotate", "degrade", "cost")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line, by default that of the process, and return its exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    with standard_streams():
        return _run(arguments, restore=argv is not None)


def _run(arguments: Sequence[str], *, restore: bool) -> int:
    interrupted = f"interrupted{_resume_hint(arguments)}"
    try:
        with interrupts(f"error: {interrupted}", restore=restore), _flushed_output(), warnings_in_one_line():
            command, options = _parse(arguments)
            return command(options) or 0
    except FieldtruthError as error:
        return _fail(str(error), USER_ERROR)
    except KeyboardInterrupt:
        return _fail(interrupted, INTERRUPTED)


@contextmanager
def _flushed_output() -> Iterator[None]:
    """Write out what was printed, also where a text of help or version ends the process; raises OutputError."""
    try:
        yield
    except SystemExit:
        sys.stdout.flush()
        raise
    sys.stdout.flush()


def _fail(message: str, code: int) -> int:
    print("error:", " ".join(message.split()), file=sys.stderr)
    return code


def _resume_hint(arguments: Sequence[str]) -> str:
    if not arguments or arguments[0] not in RESUMABLE:
        return ""
    # --overwrite would discard the finished part.
    again = shlex.join(["fieldtruth", *(a for a in arguments if a != "--overwrite")])
    return f"; the finished part is kept, resume with: {again}"


def _parse(arguments: Sequence[str]) -> tuple[Command, argparse.Namespace]:
    parser, commands = _build_parser()
    if not arguments:
        raise UsageError(f"no command given; see fieldtruth --help. Available: {', '.join(commands)}")
    if not arguments[0].startswith("-") and arguments[0] not in commands:
        raise UnknownNameError("command", arguments[0], commands)
    options, unknown = parser.parse_known_args(_renamed(arguments))
    if unknown:
        _reject(unknown[0], commands.get(arguments[0], parser))
    run: Command = options.run
    return run, options


def _renamed(arguments: Sequence[str]) -> list[str]:
    """Return the arguments with the present names of options, and warn of earlier ones."""
    renamed = [*arguments]
    for k, argument in enumerate(arguments):
        old, equals, value = argument.partition("=")
        if new := RENAMED.get((arguments[0], old)):
            warnings.warn(f"{old} is now called {new}", FieldtruthWarning, stacklevel=2)
            renamed[k] = new + equals + value
    return renamed


def _reject(argument: str, parser: argparse.ArgumentParser) -> NoReturn:
    if argument.startswith("-"):
        known = [o for action in parser._actions for o in action.option_strings if o.startswith("--")]
        raise UnknownNameError("option", argument.partition("=")[0], known)
    raise UsageError(f"unexpected argument {argument!r}")


def _build_parser() -> tuple[Parser, dict[str, Parser]]:
    table = tomllib.loads(resources.files(__name__).joinpath("commands.toml").read_text(encoding="utf-8"))
    layout: dict[str, Any] = {"formatter_class": argparse.RawDescriptionHelpFormatter, "allow_abbrev": False}
    parser = Parser(
        prog="fieldtruth",
        description="Make automatically labelled data sets of a ground robot in natural environments.",
        epilog=table["generate"]["epilog"],
        **layout,
    )
    parser.add_argument("--version", action=_Version)
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND")
    for name, row in table.items():
        text, epilog = row["help"], row.get("epilog")
        command: Parser = subparsers.add_parser(name, help=text, description=text, epilog=epilog, **layout)
        command.set_defaults(run=_COMMANDS[name])
        add_arguments(command, row["arguments"])
    return parser, dict(subparsers.choices)


class _Version(argparse.Action):
    """Prints the version, and reads it only then, because reading the metadata is slow."""

    def __init__(self, option_strings: Sequence[str], dest: str) -> None:
        super().__init__(option_strings, dest, nargs=0, help="show the version and exit")

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(f"fieldtruth {fieldtruth.__version__}")
        parser.exit()
