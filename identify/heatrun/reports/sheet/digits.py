"""Numbers with the digits that their uncertainty warrants."""

from __future__ import annotations

import math
from collections.abc import Sequence


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
    """
    if value is None or not math.isfinite(value):
        return "not determined", "–"
    if uncertainty is None or not math.isfinite(uncertainty) or uncertainty <= 0:
        return f"{value:.5g}", "–"
    places = 1 - math.floor(math.log10(uncertainty))
    if places > 0:
        return f"{value:.{places}f}", f"{uncertainty:.{places}f}"
    return f"{round(value, places):.0f}", f"{round(uncertainty, places):.0f}"


def format_interval(interval: Sequence[float | None] | None, uncertainty: float | None) -> str:
    """Return an interval as text, to the digits of the uncertainty."""
    if interval is None:
        return "not determined"
    low, high = (format_value(end, uncertainty)[0] for end in interval)
    return f"{low} … {high}"
