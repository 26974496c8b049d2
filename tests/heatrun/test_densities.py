"""Log densities of draws: windows against dense conditionals, loo against refits without them."""

from __future__ import annotations

import warnings
from dataclasses import replace

import arviz
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import logsumexp
from test_noise import covariance

from heatrun.fit.fit import fit
from heatrun.model.discrepancy import left_out, windows
from heatrun.model.model import Model
from heatrun.model.noise import from_scores
from heatrun.model.problem import Problem, residuals
from heatrun.posterior.posterior import weighted_draws
from heatrun.runs import netcdf as archive
from heatrun.runs.densities import densities


@pytest.fixture(scope="module")
def posterior(fitted):
    return weighted_draws(fitted, seed=4)


@pytest.fixture(scope="module")
def opened(posterior, tmp_path_factory):
    """The groups as written and as ArviZ itself opens them."""
    path = tmp_path_factory.mktemp("run") / "posterior_second.nc"
    archive.write(posterior, path, densities(posterior))
    assert path.stat().st_size < 2_000_000
    return arviz.from_netcdf(path)


def without_window(blocks, mask):
    """The record as if the blocks of a window had not been read."""
    count = np.where(mask, blocks.count, 0.0)
    return replace(blocks, measured=np.where(mask, blocks.measured, np.nan), count=count)


def test_windows_hold_every_reading_once(blocks, motor):
    gap = np.ones(blocks.measured.size, dtype=bool)
    gap[5:30] = False
    tests = [blocks, replace(without_window(blocks, gap), name="gapped")]
    problem = Problem.of(Model.of("first", motor), motor, tests)
    cut = windows(problem, 10)
    assert cut.test.tolist() == [0] * 5 + [1] * 5
    for test, masks in zip(tests, cut.without, strict=True):
        left = test.is_observed & ~masks
        np.testing.assert_array_equal(left.sum(axis=0), test.is_observed)
        assert np.ptp(left.sum(axis=1)) <= 1
    assert cut.to_s[0] < cut.from_s[1]


def test_a_window_has_the_density_of_the_dense_conditional_normal_law(posterior):
    problem = posterior.fit.problem
    cut = windows(problem)
    vector = posterior.flat[7]
    found = left_out(problem, cut, vector[None])[0]
    noise = from_scores(vector[problem.num_parameters :])
    test = problem.data.tests[0]
    dense = covariance(test, noise)
    z = jnp.asarray(vector[: problem.num_parameters])
    seen = jax.jit(lambda z: residuals(problem.structure, problem.data, z)[0])
    residual = np.asarray(seen(z))
    for index in (0, 11, 23):
        rest = cut.without[0][index]
        gone = ~rest
        gain = np.linalg.solve(dense[np.ix_(rest, rest)], dense[np.ix_(rest, gone)])
        law = dense[np.ix_(gone, gone)] - dense[np.ix_(gone, rest)] @ gain
        error = residual[gone] - gain.T @ residual[rest]
        log_det = np.linalg.slogdet(2 * np.pi * law)[1]
        expected = -0.5 * (error @ np.linalg.solve(law, error) + log_det)
        assert found[index] == pytest.approx(expected, abs=1e-8)


def test_prior_and_likelihood_together_are_the_density_of_the_draws(posterior, opened):
    prior = sum(
        np.asarray(value, dtype=float).reshape(4000, -1).sum(axis=1)
        for value in opened.log_prior.data_vars.values()
    )
    group = opened.log_likelihood
    likelihood = np.asarray(group["winding"], dtype=float).sum(axis=-1) + group["dependence"]
    total = np.asarray(likelihood).ravel() + prior
    np.testing.assert_allclose(total, posterior.log_density.ravel(), atol=1e-4)  # stored as float32
    names = set(opened.posterior.data_vars)
    assert set(opened.log_prior.data_vars) == names
    for name in names:
        assert opened.log_prior[name].dims == opened.posterior[name].dims
    assert "leave-one-window-out" in group["winding"].attrs["meaning"]
    assert str(group["window"].values[0]).startswith("duty, ")


def error_of(values, effective_size):
    """The relative Monte Carlo error of the mean of positive values."""
    return np.std(values) / np.mean(values) / np.sqrt(effective_size)


@pytest.mark.slow
def test_loo_of_a_written_run_is_what_refits_without_a_window_say(posterior, opened, motor):
    with warnings.catch_warnings():
        # of one window in 24, whose Pareto k is above 0.7
        warnings.filterwarnings("ignore", "Estimated shape parameter of Pareto", UserWarning)
        loo = arviz.loo(opened, var_name="winding", pointwise=True)
    by_loo = np.asarray(loo.loo_i if hasattr(loo, "loo_i") else loo.elpd_i)
    problem = posterior.fit.problem
    cut = windows(problem)
    seen = np.asarray(opened.log_likelihood["winding"], dtype=float).reshape(-1, 24)
    for index in (5, 14):
        assert float(loo.pareto_k[index]) < 0.5
        record = without_window(problem.tests[0], cut.without[0][index])
        draws = weighted_draws(fit(Problem.of(problem.model, motor, [record])), seed=6)
        assert draws.is_sound
        density = left_out(problem, cut, draws.flat)[:, index]
        by_refit = logsumexp(density) - np.log(density.size)
        errors = (
            error_of(np.exp(density - by_refit), draws.weighted.effective_size),
            error_of(np.exp(by_loo[index] - seen[:, index]), posterior.weighted.effective_size),
        )
        assert abs(by_loo[index] - by_refit) < 4 * np.hypot(*errors)
        # and what is told apart: the density at the draws that knew the window is another
        within = logsumexp(seen[:, index]) - np.log(4000)
        assert within - by_refit > 4 * np.hypot(*errors)


def sensitivity(groups, component, names=None):
    if hasattr(arviz, "psens"):
        return arviz.psens(groups, component=component, component_var_names=names)
    return arviz.psense(groups, group=component, group_var_names=names)


@pytest.mark.filterwarnings("ignore::FutureWarning")  # of xarray, inside ArviZ 0.23
def test_prior_sensitivity_tells_what_the_priors_hold(opened):
    limit = 0.05  # Kallioinen et al., Statistics and Computing 34 (2024) 57
    likelihood, prior = (sensitivity(opened, part) for part in ("likelihood", "prior"))
    for name in ("noise_sd", "noise_time"):
        assert float(likelihood[name]) > limit
    # what is known of R(T) is the prior, and with it the width of Ceq_w; not Ceq_w's own prior
    assert float(sensitivity(opened, "prior", ["Rs0"])["Rs0"]) > limit
    assert float(prior["Ceq_w"]) > limit
    assert float(sensitivity(opened, "prior", ["Ceq_w"])["Ceq_w"]) < 0.1 * limit
