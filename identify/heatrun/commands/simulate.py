"""`heatrun simulate`: a virtual prototype's record."""

import argparse
from pathlib import Path
from typing import Any

from . import words
from .console import DONE, printable, say


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser("simulate", help="simulate a virtual prototype along tests")
    parser.add_argument("motor", type=Path, metavar="MOTOR.toml", help="the motor file")
    parser.add_argument(
        "source",
        metavar="RUN_OR_PARAMETERS",
        help="run folder, or a file of parameters: TOML, or the prova.mat of an export",
    )
    parser.add_argument(
        "tests",
        nargs="+",
        type=Path,
        metavar="TEST",
        help="bench files whose current, losses and sink drive the model",
    )
    parser.add_argument(
        "--model",
        metavar="first|second|FILE.toml",
        help="network of the parameters, or one of the run's (default: the run's last one; "
        "second for a TOML file)",
    )
    folder = "folder for the CSV files (default: here)"
    words.add(parser, "--seed", f"--out: {folder}", "--force", "--json")
    return parser


def run(options: argparse.Namespace) -> int:
    """Write a CSV file for every test and print how far it is from the measured winding."""
    from ..motor.file import load_motor
    from ..results import to_json
    from ..simulation import simulate_file

    motor = load_motor(options.motor)
    rows = [
        simulate_file(
            motor,
            options.source,
            path,
            options.model,
            options.out,
            options.seed,
            is_replacing=options.force,
        )
        for path in options.tests
    ]
    for note in dict.fromkeys(note for row in rows for note in row["notes"]):
        say(note)
    if options.json:
        print(to_json({"simulated": rows}))
    else:
        for row in rows:
            error = "" if row["rmse_K"] is None else f", RMSE {row['rmse_K']:.2f} K"
            model = ", ".join([row["network"], *row["effects"]])
            print(f"{printable(row['file'])}: {row['num_rows']} rows ({model}){error}")
    return DONE
