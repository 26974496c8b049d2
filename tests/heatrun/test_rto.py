"""Draws that follow a posterior where it bends: of the density that is stated, and of all of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import multivariate_normal
from weighted_moments import gap_in_errors, moments

from heatrun.calibration import load_tests
from heatrun.fit.fit import fit
from heatrun.model.kernels import Kernels
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.motor.file import load_motor
from heatrun.posterior import rto as rounds_module
from heatrun.posterior import rto as rto_module
from heatrun.posterior.importance import importance_sample
from heatrun.posterior.posterior import sample
from heatrun.posterior.proposal import Proposal
from heatrun.posterior.rto import Rto, Several, covered, sample_rto
from heatrun.posterior.weighted import Weighted, evaluate

DATA = Path(__file__).parents[2] / "data" / "synthetic"
SLOW = pytest.mark.slow
SHORT_S = 120.0
ERRORS = 5.0
"""Standard errors that chance leaves in one case of two million."""


@pytest.fixture
def rng():
    return np.random.default_rng(8)


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """The second order's fit of the first two minutes of a step."""
    motor = load_motor(DATA / "motor.toml")
    path = tmp_path_factory.mktemp("short") / "short.csv"
    rows = pd.read_csv(DATA / "step_30min.csv.gz")
    rows[rows["t"] < SHORT_S].to_csv(path, index=False)
    tests = load_tests(motor, [path], [])
    return fit(Problem.of(Model.of("second", motor), motor, [test.blocks for test in tests]))


@pytest.fixture(scope="module")
def kernels(short):
    return Proposal.around(short, np.random.default_rng(8)).kernels


@pytest.fixture(scope="module")
def rto(short, kernels):
    return Rto.around(short, short.z, kernels)


@pytest.fixture(scope="module")
def followed(short, kernels):
    """As many draws that follow the model as make them sound."""
    return sample_rto(short, kernels, np.random.default_rng(9))


def test_draws_have_the_density_that_their_vectors_have(rto, rng):
    drawn = rto.draw(200, rng)
    is_found = np.isfinite(drawn.log_density)
    assert np.mean(is_found) > 0.8
    seen = rto.log_density(drawn.vectors[is_found])
    assert seen == pytest.approx(drawn.log_density[is_found], abs=1e-3)


LOG_MOST = 2.0
"""Logarithm of the largest ratio of two densities that counts in full."""


def assert_normalised(proposal, drawn, short, rng):
    """Against the normal law of the fit: both of its draws and of the proposal's tell the integral
    of the lesser of its density and e^2 times the proposal's.

    The plain mean of their ratio is 1 too, but in 16 dimensions a dozen of 2048 draws make it up,
    and its standard error says nothing.
    """
    normal = multivariate_normal(short.vector, short.covariance)
    by_proposal = normal.logpdf(drawn.vectors) - drawn.log_density
    vectors = normal.rvs(drawn.log_density.size, random_state=rng)
    by_normal = normal.logpdf(vectors) - proposal.log_density(vectors)
    one = np.exp(np.minimum(by_proposal, LOG_MOST))
    other = np.exp(np.minimum(0.0, LOG_MOST - by_normal))
    error = np.hypot(one.std(), other.std()) / np.sqrt(one.size)
    assert abs(one.mean() - other.mean()) < ERRORS * error


@pytest.mark.parametrize("num", [512, pytest.param(2048, marks=SLOW)])
def test_the_proposal_is_a_normalised_density(rto, short, rng, num):
    assert_normalised(rto, rto.draw(num, rng), short, rng)


def test_a_linear_model_is_drawn_as_it_is(fitted, rng):
    """Half an hour's step hardly bends: the weights given the noise are nearly equal."""
    noise_z = np.tile(fitted.noise_z, (300, 1))
    still = Kernels.over(
        noise_z + 1e-6 * rng.standard_normal(noise_z.shape), np.full(300, 1 / 300), rng
    )
    rto = Rto.around(fitted, fitted.z, still)
    white = rng.standard_normal((200, fitted.z.size))
    value, factor = rto._linear(noise_z[:200])
    behind = rto_module._solve(factor, value)
    start = fitted.z + rto_module._solve(np.swapaxes(factor, 1, 2), white - behind)
    wanted = (factor @ white[..., None])[..., 0]
    z, seen = rto._solved(start, noise_z[:200], wanted, factor)
    assert np.all(np.isfinite(seen.value))
    sd = np.sqrt(np.diag(fitted.covariance)[: fitted.z.size])
    assert np.median(np.abs(z - start) / sd) < 0.1


@pytest.mark.parametrize("seed", [0, 1])
def test_a_short_test_is_sampled_without_mcmc(short, seed):
    found = sample(short, method="quick", seed=seed)
    weighted = found.weighted
    assert weighted.is_sound, (weighted.pareto_k, weighted.effective_size)
    assert found.method == "importance"


@pytest.mark.parametrize("num", [1024, pytest.param(4096, marks=SLOW)])
def test_two_centres_give_one_law(short, kernels, followed, rng, num):
    """What is drawn does not depend on where the model was linearised."""
    first = followed
    sd = moments(first).sd
    aside = Rto.around(short, short.z + 0.5 * sd[: short.z.size], kernels)
    drawn = aside.draw(num, rng)
    second = Weighted.of(drawn.vectors, evaluate(short, drawn.vectors), drawn.log_density, aside)
    one, other = moments(first), moments(second)
    assert np.all(np.abs(one.mean - other.mean) < ERRORS * np.hypot(one.error, other.error))
    error = np.sqrt(sum(1.0 / each.effective_size for each in (first, second)))
    assert abs(first.log_evidence - second.log_evidence) < ERRORS * error


@pytest.mark.slow
def test_draws_agree_with_the_ensemble(short, followed):
    weighted = followed
    start = replace(weighted, pareto_k=1.0)  # so that no walker draws from the proposal
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("heatrun.posterior.posterior.starting_sample", lambda *_, **__: start)
        ensemble = sample(short, seed=5, most_steps=24_000)
    gap = gap_in_errors(weighted, ensemble)
    assert np.all(np.abs(gap) < ERRORS), gap
    assert np.max(np.abs(np.log(moments(weighted).sd / ensemble.flat.std(axis=0)))) < 0.15


def test_draws_without_an_answer_weigh_nothing(rto, short, rng, monkeypatch):
    whole = Rto._seen

    def with_gaps(self, z, noise_z):
        seen = whole(self, z, noise_z)
        seen.value[::3] = np.nan
        return seen

    monkeypatch.setattr(Rto, "_seen", with_gaps)
    drawn = rto.draw(30, rng)
    assert np.all(np.isfinite(drawn.vectors))
    assert np.all(drawn.log_density[::3] == np.inf)
    weighted = Weighted.of(drawn.vectors, evaluate(short, drawn.vectors), drawn.log_density, rto)
    assert np.all(weighted.weights[::3] == 0.0)
    assert weighted.weights.sum() == pytest.approx(1.0)


def test_an_optimum_that_no_draw_came_near_is_noticed(rto, short, rng):
    drawn = rto.draw(512, rng)
    found = Weighted.of(drawn.vectors, evaluate(short, drawn.vectors), drawn.log_density, rto)
    assert np.all(covered(short, found))
    far = short.noise_z + 1.5 + 0.05 * rng.standard_normal((50, short.noise_z.size))
    aside = replace(rto, kernels=(Kernels.over(far, np.full(50, 0.02), rng),))
    drawn = aside.draw(512, rng)
    found = Weighted.of(drawn.vectors, evaluate(short, drawn.vectors), drawn.log_density, aside)
    away = replace(short, modes=short.z[None])
    assert not np.any(covered(away, found))


@pytest.mark.parametrize(("num", "least"), [(512, 100), pytest.param(1024, 400, marks=SLOW)])
def test_draws_around_two_optima_give_the_law_that_those_around_one_give(
    short, kernels, followed, rng, monkeypatch, num, least
):
    """With few draws in a round, and with as many as there are."""
    monkeypatch.setattr(rounds_module, "NUM_DRAWS", num)
    monkeypatch.setattr("heatrun.posterior.weighted.LEAST_EFFECTIVE", least)
    one = followed
    aside = short.z + 0.7 * moments(one).sd[: short.z.size]
    both = replace(short, modes=np.stack([short.z, aside]))

    def covered_by(_, weighted):
        return np.array([True, isinstance(weighted.proposal, Several)])

    monkeypatch.setattr(rounds_module, "covered", covered_by)
    two = sample_rto(both, kernels, rng)
    assert isinstance(two.proposal, Several)
    assert two.is_sound
    first, second = moments(one), moments(two)
    assert np.all(np.abs(first.mean - second.mean) < ERRORS * np.hypot(first.error, second.error))
    error = np.sqrt(sum(1.0 / each.effective_size for each in (one, two)))
    assert abs(one.log_evidence - two.log_evidence) < ERRORS * error


@pytest.mark.parametrize("num", [512, pytest.param(2048, marks=SLOW)])
def test_a_proposal_around_two_optima_is_a_normalised_density(rto, short, kernels, rng, num):
    aside = Rto.around(short, short.z + 0.1, kernels)
    several = Several((rto, aside), np.array([0.3, 0.7]))
    drawn = several.draw(num, rng)
    is_found = np.isfinite(drawn.log_density)
    seen = several.log_density(drawn.vectors[is_found])
    assert seen == pytest.approx(drawn.log_density[is_found], abs=1e-3)
    assert_normalised(several, drawn, short, rng)


def test_where_the_guard_is_never_satisfied_there_are_draws_all_the_same(short, monkeypatch):
    monkeypatch.setattr("heatrun.posterior.weighted.PARETO_LIMIT", -1.0)
    monkeypatch.setattr(rounds_module, "NUM_DRAWS", 64)
    monkeypatch.setattr(rounds_module, "MOST_ROUNDS", 2)
    monkeypatch.setattr("heatrun.posterior.importance.NUM_ADAPTATIONS", 1)
    weighted = importance_sample(short)
    assert not weighted.is_sound
    assert np.isfinite(weighted.effective_size)


def test_a_matrix_without_a_factor_is_set_aside():
    matrices = np.stack([np.eye(3), -np.eye(3), np.full((3, 3), np.nan), 4.0 * np.eye(3)])
    factors = rto_module._factors(matrices)
    assert np.all(np.isfinite(factors[[0, 3]]))
    assert np.all(np.isnan(factors[[1, 2], 0, 0]))
    assert factors[3] == pytest.approx(2.0 * np.eye(3))
    vectors = np.ones((4, 3))
    solved = rto_module._solve(
        np.stack([np.eye(3), np.zeros((3, 3)), np.eye(3), np.eye(3)]), vectors
    )
    assert np.all(np.isnan(solved[1]))
    assert solved[[0, 2, 3]] == pytest.approx(vectors[:3])
