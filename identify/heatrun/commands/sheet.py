"""`heatrun sheet`: regenerate the certificate and the parameter sheet of a run."""

import argparse
from pathlib import Path
from typing import Any

from . import words
from .console import DONE, printable, say


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser(
        "sheet", help="regenerate the certificate and the parameter sheet of a run"
    )
    parser.add_argument("run", type=Path, metavar="RUN", help="run folder")
    words.add(
        parser, "--meta", "--language", "--dcc", "--dcc-schema",
        "--out: folder for the sheet (default: the run itself)",
        "--force: the sheet of another run in --out, and what this one was told by --meta",
        "--json",
    )  # fmt: skip
    return parser


def run(options: argparse.Namespace) -> int:
    """Write the sheet and print its files."""
    from ..reports.of_run import rewrite_sheet
    from ..results import to_json

    written = rewrite_sheet(
        options.run,
        options.out or options.run,
        options.meta,
        language=options.language,
        with_dcc=options.dcc,
        schema=options.dcc_schema,
        is_replacing=options.force,
        tell=say,
    )
    if options.json:
        print(to_json({"files": [str(path) for path in written]}))
    else:
        print("\n".join(printable(str(path)) for path in written))
    return DONE
