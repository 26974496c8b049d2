"""Values that many fields of the results share, and the uncertainty budget of GUM.

In a budget every source stands with its uncertainty, its sensitivity and its share.
The sources are what stands behind an estimate and is independent of all else: the scatter of the
readings, and how far each prior mean (a stated instrument, a usual size) may be off. For an
estimate that is linear in these the budget is exact. With the Jacobian $J$ of the readings over
their scatter and $g$ of the answer, both by standard normal numbers, and $S = (1 + J^T J)^{-1}$,
the mean of number $i$ moves the answer by $(S g)_i$ and the scatter by $|J S g|$; their squares
add up to $g^T S g$.

What the readings themselves tell of a source is taken into account: its share is what its prior
mean still moves, not what would go if it were known exactly. The two are one where the readings
tell nothing of it, as of most instruments.

Reference: JCGM 100:2008 (GUM), 4.3 and 5.1.2.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple, TypeVar

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


Type = Literal["A", "B"]
"""How a source is evaluated: by the scatter of the readings, or otherwise."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetRow:
    """One source of the uncertainty.

    Attributes:
        source: In words.
        type: A for what the scatter of the readings brings, B for what a prior mean does.
        unit: Of the source; empty where several numbers stand behind it.
        standard_uncertainty: Of the source alone [unit]; null where it has no unit.
        sensitivity: Of the answer to one unit [its unit per unit]; null likewise.
        contribution: Standard uncertainty that it brings to the answer [its unit].
        share: Of the variance [1].
    """

    source: str
    type: Type
    unit: str
    standard_uncertainty: NonNegative | None
    sensitivity: float | None
    contribution: NonNegative
    share: Probability


class Part(NamedTuple):
    """What a source brings.

    Attributes:
        source: In words.
        type: As `BudgetRow.type`.
        moves: By how much the answer moves with one standard uncertainty of the source.
        sd: Standard uncertainty of the source [unit]; None where several numbers stand behind it.
        unit: Of the source.
    """

    source: str
    type: Type
    moves: float
    sd: float | None = None
    unit: str = ""


def budget(parts: Iterable[Part]) -> tuple[BudgetRow, ...]:
    """Return the budget of what independent sources bring, the largest first."""
    parts = list(parts)
    whole = math.hypot(*(part.moves for part in parts)) or 1.0
    rows = [
        BudgetRow(
            source=part.source,
            type=part.type,
            unit=part.unit,
            standard_uncertainty=part.sd,
            sensitivity=part.moves / part.sd if part.sd else None,
            contribution=abs(part.moves),
            share=min(1.0, (part.moves / whole) ** 2),
        )
        for part in parts
    ]
    return tuple(sorted(rows, key=lambda row: -row.share))


def combined(rows: Iterable[BudgetRow]) -> float:
    """Return the standard uncertainty to first order, the root of the sum of a budget."""
    return math.hypot(*(row.contribution for row in rows))
