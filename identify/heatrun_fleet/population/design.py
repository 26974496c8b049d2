"""Covariates of a population's machines, numbers, dates in years or categories, as its design."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import combinations
from typing import Literal

import numpy as np
from jaxtyping import Float

from heatrun.errors import InputError, did_you_mean

from ..entries import cell_text
from .gathered import FEWEST, Gathered

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


TOGETHER = 0.9
"""Correlation of two covariates from which on what each of them does cannot be told apart [1]."""


@dataclass(frozen=True)
class Design:
    """Machines with their covariates.

    Attributes:
        gathered: Those that have all of the covariates.
        covariates: Columns of the design.
        notes: What must be known of it, in sentences.
    """

    gathered: Gathered
    covariates: tuple[Covariate, ...]
    notes: tuple[str, ...]

    def matrix(self, places: Sequence[int] | None = None) -> Float[np.ndarray, "machine covariate"]:
        """Return the columns, each divided by its span and less its mean over the machines.

        Args:
            places: Of the machines that are meant; all by default.
        """
        used = range(len(self.gathered.machines)) if places is None else places
        if not self.covariates:
            return np.zeros((len(used), 0))
        columns = np.stack([each.values / each.span for each in self.covariates], axis=1)[[*used]]
        return columns - columns.mean(axis=0)


def designed(gathered: Gathered, names: Sequence[str], where: str) -> Design:
    """Return the machines with covariates from columns of the fleet file.

    Args:
        gathered: The machines.
        names: Of the columns.
        where: What they were taken from, for messages.

    Raises:
        InputError: If there is no such column, too few machines have one, or a column can be no
            covariate.
    """
    for name in names:
        if name not in gathered.columns:
            there = ", ".join(gathered.columns) or "none"
            raise InputError(
                f"Found no column {name!r} for a covariate; there are {there}.",
                where=where,
                remedy=did_you_mean(name, gathered.columns) or "Add it to the fleet file.",
            )
    missing = {
        machine: f"has no {name}"
        for name in reversed(names)
        for machine, text in zip(gathered.machines, gathered.columns[name], strict=True)
        if not text
    }
    gathered = gathered.without(missing)
    gathered.refuse_few(where)
    covariates: list[Covariate] = []
    notes = []
    for name in dict.fromkeys(names):
        texts = gathered.columns[name]
        found = covariates_of(name, texts, where)
        if not found:
            notes.append(f"{name} is {texts[0]!r:.80} for all machines: it explains nothing here.")
        covariates += found
    _refuse_few(gathered, covariates, where)
    return Design(gathered, tuple(covariates), (*notes, *_together(covariates)))


def given_columns(gathered: Gathered, covariates: Mapping[str, Sequence[object]]) -> Gathered:
    """Return machines with covariates that were given beside them.

    Args:
        gathered: The machines.
        covariates: By name, a number, text or date for each machine.

    Raises:
        InputError: If one has not a value for each machine, or a number that is not finite.
    """
    num = len(gathered.machines)
    columns = {}
    for name, values in covariates.items():
        texts = tuple(map(cell_text, values))
        wrong = [text for text in texts if text in ("", "nan", "inf", "-inf")]
        if len(texts) != num or wrong:
            raise InputError(
                f"Expected a finite number, a text or a date for each of {num} machines as "
                f"covariate {name!r}, got {len(texts) - len(wrong)} of them.",
                remedy="Give one value for each run, in their order.",
            )
        columns[name] = texts
    return Gathered(**{**vars(gathered), "columns": columns})


def _refuse_few(gathered: Gathered, covariates: Sequence[Covariate], where: str) -> None:
    """Refuse covariates that explain so few machines whatever they are."""
    num = FEWEST + len(covariates)
    if len(gathered.machines) < num:
        raise InputError(
            f"Expected {num} machines or more for a spread with the covariates "
            f"{', '.join(each.label for each in covariates)}, got {len(gathered.machines)}.",
            where=where,
            remedy="Calibrate more machines of the type, or give fewer covariates.",
        )


def _together(covariates: Sequence[Covariate]) -> list[str]:
    found = []
    for one, other in combinations(covariates, 2):
        if one.column == other.column:
            continue
        correlation = float(np.corrcoef(one.values, other.values)[0, 1])
        if abs(correlation) > TOGETHER:
            found.append(
                f"{one.label} and {other.label} change together over the machines (correlation "
                f"{correlation:.2f}): what each of them does cannot be told apart."
            )
    return found
