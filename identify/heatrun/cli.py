"""The command line: parse, call one function, print."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module

from .commands import COMMANDS
from .commands.exit_codes import DONE, INTERRUPTED, NOT_ALLOWED, WRONG_USE
from .errors import InputError, UsageError
from .runtime import cache_compilations, one_thread_for_small_matrices


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code.

    Args:
        arguments: The words after `heatrun`; those of the process if None.
    """
    words = sys.argv[1:] if arguments is None else list(arguments)
    options = _parser().parse_args(words)
    options.command_line = " ".join(["heatrun", *words])
    cache_compilations()
    one_thread_for_small_matrices()

    try:
        return int(options.run_command(options))
    except UsageError as error:
        print(f"heatrun: {error}", file=sys.stderr)
        return WRONG_USE
    except InputError as error:
        from .commands.console import print_error

        print_error(error, as_json=getattr(options, "json", False))
        return NOT_ALLOWED
    except KeyboardInterrupt:
        print("heatrun: interrupted; the same command goes on from here.", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        return DONE


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="heatrun",
        description="Thermal networks of electric motors from bench transients, with ranges.",
    )
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name in COMMANDS:
        command = import_module(f".commands.{name}", __package__)
        command.add_parser(subparsers).set_defaults(run_command=command.run)
    return parser


if __name__ == "__main__":
    sys.exit(main())
