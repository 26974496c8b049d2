"""How far two prototypes may differ in a signal and still count as agreeing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ....bench.channels.schema import CHANNEL
from ....errors import UsageError

TEMPERATURE_K = 5.0
"""Half of the 10 K that halve the life of an insulation (Montsinger's rule)."""

SHARE = 0.05
"""Share of the reference's largest magnitude [1] for every other signal; ours, no standard."""


@dataclass(frozen=True)
class Tolerance:
    """A tolerance and where it comes from.

    Attributes:
        value: In the unit of the channel.
        basis: For the report.
    """

    value: float
    basis: str


def parse_tolerances(texts: Sequence[str]) -> dict[str, float]:
    """Return tolerances by channel.

    Args:
        texts: Each `CHANNEL=VALUE`, in the unit at the end of the channel's name (K for degC).

    Raises:
        UsageError: If a text is no such pair, the channel is unknown or the value not positive.
    """
    found = {}
    for text in texts:
        channel, sign, number = text.partition("=")
        try:
            value = float(number)
        except ValueError:
            value = float("nan")
        if not sign or not (np.isfinite(value) and value > 0.0):
            raise UsageError(
                f"--tolerance {text!r}: expected CHANNEL=VALUE with a positive value, such as "
                "winding_degC=3."
            )
        if channel not in CHANNEL or channel == "time_s":
            raise UsageError(
                f"--tolerance {text!r}: no channel of this name; known are "
                f"{', '.join(name for name in CHANNEL if name != 'time_s')}."
            )
        found[channel] = value
    return found


def tolerance_of(channel: str, reference: np.ndarray, given: Mapping[str, float]) -> Tolerance:
    """Return the tolerance of a signal.

    Args:
        channel: The signal.
        reference: The reference's course, with NaN where it has none, shape (common,).
        given: The user's, by channel.
    """
    if channel in given:
        return Tolerance(given[channel], "given")
    if channel.endswith("_degC"):
        return Tolerance(TEMPERATURE_K, "default: half of the 10 K that halve insulation life")
    largest = float(np.nanmax(np.abs(reference)))
    return Tolerance(SHARE * largest, f"default: {SHARE:.0%} of the reference's largest magnitude")
