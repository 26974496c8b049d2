"""Reports of one test or of many: which tests are meant, written as PDF, CSV and JSON."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from heatrun.errors import InputError, UsageError
from heatrun.io.open_file import digest
from heatrun.io.own_files import ENDINGS, is_run_folder, own_file_at
from heatrun.io.texts import LANGUAGES, Texts
from heatrun.io.whole_files import together, writable, write_whole
from heatrun.readers.joined import read_tests
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.results import to_json
from heatrun.runs.run import open_run
from heatrun.work import Progress, Work

from .document import (
    DateOfTest,
    choose_name,
    csv_table,
    date_of_record,
    date_of_test,
    report_content,
    set_name,
    write_pdf,
)
from .general import energy_report, general_report
from .prototypes import base_of, read_prototypes
from .prototypes_report import prototypes_report
from .report import CARDS, TEST_TYPES, Kind, Report
from .simulated import Reference, read_reference, reference_of_run, refuse_changed
from .thermal import thermal_report
from .validation_report import validation_report

USUAL_S = 2.0
"""Time that a report usually takes [s]."""


@dataclass(frozen=True)
class Outcome:
    """What became of one test."""

    test: str  # As it was named: path of a file, or name of a record.
    pdf: Path | None = None  # The report; None if there is none, as the other files.
    csv: Path | None = None
    json: Path | None = None
    report: Report | None = None
    content: Mapping[str, object] | None = None  # What stands in the JSON.
    error: InputError | None = None  # Why there is no report; None if there is one.

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
    language: str = "",
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
        language: Of the PDF, one of `heatrun.io.texts.LANGUAGES`; empty for that of the motor's
            certificate, or English.
        say: Told a sentence about each test that is begun.
        progress: Called with a sentence and the share of the reports that are written.

    Returns:
        What became of each test, in order; a folder counts as its files.

    Raises:
        InputError: If the run, the reference or a folder cannot be read, or `out` not be written.
        UsageError: If something is given that the test type does not take, or lacks.
    """
    check_use(kind, run, reference is not None, tolerances, offset_s)
    language = _language(language, motor)
    other = None if reference is None else read_reference(reference, motor)
    if run is not None:
        open_run(run)  # what is wrong with it is wrong for every test, and said once
    with writable("the folder of the reports", out):
        out.mkdir(parents=True, exist_ok=True)
    found = tests_in(tests)
    for why, paths in (
        ("no bench files, left out", found.left_out),
        ("written by heatrun itself and left out", found.own),
    ):
        if paths and say is not None:
            say(f"{why}: {', '.join(path.name for path in paths)}")
    settings = _settings(run, tolerances, offset_s, language)
    outcomes = []
    with Work(dict.fromkeys(range(len(found.tests)), USUAL_S), progress) as work:
        for number, test in enumerate(found.tests):
            name = test.name if isinstance(test, Record) else str(test)
            if say is not None:
                say(f"{kind} report of {name}")
            work.at(number, f"report {number + 1} of {len(found.tests)}")
            is_record = isinstance(test, Record)
            try:
                for record in (test,) if is_record else read_tests(test, motor, at_gaps=False):
                    when = date_of_record(record) if is_record else date_of_test(test, record)
                    report = build_report(
                        kind, motor, record, run=run, reference=other, tolerances=tolerances,
                        offset_s=offset_s,
                    )  # fmt: skip
                    settled = [*filter(None, [record.stretch]), *settings]
                    made = _written(report.test, report, when, out, settled, language)
                    outcomes.append(replace(made, test=name))
            except InputError as error:
                outcomes.append(Outcome(name, error=error))
            work.done(number)
        work.finish()
    return outcomes


def make_prototypes_report(
    motor: Motor,
    roles: Sequence[tuple[str, Path]],
    out: Path,
    *,
    run: Path | None = None,
    tolerances: Mapping[str, float] | None = None,
    language: str = "",
    say: Callable[[str], None] | None = None,
) -> Outcome:
    """Write the report on several prototypes, called after the one whose clock is kept.

    Args:
        motor: The machine.
        roles: Role and file of each prototype, or the folder of a run.
        out: As `make_report`.
        run: Folder of a calibration whose network is held against each; None for none.
        tolerances: By channel or figure, in its unit (K for temperatures).
        language: As `make_report`.
        say: Told a sentence when it begins.

    Raises:
        InputError: If a file or run cannot be read, the prototypes cannot be aligned, or `out` not
            be written.
        UsageError: If a run is to stand for a prototype and no measured record drives it.
    """
    if say is not None:
        say(f"prototypes report of {', '.join(role for role, _ in roles)}")
    language = _language(language, motor)
    prototypes = read_prototypes(roles, motor)
    report = prototypes_report(motor, prototypes, run=run, tolerances=tolerances)
    base = base_of(prototypes)
    when = date_of_test(dict(roles)[base.role], base.record)
    with writable("the folder of the reports", out):
        out.mkdir(parents=True, exist_ok=True)
    parts = [p.record.stretch for p in prototypes if p.record.stretch]
    settings = [*parts, *_settings(run, tolerances, None, language)]
    return _written(base.record.name, report, when, out, settings, language)


def _language(asked: str, motor: Motor) -> str:
    return asked or (motor.certificate.language or LANGUAGES[0])


def _settings(
    run: Path | None, tolerances: Mapping[str, float] | None, offset_s: float | None, language: str
) -> list[str]:
    """Return what makes another report of the same files, in words that can be compared."""
    said = [] if run is None else [f"run {digest(run / 'fit.json')}"]
    said += [f"tolerance {name} = {value!r}" for name, value in sorted((tolerances or {}).items())]
    said += [] if offset_s is None else [f"offset {offset_s!r} s"]
    return said if language == LANGUAGES[0] else [*said, f"language {language}"]


def _written(
    test: str,
    report: Report,
    when: DateOfTest | None,
    out: Path,
    settings: Sequence[str],
    language: str,
) -> Outcome:
    """Write a report as PDF, CSV and JSON, all or none, called after a test.

    Raises:
        InputError: If a file behind it has changed, or the folder cannot be written.
    """
    refuse_changed(report.sources)
    identity = [source.sha256 for source in report.sources] or [report.test]
    identity += settings
    content = report_content(report, when)

    def chosen() -> str:
        return set_name(choose_name(out, report.kind, when, identity, test), identity)

    with writable("the report", out), together(out, chosen) as files:
        name = files.name.partition(".")[0]
        content = {"report": f"{name}.pdf", "identity": identity, **content}
        write_pdf(report, content, files.aside / f"{name}.pdf", Texts(language))
        write_whole(files.aside / f"{name}.csv", csv_table(report).encode("utf-8-sig"))
        write_whole(files.aside / f"{name}.json", (to_json(content) + "\n").encode())
    pdf, table, text = (out / f"{name}{end}" for end in (".pdf", ".csv", ".json"))
    return Outcome(report.test, pdf, table, text, report, content)


def build_report(
    kind: Kind,
    motor: Motor,
    record: Record,
    *,
    run: Path | None = None,
    reference: Reference | None = None,
    tolerances: Mapping[str, float] | None = None,
    offset_s: float | None = None,
) -> Report:
    """Return the report of a record; nothing is read but the run, nothing is written.

    Args:
        kind: Test type.
        motor: The machine.
        record: The test on the bench.
        run: Folder of a calibration, for `"thermal"`; for `"virtual"` in place of a reference: the
            run's network driven by the test.
        reference: Record of the other prototype, for `"virtual"` and `"real"`.
        tolerances: By channel, in its unit (K for temperatures); for `"virtual"` and `"real"`.
        offset_s: What is added to the reference's clock [s]; searched if None.

    Raises:
        InputError: If the record does not allow this report.
        UsageError: If something is given that the test type does not take, or lacks.
    """
    check_use(kind, run, reference is not None, tolerances, offset_s)
    if kind == "general":
        return general_report(motor, record)
    if kind == "energy":
        return energy_report(motor, record)
    if kind == "thermal":
        return thermal_report(motor, record, run)
    if reference is None:
        assert run is not None  # by check_use
        reference = reference_of_run(run, record, motor)
    if kind == "virtual":
        reference = replace(reference, is_model=True)
    role = "virtual" if kind == "virtual" else "real"
    return validation_report(
        role, motor, record, reference, tolerances=tolerances, offset_s=offset_s
    )


def check_use(
    kind: Kind,
    run: Path | None,
    has_reference: bool,
    tolerances: Mapping[str, float] | None,
    offset_s: float | None,
) -> None:
    """Check what a test type takes; as `build_report`.

    Raises:
        UsageError: If something is given that the test type does not take, or lacks.
    """
    if kind == "prototypes":
        raise UsageError("a prototypes report takes records by role; see `confront`.")
    if kind not in TEST_TYPES:
        raise UsageError(f"no test type {kind!r}; there are {', '.join(TEST_TYPES)}.")
    takes_reference = TEST_TYPES[kind].needs_reference
    if not takes_reference and (has_reference or tolerances or offset_s is not None):
        raise UsageError(
            f"a {kind} report compares nothing: --reference, --tolerance and --offset belong to "
            "virtual and real."
        )
    if run is not None and kind not in ("thermal", "virtual"):
        raise UsageError(f"--type {kind} takes no --run; thermal and virtual do.")
    if run is not None and has_reference:
        raise UsageError("give either --reference or --run: both would be the virtual prototype.")
    if takes_reference and not has_reference and run is None:
        option = " or --run RUN" if kind == "virtual" else ""
        raise UsageError(f"a {kind} report needs --reference FILE{option}.")


NO_TESTS = (
    "readme",
    "license",
    "sheet.xlsx",
    "~$",
    *(card.stem.lower() for card in CARDS.values()),
)
"""Beginnings of names beside bench files that are none: notes, parameter sheets, locks of Excel,
and the reports themselves."""


@dataclass(frozen=True)
class ReportedTests:
    """Tests to be reported on; of folders what is no bench file, or written by heatrun itself."""

    tests: tuple[Path | Record, ...]
    left_out: tuple[Path, ...]
    own: tuple[Path, ...]


def tests_in(named: Sequence[Path | Record]) -> ReportedTests:
    """Return records and files as they are, and for each folder its bench files by name.

    Whether a file of a folder is one is told by its ending, and by its first line where it is one
    that heatrun has written; hidden files and folders are passed over, folders in it are entered,
    and run folders are not.

    Raises:
        InputError: If a folder holds no bench file, or is a run.
    """
    tests: list[Path | Record] = []
    left_out: list[Path] = []
    own: list[Path] = []
    for each in named:
        if isinstance(each, Record) or not each.is_dir():
            tests.append(each)
            continue
        if is_run_folder(each):
            raise InputError(
                "Expected bench files, got a run folder of heatrun.",
                where=str(each),
                remedy="Name the bench file that the run was made from; a run goes behind --run.",
            )
        files, runs = _files(each)
        bench = [path for path in files if _is_bench_file(path)]
        found = [path for path in bench if not own_file_at(path)]
        own_here = [*runs, *(path for path in bench if path not in found)]
        if not found:
            only_own = " but what heatrun has written" if own_here else ""
            raise InputError(
                f"Expected a folder of bench files, found none in it{only_own}.",
                where=str(each),
                remedy=f"Known endings are {', '.join(ENDINGS)}, also with .gz.",
            )
        tests += found
        own += own_here
        left_out += [path for path in files if path not in bench]
    return ReportedTests(tuple(tests), tuple(left_out), tuple(own))


def _is_bench_file(path: Path) -> bool:
    name = path.name.lower()
    return name.removesuffix(".gz").endswith(ENDINGS) and not name.startswith(NO_TESTS)


def _files(folder: Path) -> tuple[list[Path], list[Path]]:
    """Return the files of a folder, and the run folders in it, which are not entered."""

    def refuse(error: OSError) -> None:
        raise InputError(
            f"The folder cannot be read ({error.strerror}).",
            where=str(error.filename or folder),
            remedy="Check its permissions.",
        ) from error

    files: list[Path] = []
    runs: list[Path] = []
    for at, folders, names in os.walk(folder, onerror=refuse):
        shown = sorted(name for name in folders if not name.startswith("."))
        folders[:] = [name for name in shown if not is_run_folder(Path(at) / name)]
        runs += [Path(at) / name for name in shown if name not in folders]
        files += [Path(at) / name for name in sorted(names) if not name.startswith(".")]
    return files, runs
