"""How uncertain numbers are printed, value ± U or an interval, and the days of the tests."""

import datetime
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from ..io.quantities import quantity, rounded
from ..io.texts import Texts, table
from ..record.derive import constants_of
from ..record.findings import OF_ID
from ..record.motor import Certificate
from ..record.record import Finding
from ..results import FitResult
from ..results.model import DescribedTest, FittedParameter
from ..results.values import Interval, known


def format_value(value: float | None, uncertainty: float | None) -> tuple[str, str]:
    """Return value and uncertainty as text, the uncertainty to two significant digits.

    Args:
        value: The value; None is printed as not determined.
        uncertainty: Its standard or expanded uncertainty, in the same unit; None or 0 gives the
            value to five digits and a dash.

    Reference: JCGM 100:2008 (GUM), 7.2.6.

    Example:
        >>> format_value(666.03, 7.26)
        ('666.0', '7.3')
        >>> format_value(15051.0, 176.0)
        ('15050', '180')
        >>> format_value(-0.0004, 0.0996)
        ('0.00', '0.10')
    """
    if value is None or not math.isfinite(value):
        return "not determined", "–"
    if uncertainty is None or not math.isfinite(uncertainty) or uncertainty <= 0:
        return rounded(value, 5), "–"
    places = places_of(uncertainty)
    return fixed(value, places), fixed(uncertainty, places)


def fixed(value: float, places: int) -> str:
    """Return a number to so many decimal places, negative for tens and hundreds.

    Example:
        >>> fixed(204.078, 1), fixed(4711.0, -2), fixed(-0.01, 1)
        ('204.1', '4700', '0.0')
    """
    if places > 0:
        return _without_sign(f"{value:.{places}f}")
    return _without_sign(f"{round(value, places):.0f}")


def _without_sign(text: str) -> str:
    """Return a number as text; a nought has no sign."""
    return text.removeprefix("-") if float(text) == 0 else text


def format_interval(interval: Sequence[float | None] | None, uncertainty: float | None) -> str:
    """Return an interval as text, to the digits of the uncertainty."""
    if interval is None:
        return "not determined"
    low, high = (format_value(end, uncertainty)[0] for end in interval)
    return f"{low} … {high}"


def signed(value: float, places: int) -> str:
    """Return a number with its sign, a nought without.

    Example:
        >>> signed(-0.53, 2), signed(0.2, 1), signed(-0.001, 2)
        ('-0.53', '+0.2', '0.00')
    """
    text = f"{value:+.{places}f}"
    return text[1:] if float(text) == 0 else text


COVERAGE_FACTOR = 2.0
"""k of the expanded uncertainty U = k u; about 95 %."""

SKEW = 0.15
"""Share of U by which an end of the 95 % interval may differ from value ± U [1]. Quantiles of 500
draws scatter by 0.06 U; twice the standard deviation in the place of 1.96 makes 0.02 U."""


@dataclass(frozen=True)
class Printed:
    """A number as it is printed."""

    text: str  # With its unit.
    # Whether it is a value with U, an interval, or a value that was given.
    form: Literal["expanded", "interval", "given"]
    # Decimal places of its numbers, negative for tens and hundreds; None where no uncertainty says
    # how many there are.
    places: int | None


def printed(entry: FittedParameter) -> Printed:
    """Return a parameter as it is printed, with the digits that its uncertainty warrants."""
    if entry.fixed or not entry.sd > 0 or not math.isfinite(entry.sd):
        return Printed(quantity(rounded(entry.value, 5), entry.unit), "given", None)
    return uncertain(entry.value, entry.sd, entry.interval_95, entry.unit)


def uncertain(value: float, sd: float, interval: Interval, unit: str) -> Printed:
    """Return a value that was estimated as it is printed.

    Args:
        value: The value.
        sd: Its standard uncertainty, above 0.
        interval: Its 95 % interval.
        unit: Unit of all of them.
    """
    expanded = COVERAGE_FACTOR * sd
    if is_symmetric(value, expanded, interval):
        middle, U = format_value(value, expanded)
        return Printed(quantity(f"{middle} ± {U}", unit), "expanded", places_of(expanded))
    low, high = interval_ends(interval, sd)
    return Printed(quantity(f"{low} … {high}", unit), "interval", places_of(sd))


def is_symmetric(value: float, expanded: float, interval: Interval) -> bool:
    """Return whether value ± U says the same as the 95 % interval.

    Args:
        value: The value.
        expanded: Its expanded uncertainty U, in the same unit.
        interval: Both ends of its 95 % interval.
    """
    low, high = interval
    room = SKEW * expanded
    return abs(low - (value - expanded)) <= room and abs(high - (value + expanded)) <= room


def interval_ends(interval: Interval, sd: float) -> tuple[str, str]:
    """Return both ends to the digits of the uncertainty; one that is not 0 does not become 0.

    Args:
        interval: The ends.
        sd: Standard uncertainty, in the same unit.
    """
    low, high = (format_value(end, sd)[0] for end in interval)
    return tuple(
        rounded(end, 2) if end != 0 and float(text) == 0 else text
        for end, text in zip(interval, (low, high), strict=True)
    )  # type: ignore[return-value]


def places_of(uncertainty: float) -> int:
    """Return the decimal places of an uncertainty of two significant digits.

    Example:
        >>> places_of(20.0), places_of(0.00996), places_of(370.0)
        (0, 3, -1)
    """
    # rounded first: 0.0996 has two significant digits as 0.10
    return 1 - math.floor(math.log10(float(f"{uncertainty:.1e}")))


DAY_S = 86400.0


@dataclass(frozen=True)
class TestDays:
    """First and last day of the tests, ISO 8601; empty where they are not known."""

    first: str = ""  # The first day.
    last: str = ""  # The last day.
    note: str = ""  # What the records say where the laboratory states another day; else empty.

    def __str__(self) -> str:
        """Return the days as they are printed; empty where they are not known."""
        return self.first if self.first == self.last else f"{self.first} to {self.last}"


def test_days(result: FitResult, certificate: Certificate) -> TestDays:
    """Return the days of the tests of a run.

    A day that the certificate states goes before that of a record. Where the record of one test has
    no date, those of the others say nothing of the whole.
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


def num_stated(tests: Sequence[DescribedTest], channel: str) -> int:
    """Return in how many tests a channel is a constant of the motor file."""
    return sum(channel in constants_of(test.notes) for test in tests)


def ranked(findings: Sequence[Finding]) -> list[Finding]:
    """Return findings, the gravest first."""
    order = {"error": 0, "warning": 1, "note": 2}
    return sorted(findings, key=lambda finding: order[finding.severity])


def told(finding: Finding, say: Texts) -> tuple[str, bool]:
    """Return a finding as a line of text, and whether all of it is in the language of the page.

    A message that the table lacks stays English, under what all findings of its id mean.
    """
    message, remedy = say.sentences(finding.message), say.sentences(finding.remedy)
    meaning = f"{OF_ID}{finding.id}"
    above = say(meaning) if message is None and meaning in table() else ""
    said = replace(
        finding,
        where=say.sentences(finding.where) or finding.where,
        message=finding.message if message is None else message,
        remedy=finding.remedy if remedy is None else remedy,
    )
    return f"{above} {said.sentence()}".strip(), None not in (message, remedy)
