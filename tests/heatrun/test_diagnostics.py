"""R-hat and Pareto k as ArviZ gives them, against textbook formulas, SciPy and known laws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import genpareto

from heatrun.inference.sampling.convergence import RHAT_LIMIT, judge
from heatrun.inference.sampling.diagnostics import pareto_shape, split_rhat

NUM_STEPS, NUM_WALKERS = 400, 64


def autoregressive(
    rng: np.random.Generator, num_steps: int = NUM_STEPS, coefficient: float = 0.8
) -> np.ndarray:
    """Two ensembles of walkers in three parameters that remember, shape (2, step, walker, 3)."""
    chains = np.empty((2, num_steps, NUM_WALKERS, 3))
    chains[:, 0] = rng.standard_normal(chains[:, 0].shape)
    for step in range(1, num_steps):
        news = rng.standard_normal(chains[:, step].shape)
        chains[:, step] = coefficient * chains[:, step - 1] + np.sqrt(1 - coefficient**2) * news
    return chains


@pytest.mark.parametrize("shift", [0.0, 0.1, 1.0])
def test_rhat_is_that_of_the_textbook_over_ensembles_and_their_halves(shift):
    chains = autoregressive(np.random.default_rng(1))
    chains[1, :, :, 2] += shift  # the second ensemble disagrees in the last parameter
    halves = [half for each in chains for half in (each[: NUM_STEPS // 2], each[NUM_STEPS // 2 :])]
    within = np.mean([half.var(axis=(0, 1), ddof=1) for half in halves], axis=0)
    means = np.var([half.mean(axis=(0, 1)) for half in halves], axis=0, ddof=1)
    draws = NUM_STEPS // 2 * NUM_WALKERS
    textbook = np.sqrt((draws - 1) / draws + means / within)
    found = split_rhat(chains.reshape(2, -1, 3))
    np.testing.assert_allclose(found, textbook, rtol=1e-12)
    # the formula by hand that this replaces had 1 in place of (n-1)/n
    np.testing.assert_allclose(found, np.sqrt(1.0 + means / within), atol=1.0 / draws)
    assert judge(chains).rhat == found.max()
    assert (found.max() > RHAT_LIMIT) == (shift == 1.0)


def test_the_effective_sample_size_of_an_ensemble_follows_its_autocorrelation():
    """Of an autoregression, tau = (1 + a) / (1 - a) is known: 9 steps at a = 0.8."""
    num_steps = 4000  # the means of shorter walks are subtracted with what they remember
    found = judge(autoregressive(np.random.default_rng(2), num_steps))
    # 2 x 64 walks of 444 autocorrelation times: less than 1 % of error, and 2 % for the means
    assert found.autocorrelation == pytest.approx(9.0, rel=0.04)
    assert found.effective_size == pytest.approx(2 * num_steps * NUM_WALKERS / 9.0, rel=0.04)


@pytest.mark.parametrize("shape", [0.2, 0.5, 0.9, 1.4])
def test_the_pareto_k_of_a_pareto_law_is_its_shape(shape):
    """And that of SciPy's maximum likelihood, which was used before, on the same tail."""
    rng = np.random.default_rng(3)
    weight = genpareto.rvs(shape, size=16_000, random_state=rng)
    found = pareto_shape(np.log(weight))
    num_tail = int(3 * np.sqrt(weight.size))
    error = (1.0 + shape) / np.sqrt(num_tail)  # of the maximum likelihood estimate
    assert abs(found - shape) < 3 * error
    ordered = np.sort(weight)
    by_scipy = genpareto.fit(ordered[-num_tail:] - ordered[-num_tail - 1], floc=0.0)[0]
    # one tail, so the errors are shared: ArviZ draws k towards 0.5 by ten draws' worth
    assert abs(found - by_scipy) < 0.3 * error + 10.0 / num_tail * abs(by_scipy - 0.5)


def test_the_pareto_k_tells_light_tails_from_heavy_ones():
    rng = np.random.default_rng(0)
    assert pareto_shape(np.log(rng.uniform(0.5, 1.5, 4000))) < 0.3
    assert pareto_shape(np.log(rng.pareto(1.0, 4000))) > 0.7


def test_weights_without_a_tail_are_never_sound():
    alone = np.full(4096, -np.inf)
    alone[7] = 0.0
    for log_weight in (np.zeros(4096), np.full(4096, -np.inf), alone):
        assert pareto_shape(log_weight) == np.inf
    rng = np.random.default_rng(5)
    with_zeros = np.where(rng.random(4096) < 0.01, -np.inf, rng.standard_normal(4096))
    assert 0.0 < pareto_shape(with_zeros) < 0.5  # lognormal weights
