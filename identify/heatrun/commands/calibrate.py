"""`heatrun calibrate`: parameters with 95 % intervals, bands, verdict and parameter sheet."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import words
from .console import bar, printable, say
from .exit_codes import DONE, NOT_ALLOWED
from .loading import load

if TYPE_CHECKING:
    from ..calibration import Calibration
    from ..motor import Motor
    from ..runs.run_folder import RunFolder


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser(
        "calibrate", help="parameters with 95 % intervals, bands, verdict and parameter sheet"
    )
    words.add_inputs(parser)
    words.add_holdout(parser)
    parser.add_argument(
        "--model", choices=("first", "second", "both"), default="both", help="order"
    )
    parser.add_argument(
        "--rating",
        action="append",
        default=[],
        metavar="S2-MIN|S3-PCT",
        help="current of a duty type at the insulation limit, such as S2-30 or S3-40",
    )
    words.add_sampling(parser)
    words.add_out(parser, "run folder (default: results/runs/NAME)")
    words.add_json(parser)
    return parser


def run(options: argparse.Namespace) -> int:
    """Calibrate and write the run folder."""
    from ..motorfile import load_motor

    orders = ("first", "second") if options.model == "both" else (options.model,)
    return calibrate_into_folder(
        options, load_motor(options.motor), options.tests, options.holdout, orders
    )


def calibrate_into_folder(
    options: argparse.Namespace,
    motor: Motor,
    calibration: Sequence[Path],
    holdout: Sequence[Path],
    orders: Sequence[Any],
) -> int:
    """Calibrate, write the run folder and print what was found.

    Args:
        options: With `out`, `quick`, `seed`, `json`, `command_line`, and `model` where no `out`
            is given; `rating` is optional.
        motor: The motor.
        calibration: Paths of the tests that are fitted.
        holdout: Paths of the tests that are predicted.
        orders: `"first"`, `"second"` or both.
    """
    from ..calibration import calibrate, default_folder, identity, refuse_unwritable
    from ..ratings.duties import parse_duty
    from ..reports.terminal import result_text
    from ..runs.run_folder import RunFolder, dump

    tests = load(motor, calibration, holdout, as_json=options.json)
    if tests is None:
        return NOT_ALLOWED
    path = options.out or default_folder(motor, tests, options.model)
    refuse_unwritable(path)
    method = "quick" if options.quick else "emcee"
    for duty in getattr(options, "rating", ()):
        parse_duty(duty, 1.0)  # wrong use is said before anything is fitted
    same = identity(motor, tests, orders=list(orders), method=method, seed=options.seed)
    folder = RunFolder.begin(path, same)
    if folder.note:
        say(folder.note)
    with bar() as progress:
        found = calibrate(
            motor,
            tests,
            orders=orders,
            method=method,
            seed=options.seed,
            command=options.command_line,
            duties=getattr(options, "rating", ()),
            folder=folder,
            say=say,
            progress=progress,
        )
    say("writing the sheet")
    written = _write(found, folder, options)
    if options.json:
        print(dump({**found.result, "run": str(written)}))
    else:
        print(result_text(found.result))
        print(f"\nRun folder:      {printable(str(written))}")
        for name in ("sheet.pdf", "sheet.xlsx", "posterior_second.nc", "figures"):
            if (written / name).exists():
                print(f"  {name:<14} {written / name}")
    return DONE


def _write(found: Calibration, folder: RunFolder, options: argparse.Namespace) -> Path:
    from ..calibration import manifest
    from ..reports.sheet.of_run import write_sheet_of
    from ..runs import netcdf as archive

    folder.write_json("fit.json", found.result)
    for order, posterior in found.posteriors.items():
        archive.write(posterior, folder.partial / f"posterior_{order}.nc")
    write_sheet_of(found, folder.partial)
    return folder.finish(manifest(found, options.command_line, options.seed))
