"""The report on several prototypes, written as PDF, CSV and JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from heatrun.io.whole_files import writable
from heatrun.motor import Motor
from heatrun.reports.texts import LANGUAGES

from ..job import Outcome, settings_of, write_report
from ..report_name import date_of_test
from .confront import base_of
from .prototype import read_prototypes
from .report import prototypes_report


def make_prototypes_report(
    motor: Motor,
    roles: Sequence[tuple[str, Path]],
    out: Path,
    *,
    run: Path | None = None,
    tolerances: Mapping[str, float] | None = None,
    language: str = LANGUAGES[0],
    say: Callable[[str], None] | None = None,
) -> Outcome:
    """Write the report on several prototypes.

    It is called after the date of the prototype whose clock is kept, as
    `heatrun_reports.job.make_report` calls the others.

    Args:
        motor: The machine.
        roles: Role and file of each prototype, or the folder of a run.
        out: Folder of the report; made if it is not there.
        run: Folder of a calibration whose network is held against each; None for none.
        tolerances: By channel or figure, in its unit (K for temperatures).
        language: As `heatrun_reports.job.make_report`.
        say: Told a sentence when it begins.

    Returns:
        The files, and what stands in them.

    Raises:
        InputError: If a file or run cannot be read, the prototypes cannot be aligned, or `out` not
            be written.
        UsageError: If a run is to stand for a prototype and no measured record drives it.
    """
    if say is not None:
        say(f"prototypes report of {', '.join(role for role, _ in roles)}")
    prototypes = read_prototypes(roles, motor)
    report = prototypes_report(motor, prototypes, run=run, tolerances=tolerances)
    base = base_of(prototypes)
    when = date_of_test(dict(roles)[base.role], base.record)
    with writable("the folder of the reports", out):
        out.mkdir(parents=True, exist_ok=True)
    parts = [p.record.stretch for p in prototypes if p.record.stretch]
    settings = [*parts, *settings_of(run, tolerances, None, language)]
    return write_report(report.test, report, when, out, settings, language)
