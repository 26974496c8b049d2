"""`heatrun export`: a run's model and record for other programs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from . import words
from .console import printable, say
from .exit_codes import DONE


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser("export", help="a run for MATLAB, Simulink and Octave")
    parser.add_argument("run", type=Path, metavar="RUN", help="run folder")
    parser.add_argument(
        "--to",
        choices=("mat",),
        required=True,
        help="mat: prova.mat with run_prova.m for the built-in networks; network.mat with "
        "run_network.m for any other and for models with effects",
    )
    parser.add_argument(
        "--test", metavar="NAME", help="test of the run (default: the first calibrated on)"
    )
    parser.add_argument(
        "--model", metavar="NAME", help="network of the run (default: its last one)"
    )
    parser.add_argument(
        "--corrected",
        action="store_true",
        help="correct Is, Pd and Te by the estimated errors of current, losses, sink and timing",
    )
    words.add_out(parser, "folder for the files (default: the run itself)")
    words.add_json(parser)
    return parser


def run(options: argparse.Namespace) -> int:
    """Write the files and print what is in them."""
    from ..export import export_mat
    from ..results import to_json

    written = export_mat(
        options.run,
        folder=options.out,
        test=options.test,
        network=options.model,
        is_corrected=options.corrected,
    )
    for note in written["notes"]:
        say(note)
    for finding in written["findings"]:
        sentence = f"{finding.where}: {finding.message} {finding.remedy}"
        print(f"warning {printable(sentence)}", file=sys.stderr)
    if options.json:
        print(to_json(written))
        return DONE
    samples = written["variables"]["t"]["shape"][0]
    effects = f" with {', '.join(written['effects'])}" if written["effects"] else ""
    print(
        f"{len(written['variables'])} variables, {samples} samples of "
        f"{printable(written['test'])}, {printable(written['title'])}{effects}"
    )
    if Path(written["files"][0]).name == "prova.mat":
        print(
            f"RMSE of Tw to Tw_m: {written['rmse_K']:.4f} K by heatrun "
            f"({written['rmse_reading_K']:.4f} K with the sensor's error that the run found)"
        )
    else:
        print(
            f"RMSE of the reading to Tw_m: {written['rmse_reading_K']:.4f} K by heatrun, sample by "
            "sample (a report gives that of block means)"
        )
    print("\n".join(printable(path) for path in written["files"]))
    return DONE
