"""Draws, weights and walkers: of the right law, and judged for what they are."""

from types import SimpleNamespace

import arviz
import emcee
import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import gamma, kstest, norm

from heatrun.fit.fit import fit
from heatrun.model.draws import NUM_NOISE
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.posterior import posterior as sampling
from heatrun.posterior import weighted as module
from heatrun.posterior.convergence import (
    AGREEMENT_WANTED,
    FULL,
    TAILS,
    autocorrelation_times,
    is_one_law,
    judge,
)
from heatrun.posterior.ensemble import evolution, of_noise
from heatrun.posterior.importance import linear_sample
from heatrun.posterior.posterior import sample
from heatrun.posterior.proposal import Proposal
from heatrun.posterior.weighted import pareto_smoothed, spread
from heatrun.record.reduction import reduce


@pytest.fixture(scope="module")
def short(bench, generator, motor):
    """The first order on twenty minutes: a likelihood that costs little."""
    blocks = reduce(bench(generator.duty(1200.0), seed=11), motor)
    return fit(Problem.of(Model.of("first", motor), motor, [blocks]))


@pytest.fixture(scope="module")
def quick(short):
    return sample(short, method="quick", seed=2)


def pareto_shape(log_weight: np.ndarray) -> float:
    return pareto_smoothed(log_weight).pareto_k


def test_weights_without_a_tail_are_never_sound():
    alone = np.full(4096, -np.inf)
    alone[7] = 0.0
    for log_weight in (np.zeros(4096), np.full(4096, -np.inf), alone):
        assert pareto_shape(log_weight) == np.inf
    rng = np.random.default_rng(5)
    with_zeros = np.where(rng.random(4096) < 0.01, -np.inf, rng.standard_normal(4096))
    assert 0.0 < pareto_shape(with_zeros) < 0.5  # lognormal weights


def test_importance_samples_carry_smoothed_weights_and_evidence_of_raw_ones(short):
    found = linear_sample(short, num_draws=1024, seed=2)
    log_weight = found.log_density - found.proposal.log_density(found.vectors)
    smoothed = pareto_smoothed(log_weight)
    assert found.pareto_k == pytest.approx(smoothed.pareto_k, abs=1e-6)
    np.testing.assert_allclose(found.weights, np.exp(smoothed.log_weight), rtol=1e-6)
    raw = np.exp(log_weight - logsumexp(log_weight))
    inside = raw > 0.0  # a draw beyond an end of the prior weighs nothing
    assert np.max(np.abs(found.weights[inside] / raw[inside] - 1.0)) > 0.01
    assert found.log_evidence == pytest.approx(logsumexp(log_weight) - np.log(log_weight.size))


def test_no_draw_of_the_quick_posterior_stands_for_many(short, quick):
    """1166 of 4000 were distinct, and one stood 43 times, where an interval ends."""
    assert quick.method == "importance"
    _, count = np.unique(quick.flat, axis=0, return_counts=True)
    assert count.size > 0.9 * quick.flat.shape[0]
    # a hundred draws lie beyond an end of a 95 % interval: no tenth of them may be one
    assert count.max() < 0.1 * 0.025 * quick.flat.shape[0]
    again = sample(short, method="quick", seed=2)
    np.testing.assert_array_equal(again.flat, quick.flat)


def of_a_skewed_law(monkeypatch, num, seed):
    """Draws from an exponential law of mean 2 in two dimensions, weighted to a gamma law."""
    shape = 3.0

    def log_density(vectors):
        inside = np.all(vectors > 0, axis=1)
        return np.where(inside, gamma.logpdf(np.abs(vectors), shape).sum(axis=1), -np.inf)

    monkeypatch.setattr(module, "evaluate", lambda fit, vectors: log_density(vectors))
    vectors = np.random.default_rng(seed).exponential(2.0, size=(num, 2))
    log_weight = log_density(vectors) + vectors.sum(axis=1) / 2.0
    weights = np.exp(log_weight - log_weight.max())
    return SimpleNamespace(
        vectors=vectors, log_density=log_density(vectors), weights=weights / weights.sum()
    ), gamma(shape)


def test_the_law_stays_as_it_is(monkeypatch):
    weighted, law = of_a_skewed_law(monkeypatch, 200_000, 1)
    vectors, density = spread(None, weighted, 4000, np.random.default_rng(2))  # pyright: ignore[reportArgumentType]
    for column in vectors.T:
        assert kstest(column[::4], law.cdf).pvalue > 1e-3
    np.testing.assert_allclose(density, law.logpdf(vectors).sum(axis=1))


@pytest.mark.parametrize("rounds", [0, 5])
def test_moving_brings_few_draws_closer_to_their_law(monkeypatch, rounds):
    """Of 60 weighted draws the law is hardly known; the steps find what lies between them."""
    monkeypatch.setattr(module, "ROUNDS", rounds)
    gaps = []
    for seed in range(20):
        weighted, law = of_a_skewed_law(monkeypatch, 60, seed)
        vectors, _ = spread(None, weighted, 2000, np.random.default_rng(seed))  # pyright: ignore[reportArgumentType]
        gaps.append(kstest(vectors[:, 0], law.cdf).statistic)
    assert (np.mean(gaps) < 0.08) == (rounds > 0)


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


def test_importance_samples_stand_in_for_a_long_mcmc_that_agrees(short, quick, monkeypatch):
    monkeypatch.setattr(sampling, "FULL", FULL._replace(size=1e6))
    found = sample(short, seed=2)
    assert found.method == "importance"
    assert found.is_sound
    assert "MCMC agrees and would take" in found.sentence()
    np.testing.assert_array_equal(found.vectors, quick.vectors)


def test_importance_samples_that_the_walkers_began_at_stand_in(short, quick, monkeypatch):
    assert not isinstance(quick.weighted.proposal, Proposal)
    monkeypatch.setattr(sampling, "FULL", FULL._replace(size=1e6))
    monkeypatch.setattr(sampling, "LONG", 10**9)
    monkeypatch.setattr(sampling, "starting_sample", lambda *_, **__: quick.weighted)
    found = sample(short, seed=2, most_steps=600)
    assert found.method == "importance"
    assert found.weighted is quick.weighted


def test_importance_samples_of_another_law_do_not_stand_in(short, quick, monkeypatch):
    asked = []
    monkeypatch.setattr(sampling, "FULL", FULL._replace(size=1e6))
    monkeypatch.setattr(sampling, "LONG", 500)
    monkeypatch.setattr(sampling, "importance_sample", lambda *_, **__: quick.weighted)
    monkeypatch.setattr(sampling, "is_one_law", lambda *given: asked.append(given))
    assert sample(short, seed=2, most_steps=550).method == "emcee"
    assert len(asked) == 1


@pytest.mark.parametrize(
    ("moved", "wider", "is_one"), [(0, 1, True), (0.3, 1, False), (0, 1.4, False)]
)
def test_importance_samples_of_another_law_are_told(moved, wider, is_one):
    rng = np.random.default_rng(8)
    draws = rng.standard_normal((1500, 3))
    draws[:, 1] = moved + wider * draws[:, 1]
    weights = rng.uniform(0.5, 1.5, 1500)
    assert is_one_law(autoregressive(4), draws, weights / weights.sum()) is is_one


def test_ensembles_of_one_law_are_seldom_held_apart():
    """Once in a hundred by chance: of 30 looks at 13 parameters, 3 or more have p = 0.003."""
    held = [judge(autoregressive(100 + i, 400, 13)).agreement < AGREEMENT_WANTED for i in range(30)]
    assert sum(held) <= 2


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


SIZE, WALKERS, STEPS = 16, 64, 4000


def with_a_long_tail(rows):
    """Return the log density of normal scores, of which the first of the noise has a tail.

    It is that of its prior below -1, and next to nothing above 0.5, as a white part has it that
    may be too small to show.
    """
    tail = rows[:, -NUM_NOISE]
    return -0.5 * np.sum(rows**2, axis=1) - np.logaddexp(0.0, 8.0 * (tail + 0.5))


def run(moves):
    sampler = emcee.EnsembleSampler(WALKERS, SIZE, with_a_long_tail, vectorize=True, moves=moves)
    start = -0.8 + 0.1 * np.random.default_rng(0).standard_normal((WALKERS, SIZE))
    random_state = np.random.RandomState(1).get_state()
    sampler.run_mcmc(emcee.State(start, random_state=random_state), STEPS)
    return sampler.get_chain(discard=500)


def test_scores_of_the_noise_from_their_prior_keep_the_law():
    chain = run([(emcee.moves.MHMove(of_noise), 0.6), *((m, 0.4 * s) for m, s in evolution())])
    grid = np.linspace(-6.0, 4.0, 20001)
    rows = np.zeros((grid.size, NUM_NOISE))
    rows[:, 0] = grid
    density = np.exp(with_a_long_tail(rows))
    density /= density.sum()
    mean = density @ grid
    sd = np.sqrt(density @ (grid - mean) ** 2)
    tail, others = chain[..., -NUM_NOISE], np.delete(chain, SIZE - NUM_NOISE, axis=-1)
    assert abs(tail.mean() - mean) < 0.02
    assert abs(tail.std() / sd - 1.0) < 0.02
    assert abs(np.mean(others.var(axis=(0, 1))) - 1.0) < 0.03


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
