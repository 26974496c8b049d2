"""`heatrun check`: findings about the records, before any fit."""

from __future__ import annotations

import argparse
from typing import Any

from . import words
from .console import printable, say
from .exit_codes import DONE, NOT_ALLOWED


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser("check", help="findings about the records, before any fit")
    words.add_inputs(parser)
    parser.add_argument(
        "--model",
        metavar="first|second|FILE.toml",
        help="also check that the tests have what this network needs (default: records alone)",
    )
    words.add_with(parser)
    words.add_json(parser)
    return parser


def run(options: argparse.Namespace) -> int:
    """Print the findings about every test; they forbid a calibration if one is an error."""
    from ..bench import Finding
    from ..bench.channels.column_mapping import (
        ReadColumns,
        describe_columns,
        mapping_text,
    )
    from ..bench.checks import check_record
    from ..bench.joined import read_test
    from ..inference.model_check import check_model
    from ..motorfile import load_motor
    from ..reports.terminal import findings_text
    from ..results import to_json

    motor = load_motor(options.motor)
    records = []
    findings: list[Finding] = []
    tests: list[ReadColumns] = []
    for path in options.tests:
        record = read_test(path, motor)
        say(f"{record.name}: {record.time_s.size} samples over {record.duration_s:.0f} s")
        for note in record.notes:
            # the table of columns says the same
            if not any(note.startswith(f"{one.channel} from column") for one in record.mapping):
                say(f"  {note}")
        tests.append(describe_columns(record))
        findings += check_record(record, motor)
        records.append(record)
    if all(finding.severity != "error" for finding in findings):
        findings += check_model(options.model, options.effects_known, motor, records)
    has_error = any(finding.severity == "error" for finding in findings)
    if options.json:
        print(to_json({"findings": findings, "tests": tests}))
    else:
        columns = mapping_text(tests)
        if columns:
            print("\n".join(printable(line) for line in columns.split("\n")), end="\n\n")
        print(findings_text(findings))
    return NOT_ALLOWED if has_error else DONE
