"""The machines of a type before they are pooled: their evidence, and who is left out and why.

Evidence is what the tests of a machine say of its parameters, without the prior of its calibration.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from heatrun.errors import InputError

NEGLIGIBLE = 1e-6
"""Share of the prior's precision that a posterior may fall short of it by rounding [1]."""


@dataclass(frozen=True)
class Evidence:
    """Gaussian likelihoods of machines, in the space in which the parameters are normal.

    The likelihood of a machine is, up to a constant, exp(h' x - x' L x / 2). A direction of which
    its tests say nothing has no precision in L, so that short tests need no special case.

    Attributes:
        names: Of the parameters.
        information: h, shape (machine, parameter).
        precision: L, shape (machine, parameter, parameter).
        clipped: How far a posterior was wider than its prior in some direction, over the prior's
            precision, shape (machine,) [1]: more than a trifle says that posterior or prior are not
            Gaussian there, and the second stage is not to be trusted for the machine.
    """

    names: tuple[str, ...]
    information: Float[np.ndarray, "machine parameter"]
    precision: Float[np.ndarray, "machine parameter parameter"]
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

        Args:
            names: Of the parameters.
            mean: Of the posteriors.
            covariance: Of the posteriors.
            prior_mean: Of the priors.
            prior_covariance: Of the priors.

        Raises:
            InputError: If an array has another shape, or a covariance is not positive definite.
        """
        size, num = len(names), np.shape(mean)[0]
        for label, array, shape in (
            ("mean", mean, (num, size)), ("covariance", covariance, (num, size, size)),
            ("prior_mean", prior_mean, (num, size)),
            ("prior_covariance", prior_covariance, (num, size, size)),
        ):  # fmt: skip
            if np.shape(array) != shape:
                raise InputError(
                    f"Expected {label} of shape {shape}, got {np.shape(array)}.",
                    remedy="Give one row for each machine and one column for each parameter.",
                )
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
