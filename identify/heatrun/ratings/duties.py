"""Currents of the duty types S2 and S3 at the insulation limit, where they are asked for."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import UsageError

CYCLE_S = 600.0
"""Length of a cycle of S3 [s]; IEC 60034-1, 4.2.3, if not agreed otherwise."""

NUM_DRAWS = 300
"""Draws behind a rating: each is a search over simulated duties."""

NUM_HALVINGS = 14
"""Halvings of the current's range: 2^-14 of it, far below its uncertainty."""

PATTERN = re.compile(r"^S2-(?P<minutes>\d+(?:\.\d+)?)$|^S3-(?P<percent>\d+(?:\.\d+)?)$")


@dataclass(frozen=True)
class Duty:
    """A duty type of IEC 60034-1.

    Attributes:
        name: As asked for: `"S2-30"` is 30 minutes from cold, `"S3-40"` 40 % of each cycle.
        on_s: Time under load [s].
        off_s: Time at rest, de-energised, after it [s]; 0 for S2.
        num_cycles: Cycles until the last one counts.
    """

    name: str
    on_s: float
    off_s: float
    num_cycles: int


def parse_duty(text: str, slow_s: float) -> Duty:
    """Return a duty by its name.

    Args:
        text: `"S2-MINUTES"` or `"S3-PERCENT"`.
        slow_s: Slow time constant [s]; a cycled duty runs for five of them.

    Raises:
        UsageError: If the name is none of these, or the share is not inside 0…100 %.
    """
    found = PATTERN.match(text)
    if found and found["minutes"] and float(found["minutes"]) > 0:
        return Duty(text, 60.0 * float(found["minutes"]), 0.0, 1)
    if found and found["percent"] and 0 < float(found["percent"]) < 100:
        on = CYCLE_S * float(found["percent"]) / 100.0
        return Duty(text, on, CYCLE_S - on, max(2, round(5 * slow_s / CYCLE_S)))
    raise UsageError(f"rating {text!r}: expected S2-MINUTES or S3-PERCENT, such as S2-30 or S3-40.")


def current_at_limit(
    duty: Duty,
    highest: Callable[[np.ndarray, Duty], np.ndarray],
    limit_degC: float,
    largest_A: float,
    num_draws: int,
) -> np.ndarray:
    """Return the rms current at which the winding just reaches its limit [A], shape (draw,).

    Args:
        duty: The duty.
        highest: Returns the highest winding temperature [degC] for currents [A] of each draw.
        limit_degC: Limit of the insulation class.
        largest_A: Upper end of the search; draws that stay below the limit there return inf.
        num_draws: Number of draws.
    """
    low, high = np.zeros(num_draws), np.full(num_draws, largest_A)
    beyond = highest(high, duty) < limit_degC
    for _ in range(NUM_HALVINGS):
        middle = 0.5 * (low + high)
        is_hot = highest(middle, duty) >= limit_degC
        low, high = np.where(is_hot, low, middle), np.where(is_hot, middle, high)
    return np.where(beyond, np.inf, 0.5 * (low + high))
