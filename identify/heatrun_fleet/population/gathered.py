"""The machines of a type before they are pooled: their evidence, and who is left out and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from heatrun.errors import InputError

from .evidence import Evidence

FEWEST = 3
"""Machines that a spread can be told from."""


@dataclass(frozen=True)
class LeftOut:
    """A machine that does not count.

    Attributes:
        machine: Its name.
        reason: Why, in a sentence.
    """

    machine: str
    reason: str


@dataclass(frozen=True)
class Gathered:
    """Machines of one type, each with the posterior of its own calibration.

    Posteriors and priors are normal in the space of the transforms: the logarithm of the value in
    its unit for `"log"`, the value for `"linear"`.

    Attributes:
        machines: Their names.
        names: Of the parameters.
        units: Of the parameters.
        transforms: `"log"` or `"linear"` for each parameter.
        mean: Of the posteriors.
        covariance: Of the posteriors.
        prior_mean: Of the priors.
        prior_sd: Of the priors, which are independent.
        columns: Covariates by name, a text for each machine, empty where there is none.
        left_out: The others.
        source: What they were taken from, for the record.
        noise: Noise and unmodelled heat of machines of the same type, likewise; None where nothing
            is known of them.
    """

    machines: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    transforms: tuple[str, ...]
    mean: Float[np.ndarray, "machine parameter"]
    covariance: Float[np.ndarray, "machine parameter parameter"]
    prior_mean: Float[np.ndarray, "machine parameter"]
    prior_sd: Float[np.ndarray, "machine parameter"]
    columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    left_out: tuple[LeftOut, ...] = ()
    source: Mapping[str, str] = field(default_factory=dict)
    noise: Gathered | None = None

    def evidence(self) -> Evidence:
        """Return what the tests of each machine say, the priors divided out."""
        prior = self.prior_sd[:, :, None] ** 2 * np.eye(len(self.names))
        return Evidence.of_posteriors(
            self.names, self.mean, self.covariance, self.prior_mean, prior
        )

    def without(self, others: Mapping[str, str]) -> Gathered:
        """Return the same with further machines left out.

        Args:
            others: Reason by machine.
        """
        kept = [place for place, name in enumerate(self.machines) if name not in others]
        return Gathered(
            tuple(self.machines[place] for place in kept), self.names, self.units, self.transforms,
            self.mean[kept], self.covariance[kept], self.prior_mean[kept], self.prior_sd[kept],
            {name: tuple(texts[place] for place in kept) for name, texts in self.columns.items()},
            (*self.left_out, *(LeftOut(name, why) for name, why in others.items())),
            self.source,
            None if self.noise is None else self.noise.without(
                {name: why for name, why in others.items() if name in self.noise.machines}
            ),
        )  # fmt: skip

    def refuse_few(self, where: str) -> None:
        """Refuse machines that a spread cannot be told from.

        Args:
            where: What they were taken from, for messages.

        Raises:
            InputError: With those that were left out.
        """
        if len(self.machines) >= FEWEST:
            return
        raise InputError(
            f"Expected {FEWEST} machines or more, got {len(self.machines)}{_named(self.left_out)}.",
            where=where,
            remedy="Calibrate more machines of the type; a spread cannot be told from fewer.",
        )


def is_positive(covariance: Float[np.ndarray, "..."], size: int) -> bool:
    """Return whether numbers are a covariance of so many parameters, finite and positive definite.

    Args:
        covariance: Row by row, or as a matrix.
        size: Number of parameters.
    """
    return (
        covariance.size == size**2
        and bool(np.all(np.isfinite(covariance)))
        and np.linalg.eigvalsh(covariance.reshape(size, size)).min() > 0.0
    )


MOST_NAMED = 3
"""Machines that a message names with their reasons."""


def _named(left_out: Sequence[LeftOut]) -> str:
    if not left_out:
        return ""
    first = "; ".join(f"{each.machine}: {each.reason}" for each in left_out[:MOST_NAMED])
    more = f"; and {len(left_out) - MOST_NAMED} more" if len(left_out) > MOST_NAMED else ""
    return f"; left out were {first}{more}"
