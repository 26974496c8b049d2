"""The command line: parse, call one function, print."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from .errors import InputError, UsageError
from .runtime import cache_compilations

DONE, NOT_ALLOWED, WRONG_USE, INTERRUPTED = 0, 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code.

    Args:
        arguments: The words after `heatrun`; those of the process if None.
    """
    words = sys.argv[1:] if arguments is None else list(arguments)
    options = _parser().parse_args(words)
    options.command_line = " ".join(["heatrun", *words])
    cache_compilations()
    from . import commands

    try:
        return int(getattr(commands, options.command)(options))
    except UsageError as error:
        print(f"heatrun: {error}", file=sys.stderr)
        return WRONG_USE
    except InputError as error:
        commands.print_error(error, as_json=getattr(options, "json", False))
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
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    check = commands.add_parser("check", help="findings about the records, before any fit")
    _add_inputs(check)
    _add_json(check)

    for name, text in (
        ("calibrate", "parameters with ranges, bands, verdict and parameter sheet"),
        ("compare", "first against second order on the same records"),
    ):
        command = commands.add_parser(name, help=text)
        _add_inputs(command)
        command.add_argument(
            "--holdout", nargs="+", type=Path, default=[], metavar="TEST", help="predict only"
        )
        if name == "calibrate":
            command.add_argument(
                "--model", choices=("first", "second", "both"), default="both", help="order"
            )
            command.add_argument(
                "--rating",
                action="append",
                default=[],
                metavar="S2-MIN|S3-PCT",
                help="current of a duty type at the insulation limit, such as S2-30 or S3-40",
            )
        _add_sampling(command)
        _add_out(command, "run folder (default: results/runs/NAME)")
        _add_json(command)

    discover = commands.add_parser(
        "discover", help="where model and measurement disagree, and what is missing"
    )
    _add_inputs(discover)
    discover.add_argument(
        "--holdout", nargs="+", type=Path, default=[], metavar="TEST", help="predict only"
    )
    discover.add_argument(
        "--model", choices=("first", "second"), default="second", help="order of the base network"
    )
    discover.add_argument(
        "--effects",
        action="append",
        type=Path,
        default=[],
        metavar="FILE.py",
        help="effects of your own, searched beside the catalogue; the file is run",
    )
    _add_sampling(discover)
    _add_out(discover, "run folder (default: results/runs/NAME)")
    _add_json(discover)

    simulate = commands.add_parser("simulate", help="a virtual prototype's record")
    simulate.add_argument("motor", type=Path, metavar="MOTOR.toml")
    simulate.add_argument(
        "source", metavar="RUN_OR_PARAMETERS", help="run folder, or a TOML file of parameters"
    )
    simulate.add_argument("tests", nargs="+", type=Path, metavar="TEST")
    simulate.add_argument("--model", choices=("first", "second"), default="second")
    simulate.add_argument("--seed", type=int, default=0)
    _add_out(simulate, "folder for the CSV files (default: here)")
    _add_json(simulate)

    sheet = commands.add_parser("sheet", help="parameter sheet of a run, again")
    sheet.add_argument("run", type=Path, metavar="RUN")
    _add_out(sheet, "folder for the sheet (default: the run itself)")
    _add_json(sheet)

    demo = commands.add_parser("demo", help="the main job on bundled data")
    _add_sampling(demo)
    _add_out(demo, "run folder (default: results/runs/demo)")
    _add_json(demo)
    return parser


def _add_inputs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("motor", type=Path, metavar="MOTOR.toml", help="the motor file")
    parser.add_argument(
        "tests",
        nargs="+",
        type=Path,
        metavar="TEST",
        help="bench files; TEMPERATURES+DRIVE@10Hz joins two loggers",
    )


def _add_sampling(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--seed", type=int, default=0, help="of everything that is drawn")
    parser.add_argument(
        "--quick", action="store_true", help="weighted draws instead of emcee where they hold"
    )


def _add_out(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument("--out", type=Path, default=None, metavar="DIR", help=text)


def _add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")


if __name__ == "__main__":
    sys.exit(main())
