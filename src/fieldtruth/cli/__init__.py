# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The command ``fieldtruth``: a thin coat. Each sub-command is one call of the library; a user's mistake is one line.

Exit codes: 0 done; 1 a run that fails its check; 2 something the user can repair; 130 interrupted. Only light modules
are imported at the top, so that ``--help``, ``list`` and every mistake answer at once.
"""

import argparse
import shlex
import sys
from collections.abc import Sequence
from typing import Final, NoReturn

import fieldtruth
from fieldtruth.cli import making, using
from fieldtruth.cli.arguments import Command, Parser, UsageError
from fieldtruth.core.errors import FieldtruthError, UnknownNameError, nearest_first

INTERRUPTED: Final = 130
MISTAKE: Final = 2


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line (by default the process's) and return its exit code."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        command, options = _parse(arguments)
        return command(options) or 0
    except FieldtruthError as error:
        return _fail(str(error), MISTAKE)
    except KeyboardInterrupt:
        return _fail(_how_to_resume(arguments), INTERRUPTED)


def _fail(message: str, code: int) -> int:
    print("fieldtruth:", " ".join(message.split()), file=sys.stderr)
    return code


def _how_to_resume(arguments: Sequence[str]) -> str:
    if arguments[:1] not in (["generate"], ["annotate"]):
        return "interrupted"
    # --overwrite would throw away what is to be kept.
    again = shlex.join(["fieldtruth", *(a for a in arguments if a != "--overwrite")])
    return f"interrupted; what is finished is kept, the same command goes on from there: {again}"


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


def _build_parser() -> tuple[Parser, dict[str, Parser]]:
    layout = argparse.RawDescriptionHelpFormatter
    parser = Parser(
        prog="fieldtruth",
        description="Make automatically annotated data sets of a ground robot in natural environments.",
        epilog=making.EXAMPLES,
        formatter_class=layout,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action=_Version)
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND")

    def command(name: str, run: Command, help_text: str, epilog: str | None = None) -> Parser:
        made: Parser = subparsers.add_parser(
            name, help=help_text, description=help_text, epilog=epilog, formatter_class=layout, allow_abbrev=False
        )
        made.set_defaults(run=run)
        return made

    making.add_commands(command)
    using.add_commands(command)
    return parser, dict(subparsers.choices)


class _Version(argparse.Action):
    """Prints the version; asks for it late, because the metadata take time to read."""

    def __init__(self, option_strings: Sequence[str], dest: str) -> None:
        super().__init__(option_strings, dest, nargs=0, help="show the version and exit")

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(f"fieldtruth {fieldtruth.__version__}")
        parser.exit()
