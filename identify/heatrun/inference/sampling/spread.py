"""Equally weighted draws of which none stands for many.

Draws that are picked by their weights repeat: the few that the proposal makes too rarely stand
dozens of times, and the end of an interval may rest on one of them. Some steps of differential
evolution, which leave the posterior as it is, move the copies apart.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ..fitting.fit_result import Fit
from .weighted import Weighted, evaluate

ROUNDS = 5
"""Steps of each draw."""

GAMMA = 1.2
"""Length of a step times the root of twice the number of dimensions [1]: half of what mixes
fastest, for more of the steps are then accepted, and a draw that has not moved stands with its
copies."""

JITTER = 1e-5
"""Standard deviation that is added to each step [scores], so that every point can be reached."""

Spread = tuple[Float[np.ndarray, "draw all"], Float[np.ndarray, " draw"]]


def spread(fit: Fit, weighted: Weighted, num: int, rng: np.random.Generator) -> Spread:
    """Return draws picked by their weights and moved apart, with their log posterior [nat].

    Args:
        fit: What is sampled.
        weighted: Draws with weights.
        num: Number of draws wanted.
        rng: Of the choice and of the steps.

    Reference: W. R. Gilks, C. Berzuini, Following a moving target: Monte Carlo inference for
        dynamic Bayesian models, Journal of the Royal Statistical Society B 63 (2001) 127-146
        (resample and move); C. J. F. ter Braak, A Markov chain Monte Carlo version of the genetic
        algorithm differential evolution, Statistics and Computing 16 (2006) 239-249.
    """
    picked = _systematic(weighted.weights, num, rng)
    rng.shuffle(picked)  # copies stand in a row, and would all be in one half
    vectors, density = weighted.vectors[picked], weighted.log_density[picked]
    halves = np.array_split(np.arange(num), 2)
    for _ in range(ROUNDS):
        for mine, others in (halves, halves[::-1]):
            moved = vectors[mine] + _steps(vectors[others], mine.size, rng)
            there = evaluate(fit, moved)
            is_taken = np.log(rng.uniform(size=mine.size)) < there - density[mine]
            vectors[mine[is_taken]], density[mine[is_taken]] = moved[is_taken], there[is_taken]
    return vectors, density


def _steps(
    others: Float[np.ndarray, "other all"], num: int, rng: np.random.Generator
) -> Float[np.ndarray, "num all"]:
    """Return differences of two draws of the other half, scaled."""
    first = rng.integers(others.shape[0], size=num)
    second = (first + rng.integers(1, others.shape[0], size=num)) % others.shape[0]
    size = others.shape[1]
    jitter = JITTER * rng.standard_normal((num, size))
    return GAMMA / np.sqrt(2.0 * size) * (others[first] - others[second]) + jitter


def _systematic(
    weights: Float[np.ndarray, " draw"], num: int, rng: np.random.Generator
) -> np.ndarray:
    """Return positions: each stands as often as its weight says, rounded up or down."""
    levels = (np.arange(num) + rng.uniform()) / num
    return np.minimum(np.searchsorted(np.cumsum(weights), levels), weights.size - 1)
