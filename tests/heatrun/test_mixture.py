"""The proposal of the weighted draws: it draws from the density that it states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm
from weighted_moments import gap_in_errors

from heatrun.calibration import load_tests
from heatrun.fit.fit import fit
from heatrun.model.kernels import Kernels
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.motor.file import load_motor
from heatrun.posterior.fit_checks import holding_heat
from heatrun.posterior.importance import importance_sample, linear_sample
from heatrun.posterior.posterior import sample
from heatrun.posterior.proposal import Proposal
from heatrun.posterior.weighted import truncated

DATA = Path(__file__).parents[2] / "data" / "synthetic"

ERRORS = 5.0
"""Standard errors of a mean that chance leaves in one case of two million."""


CENTRE, SD = np.array([0.5, -1.0, 0.0, -0.5]), np.array([0.2, 0.8, 1.0, 0.9])
"""Of a normal law of the scores of a noise."""


@pytest.fixture
def rng():
    return np.random.default_rng(4)


@pytest.fixture(scope="module")
def one_node():
    """The first order's fit of a step of 90 minutes."""
    motor = load_motor(DATA / "motor.toml")
    tests = load_tests(motor, [DATA / "step_90min.csv.gz"], [])
    return fit(Problem.of(Model.of("first", motor), motor, [test.blocks for test in tests]))


@pytest.fixture(scope="module")
def half_hour():
    """The first order's fit of a step of 30 minutes."""
    motor = load_motor(DATA / "motor.toml")
    blocks = [each.blocks for each in load_tests(motor, [DATA / "step_30min.csv.gz"], [])]
    model = Model.of("first", motor).scaled(motor, blocks)
    return holding_heat(fit(Problem.of(model, motor, blocks), seed=0), seed=0)


def mean_is_one(log_ratio):
    """Whether a target's mean ratio over draws is 1, as it is for two normalised densities."""
    ratio = np.exp(log_ratio)
    return abs(ratio.mean() - 1.0) < ERRORS * ratio.std() / np.sqrt(ratio.size)


@pytest.fixture
def kernels(rng):
    noise_z = rng.standard_normal((500, 4)) * SD + CENTRE
    return Kernels.over(noise_z, np.full(500, 1.0 / 500), rng)


def test_kernels_draw_from_their_density(kernels, rng):
    drawn = kernels.draw(20_000, rng)
    target = multivariate_normal(CENTRE, np.diag(SD) ** 2)
    assert mean_is_one(target.logpdf(drawn) - kernels.log_densities(drawn))


def test_kernels_reach_the_tails_of_the_prior(kernels):
    """Where the tests say nothing of a noise, weights against the prior stay bounded."""
    far = np.array([[-4.0, 4.0, 4.0, -4.0]])
    assert norm.logpdf(far).sum() - kernels.log_densities(far)[0] < np.log(10.0) + 1e-9


@pytest.mark.parametrize("score", range(4))
def test_kernels_reach_the_tail_of_one_score_with_the_others_in_place(rng, score):
    """The tests leave one score to its prior and tell the others well."""
    noise_z = 0.05 * rng.standard_normal((500, 4))
    kernels = Kernels.over(noise_z, np.full(500, 1.0 / 500), rng)
    far = np.zeros(4)
    far[score] = -3.0
    target = norm.logpdf(np.delete(far, score), scale=0.05).sum() + norm.logpdf(far[score])
    assert target - kernels.log_densities(far[None])[0] < np.log(100.0)


def test_the_proposal_draws_from_its_density(fitted, rng):
    """Narrow and wide parts, shifted and reshaped by a round, against the normal of the fit."""
    proposal = Proposal.around(fitted, rng)
    target = multivariate_normal(fitted.vector, fitted.covariance)
    for _ in range(2):
        drawn = proposal.draw(8192, rng)
        log_ratio = target.logpdf(drawn.vectors) - drawn.log_density
        assert mean_is_one(log_ratio)
        weights = np.exp(log_ratio - np.max(log_ratio))
        proposal = proposal.adapted(drawn, truncated(weights / weights.sum()), rng)
    assert proposal.branches.share.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("which", ["half_hour", pytest.param("one_node", marks=pytest.mark.slow)])
def test_weights_hold_where_a_network_is_too_small(request, which, seed):
    """One node for a winding and its stator: the noise grows to what its prior allows.

    What the first rounds of the linear models miss, the later ones find.
    """
    weighted = linear_sample(request.getfixturevalue(which), seed=seed)
    assert weighted.is_sound, (weighted.pareto_k, weighted.effective_size)


@pytest.mark.slow
def test_a_quick_posterior_of_a_network_that_is_too_small_takes_no_mcmc(half_hour):
    """Draws that follow the model fail here; the linear models, above, make up for them."""
    weighted = importance_sample(half_hour, seed=0)
    assert weighted.is_sound, (weighted.pareto_k, weighted.effective_size)


@pytest.mark.slow
def test_weights_and_ensembles_agree_where_a_network_is_too_small(one_node):
    weighted = linear_sample(one_node, num_draws=8192, seed=5)
    ensemble = sample(one_node, seed=5, most_steps=12_000)
    gap = gap_in_errors(weighted, ensemble)
    assert np.all(np.abs(gap) < ERRORS), gap


def test_no_truncated_weight_overwhelms_the_others():
    weights = np.full(10_000, 1e-4)
    weights[0] = 1.0
    cut = truncated(weights / weights.sum())
    assert cut.sum() == pytest.approx(1.0)
    assert cut[0] <= 0.02  # a hundredth of the sum before the others are scaled up
