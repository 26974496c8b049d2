"""Reports of one test or of many, written as PDF, CSV and JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from heatrun.errors import InputError
from heatrun.io.file_set import together
from heatrun.io.open_file import digest
from heatrun.io.texts import LANGUAGES, Texts
from heatrun.io.whole_files import writable, write_whole
from heatrun.readers.joined import read_tests
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.results import to_json
from heatrun.runs.run import open_run
from heatrun.work import Progress, Work

from .bench_test_types import Kind
from .build import build_report, check_use
from .content import report_content
from .csv_table import csv_table
from .document import write_pdf
from .report import Report
from .report_name import DateOfTest, choose_name, date_of_record, date_of_test, set_name
from .simulated import read_reference, refuse_changed
from .tests_in import tests_in

USUAL_S = 2.0
"""Time that a report usually takes [s]."""


@dataclass(frozen=True)
class Outcome:
    """What became of one test.

    Attributes:
        test: As it was named: path of a file, or name of a record.
        pdf: The report; None if there is none.
        csv: Its tables.
        json: Its tables, findings and sources.
        report: What was typeset.
        content: What stands in the JSON.
        error: Why there is no report; None if there is one.
    """

    test: str
    pdf: Path | None = None
    csv: Path | None = None
    json: Path | None = None
    report: Report | None = None
    content: Mapping[str, object] | None = None
    error: InputError | None = None

    @property
    def written(self) -> tuple[Path, ...]:
        """The files, PDF first; empty if there is no report."""
        return tuple(path for path in (self.pdf, self.csv, self.json) if path is not None)


def make_report(
    kind: Kind,
    motor: Motor,
    tests: Sequence[Path | Record],
    out: Path,
    run: Path | None = None,
    reference: Path | None = None,
    tolerances: Mapping[str, float] | None = None,
    *,
    offset_s: float | None = None,
    language: str = LANGUAGES[0],
    say: Callable[[str], None] | None = None,
    progress: Progress | None = None,
) -> list[Outcome]:
    """Write the reports of tests; one that cannot be made is named, and the others are.

    A report is called after its test type and the test's name and date, such as
    `GeneralInformationTest_pump_3_2022_12_07_001.pdf`. Made again from the same files with the same
    run, tolerances and offset it takes its former place; any other report is never overwritten.

    Args:
        kind: Test type, one of `TEST_TYPES`.
        motor: The machine.
        tests: Bench files (also `TEMPERATURES+DRIVE`), folders of them, or records.
        out: Folder of the reports; made if it is not there.
        run: As `build_report`.
        reference: File of the other prototype, for `"virtual"` and `"real"`.
        tolerances: As `build_report`.
        offset_s: As `build_report`.
        language: Of the PDF, one of `heatrun.io.texts.LANGUAGES`.
        say: Told a sentence about each test that is begun.
        progress: Called with a sentence and the share of the reports that are written.

    Returns:
        What became of each test, in order; a folder counts as its files.

    Raises:
        InputError: If the run, the reference or a folder cannot be read, or `out` not be written.
        UsageError: If something is given that the test type does not take, or lacks.
    """
    check_use(kind, run, reference is not None, tolerances, offset_s)
    other = None if reference is None else read_reference(reference, motor)
    if run is not None:
        open_run(run)  # what is wrong with it is wrong for every test, and said once
    with writable("the folder of the reports", out):
        out.mkdir(parents=True, exist_ok=True)
    found = tests_in(tests)
    if found.left_out and say is not None:
        say(f"no bench files, left out: {', '.join(path.name for path in found.left_out)}")
    if found.own and say is not None:
        names = ", ".join(path.name for path in found.own)
        say(f"written by heatrun itself and left out: {names}")
    settings = settings_of(run, tolerances, offset_s, language)
    outcomes = []
    with Work(dict.fromkeys(range(len(found.tests)), USUAL_S), progress) as work:
        for number, test in enumerate(found.tests):
            name = test.name if isinstance(test, Record) else str(test)
            if say is not None:
                say(f"{kind} report of {name}")
            work.at(number, f"report {number + 1} of {len(found.tests)}")
            try:
                is_record = isinstance(test, Record)
                records = (test,) if is_record else read_tests(test, motor, at_gaps=False)
                for record in records:
                    is_file = not isinstance(test, Record)
                    when = date_of_test(test, record) if is_file else date_of_record(record)
                    report = build_report(
                        kind, motor, record, run=run, reference=other, tolerances=tolerances,
                        offset_s=offset_s,
                    )  # fmt: skip
                    settled = [*_part(record), *settings]
                    outcomes.append(write_report(name, report, when, out, settled, language))
            except InputError as error:
                outcomes.append(Outcome(name, error=error))
            work.done(number)
        work.finish()
    return outcomes


def settings_of(
    run: Path | None,
    tolerances: Mapping[str, float] | None,
    offset_s: float | None,
    language: str = LANGUAGES[0],
) -> list[str]:
    """Return what makes another report of the same files, in words that can be compared.

    Args:
        run: Folder of the run that is held against the tests.
        tolerances: By channel.
        offset_s: Offset of the clocks that was given [s].
        language: Of the PDF.
    """
    said = [] if run is None else [f"run {digest(run / 'fit.json')}"]
    said += [f"tolerance {name} = {value!r}" for name, value in sorted((tolerances or {}).items())]
    said += [] if offset_s is None else [f"offset {offset_s!r} s"]
    return said if language == LANGUAGES[0] else [*said, f"language {language}"]


def _part(record: Record) -> list[str]:
    return [record.stretch] if record.stretch else []


def write_report(
    test: str,
    report: Report,
    when: DateOfTest | None,
    out: Path,
    settings: Sequence[str],
    language: str = LANGUAGES[0],
) -> Outcome:
    """Write a report as PDF, CSV and JSON, all or none.

    Args:
        test: As it was named.
        report: What is written.
        when: Date of the test, for the name; None where it is not known.
        out: Folder of the reports.
        settings: What makes another report of the same files: part, run, tolerances, language.
        language: Of the PDF.

    Raises:
        InputError: If a file behind it has changed, or the folder cannot be written.
    """
    refuse_changed(report.sources)
    identity = [source.sha256 for source in report.sources] or [report.test]
    identity += settings
    content = report_content(report, when)

    def chosen() -> str:
        of_one = report.test if report.kind != "prototypes" else ""
        return set_name(choose_name(out, report.kind, when, identity, of_one), identity)

    with writable("the report", out), together(out, chosen) as files:
        name = files.name.partition(".")[0]
        content = {"report": f"{name}.pdf", "identity": identity, **content}
        write_pdf(report, content, files.aside / f"{name}.pdf", Texts(language))
        write_whole(files.aside / f"{name}.csv", csv_table(report).encode("utf-8-sig"))
        write_whole(files.aside / f"{name}.json", (to_json(content) + "\n").encode())
    pdf, table, text = (out / f"{name}{end}" for end in (".pdf", ".csv", ".json"))
    return Outcome(test, pdf, table, text, report, content)
