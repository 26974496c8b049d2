"""`heatrun init`: a commented motor file from what the files of a test hold."""

from __future__ import annotations

import argparse
import os
import shlex
from pathlib import Path
from typing import Any

from . import words
from .console import printable, say
from .exit_codes import DONE

USUAL_NAME = "motor.toml"


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser("init", help="a commented motor file from what the tests hold")
    parser.add_argument(
        "tests",
        nargs="+",
        type=Path,
        metavar="TEST",
        help="bench files; TEMPERATURES+DRIVE@10Hz joins two loggers",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(USUAL_NAME),
        metavar="FILE",
        help=f"the motor file to write (default: {USUAL_NAME})",
    )
    parser.add_argument("--force", action="store_true", help="replace the file if there is one")
    words.add_json(parser)
    return parser


def run(options: argparse.Namespace) -> int:
    """Look at the tests, write the motor file, and print what is known and what is missing."""
    from ..bench.joined import files_of
    from ..bench.survey import survey
    from ..errors import InputError
    from ..io.whole_files import writable, write_whole
    from ..motor_draft import draft
    from ..motor_gaps import gaps
    from ..motorfile import parse_motor
    from ..results import to_json

    out: Path = options.out
    files = [file for test in options.tests for file in files_of(test)]
    if os.path.lexists(out) and not options.force:
        raise InputError(
            "There is a file of this name already.",
            where=str(out),
            remedy="Choose another name with --out, or replace it with --force.",
        )
    if any(out.exists() and file.exists() and out.samefile(file) for file, _ in files):
        raise InputError("This is one of the tests.", where=str(out), remedy="Choose another name.")
    surveys = []
    for file, sheet in files:
        found = survey(file, sheet)
        say(f"{file}: {found.reader}, {len(found.recognised)} columns recognised, "
            f"{len(found.free)} not")  # fmt: skip
        for finding in found.findings:
            say(f"  {finding.message} {finding.remedy}")
        surveys.append(found)
    content = draft(_name_of(files[0][0]), surveys).encode()
    parse_motor(content, str(out))  # what is written can be read
    with writable("The motor file", out):
        write_whole(out, content)
    missing = gaps(surveys)
    tests = shlex.join(str(test) for test in options.tests)
    following = f"heatrun check {shlex.quote(str(out))} {tests}"
    if options.json:
        print(to_json({"motor_file": str(out), "tests": surveys, "missing": missing,
                       "next": following}))  # fmt: skip
        return DONE
    print(f"{printable(str(out))} is written.")
    for gap in missing:
        print(f"  missing  {gap.place}: {printable(gap.sentence)}")
        for side, note in gap.candidates:
            print(f"             {printable(' '.join(side.split()))}: {note}")
    before = f"edit {printable(str(out))}, then " if missing else ""
    print(f"Next: {before}{printable(following)}")
    return DONE


def _name_of(file: Path) -> str:
    """Return the name that the machine has until a person gives it one."""
    stem = file.stem if file.suffix.lower() != ".gz" else Path(file.stem).stem
    return "".join(c for c in stem if c.isprintable()).strip()[:100] or "motor"
