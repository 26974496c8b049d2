"""The verdict on ensembles: against known autocorrelations, ArviZ, and ensembles that differ."""

from __future__ import annotations

import arviz
import numpy as np
import pytest
from scipy.stats import norm

from heatrun.posterior.convergence import AGREEMENT_WANTED, TAILS, autocorrelation_times, judge

NUM_STEPS, NUM_WALKERS, MEMORY = 1000, 64, 0.8


def autoregressive(seed: int, num_steps: int = NUM_STEPS, num_parameters: int = 3) -> np.ndarray:
    """Two ensembles of walkers that remember, each value standard normal, tau = 9 steps.

    Shape (2, step, walker, parameter).
    """
    rng = np.random.default_rng(seed)
    chains = np.empty((2, num_steps, NUM_WALKERS, num_parameters))
    chains[:, 0] = rng.standard_normal(chains[:, 0].shape)
    for step in range(1, num_steps):
        news = rng.standard_normal(chains[:, step].shape)
        chains[:, step] = MEMORY * chains[:, step - 1] + np.sqrt(1 - MEMORY**2) * news
    return chains


def test_ensembles_that_remember_nine_steps_are_long_enough():
    found = judge(autoregressive(1))
    assert found.is_enough
    assert found.sentence().startswith("MCMC converged (ESS 1")


def apart(chains):  # the mean of 14,000 effective draws is known to 0.0085 sd
    chains[1, ..., 2] += 0.1
    return chains


def drifting(chains):  # by a tenth of a sd to either side
    chains[..., 2] += np.linspace(-0.1, 0.1, NUM_STEPS)[:, None]
    return chains


def wandering(chains):  # both ensembles for themselves, slowly
    waves = np.sin(2 * np.pi * np.arange(NUM_STEPS) / 1300.0 + np.array([[0.3], [2.0]]))
    chains[..., 2] += 0.1 * waves[..., None]
    return chains


def narrow(chains):  # one of the ensembles: equal means, other intervals
    chains[1, ..., 2] *= 0.9
    return chains


def one_sided(chains):  # one of the ensembles misses the outer half of the upper tail
    end = norm.ppf(0.975)
    cut = chains[1, ..., 2]
    cut[cut > end] = 2 * end - cut[cut > end]
    return chains


@pytest.mark.parametrize("fault", [apart, drifting, wandering, narrow, one_sided])
def test_ensembles_that_differ_have_not_converged(fault):
    found = judge(fault(autoregressive(2)))
    assert not found.is_enough
    assert found.agreement < AGREEMENT_WANTED
    assert "the ensembles differ by more than their Monte Carlo errors explain" in found.sentence()


def test_ensembles_of_one_law_are_seldom_held_apart():
    """Once in a hundred by chance: of 60 looks at 13 parameters, 4 or more have p = 0.003."""
    held = [judge(autoregressive(100 + i, 400, 13)).agreement < AGREEMENT_WANTED for i in range(60)]
    assert sum(held) <= 3


def test_rhat_is_the_largest_of_means_and_tails_as_arviz_has_it():
    chains = autoregressive(3)
    chains[1, ..., 1] += 0.05
    rows = np.swapaxes(chains, 1, 2).reshape(2, -1, 3)
    # halves in time, and not of the walkers: steps first
    rows = chains.reshape(2, -1, 3)
    low, high = np.quantile(rows.reshape(-1, 3), TAILS, axis=0)
    seen = {"mean": rows, "low": 1.0 * (rows <= low), "high": 1.0 * (rows >= high)}
    by_arviz = arviz.rhat(arviz.convert_to_dataset(seen), method="split")
    largest = max(float(by_arviz[name].max()) for name in seen)
    # single precision; and the tails begin where 16,000 of the draws say
    assert judge(chains).rhat - 1.0 == pytest.approx(largest - 1.0, rel=0.02)


def test_the_effective_sample_size_of_an_ensemble_follows_its_autocorrelation():
    """Of an autoregression, tau = (1 + a) / (1 - a) is known: 9 steps at a = 0.8."""
    num_steps = 4000
    found = judge(autoregressive(2, num_steps))
    # 2 x 64 walks of 444 autocorrelation times: 1 % of error, and the largest of three
    assert found.autocorrelation == pytest.approx(9.0, rel=0.03)
    assert found.effective_size == pytest.approx(2 * num_steps * NUM_WALKERS / 9.0, rel=0.03)


def test_the_tails_are_forgotten_as_the_normal_law_says():
    """The indicator of a tail remembers sum_k (P2(rho_k) - p^2) / (p - p^2) of a normal pair."""
    p = TAILS[0]
    end = norm.ppf(p)
    lags = np.arange(1, 60)
    # P(both below) = integral of the density along the correlation (Plackett's identity)
    total = 1.0
    for rho in MEMORY**lags:
        r = np.linspace(0.0, rho, 2001)
        density = np.exp(-(end**2) / (1 + r)) / (2 * np.pi * np.sqrt(1 - r**2))
        total += 2 * np.trapezoid(density, r) / (p - p**2)
    num_steps = 4000
    found = judge(autoregressive(4, num_steps))
    expected = 2 * num_steps * NUM_WALKERS / total
    assert found.tail_size == pytest.approx(expected, rel=0.05)  # the smallest of six


def test_short_walks_are_not_freed_of_what_they_remember():
    """At 27 autocorrelation times each, about own means it comes out a third too short."""
    walks = autoregressive(6, 240, 8).transpose(3, 0, 2, 1)
    assert np.mean(autocorrelation_times(walks)) == pytest.approx(9.0, rel=0.05)


def test_walkers_that_never_move_have_not_converged():
    chains = autoregressive(5)
    chains[..., 1] = 0.7
    with np.errstate(all="raise"):
        found = judge(chains)
    assert not found.is_enough
    assert found.autocorrelation == NUM_STEPS
    stuck = np.broadcast_to(autoregressive(5)[:, :1], (2, NUM_STEPS, NUM_WALKERS, 3))
    assert not judge(stuck).is_enough
