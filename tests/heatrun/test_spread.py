"""Draws of the quick posterior: of equal weight, none standing for many, and of the right law."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import gamma, kstest

from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.posterior import weighted as module
from heatrun.posterior.posterior import sample
from heatrun.posterior.weighted import spread


def test_no_draw_of_the_quick_posterior_stands_for_many(blocks, motor):
    """1166 of 4000 were distinct, and one stood 43 times, where an interval ends."""
    first = fit(Problem.of(Model.of("first", motor), motor, [blocks]))
    quick = sample(first, method="quick", seed=2)
    assert quick.method == "importance"
    _, count = np.unique(quick.flat, axis=0, return_counts=True)
    assert count.size > 0.9 * quick.flat.shape[0]
    # a hundred draws lie beyond an end of a 95 % interval: no tenth of them may be one
    assert count.max() < 0.1 * 0.025 * quick.flat.shape[0]
    again = sample(first, method="quick", seed=2)
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
