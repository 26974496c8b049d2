"""Tolerances as the user gives them: `CHANNEL=VALUE`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heatrun.bench.channels.schema import CHANNEL
from heatrun.errors import UsageError

from .general_information import FIGURES

NAMES = (*(name for name in CHANNEL if name != "time_s"), *(name for name, _, _ in FIGURES))
"""What a tolerance can be given for: channels, and figures of the General Information table."""


def parse_tolerances(texts: Sequence[str]) -> dict[str, float]:
    """Return tolerances by channel or figure.

    Args:
        texts: Each `NAME=VALUE`, in the unit at the end of the name (K for degC).

    Raises:
        UsageError: If a text is no such pair, the name is unknown or the value not positive.
    """
    found = {}
    for text in texts:
        name, sign, number = text.partition("=")
        try:
            value = float(number)
        except ValueError:
            value = float("nan")
        if not sign or not (np.isfinite(value) and value > 0.0):
            raise UsageError(
                f"--tolerance {text!r}: expected CHANNEL=VALUE with a positive value, such as "
                "winding_degC=3."
            )
        if name not in NAMES:
            raise UsageError(
                f"--tolerance {text!r}: no channel or figure of this name; known are "
                f"{', '.join(NAMES)}."
            )
        found[name] = value
    return found
