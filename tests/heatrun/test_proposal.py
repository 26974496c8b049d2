"""The proposals of the weighted draws draw from the density that they state, and from all of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import multivariate_normal, norm
from weighted_moments import gap_in_errors, moments

from heatrun.calibration import load_tests
from heatrun.fit.fit import fit
from heatrun.model.kernels import Kernels
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.motor.file import load_motor
from heatrun.posterior import importance as importance_module
from heatrun.posterior import rto as rto_module
from heatrun.posterior.fit_checks import holding_heat
from heatrun.posterior.importance import (
    Several,
    covered,
    importance_sample,
    linear_sample,
    sample_rto,
)
from heatrun.posterior.posterior import sample
from heatrun.posterior.proposal import Proposal
from heatrun.posterior.rto import LEAST_KEPT, Noises, Rto
from heatrun.posterior.weighted import Weighted, evaluate, truncated

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


@pytest.mark.parametrize("anew", [None, *range(4)])
def test_kernels_draw_from_their_density(kernels, rng, anew):
    """Against what they were made over, and that with one score as its prior has it."""
    drawn, is_anew = kernels.draw(20_000, rng), np.arange(4) == anew
    target = norm(np.where(is_anew, 0.0, CENTRE), np.where(is_anew, 1.0, SD))
    log_ratio = target.logpdf(drawn).sum(axis=1) - kernels.log_densities(drawn)
    assert mean_is_one(log_ratio)


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


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
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


SLOW = pytest.mark.slow
SHORT_S = 120.0
"""Standard errors that chance leaves in one case of two million."""


@pytest.fixture
def rng8():
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
def of_short(short):
    return Proposal.around(short, np.random.default_rng(8)).kernels


@pytest.fixture(scope="module")
def rto(short, of_short):
    return Rto.around(short, short.z, of_short, np.random.default_rng(7))


@pytest.fixture(scope="module")
def followed(short, of_short):
    """As many draws that follow the model as make them sound."""
    return sample_rto(short, of_short, np.random.default_rng(9))


def test_draws_have_the_density_that_their_vectors_have(rto, rng8):
    drawn = rto.draw(200, rng8)
    is_found = np.isfinite(drawn.log_density)
    assert np.mean(is_found) > 0.8
    seen = rto.log_density(drawn.vectors[is_found])
    assert seen == pytest.approx(drawn.log_density[is_found], abs=1e-3)


LOG_MOST = 2.0
"""Logarithm of the largest ratio of two densities that counts in full."""


def assert_normalised(proposal, drawn, short, rng8):
    """Against the normal law of the fit: both of its draws and of the proposal's tell the integral
    of the lesser of its density and e^2 times the proposal's.

    The plain mean of their ratio is 1 too, but in 16 dimensions a dozen of 2048 draws make it up,
    and its standard error says nothing.
    """
    normal = multivariate_normal(short.vector, short.covariance)
    by_proposal = normal.logpdf(drawn.vectors) - drawn.log_density
    vectors = normal.rvs(drawn.log_density.size, random_state=rng8)
    by_normal = normal.logpdf(vectors) - proposal.log_density(vectors)
    one = np.exp(np.minimum(by_proposal, LOG_MOST))
    other = np.exp(np.minimum(0.0, LOG_MOST - by_normal))
    error = np.hypot(one.std(), other.std()) / np.sqrt(one.size)
    assert abs(one.mean() - other.mean()) < ERRORS * error


@pytest.mark.parametrize("num", [512, pytest.param(2048, marks=SLOW)])
def test_the_proposal_is_a_normalised_density(rto, short, rng8, num):
    assert_normalised(rto, rto.draw(num, rng8), short, rng8)


def test_where_the_linear_model_says_nothing_some_noises_are_kept_all_the_same(of_short):
    law = Noises.of(of_short, np.full(50, np.nan))
    assert np.exp(law.log_chance(np.array([np.nan, -1e4]))) == pytest.approx(LEAST_KEPT)
    assert np.exp(law.log_share) == pytest.approx(LEAST_KEPT)


def test_a_short_test_is_sampled_without_mcmc(short):
    found = sample(short, method="quick", seed=1)
    weighted = found.weighted
    assert weighted.is_sound, (weighted.pareto_k, weighted.effective_size)
    assert found.method == "importance"


@pytest.mark.parametrize("num", [1024, pytest.param(4096, marks=SLOW)])
def test_two_centres_give_one_law(short, of_short, followed, rng8, num):
    """What is drawn does not depend on where the model was linearised."""
    first = followed
    sd = moments(first).sd
    aside = Rto.around(short, short.z + 0.5 * sd[: short.z.size], of_short, rng8)
    drawn = aside.draw(num, rng8)
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
        patch.setattr("heatrun.posterior.posterior.LONG", 0)  # so that no draws stand in for it
        ensemble = sample(short, seed=5, most_steps=24_000)
    gap = gap_in_errors(weighted, ensemble)
    assert np.all(np.abs(gap) < ERRORS), gap
    assert np.max(np.abs(np.log(moments(weighted).sd / ensemble.flat.std(axis=0)))) < 0.15


def test_draws_without_an_answer_weigh_nothing(rto, short, rng8, monkeypatch):
    whole = Rto._seen

    def with_gaps(self, z, noise_z):
        seen = whole(self, z, noise_z)
        seen.value[::3] = np.nan
        return seen

    monkeypatch.setattr(Rto, "_seen", with_gaps)
    drawn = rto.draw(30, rng8)
    assert np.all(np.isfinite(drawn.vectors))
    assert np.all(drawn.log_density[::3] == np.inf)
    weighted = Weighted.of(drawn.vectors, evaluate(short, drawn.vectors), drawn.log_density, rto)
    assert np.all(weighted.weights[::3] == 0.0)
    assert weighted.weights.sum() == pytest.approx(1.0)


def test_an_optimum_that_no_draw_came_near_is_noticed(rto, short, rng8):
    drawn = rto.draw(512, rng8)
    found = Weighted.of(drawn.vectors, evaluate(short, drawn.vectors), drawn.log_density, rto)
    assert np.all(covered(short, found))
    far = short.noise_z + 1.5 + 0.05 * rng8.standard_normal((50, short.noise_z.size))
    aside = rto.over(Kernels.over(far, np.full(50, 0.02), rng8), rng8)
    drawn = aside.draw(512, rng8)
    found = Weighted.of(drawn.vectors, evaluate(short, drawn.vectors), drawn.log_density, aside)
    away = replace(short, modes=short.z[None])
    assert not np.any(covered(away, found))


@pytest.mark.parametrize(("num", "least"), [(512, 100), pytest.param(1024, 400, marks=SLOW)])
def test_draws_around_two_optima_give_the_law_that_those_around_one_give(
    short, of_short, followed, rng8, monkeypatch, num, least
):
    """With few draws in a round, and with as many as there are."""
    monkeypatch.setattr(importance_module, "NUM_DRAWS", num)
    monkeypatch.setattr("heatrun.posterior.weighted.LEAST_EFFECTIVE", least)
    one = followed
    aside = short.z + 0.7 * moments(one).sd[: short.z.size]
    both = replace(short, modes=np.stack([short.z, aside]))

    def covered_by(_, weighted):
        return np.array([True, isinstance(weighted.proposal, Several)])

    monkeypatch.setattr(importance_module, "covered", covered_by)
    two = sample_rto(both, of_short, rng8)
    assert isinstance(two.proposal, Several)
    assert two.is_sound
    first, second = moments(one), moments(two)
    assert np.all(np.abs(first.mean - second.mean) < ERRORS * np.hypot(first.error, second.error))
    error = np.sqrt(sum(1.0 / each.effective_size for each in (one, two)))
    assert abs(one.log_evidence - two.log_evidence) < ERRORS * error


@pytest.mark.parametrize("num", [512, pytest.param(2048, marks=SLOW)])
def test_a_proposal_around_two_optima_is_a_normalised_density(rto, short, of_short, rng8, num):
    aside = Rto.around(short, short.z + 0.1, of_short, rng8)
    several = Several((rto, aside), np.array([0.3, 0.7]))
    drawn = several.draw(num, rng8)
    is_found = np.isfinite(drawn.log_density)
    seen = several.log_density(drawn.vectors[is_found])
    assert seen == pytest.approx(drawn.log_density[is_found], abs=1e-3)
    assert_normalised(several, drawn, short, rng8)


def test_where_the_guard_is_never_satisfied_there_are_draws_all_the_same(short, monkeypatch):
    monkeypatch.setattr("heatrun.posterior.weighted.PARETO_LIMIT", -1.0)
    monkeypatch.setattr(importance_module, "NUM_DRAWS", 64)
    monkeypatch.setattr(importance_module, "MOST_ROUNDS", 2)
    monkeypatch.setattr("heatrun.posterior.importance.NUM_ADAPTATIONS", 1)
    weighted = importance_sample(short)
    assert not weighted.is_sound
    assert np.isfinite(weighted.effective_size)


@pytest.mark.parametrize(("least", "rounds"), [(1e9, 4), (500, 8)])
def test_rounds_that_would_never_be_enough_are_not_gone_on_with(
    short, of_short, monkeypatch, least, rounds
):
    """Ten minutes were spent on two optima of a motor, where one draw in two hundred counted."""
    monkeypatch.setattr(importance_module, "NUM_DRAWS", 64)
    monkeypatch.setattr(importance_module, "MOST_ROUNDS", 8)
    for module in ("importance", "weighted"):
        monkeypatch.setattr(f"heatrun.posterior.{module}.LEAST_EFFECTIVE", least)
    found = sample_rto(short, of_short, np.random.default_rng(4))
    assert found.weights.size == 64 * rounds


@pytest.mark.parametrize(
    ("shape", "num", "is_beyond"),
    [(1.3, 8192, True), (1.3, 64, False), (0.75, 8192, False), (0.4, 8192, False)],
)
def test_only_a_tail_that_is_surely_too_heavy_ends_the_rounds(shape, num, is_beyond):
    """Of weights by a Pareto law most draws are alike: enough of them count in any case."""
    rng = np.random.default_rng(3)
    tail = rng.uniform(size=num) < 0.02
    log_weight = np.where(tail, np.log1p(0.1 * rng.pareto(1.0 / shape, size=num)), 0.0)
    nothing = np.zeros(num)
    weighted = Weighted.of(np.zeros((num, 1)), log_weight, nothing, None)
    assert weighted.is_beyond_hope == is_beyond, (weighted.pareto_k, weighted.effective_size)


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
