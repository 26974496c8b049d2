"""`heatrun check`: findings about the records, before any fit."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from . import words
from .console import DONE, NOT_ALLOWED, printable, say

if TYPE_CHECKING:
    from ..init.survey import UnreadTest
    from ..record.record import Finding, Record


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser("check", help="findings about the records, before any fit")
    words.add_inputs(parser)
    parser.add_argument(
        "--model",
        metavar="first|second|FILE.toml",
        help="also check that the tests have what this network needs (default: records alone)",
    )
    columns = "how each column was read, columns that no channel claims, and notes"
    words.add(parser, "--with", f"--verbose: {columns}", "--json")
    return parser


def run(options: argparse.Namespace) -> int:
    """Print whether the tests will do, and why; an error forbids a calibration."""
    from ..checks import check_record
    from ..checks.suitability import other_tests, suitability
    from ..errors import InputError
    from ..init.survey import unread_test
    from ..model.model_parameters import check_model, check_second_order
    from ..motor.file import load_motor
    from ..readers.joined import read_tests
    from ..readers.mapping import ReadColumns, describe_columns, mapping_text
    from ..record.record import Record
    from ..reports.terminal import findings_text
    from ..results import to_json

    motor = load_motor(options.motor)
    subjects: list[Record | UnreadTest] = []
    findings: list[Finding] = []
    tests: list[ReadColumns] = []
    for path in options.tests:
        try:
            subjects += read_tests(path, motor)
        except InputError as error:
            found = unread_test(path, motor, error)
            if found is None:
                raise
            subjects.append(found)
            tests.append(ReadColumns(found.name, list(found.mapping)))
            findings += found.findings
    records = [one for one in subjects if isinstance(one, Record)]
    for record in records:
        if options.verbose:
            _describe(record)
        tests.append(describe_columns(record))
        findings += check_record(record, motor)
    elsewhere = list(other_tests(motor, [subject.name for subject in subjects]))
    findings += elsewhere
    if all(finding.severity != "error" for finding in findings):
        findings += check_model(options.model, options.effects_known, motor, records)
    has_error = any(finding.severity == "error" for finding in findings)
    # what the second order lacks is no error of the records: another network may not need it
    lacks: dict[str, Finding] = {}
    if options.model is None and not has_error:
        lacks = check_second_order(options.effects_known, motor, records)
    answers = [
        suitability(
            subject.name,
            [finding for finding in findings if finding.test == subject.name],
            _aim(options.model),
            lacks.get(subject.name),
        )
        for subject in subjects
    ]
    unclaimed = {subject.name: subject.unused for subject in subjects}
    following = _next(options, findings, list(lacks.values()))
    if options.json:
        print(to_json({"findings": findings, "tests": tests, "unclaimed": unclaimed,
                       "suitability": answers, "next": following}))  # fmt: skip
        return NOT_ALLOWED if has_error else DONE
    # a channel that is missing may be among the columns that none claims
    lacking = {finding.test for finding in findings if finding.id == "missing_channel"}
    unread = {finding.test for finding in findings if finding.id == "not_read"}
    wrong = {finding.test for finding in findings if finding.severity == "error"} - lacking
    alike: dict[str, list[str]] = {}
    for answer in answers:
        verdict, colon, _ = answer.sentence.partition(": ")
        # what is wrong stands below in full
        said = f"{verdict}." if colon and answer.test in wrong else answer.sentence
        alike.setdefault(said, []).append(answer.test)
    lines = [
        sentence if len(answers) == 1 else f"{', '.join(names)}: {sentence}"
        for sentence, names in alike.items()
    ]
    lines += findings_text(findings, verbose=options.verbose).splitlines()
    for test, unused in unclaimed.items():
        if unused and (options.verbose or test in lacking | unread):
            names = ", ".join(" ".join(name.split()) for name in unused)
            lines.append(f"No channel claims, in {test}: {names}")
    if options.verbose:
        lines += mapping_text(tests).splitlines()
    else:
        # whoever named a part wants it used
        lines += [one.message for one in elsewhere if one.severity == "note"][:MOST_ELSEWHERE]
        notes = ", notes" if any(finding.severity == "note" for finding in findings) else ""
        lines.append(f"With -v: how each column was read{notes}.")
    print("\n".join(printable(line) for line in [*lines, f"Next: {following}"]))
    return NOT_ALLOWED if has_error else DONE


MOST_ELSEWHERE = 3
"""Sections of other tests that are told without -v: a motor file may serve many."""


def _describe(record: Record) -> None:
    """Say how long a record is, and what was done to read it."""
    say(f"{record.name}: {record.time_s.size} samples over {record.duration_s:.0f} s")
    for note in record.notes:
        # the table of columns says the same
        if not any(note.startswith(f"{one.channel} from column") for one in record.mapping):
            say(f"  {note}")


def _aim(model: str | None) -> str:
    orders = {"first": "a first-order calibration", "second": "a second-order calibration"}
    name = model or "second"
    return orders["second"] if name == "both" else orders.get(name, f"a calibration of {name}")


def _next(
    options: argparse.Namespace, findings: Sequence[Finding], lacks: Sequence[Finding]
) -> str:
    """Return what to do next, with the command in full."""
    from ..checks.suitability import SIMULATED, doubts

    words = [str(options.motor), *map(str, options.tests)]
    words += ["--model", options.model] if options.model else []
    words += ["--with", options.effects_known] if options.effects_known else []
    again = shlex.join(["heatrun", "check", *words])
    errors = [finding for finding in findings if finding.severity == "error"]
    if any(finding.id == "missing_channel" for finding in errors):
        draft = shlex.join(["heatrun", "init", *map(str, options.tests), "--out", "draft.toml"])
        return f"name the missing channels in {options.motor} ({draft} proposes), then: {again}"
    if errors:
        return f"do what the errors above say, then: {again}"
    if lacks:
        return f"{options.motor}: {lacks[0].remedy} Then: {again}"
    if any(finding.id == SIMULATED for finding in findings):
        return f"name tests that were measured, then: {again}"
    calibrate = shlex.join(["heatrun", "calibrate", *words])
    if doubts(findings):
        return f"clear up the warnings named above, then: {calibrate}"
    return calibrate
