"""Tests that a command fits, loaded; their findings printed where they forbid it."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from .console import bar, say

if TYPE_CHECKING:
    from ..calibration import BenchTest
    from ..record.motor import Motor


def load(
    motor: Motor, calibration: Sequence[Path], holdout: Sequence[Path], *, as_json: bool
) -> tuple[BenchTest, ...] | None:
    """Return the tests, or None after the findings that forbid them were printed."""
    count = len(calibration) + len(holdout)
    from ..calibration import Refused, load_tests
    from ..checks.suitability import other_tests
    from ..reports.terminal import findings_text
    from ..results import to_json

    try:
        with bar() as progress:
            progress(f"reading {count} test{'s' if count > 1 else ''}", 0.0)
            tests = load_tests(motor, calibration, holdout)
    except Refused as refusal:
        if as_json:
            print(to_json({"findings": refusal.findings}))
        print(findings_text(refusal.findings), file=sys.stderr)
        print("heatrun: the data do not allow a calibration.", file=sys.stderr)
        return None
    for finding in other_tests(motor, [test.record.name for test in tests]):
        say(f"{finding.severity}: {finding.sentence()}")
    return tests
