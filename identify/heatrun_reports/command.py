"""`heatrun report`: the bench's reports by test type."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heatrun.commands import words
from heatrun.commands.console import DONE, NOT_ALLOWED, bar, printable, say

if TYPE_CHECKING:
    from . import Outcome

TYPES = ("general", "thermal", "energy", "virtual", "real", "prototypes")
"""As `heatrun_reports.CARDS`, which is slow to import."""

PROTOTYPES = (
    "A prototypes report compares any number of records of one manoeuvre, given as ROLE=FILE: "
    "heatrun report --type prototypes MOTOR.toml virtual=FILE semi-real=FILE real=FILE "
    "[real-2=FILE]. Clocks are aligned pair by pair, each signal of each pair has a verdict; the "
    "folder of a run in place of a file is the run's network driven by the first measured record."
)


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser(
        "report", help="reports by test type, of tests or whole folders",
        description="Reports by test type, as PDF, CSV and JSON.", epilog=PROTOTYPES,
    )  # fmt: skip
    parser.add_argument(
        "--type", dest="kind", choices=TYPES, required=True, help="test type of the bench"
    )
    words.add_inputs(parser, "bench files, or folders of them; ROLE=FILE with --type prototypes")
    parser.add_argument(
        "--run",
        type=Path,
        metavar="RUN",
        help="run folder of the calibrated network (thermal, virtual, prototypes)",
    )
    parser.add_argument(
        "--reference",
        type=Path,
        metavar="FILE",
        help="record of the other prototype (virtual, real)",
    )
    parser.add_argument(
        "--tolerance",
        action="append",
        default=[],
        metavar="CHANNEL=VALUE",
        help="absolute tolerance of a signal or figure, such as winding_degC=3 or energy_kWh=0.05 "
        "(virtual, real, prototypes); default: 5 %% of the rise or magnitude, or what the "
        "instruments leave open",
    )
    parser.add_argument(
        "--offset",
        type=float,
        metavar="SECONDS",
        help="clock offset of the reference, instead of its estimate (virtual, real)",
    )
    words.add(
        parser,
        "--language: of the PDF",
        "--out: folder for the reports (default: Reports)",
        "--json",
    )
    return parser


def run(options: argparse.Namespace) -> int:
    """Write the reports and print their tables; one that failed makes the exit code 1."""
    from heatrun.errors import UsageError
    from heatrun.motor.file import load_motor
    from heatrun.results import to_json

    from . import make_prototypes_report, make_report
    from .analysis.general_information import parse_tolerances
    from .prototypes import parse_roles

    out = options.out or Path("Reports")
    asked = {
        "run": options.run,
        "tolerances": parse_tolerances(options.tolerance),
        "language": options.language,
        "say": say,
    }
    if options.kind == "prototypes":
        if options.reference is not None or options.offset is not None:
            raise UsageError(
                "a prototypes report takes ROLE=FILE for each record and searches the clocks; "
                "--reference and --offset belong to virtual and real."
            )
        roles = parse_roles([str(text) for text in options.tests])
        outcomes = [make_prototypes_report(load_motor(options.motor), roles, out, **asked)]
    else:
        with bar() as progress:
            outcomes = make_report(
                options.kind, load_motor(options.motor), options.tests, out,
                reference=options.reference, offset_s=options.offset, progress=progress, **asked,
            )  # fmt: skip
    if options.json:
        print(to_json({"reports": [_described(outcome) for outcome in outcomes]}))
    else:
        print(printable(_text(outcomes)))
    return NOT_ALLOWED if any(outcome.error is not None for outcome in outcomes) else DONE


def _described(outcome: Outcome) -> dict[str, Any]:
    if outcome.error is not None:
        error = outcome.error
        problem = {"problem": error.problem, "where": error.where, "remedy": error.remedy}
        return {"file": outcome.test, "error": problem}
    files = [str(path) for path in outcome.written]
    return {"file": outcome.test, "written": files, **(outcome.content or {})}


def _text(outcomes: Sequence[Outcome]) -> str:
    from heatrun.reports.printed import ranked

    from .document import number

    lines = []
    for outcome in outcomes:
        lines.append(outcome.test)
        if outcome.error is not None:
            lines += [f"  no report: {outcome.error}", ""]
            continue
        assert outcome.report is not None  # an outcome is a report or an error
        lines.append(f"  {outcome.report.summary}")
        for row in outcome.report.rows:
            note = f"  ({row.note})" if row.note else ""
            lines.append(f"  {row.label:<40} {number(row.value, row.places):>12} {row.unit}{note}")
        lines += [
            f"  {finding.severity}: {finding.sentence()}"
            for finding in ranked(outcome.report.findings)
            if finding.severity != "note"
        ]
        lines += [*(f"  {path}" for path in outcome.written), ""]
    failed = sum(outcome.error is not None for outcome in outcomes)
    if failed:
        lines.append(f"{failed} of {len(outcomes)} tests have no report.")
    return "\n".join(lines)
