"""The days of the tests: from the records, or as the laboratory states them."""

from __future__ import annotations

import datetime
from dataclasses import dataclass

from ...certificate import Certificate
from ...results import FitResult
from ...results.values import known

DAY_S = 86400.0


@dataclass(frozen=True)
class TestDays:
    """First and last day of the tests, ISO 8601; empty where they are not known.

    Attributes:
        first: The first day.
        last: The last day.
        note: What the records say where the laboratory states another day; else empty.
    """

    first: str = ""
    last: str = ""
    note: str = ""

    def __str__(self) -> str:
        """Return the days as they are printed; empty where they are not known."""
        return self.first if self.first == self.last else f"{self.first} to {self.last}"


def test_days(result: FitResult, certificate: Certificate) -> TestDays:
    """Return the days of the tests of a run.

    A day that the certificate states goes before that of a record. Where the record of one test has
    no date, those of the others say nothing of the whole.

    Args:
        result: What stands in `fit.json`.
        certificate: What the laboratory states.
    """
    first, last = _by_record(result)
    begin = certificate.test_from or certificate.test_until
    if not begin:
        return TestDays(first, last)
    stated = TestDays(begin, certificate.test_until or begin)
    if not first or (first, last) == (stated.first, stated.last):
        return stated
    return TestDays(stated.first, stated.last, f"By the records: {TestDays(first, last)}.")


def _by_record(result: FitResult) -> tuple[str, str]:
    """Return first and last day by the records; empty if one has no date."""
    starts = [known(test.start) or "" for test in result.tests]
    if not all(starts):
        return "", ""
    ends = [
        datetime.date.fromisoformat(start) + datetime.timedelta(days=int(test.duration_s // DAY_S))
        for start, test in zip(starts, result.tests, strict=True)
    ]
    return min(starts), max(ends).isoformat()
