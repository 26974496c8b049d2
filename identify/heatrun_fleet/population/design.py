"""The covariates of a population's machines as the columns of its design."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float

from heatrun.errors import InputError, did_you_mean

from ..manifest import cell_text
from .covariates import Covariate, covariates_of
from .gathered import FEWEST, Gathered

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
