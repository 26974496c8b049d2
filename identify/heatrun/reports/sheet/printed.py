"""How an uncertain number is printed: value ± U where that is true, else its interval."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from ...io.quantities import quantity, rounded
from ...results.parameter import FittedParameter
from ...results.values import Interval
from .digits import format_value

COVERAGE_FACTOR = 2.0
"""k of the expanded uncertainty U = k u; about 95 %."""

SKEW = 0.15
"""Share of U by which an end of the 95 % interval may differ from value ± U [1]. Quantiles of 500
draws scatter by 0.06 U; twice the standard deviation in the place of 1.96 makes 0.02 U."""


@dataclass(frozen=True)
class Printed:
    """A number as it is printed.

    Attributes:
        text: With its unit.
        form: Whether it is a value with U, an interval, or a value that was given.
        places: Decimal places of its numbers, negative for tens and hundreds; None where no
            uncertainty says how many there are.
    """

    text: str
    form: Literal["expanded", "interval", "given"]
    places: int | None


def printed(entry: FittedParameter) -> Printed:
    """Return a parameter as it is printed, with the digits that its uncertainty warrants.

    Args:
        entry: The parameter.
    """
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

    Args:
        uncertainty: Above 0.

    Example:
        >>> places_of(20.0), places_of(0.00996), places_of(370.0)
        (0, 3, -1)
    """
    return 1 - math.floor(math.log10(float(f"{uncertainty:.1e}")))
