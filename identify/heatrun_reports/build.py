"""From records to a report, by test type."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from heatrun.errors import UsageError
from heatrun.record.motor import Motor
from heatrun.record.record import Record

from .bench_test_types import TEST_TYPES, Kind
from .general import energy_report, general_report
from .report import Report
from .simulated import Reference, reference_of_run, simulate_run
from .thermal import thermal_report
from .validation_report import validation_report


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
        reference = reference_of_run(simulate_run(run, record, motor), run, motor)
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
        raise UsageError(f"a {kind} report takes no --run; thermal and virtual do.")
    if run is not None and has_reference:
        raise UsageError("give either --reference or --run: both would be the virtual prototype.")
    if takes_reference and not has_reference and run is None:
        option = " or --run RUN" if kind == "virtual" else ""
        raise UsageError(f"a {kind} report needs --reference FILE{option}.")
