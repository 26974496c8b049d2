"""Kinds of values that many fields of the results share, with the limits that a reader checks."""

from __future__ import annotations

import math
from typing import Annotated, Literal, TypeVar

from msgspec import UNSET, Meta, UnsetType

T = TypeVar("T")

Interval = tuple[float, float]
"""Lower and upper limit of a 95 % interval [unit of the value]."""

NonNegative = Annotated[float, Meta(ge=0)]
"""A number that cannot be below 0."""

Probability = Annotated[float, Meta(ge=0, le=1)]
"""A probability or a share [1]."""

Count = Annotated[int, Meta(ge=0)]
"""A number of things."""

Role = Literal["calibration", "holdout"]
"""Whether a test was fitted or only predicted."""


def number(value: float | None) -> float:
    """Return a number of a result, NaN where the file holds null: it was not finite."""
    return math.nan if value is None else value


def known(value: T | UnsetType) -> T | None:
    """Return what a field of a result says, None where it is unset."""
    return None if value is UNSET else value
