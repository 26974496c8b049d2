"""The moves of the ensembles keep the law that they sample."""

from __future__ import annotations

import emcee
import numpy as np

from heatrun.model.draws import NUM_NOISE
from heatrun.posterior.ensemble import evolution, of_noise

SIZE, WALKERS, STEPS = 16, 64, 6000


def test_a_normal_law_keeps_its_mean_and_variance():
    """Some 100 000 effective draws of a variance: its error is 0.5 %; emcee's snooker took 5 %."""
    sampler = emcee.EnsembleSampler(
        WALKERS, SIZE, lambda rows: -0.5 * np.sum(rows**2, axis=1), vectorize=True,
        moves=evolution(),
    )  # fmt: skip
    start = np.random.default_rng(0).standard_normal((WALKERS, SIZE))
    random_state = np.random.RandomState(1).get_state()
    sampler.run_mcmc(emcee.State(start, random_state=random_state), STEPS)
    chain = sampler.get_chain(discard=500, flat=True)
    assert abs(np.mean(chain.var(axis=0)) - 1.0) < 0.02
    assert np.max(np.abs(chain.mean(axis=0))) < 0.1


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


def test_they_move_one_score_of_the_noise_and_nothing_else():
    coordinates = np.zeros((400, SIZE))
    moved, factors = of_noise(coordinates, np.random.RandomState(0))
    changed = moved != coordinates
    assert np.all(changed.sum(axis=1) == 1)
    assert not np.any(changed[:, :-NUM_NOISE])
    assert np.all(changed[:, -NUM_NOISE:].any(axis=0))
    np.testing.assert_allclose(factors, 0.5 * np.sum(moved**2, axis=1))
