"""Numbers with the digits that their uncertainty warrants."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...io.quantities import rounded


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
    # rounded first: 0.0996 has two significant digits as 0.10
    places = 1 - math.floor(math.log10(float(f"{uncertainty:.1e}")))
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
