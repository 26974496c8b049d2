"""Pareto k and smoothed weights against ArviZ, SciPy and known laws."""

from __future__ import annotations

import arviz
import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import genpareto, norm

from heatrun.posterior.importance import linear_sample
from heatrun.posterior.weighted import pareto_smoothed


def pareto_shape(log_weight: np.ndarray) -> float:
    return pareto_smoothed(log_weight).pareto_k


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


def test_smoothed_weights_are_quantiles_of_a_pareto_law_above_the_body():
    rng = np.random.default_rng(6)
    log_weight = np.log(genpareto.rvs(0.6, size=4096, random_state=rng)) + 3.0
    found = pareto_smoothed(log_weight)
    order = np.argsort(log_weight)
    num_tail = int(np.ceil(3 * np.sqrt(4096)))
    body, tail = order[:-num_tail], order[-num_tail:]
    assert logsumexp(found.log_weight) == pytest.approx(0.0, abs=1e-12)
    # up to one factor the body is as it was, and the order is that of the raw weights
    shift = found.log_weight[body] - log_weight[body]
    np.testing.assert_allclose(shift, shift[0], atol=1e-10)
    assert np.all(np.diff(found.log_weight[order]) >= 0.0)
    excess = np.exp(found.log_weight[tail]) - np.exp(found.log_weight[body[-1]])
    places = (np.arange(num_tail) + 0.5) / num_tail
    law = genpareto.ppf(places, found.pareto_k)
    scale = excess[num_tail // 2] / law[num_tail // 2]
    # the largest may be cut to the largest raw weight
    np.testing.assert_allclose(excess[:-3], scale * law[:-3], rtol=1e-6)


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")  # theirs
@pytest.mark.skipif(not hasattr(arviz, "psislw"), reason="ArviZ 1.x has it elsewhere")
@pytest.mark.parametrize("size", [30, 1000, 20_000])
def test_smoothed_weights_are_those_of_arviz(size):
    rng = np.random.default_rng(size)
    light, heavy = rng.standard_normal(size), 2.0 * rng.standard_t(3, size)
    for log_weight in (light, heavy, np.where(rng.random(size) < 0.3, -np.inf, light)):
        found = pareto_smoothed(log_weight)
        theirs, shape = arviz.psislw(log_weight)
        assert found.pareto_k == pytest.approx(float(shape), rel=1e-9)
        np.testing.assert_allclose(np.exp(found.log_weight), np.exp(theirs), rtol=1e-9)


def test_smoothed_weights_err_less_than_raw_ones():
    """The second moment of a normal law from draws of half its variance: k = 0.5 at the edge."""
    truth, raw, smoothed = 1.0, [], []
    for seed in range(300):
        x = np.sqrt(0.5) * np.random.default_rng(seed).standard_normal(1000)
        log_weight = norm.logpdf(x) - norm.logpdf(x, scale=np.sqrt(0.5))
        weight = np.exp(log_weight - logsumexp(log_weight))
        raw.append(weight @ x**2)
        smoothed.append(np.exp(pareto_smoothed(log_weight).log_weight) @ x**2)
    by_raw, by_smoothed = (np.sqrt(np.mean((np.array(e) - truth) ** 2)) for e in (raw, smoothed))
    assert by_smoothed < 0.9 * by_raw


def test_importance_samples_carry_smoothed_weights_and_evidence_of_raw_ones(fitted):
    found = linear_sample(fitted, num_draws=1024, seed=2)
    log_weight = found.log_density - found.proposal.log_density(found.vectors)
    smoothed = pareto_smoothed(log_weight)
    assert found.pareto_k == pytest.approx(smoothed.pareto_k, abs=1e-6)
    np.testing.assert_allclose(found.weights, np.exp(smoothed.log_weight), rtol=1e-6)
    raw = np.exp(log_weight - logsumexp(log_weight))
    inside = raw > 0.0  # a draw beyond an end of the prior weighs nothing
    assert np.max(np.abs(found.weights[inside] / raw[inside] - 1.0)) > 0.01
    assert found.log_evidence == pytest.approx(logsumexp(log_weight) - np.log(log_weight.size))
