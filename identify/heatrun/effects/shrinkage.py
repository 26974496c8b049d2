"""The prior of an effect's amplitude: small in most machines, typical in some.

A refit has a wide prior, for an effect that is there. Whether it is there, and what it does where
it hardly shows, calls for a mixture of normal laws of a tenth, a third and all of the typical
amplitude. For the Gaussian that a refit leaves, the change of the prior is exact.

Reference: G. J. Koop, Bayesian Econometrics, Wiley, 2003, section 4.3 (Savage-Dickey ratio).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import norm

SCALES = (0.1, 0.3, 1.0)
"""Standard deviations of an amplitude over the typical one, equally probable [1]."""


@dataclass(frozen=True)
class Part:
    """A Gaussian law of the scores of network and effect, for one scale of the amplitude.

    Attributes:
        share: Its weight within the alternative [1].
        mean: Shape (all,): the fit's parameters, then the effect's.
        covariance: Shape (all, all).
    """

    share: float
    mean: Float[np.ndarray, " all"]
    covariance: Float[np.ndarray, "all all"]


def shrunk(
    information: Float[np.ndarray, " all"],
    precision: Float[np.ndarray, "all all"],
    strong: Sequence[int],
    usual: Float[np.ndarray, " amplitude"],
    *,
    has_one_sign: bool,
) -> tuple[tuple[Part, ...], float]:
    """Return the laws under the mixture, and the gain of the log evidence over a wide prior [nat].

    Args:
        information: Precision times mean of a Gaussian under standard normal priors.
        precision: Its precision.
        strong: Places of the amplitudes.
        usual: Their typical scores.
        has_one_sign: Whether the amplitudes cannot fall below zero; the priors are then folded.
    """
    found = [
        rescaled(information, precision, strong, scale * usual, has_one_sign=has_one_sign)
        for scale in SCALES
    ]
    gains = np.array([gain for _, _, gain in found])
    together = float(np.logaddexp.reduce(gains))
    parts = tuple(
        Part(float(np.exp(gain - together)), mean, covariance) for mean, covariance, gain in found
    )
    return parts, together - float(np.log(len(SCALES)))


def rescaled(
    information: np.ndarray,
    precision: np.ndarray,
    strong: Sequence[int],
    sizes: np.ndarray,
    *,
    has_one_sign: bool,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return mean and covariance of a Gaussian under another prior of some scores, and the gain of
    its log evidence [nat].

    Args:
        information: Precision times mean, under standard normal priors.
        precision: Likewise.
        strong: Places of the scores whose prior changes.
        sizes: Their new standard deviations.
        has_one_sign: Whether these scores cannot fall below zero; the prior is then folded.
    """
    after = precision.copy()
    after[strong, strong] += 1.0 / sizes**2 - 1.0
    mean = np.linalg.solve(precision, information)
    covariance = np.linalg.inv(after)
    moved = covariance @ information
    gain = 0.5 * float(np.linalg.slogdet(precision)[1] - np.linalg.slogdet(after)[1])
    gain -= float(np.sum(np.log(np.abs(sizes))))
    gain += 0.5 * float(moved @ information - mean @ information)
    if has_one_sign:
        sd = np.sqrt(np.diag(covariance)[list(strong)])
        gain += float(np.sum(np.log(2.0) + norm.logcdf(moved[list(strong)] / sd)))
    return moved, covariance, gain
