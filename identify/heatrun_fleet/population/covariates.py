"""Columns of the fleet file as covariates: numbers, dates in years, or categories."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Literal

import numpy as np
from jaxtyping import Float

from heatrun.errors import InputError

DAYS_OF_A_YEAR = 365.25

FEWEST_OF_A_CATEGORY = 2.0
"""Machines per category, on average, from which on texts count as categories; two always do."""

Kind = Literal["number", "date", "category"]


@dataclass(frozen=True)
class Covariate:
    """A column of the design.

    Attributes:
        label: Its name in results: the column's, with the category behind it.
        column: Name of the column.
        kind: What its texts are.
        values: One for each machine, not centred: the number, years, or 1 in the category.
        unit: What one unit of `values` is: `"1"`, `"year"` or the category.
        reference: The category that it is held against, which most machines have; else empty.
        low: Smallest text: the number or the date; empty for a category.
        high: Largest text, likewise.
    """

    label: str
    column: str
    kind: Kind
    values: Float[np.ndarray, " machine"]
    unit: str
    reference: str = ""
    low: str = ""
    high: str = ""

    @property
    def span(self) -> float:
        """Largest less smallest value."""
        return float(np.ptp(self.values))


def covariates_of(name: str, texts: Sequence[str], where: str) -> list[Covariate]:
    """Return the columns of the design that stand for a column of the fleet file.

    Args:
        name: Of the column.
        texts: One for each machine, none empty.
        where: What they were taken from, for messages.

    Returns:
        One column for numbers and dates, one for each category but the most common; none where all
        machines have the same.

    Raises:
        InputError: If the texts are neither numbers nor dates, and too many to be categories.
    """
    if len(set(texts)) <= 1:
        return []
    numbers = [_number(text) for text in texts]
    if all(number is not None for number in numbers):
        return [_scale(name, "number", "1", np.array(numbers, dtype=float), texts)]
    years = [_year(text) for text in texts]
    if all(year is not None for year in years):
        return [_scale(name, "date", "year", np.array(years, dtype=float), texts)]
    counts = Counter(texts)
    if len(counts) > max(2.0, len(texts) / FEWEST_OF_A_CATEGORY):
        raise InputError(
            f"Expected numbers, dates or a few categories in the column {name!r}, got "
            f"{len(counts)} different texts for {len(texts)} machines, such as "
            f"{_odd(texts, numbers, years)[:60]!r}.",
            where=where,
            remedy="Write dates as 2026-03-31, numbers with a point; or leave the column out.",
        )
    # the most common first; ties in the order of the alphabet
    reference, *others = sorted(counts, key=lambda text: (-counts[text], text))
    return [
        Covariate(
            f"{name}={text}", name, "category",
            np.array([float(each == text) for each in texts]), text, reference,
        )
        for text in others
    ]  # fmt: skip


def _odd(texts: Sequence[str], *read: Sequence[float | None]) -> str:
    """Return the first text that is not what most are: a number or a date."""
    best = max(read, key=lambda values: sum(value is not None for value in values))
    return next(text for text, value in zip(texts, best, strict=True) if value is None)


def _scale(name: str, kind: Kind, unit: str, values: np.ndarray, texts: Sequence[str]) -> Covariate:
    low, high = texts[int(np.argmin(values))], texts[int(np.argmax(values))]
    return Covariate(name, name, kind, values, unit, low=low, high=high)


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _year(text: str) -> float | None:
    """Return a date or time of ISO 8601 in years; without a zone it counts as UTC."""
    try:
        found = datetime.fromisoformat(text.strip())
    except ValueError:
        return None
    found = found.replace(tzinfo=UTC) if found.tzinfo is None else found
    return found.timestamp() / 86400.0 / DAYS_OF_A_YEAR
