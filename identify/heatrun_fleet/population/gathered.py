"""The machines of a type before they are pooled: evidence, covariates, who is left out and why.

Evidence is what the tests of a machine say of its parameters, without the prior of its calibration.
Covariates, numbers, dates in years or categories, become a design.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from itertools import combinations
from typing import Literal

import numpy as np
from jaxtyping import Float

from heatrun.errors import InputError, did_you_mean

from ..entries import cell_text
from ..results import MachineLeftOut

NEGLIGIBLE = 1e-6
"""Share of the prior's precision that a posterior may fall short of it by rounding [1]."""


@dataclass(frozen=True)
class Evidence:
    """Gaussian likelihoods of machines, in the space in which the parameters are normal.

    The likelihood of a machine is, up to a constant, exp(h' x - x' L x / 2). A direction of which
    its tests say nothing has no precision in L, so that short tests need no special case.
    """

    names: tuple[str, ...]  # Of the parameters.
    information: Float[np.ndarray, "machine parameter"]  # h, shape (machine, parameter).
    # L, shape (machine, parameter, parameter).
    precision: Float[np.ndarray, "machine parameter parameter"]
    # How far a posterior was wider than its prior in some direction, over the prior's precision,
    # shape (machine,) [1]: more than a trifle says that posterior or prior are not Gaussian there,
    # and the second stage is not to be trusted for the machine.
    clipped: Float[np.ndarray, " machine"]

    @classmethod
    def of_posteriors(
        cls,
        names: tuple[str, ...],
        mean: Float[np.ndarray, "machine parameter"],
        covariance: Float[np.ndarray, "machine parameter parameter"],
        prior_mean: Float[np.ndarray, "machine parameter"],
        prior_covariance: Float[np.ndarray, "machine parameter parameter"],
    ) -> Evidence:
        """Return the evidence of Gaussian posteriors and the priors that they were found with.

        Raises:
            InputError: If a covariance is not positive definite.
        """
        posterior = _inverse(covariance, "posterior")
        prior = _inverse(prior_covariance, "prior")
        # in units of the prior, where the eigenvalues tell what the tests add to it
        factor = np.linalg.cholesky(prior)
        inverse = np.linalg.inv(factor)
        added = inverse @ (posterior - prior) @ np.swapaxes(inverse, -1, -2)
        share, directions = np.linalg.eigh(0.5 * (added + np.swapaxes(added, -1, -2)))
        kept = np.einsum("mij,mj,mkj->mik", directions, np.maximum(share, 0.0), directions)
        precision = factor @ kept @ np.swapaxes(factor, -1, -2)
        information = np.einsum("mij,mj->mi", posterior, mean)
        information -= np.einsum("mij,mj->mi", prior, prior_mean)
        # along a direction that was clipped, the posterior's mean says no more than the prior's
        is_kept = (share > NEGLIGIBLE)[:, None, :] * directions
        back = np.einsum("mij,mkj->mik", is_kept, directions)
        information = np.einsum("mij,mjk,mkl,ml->mi", factor, back, inverse, information)
        clipped = np.maximum(-share.min(axis=-1), 0.0)
        return cls(tuple(names), information, precision, np.where(clipped > NEGLIGIBLE, clipped, 0))

    @property
    def num_machines(self) -> int:
        """Number of machines."""
        return self.information.shape[0]


def _inverse(covariance: np.ndarray, of: str) -> np.ndarray:
    wrong = [
        place for place, matrix in enumerate(covariance)
        if not np.all(np.isfinite(matrix)) or np.linalg.eigvalsh(matrix).min() <= 0.0
    ]  # fmt: skip
    if wrong:
        raise InputError(
            f"Expected positive definite covariances of the {of}s, which those of machines "
            f"{', '.join(map(str, wrong[:5]))} (counted from 0) are not.",
            remedy="Leave out machines whose fit did not converge.",
        )
    factor = np.linalg.inv(np.linalg.cholesky(covariance))
    return np.swapaxes(factor, -1, -2) @ factor


DAYS_OF_A_YEAR = 365.25

FEWEST_OF_A_CATEGORY = 2.0
"""Machines per category, on average, from which on texts count as categories; two always do."""

Kind = Literal["number", "date", "category"]


@dataclass(frozen=True)
class Covariate:
    """A column of the design."""

    label: str  # Its name in results: the column's, with the category behind it.
    column: str  # Name of the column.
    kind: Kind  # What its texts are.
    # One for each machine, not centred: the number, years, or 1 in the category.
    values: Float[np.ndarray, " machine"]
    unit: str  # What one unit of `values` is: `"1"`, `"year"` or the category.
    # The category that it is held against, which most machines have; else empty.
    reference: str = ""
    low: str = ""  # Smallest text: the number or the date; empty for a category.
    high: str = ""  # Largest text, likewise.

    @property
    def span(self) -> float:
        """Largest less smallest value."""
        return float(np.ptp(self.values))


def covariates_of(name: str, texts: Sequence[str], where: str) -> list[Covariate]:
    """Return the columns of the design that stand for a column of the fleet file, with a text for
    each machine: one for numbers and dates, one for each category but the most common; none where
    all machines have the same.

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


FEWEST = 3
"""Machines that a spread can be told from."""

MOST_NAMED = 3
"""Machines that a message names with their reasons."""


@dataclass(frozen=True)
class Gathered:
    """Machines of one type, each with the posterior of its own calibration.

    Posteriors and priors are normal in the space of the transforms: the logarithm of the value in
    its unit for `"log"`, the value for `"linear"`.
    """

    machines: tuple[str, ...]  # Their names.
    names: tuple[str, ...]  # Of the parameters.
    units: tuple[str, ...]  # Of the parameters.
    transforms: tuple[str, ...]  # `"log"` or `"linear"` for each parameter.
    mean: Float[np.ndarray, "machine parameter"]  # Of the posteriors.
    covariance: Float[np.ndarray, "machine parameter parameter"]  # Of the posteriors.
    prior_mean: Float[np.ndarray, "machine parameter"]  # Of the priors.
    prior_sd: Float[np.ndarray, "machine parameter"]  # Of the priors, which are independent.
    # Covariates by name, a text for each machine, empty where there is none.
    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    left_out: tuple[MachineLeftOut, ...] = ()  # The others.
    # What they were taken from, for the record.
    source: Mapping[str, str] = field(default_factory=dict)
    # Noise and unmodelled heat of machines of the same type, likewise; None where nothing is known
    # of them.
    noise: Gathered | None = None
    covariates: tuple[Covariate, ...] = ()  # Those that were chosen, as columns of the design.
    notes: tuple[str, ...] = ()  # What must be known of it, in sentences.

    def evidence(self) -> Evidence:
        """Return what the tests of each machine say, the priors divided out."""
        prior = self.prior_sd[:, :, None] ** 2 * np.eye(len(self.names))
        return Evidence.of_posteriors(
            self.names, self.mean, self.covariance, self.prior_mean, prior
        )

    def without(self, others: Mapping[str, str]) -> Gathered:
        """Return the same with further machines left out, by name with the reason."""
        kept = [place for place, name in enumerate(self.machines) if name not in others]
        laws = ("mean", "covariance", "prior_mean", "prior_sd")
        return replace(
            self,
            machines=tuple(self.machines[place] for place in kept),
            **{name: getattr(self, name)[kept] for name in laws},
            columns={name: tuple(own[i] for i in kept) for name, own in self.columns.items()},
            left_out=(*self.left_out,
                      *(MachineLeftOut(name=name, reason=why) for name, why in others.items())),
            noise=self.noise and self.noise.without(others),
        )  # fmt: skip

    def matrix(self, places: Sequence[int] | None = None) -> Float[np.ndarray, "machine covariate"]:
        """Return the covariates, each divided by its span and less its mean over the machines, of
        all machines or of those at some places.
        """
        used = [*range(len(self.machines))] if places is None else places
        if not self.covariates:
            return np.zeros((len(used), 0))
        columns = np.stack([each.values / each.span for each in self.covariates], axis=1)[used]
        return columns - columns.mean(axis=0)


def is_positive(covariance: Float[np.ndarray, "..."], size: int) -> bool:
    """Return whether numbers, row by row or as a matrix, are a covariance of so many parameters,
    finite and positive definite.
    """
    return (
        covariance.size == size**2
        and bool(np.all(np.isfinite(covariance)))
        and np.linalg.eigvalsh(covariance.reshape(size, size)).min() > 0.0
    )


TOGETHER = 0.9
"""Correlation of two covariates from which on what each of them does cannot be told apart [1]."""


def designed(gathered: Gathered, names: Sequence[str], where: str) -> Gathered:
    """Return the machines with covariates from columns of the fleet file, by name.

    Raises:
        InputError: If there is no such column, too few machines are there or have one, or a column
            can be no covariate.
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
    num = len(gathered.machines)
    if num < FEWEST:
        first = "; ".join(f"{each.name}: {each.reason}" for each in gathered.left_out[:MOST_NAMED])
        others = len(gathered.left_out) - MOST_NAMED
        more = f"; and {others} more" if others > 0 else ""
        said = f"; left out were {first}{more}" if first else ""
        raise InputError(
            f"Expected {FEWEST} machines or more, got {num}{said}.",
            where=where,
            remedy="Calibrate more machines of the type; a spread cannot be told from fewer.",
        )
    covariates: list[Covariate] = []
    notes: list[str] = []
    for name in dict.fromkeys(names):
        texts = gathered.columns[name]
        found = covariates_of(name, texts, where)
        if not found:
            notes.append(f"{name} is {texts[0]!r:.80} for all machines: it explains nothing here.")
        covariates += found
    if num < FEWEST + len(covariates):
        raise InputError(
            f"Expected {FEWEST + len(covariates)} machines or more for a spread with the "
            f"covariates {', '.join(each.label for each in covariates)}, got {num}.",
            where=where,
            remedy="Calibrate more machines of the type, or give fewer covariates.",
        )
    for one, other in combinations(covariates, 2):
        correlation = float(np.corrcoef(one.values, other.values)[0, 1])
        if abs(correlation) > TOGETHER and one.column != other.column:
            notes.append(
                f"{one.label} and {other.label} change together over the machines (correlation "
                f"{correlation:.2f}): what each of them does cannot be told apart."
            )
    return replace(gathered, covariates=tuple(covariates), notes=tuple(notes))


def given_columns(gathered: Gathered, covariates: Mapping[str, Sequence[object]]) -> Gathered:
    """Return machines with covariates that were given beside them: by name, a number, text or date
    for each machine.

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
    return replace(gathered, columns=columns)
