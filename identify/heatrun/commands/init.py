"""`heatrun init`: a commented motor file from what the files of a test hold."""

from __future__ import annotations

import argparse
import math
import os
import shlex
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import words
from .console import DONE, printable, say

if TYPE_CHECKING:
    from ..init.gaps import Gap
    from ..init.survey import Survey

USUAL_NAME = "motor.toml"
UNITS = {"phase_resistance_ohm": "Ω at 25 °C", "time_s": "samples per second",
         "phase_current_A": "A", "ambient_degC": "°C", "mechanical_power_W": "W",
         "torque_Nm": "Nm", "speed_rpm": "rpm", "i_d_A": "A"}  # fmt: skip
"""What a number is asked in."""

ABOVE_ZERO = ("phase_resistance_ohm", "time_s", "phase_current_A")
"""Of which a number is above 0; a speed may be none."""


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
    parser.add_argument(
        "--accept",
        action="store_true",
        help="the best candidates hold, marked '# please check', instead of standing behind a #",
    )
    words.add(parser, "--json")
    return parser


def run(options: argparse.Namespace) -> int:
    """Look at the tests, write the motor file, and print what is known and what is missing."""
    from ..init.draft import draft
    from ..init.gaps import gaps
    from ..results import to_json

    out: Path = options.out
    surveys = look_at(options.tests, out, is_replacing=options.force)
    write(out, draft(name_of(surveys), surveys, is_accepted=options.accept))
    missing = [gap for gap in gaps(surveys) if not (options.accept and gap.is_answered)]
    following = next_command("check", out, options.tests)
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
    checked = f"check the lines marked '# please check' in {printable(str(out))}, then "
    print(f"Next: {before or (checked if options.accept else '')}{printable(following)}")
    return DONE


def look_at(tests: Sequence[Path], out: Path, *, is_replacing: bool = False) -> list[Survey]:
    """Return what the files of tests hold.

    Raises:
        InputError: If a file cannot be read, or the motor file would replace something.
    """
    from ..errors import InputError
    from ..init.survey import survey
    from ..readers.joined import files_of

    files = [(test, *file) for test in tests for file in files_of(test)]
    if os.path.lexists(out) and not is_replacing:
        raise InputError(
            "There is a file of this name already.",
            where=str(out),
            remedy="Choose another name with --out, or replace it with --force.",
        )
    if any(out.exists() and file.exists() and out.samefile(file) for _, file, _ in files):
        raise InputError("This is one of the tests.", where=str(out), remedy="Choose another name.")
    surveys = []
    for test, file, sheet in files:
        found = survey(file, sheet)
        say(f"{file}: {found.reader}, {len(found.recognised)} columns recognised, "
            f"{len(found.free)} not")  # fmt: skip
        for finding in found.findings:
            say(f"  {finding.message} {finding.remedy}")
        if found.machines:
            say(f"  {found.machines}")
        surveys.append(replace(found, test=str(test)))
    return surveys


def write(out: Path, text: str) -> None:
    """Write a motor file that loads."""
    from ..io.whole_files import writable, write_whole
    from ..motor.file import parse_motor

    content = text.encode()
    parse_motor(content, str(out))  # what is written can be read
    with writable("The motor file", out):
        write_whole(out, content)


OF_COPPER = ("phase_resistance_ohm", "phase_current_A", "i_d_A", "i_q_A")
"""What the copper loss alone needs."""


def motor_of_tests(tests: Sequence[Path], given: str, *, has_winding: bool = True) -> Path:
    """Write the motor file of tests that come without one, and ask for the numbers that it lacks.

    Args:
        tests: As the command line names them.
        given: The command line, which is to be given again with the motor file.
        has_winding: Whether a network has a node that the copper loss heats; without, neither
            current nor resistance is asked for.

    Returns:
        The motor file.

    Raises:
        InputError: If there is one, or something is missing that nobody at a terminal can be asked
            for; what was found is written nevertheless.
    """
    from ..errors import InputError
    from ..init.draft import draft
    from ..init.gaps import gaps

    out = Path(USUAL_NAME)
    heatrun, command, *words = shlex.split(given)
    again = shlex.join([heatrun, command, str(out), *words])
    if os.path.lexists(out):
        raise InputError("There is a motor file already.", where=str(out), remedy=f"{again}")
    surveys = look_at(tests, out)
    missing = [gap for gap in gaps(surveys) if not gap.is_answered]
    missing = [gap for gap in missing if has_winding or (gap.channel or gap.key) not in OF_COPPER]
    may_ask = all(gap.number for gap in missing) and sys.stdin.isatty()
    numbers = {gap.channel or gap.key: _asked(gap) for gap in missing if may_ask}
    write(out, draft(name_of(surveys), surveys, is_accepted=True, numbers=numbers))
    if missing and not may_ask:
        numbers = [gap.channel or gap.key for gap in missing if gap.number]
        columns = [gap.channel for gap in missing if not gap.number]
        said = [*(["a number for " + ", ".join(numbers)] if numbers else []),
                *(["a column for " + ", ".join(columns)] if columns else [])]  # fmt: skip
        raise InputError(
            f"The tests do not say all that a calibration needs: {' and '.join(said)}.",
            where=str(out),
            remedy=f"Put {'it' if len(missing) == 1 else 'them'} into {out}, which is written with "
            f"what the tests say, then: {again}",
        )
    say(f"{out} is written; check the lines marked '# please check'")
    return out


def _asked(gap: Gap) -> float:
    """Return a number that a person at the terminal gives."""
    name = gap.channel or gap.key
    print(f"{name}: {printable(gap.sentence)}", file=sys.stderr)
    while True:
        print(
            f"{name} [{UNITS[name]}], such as {gap.number}: ", end="", file=sys.stderr, flush=True
        )
        line = sys.stdin.readline()
        if not line:
            raise KeyboardInterrupt
        least = 0.0 if name in ABOVE_ZERO else -math.inf
        with suppress(ValueError):
            if least < (number := float(line.replace(",", "."))) < math.inf:
                return number
        above = " above 0" if name in ABOVE_ZERO else ""
        print(f"Expected a number{above}, got {line.strip()[:40]!r}.", file=sys.stderr)


def next_command(command: str, motor: Path, tests: Sequence[Path]) -> str:
    """Return a command about tests and their motor file."""
    words = shlex.join(str(test) for test in tests)
    return f"heatrun {command} {shlex.quote(str(motor))} {words}"


def name_of(surveys: Sequence[Survey]) -> str:
    """Return the name that the machine has until a person gives it one."""
    file = Path(surveys[0].path)
    stem = file.stem if file.suffix.lower() != ".gz" else Path(file.stem).stem
    return "".join(c for c in stem if c.isprintable()).strip()[:100] or "motor"
