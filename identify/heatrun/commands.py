"""What each command does: load, call, write, print. Computes nothing itself."""

from __future__ import annotations

import argparse
import hashlib
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tqdm import tqdm

from .bench import Finding
from .bench.checks import check_record
from .bench.joined import read_test
from .calibrate import (
    Calibration,
    Refused,
    Test,
    default_folder,
    load_tests,
    manifest,
    refuse_unwritable,
)
from .calibrate import (
    calibrate as run_calibration,
)
from .cli import DONE, NOT_ALLOWED
from .errors import InputError
from .motor import Motor
from .motorfile import load_motor
from .ratings import parse_duty
from .report_text import findings_text, result_text
from .result import describe_finding
from .run_folder import RunFolder, dump


def check(options: argparse.Namespace) -> int:
    """`heatrun check`."""
    motor = load_motor(options.motor)
    findings: list[Finding] = []
    for path in options.tests:
        record = read_test(path, motor)
        _say(f"{record.name}: {record.time_s.size} samples over {record.duration_s:.0f} s")
        for note in record.notes:
            _say(f"  {note}")
        findings += check_record(record, motor)
    has_error = any(finding.severity == "error" for finding in findings)
    if options.json:
        print(dump({"findings": [describe_finding(finding) for finding in findings]}))
    else:
        print(findings_text(findings))
    return NOT_ALLOWED if has_error else DONE


def calibrate(options: argparse.Namespace) -> int:
    """`heatrun calibrate`."""
    orders = ("first", "second") if options.model == "both" else (options.model,)
    return _calibrate(options, load_motor(options.motor), options.tests, options.holdout, orders)


def compare(options: argparse.Namespace) -> int:
    """`heatrun compare`: both orders; a run folder is written only where one is named."""
    motor = load_motor(options.motor)
    both = ("first", "second")
    if options.out is not None:
        return _calibrate(options, motor, options.tests, options.holdout, both)
    tests = _load(motor, options.tests, options.holdout, options.json)
    if tests is None:
        return NOT_ALLOWED
    found = run_calibration(
        motor,
        tests,
        method="quick" if options.quick else "emcee",
        seed=options.seed,
        command=options.command_line,
        say=_say,
        progress=None,
    )
    if options.json:
        print(dump({k: found.result[k] for k in ("verdict", "comparison", "findings", "tests")}))
    else:
        print(
            "\n".join([found.result["verdict"]["sentence"], *found.result["comparison"]["words"]])
        )
    return DONE


def discover(options: argparse.Namespace) -> int:
    """`heatrun discover`."""
    from .discover.job import run_job
    from .discover.library import all_effects
    from .report_text import discovery_text

    motor = load_motor(options.motor)
    kinds = all_effects(options.effects)
    tests = _load(motor, options.tests, options.holdout, options.json)
    if tests is None:
        return NOT_ALLOWED
    path = options.out or default_folder(motor, tests, "discovery")
    refuse_unwritable(path)
    method = "quick" if options.quick else "emcee"
    identity = {
        "command": "discover",
        "motor": motor.sha256,
        "tests": [[s.sha256 for s in test.record.sources] + [test.role] for test in tests],
        "effects": [[str(p), hashlib.sha256(p.read_bytes()).hexdigest()] for p in options.effects],
        "order": options.model,
        "method": method,
        "seed": options.seed,
    }
    folder = RunFolder.begin(path, identity)
    with _bar() as progress:
        job = run_job(
            motor,
            tests,
            folder,
            order=options.model,
            kinds=kinds,
            method=method,
            seed=options.seed,
            command=options.command_line,
            say=_say,
            progress=progress,
        )
    if options.json:
        print(dump({**job.result, "run": str(job.path)}))
    else:
        print(discovery_text(job.result))
        print(f"\nRun folder:      {job.path}")
        for name in ("discovery.pdf", "sheet.pdf", "discovery.json"):
            print(f"  {name:<14} {job.path / name}")
    return DONE


def demo(options: argparse.Namespace) -> int:
    """`heatrun demo`: the main job on bundled data."""
    from .bundled import bundled

    folder = bundled("synthetic")
    options.out = options.out or Path("results") / "runs" / "demo"
    return _calibrate(
        options,
        load_motor(folder / "motor.toml"),
        [folder / "duty_90min.csv.gz"],
        [folder / "step_90min.csv.gz"],
        ("first", "second"),
    )


def sheet(options: argparse.Namespace) -> int:
    """`heatrun sheet`."""
    from .sheet_of_run import rewrite_sheet

    written = rewrite_sheet(options.run, options.out or options.run)
    if options.json:
        print(dump({"files": [str(path) for path in written]}))
    else:
        print("\n".join(str(path) for path in written))
    return DONE


def simulate(options: argparse.Namespace) -> int:
    """`heatrun simulate`."""
    from .virtual import simulate_file

    motor = load_motor(options.motor)
    folder = options.out or Path()
    rows = [
        simulate_file(motor, options.source, path, options.model, folder, options.seed)
        for path in options.tests
    ]
    if options.json:
        print(dump({"simulated": rows}))
    else:
        for row in rows:
            error = "" if row["rmse_K"] is None else f", {row['rmse_K']:.2f} K RMSE to measured"
            print(f"{row['file']}: {row['num_rows']} rows{error}")
    return DONE


def print_error(error: InputError, *, as_json: bool) -> None:
    """Print an error as a message, or as JSON with the same words."""
    if as_json:
        print(dump({"error": {"problem": error.problem, "where": error.where,
                              "remedy": error.remedy}}))  # fmt: skip
    print(f"heatrun: {_printable(str(error))}", file=sys.stderr)


def _calibrate(
    options: argparse.Namespace,
    motor: Motor,
    calibration: Sequence[Path],
    holdout: Sequence[Path],
    orders: Sequence[Any],
) -> int:
    tests = _load(motor, calibration, holdout, options.json)
    if tests is None:
        return NOT_ALLOWED
    path = options.out or default_folder(motor, tests, options.model)
    refuse_unwritable(path)
    method = "quick" if options.quick else "emcee"
    identity = {
        "motor": motor.sha256,
        "tests": [[s.sha256 for s in test.record.sources] + [test.role] for test in tests],
        "orders": list(orders),
        "method": method,
        "seed": options.seed,
    }
    for duty in getattr(options, "rating", ()):
        parse_duty(duty, 1.0)  # wrong use is said before anything is fitted
    folder = RunFolder.begin(path, identity)
    with _bar() as progress:
        found = run_calibration(
            motor,
            tests,
            orders=orders,
            method=method,
            seed=options.seed,
            command=options.command_line,
            duties=getattr(options, "rating", ()),
            folder=folder,
            say=_say,
            progress=progress,
        )
    _say("writing the sheet")
    written = _write(found, folder, options)
    if options.json:
        print(dump({**found.result, "run": str(written)}))
    else:
        print(result_text(found.result))
        print(f"\nRun folder:      {written}")
        for name in ("sheet.pdf", "sheet.xlsx", "posterior_second.nc", "figures"):
            if (written / name).exists():
                print(f"  {name:<14} {written / name}")
    return DONE


def _write(found: Calibration, folder: RunFolder, options: argparse.Namespace) -> Path:
    from . import archive
    from .sheet_of_run import write_sheet_of

    folder.write_json("fit.json", found.result)
    for order, posterior in found.posteriors.items():
        archive.write(posterior, folder.partial / f"posterior_{order}.nc")
    write_sheet_of(found, folder.partial)
    return folder.finish(manifest(found, options.command_line, options.seed))


def _load(
    motor: Motor, calibration: Sequence[Path], holdout: Sequence[Path], as_json: bool
) -> tuple[Test, ...] | None:
    """Return the tests, or None after the findings that forbid them were printed."""
    try:
        return load_tests(motor, calibration, holdout)
    except Refused as refusal:
        if as_json:
            print(dump({"findings": [describe_finding(f) for f in refusal.findings]}))
        print(findings_text(refusal.findings), file=sys.stderr)
        print("heatrun: the data do not allow a calibration.", file=sys.stderr)
        return None


@contextmanager
def _bar() -> Iterator[Callable[[str, float], None]]:
    """Show a bar on stderr that is told a sentence and the share done."""
    with tqdm(total=100, disable=None, file=sys.stderr, leave=False, unit="%") as bar:

        def progress(sentence: str, share: float) -> None:
            bar.set_description(sentence)
            bar.n = int(100 * share)
            bar.refresh()

        yield progress


def _say(sentence: str) -> None:
    print(f"· {_printable(sentence)}", file=sys.stderr)


def _printable(text: str) -> str:
    """Escape control characters, so that a file name cannot steer the terminal."""
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text)
