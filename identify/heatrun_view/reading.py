"""The chosen tests read and checked, for a thread beside the page."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path

from heatrun.checks import check_record
from heatrun.errors import InputError
from heatrun.init.survey import Survey, survey
from heatrun.io.whole_files import Opener, opening_by
from heatrun.motor.file import load_motor
from heatrun.readers.following import NotFollowed
from heatrun.readers.joined import over_gaps
from heatrun.readers.mapping import HEAD, describe_columns, grouped
from heatrun.record.motor import Motor, PartsOfTest
from heatrun.record.record import Finding, Record
from heatrun.record.samples import needed_channels

from .store import NOTHING, Opened, RecordStore, Stamp
from .words import findings_html, message, problem, table


@dataclass(frozen=True)
class Refused:
    """A file that could not be read: its state at that time, and why, as HTML."""

    stamp: Stamp
    problem: str


@dataclass(frozen=True)
class Reading:
    """What became of the chosen tests, by the names of the page; why some are refused, as HTML."""

    opened: Mapping[str, Opened]
    problems: str
    # Findings and how the files were read, as HTML; None where they were not checked.
    checks: str | None = None
    refused: Mapping[str, Refused] = field(default_factory=dict)


@dataclass(frozen=True)
class Reader:
    """Reads tests for one tab."""

    # Returns the file of a name as the page lists it, or raises InputError.
    path: Callable[[str], Path]
    store: RecordStore  # Holds what was read before.
    opener: Opener  # Opens files in the folders that are shown, and no others.

    def read(self, names: Sequence[str], motor_name: str | None) -> Reading:
        """Read and check tests; one that cannot be read is named, and the others are.

        Of a text file that is written meanwhile the whole lines are taken. Tests and motor file are
        named as the page lists them.
        """
        with opening_by(self.opener):
            try:
                motor = None if motor_name is None else self.motor(motor_name)
            except Exception as error:
                fault = message("warning", "The motor file is at fault.")
                return Reading({}, problem(str(motor_name), error), fault)
        return self._read(names, motor)

    def check(self, names: Sequence[str], motor: Motor) -> str:
        """Return what a machine that stands in no file yet finds in tests, as HTML."""
        reading = self._read(names, motor)
        return reading.problems + (reading.checks or "")

    def _read(self, names: Sequence[str], motor: Motor | None) -> Reading:
        opened: dict[str, Opened] = {}
        refused: dict[str, Refused] = {}
        findings = []
        with opening_by(self.opener):
            for name in names:
                stamp = NOTHING
                try:
                    path = self.path(name)
                    stamp = Stamp.of(path)
                    test = self._open(path, motor, stamp)
                    findings += _found(test.record, motor) if motor else []
                    opened[name] = test
                except Exception as error:
                    refused[name] = Refused(stamp, problem(name, error))
        checks = _checks(list(opened.values()), motor, findings)
        problems = "".join(each.problem for each in refused.values())
        return Reading(opened, problems, checks, refused)

    def follow(self, before: Mapping[str, Opened | Refused], motor_name: str | None) -> Reading:
        """Read what has been written to tests; one that cannot be read stays as it was."""
        opened = {name: each for name, each in before.items() if isinstance(each, Opened)}
        refused = {name: each for name, each in before.items() if isinstance(each, Refused)}
        problems: list[str] = []
        with opening_by(self.opener):
            try:
                motor = None if motor_name is None else self.motor(motor_name)
            except Exception as error:
                return Reading(opened, problem(str(motor_name), error), None, refused)
            for name, last in before.items():
                stamp = NOTHING
                try:
                    path = self.path(name)
                    stamp = Stamp.of(path)
                    if stamp != last.stamp:
                        opened[name] = self._followed(path, motor)
                        refused.pop(name, None)
                except Exception as error:
                    said = problem(name, error)
                    if name in opened:
                        problems.append(said)
                    else:
                        refused[name] = Refused(stamp, said)
        notices = "".join(
            message("warning", f"{name}: {each.notice}")
            for name, each in opened.items()
            if each.notice
        )
        problems += [each.problem for each in refused.values()]
        return Reading(opened, "".join(problems) + notices, None, refused)

    def survey(self, names: Sequence[str]) -> list[Survey]:
        """Return what tests hold, without any motor file.

        Raises:
            InputError: If one cannot be read.
        """
        with opening_by(self.opener):
            paths = [self.path(name) for name in names]
            return [replace(survey(path), test=str(path)) for path in paths]

    def lacking(self, names: Sequence[str], motor_name: str) -> list[str]:
        """Return the channels that a fit needs and that tests have not by a motor file.

        Raises:
            InputError: If one, or the motor file, cannot be read.
        """
        with opening_by(self.opener):
            motor, paths = self.motor(motor_name), [self.path(name) for name in names]
            records = [self._open(path, motor, Stamp.of(path)).record for path in paths]
        lacked = (c for r in records for c in needed_channels(r, motor) if c not in r)
        return list(dict.fromkeys(lacked))

    def motor(self, name: str) -> Motor:
        """Return the machine of a motor file as the page lists it.

        Raises:
            InputError: If it cannot be read or is none.
        """
        return load_motor(self.path(name))

    def _open(self, path: Path, motor: Motor | None, stamp: Stamp) -> Opened:
        try:
            return self.store.open(path, motor)
        except InputError as error:
            if Stamp.of(path) == stamp:
                raise
            with suppress(NotFollowed):
                return self.store.follow(path, motor, self.opener)
            raise error

    def _followed(self, path: Path, motor: Motor | None) -> Opened:
        try:
            return self.store.follow(path, motor, self.opener)
        except NotFollowed:
            return self.store.open(path, motor)


def _found(record: Record, motor: Motor) -> list[Finding]:
    """Return what is to be said about a record, as a calibration takes its gaps."""
    load = motor.tests.get(record.name, PartsOfTest()).gap_load
    return [f for part in over_gaps(record, load, splits=True) for f in check_record(part, motor)]


def _checks(opened: Sequence[Opened], motor: Motor | None, findings: Sequence) -> str:
    if not opened:
        return message("note", "Choose tests in the side panel.")
    parts, said = [each.record.name for each in opened if each.is_part], ""
    if parts:
        said = message(
            "note",
            f"{', '.join(parts)}: the file was being written; this is about its lines so far. "
            "“Look again” checks it anew.",
        )
    if motor is None:
        return said + message("warning", "Choose a motor file: checks need it.") + _notes(opened)
    return said + findings_html(findings) + _notes(opened)


def _notes(opened: Sequence[Opened]) -> str:
    rows = [(each.record.name, note) for each in opened for note in each.record.notes]
    rows += [
        (each.record.name, f"Columns that are not used: {', '.join(each.record.unused)}")
        for each in opened
        if each.record.unused
    ]
    tests = [describe_columns(each.record) for each in opened]
    columns = "".join(
        f"<h3>Columns of {escape(names)}</h3>" + table(HEAD, lines)
        for names, lines in grouped(tests)
    )
    notes = "<h3>How the files were read</h3>" + table(("test", "note"), rows) if rows else ""
    return columns + notes
