"""`heatrun sheet`: the regenerate the parameter sheet of a run."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from . import words
from .console import printable
from .exit_codes import DONE


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser("sheet", help="regenerate the parameter sheet of a run")
    parser.add_argument("run", type=Path, metavar="RUN", help="run folder")
    words.add_out(parser, "folder for the sheet (default: the run itself)")
    words.add_force(parser)
    words.add_json(parser)
    return parser


def run(options: argparse.Namespace) -> int:
    """Write the sheet and print its files."""
    from ..reports.sheet.of_run import rewrite_sheet
    from ..results import to_json

    written = rewrite_sheet(options.run, options.out or options.run, is_replacing=options.force)
    if options.json:
        print(to_json({"files": [str(path) for path in written]}))
    else:
        print("\n".join(printable(str(path)) for path in written))
    return DONE
