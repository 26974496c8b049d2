"""`heatrun shutdown`: the winding's temperature at the instant of switch-off."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import UsageError
from . import words
from .console import DONE, NOT_ALLOWED, printable, say

if TYPE_CHECKING:
    from ..record.motor import Certificate
    from ..shutdown.result import ShutdownResult


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser(
        "shutdown", help="winding temperature at switch-off, from readings that came later"
    )
    parser.add_argument("motor", type=Path, metavar="MOTOR.toml", help="the motor file")
    parser.add_argument(
        "readings",
        type=Path,
        metavar="READINGS",
        help="file of resistances, or of a sensor in the winding, over the time since switch-off",
    )
    parser.add_argument(
        "--run", type=Path, metavar="RUN", help="run folder of this machine: its time constants"
    )
    parser.add_argument(
        "--model", metavar="NAME", help="network of the run (default: its last one)"
    )
    parser.add_argument(
        "--at",
        default="",
        metavar="TIME",
        help="moment of switch-off in the time of the file, such as 10min or 14:32:05 (default: 0; "
        "a file with dates needs it)",
    )
    parser.add_argument(
        "--within",
        type=float,
        default=None,
        metavar="K",
        help="uncertainty of the extrapolation, 95 %%, beyond which it is not determinable "
        "(default: 5)",
    )
    words.add(
        parser, "--meta", "--language: of page, figure and workbook", "--dcc", "--dcc-schema",
        "--seed", "--out: folder for the results: JSON, PDF, XLSX, figure, curve (default: none)",
        "--force", "--verbose: the uncertainty budget and how the file was read", "--json",
    )  # fmt: skip
    return parser


def run(options: argparse.Namespace) -> int:
    """Print the temperature with its interval; write the files if asked."""
    from ..motor.certificate import stated_in_all
    from ..motor.file import load_motor
    from ..results import to_json
    from ..shutdown import winding_at_switch_off
    from ..shutdown.printed import text
    from ..shutdown.result import as_content
    from ..shutdown.sheet import write_results

    if options.model is not None and options.run is None:
        raise UsageError("--model names a network of a run: give --run too")
    if options.within is not None and not options.within > 0.0:
        raise UsageError(f"--within is a number of kelvin above 0, got {options.within:g}")
    has_dcc = options.dcc or options.dcc_schema is not None
    if has_dcc and options.out is None:
        raise UsageError("--dcc writes dcc.xml into a folder: give --out too")
    if options.meta is not None and not has_dcc:
        raise UsageError("--meta is what the certificate says: give --dcc too")
    result = winding_at_switch_off(
        options.motor,
        options.readings,
        run=options.run,
        model=options.model,
        at=options.at,
        within_K=options.within,
        seed=options.seed,
    )
    if options.out is not None:
        stated = load_motor(options.motor).certificate
        stated = stated_in_all(stated, options.meta, options.language)
        document = _certificate(result, stated, options) if has_dcc else None
        for path in write_results(
            result, options.out, stated=stated, certificate=document, is_replacing=options.force
        ):
            say(str(path))
    if options.json:
        print(to_json(as_content(result)))
    else:
        print(printable(text(result, verbose=options.verbose)))
    return DONE if result.is_determinable else NOT_ALLOWED


def _certificate(result: ShutdownResult, stated: Certificate, options: argparse.Namespace) -> bytes:
    """Return the certificate, valid under the schema where one is given."""
    from ..reports.dcc_schema import validate
    from ..shutdown.sheet import dcc_text

    document = dcc_text(result, stated)
    if options.dcc_schema is not None:
        validate(document, options.dcc_schema)
    return document
