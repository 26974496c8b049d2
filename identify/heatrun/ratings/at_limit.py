"""Continuous current and time to the limit of the insulation class."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..io.quantities import rounded
from ..results.derived import DerivedFigure
from .figure import figure, refused
from .machine import WARM, Machine
from .tested import REACH, Tested

LIMIT_DEGC = {"A": 105.0, "E": 120.0, "B": 130.0, "F": 155.0, "H": 180.0, "N": 200.0, "R": 220.0}
"""Temperature of the insulation classes [degC]; IEC 60085, table 1."""

NO_CLASS = "no insulation class: give [motor] insulation_class in the motor file"

NO_CURRENT = (
    "the current does not enter: the total loss is measured, and all of it heats one node; "
    "calibrate a network with a winding of its own"
)


@dataclass(frozen=True)
class Limit:
    """The limit of an insulation class.

    Attributes:
        insulation: Letter of the class.
        degC: Its temperature [degC].
    """

    insulation: str
    degC: float

    def __str__(self) -> str:
        """Return the limit as it stands in conditions."""
        return f"class {self.insulation} ({self.degC:.0f} °C)"


def at_limit(
    drawn: Machine, seen: Tested, limit: Limit | None, heated: str
) -> dict[str, DerivedFigure]:
    """Return the figures at the limit by name.

    Args:
        drawn: The machine of each draw.
        seen: Range of the tests.
        limit: Limit of the insulation; None if the motor file gives no class.
        heated: Losses and surroundings that the figures hold under.
    """
    names = {"cold": "time_to_limit_cold_s", "hot": "time_to_limit_hot_s"}
    if limit is None:
        return {key: refused(NO_CLASS) for key in ("continuous_current_A", *names.values())}
    text = f"{limit}, {heated}"
    figures = {"continuous_current_A": _continuous(drawn, seen, limit, text)}
    beyond = seen.beyond_limit(limit.degC)
    starts = {"cold": "from the sink's temperature",
              "hot": f"from {100 * WARM:.0f} % of the steady rise"}  # fmt: skip
    for name, draws in (("cold", drawn.cold_s), ("hot", drawn.warm_s)):
        if beyond:
            figures[names[name]] = refused(beyond)
            continue
        entry = figure(np.asarray(draws), "s", f"{rounded(seen.amperes)} A, {starts[name]}, {text}")
        if not np.isfinite(entry.median):
            entry = refused(f"{rounded(seen.amperes)} A does not reach {limit.degC:.0f} °C")
        figures[names[name]] = entry
    return figures


def _continuous(drawn: Machine, seen: Tested, limit: Limit, text: str) -> DerivedFigure:
    if not np.any(drawn.copper_slope):
        return refused(NO_CURRENT)
    beyond = seen.beyond_limit(limit.degC)
    if beyond:
        return refused(beyond)
    squared = np.asarray(drawn.limit_squared)
    entry = figure(np.sqrt(np.maximum(squared, 0.0)), "A", text)
    if not entry.median <= REACH * seen.current_A:
        return refused(
            f"{rounded(entry.median)} A is outside the tested range: the largest "
            f"current tested is {rounded(seen.current_A)} A"
        )
    return entry
