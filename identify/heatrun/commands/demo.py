"""`heatrun demo`: the main job on bundled data."""

import argparse
from pathlib import Path
from typing import Any

from ..errors import InputError
from . import words
from .calibrate import calibrate_into_folder


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser("demo", help="the main job on bundled data")
    words.add(
        parser, "--seed", "--quick", "--out: run folder (default: results/runs/demo)", "--force",
        "--verbose: all networks, how they were sampled, columns and notes", "--json",
    )  # fmt: skip
    return parser


def run(options: argparse.Namespace) -> int:
    """Calibrate both orders on a duty and predict a load step."""
    from ..model.network_text import networks_of
    from ..motor.file import load_motor

    folder = bundled("synthetic")
    return calibrate_into_folder(
        options,
        load_motor(folder / "motor.toml"),
        [folder / "duty_90min.csv.gz"],
        [folder / "step_90min.csv.gz"],
        networks_of("both"),
        Path("results") / "runs" / "demo",
    )


def bundled(name: str) -> Path:
    """Return the folder of a bundled data set.

    Raises:
        InputError: If this installation has none.
    """
    here = Path(__file__).resolve()
    for folder in (here.parents[1] / "data" / name, here.parents[3] / "data" / name):
        if folder.is_dir():
            return folder
    raise InputError(
        f"the bundled data set {name!r} is not part of this installation.",
        remedy="Install heatrun from its wheel or run it in a checkout.",
    )
