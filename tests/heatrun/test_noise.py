"""Noise and unmodelled heat: densities against dense covariances and an independent integration."""

import warnings
from dataclasses import replace

import arviz
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import logsumexp

from heatrun.fit.fit import fit, ljung_box, low_frequency_excess
from heatrun.fit.restricted import restricted_log_likelihood
from heatrun.model.discrepancy import block_responses, heat_columns, left_out, windows
from heatrun.model.model import Model
from heatrun.model.noise import Noise, draw, from_scores, log_density, variance_of_mean, whiten
from heatrun.model.problem import Problem, residuals
from heatrun.posterior.posterior import weighted_draws
from heatrun.record.motor import Adequacy
from heatrun.runs import netcdf as archive
from heatrun.runs.netcdf import densities
from lptn import second_order


@pytest.fixture
def observation(blocks):
    return blocks.observation()


NOISE = Noise(*map(jnp.asarray, (0.3, 45.0, 0.1, 0.004)))


def covariance(observation, noise):
    """The dense covariance of the block means, from its definition reading by reading."""
    seen = np.asarray(observation.is_observed)
    length = float(observation.block_s)
    counts = np.maximum(np.asarray(observation.count).astype(int), 1)
    block = np.repeat(np.arange(seen.size), counts)
    times = np.concatenate([length * (j + (np.arange(n) + 0.5) / n) for j, n in enumerate(counts)])
    averaging = np.zeros((seen.size, times.size))
    averaging[block, np.arange(times.size)] = 1.0 / counts[block]
    lag = np.abs(np.subtract.outer(times, times))
    of_readings = float(noise.sd) ** 2 * np.exp(-lag / float(noise.time))
    slow = averaging @ of_readings @ averaging.T
    white = float(noise.white) ** 2 * 20.0 / length + np.asarray(observation.known_variance)
    heat = np.asarray(observation.heat) * float(noise.heat)
    moments = np.asarray(observation.moments)
    return (slow + np.diag(white) + heat @ heat.T + moments @ moments.T)[np.ix_(seen, seen)]


def log_normal(values, covariance):
    """The log density of a normal distribution around zero, by the dense formula."""
    squares = values @ np.linalg.solve(covariance, values)
    log_det = np.linalg.slogdet(2.0 * np.pi * covariance)[1]
    return -0.5 * (squares + log_det)


def sampled(observation, counts, **changes):
    """The first blocks with as many readings in each as `counts` says, in turn."""
    num = 30
    cut = {
        name: getattr(observation, name)[:num]
        for name in (
            "measured", "is_observed", "weight", "position", "known_variance", "heat", "moments",
        )
    }  # fmt: skip
    count = jnp.asarray(np.resize(counts, num), dtype=float)
    return type(observation)(**{**vars(observation), **cut, "count": count, **changes})


@pytest.mark.parametrize(
    ("counts", "time"),
    [([1], 45.0), ([2], 45.0), ([10], 45.0), ([50], 45.0), ([1, 5, 20, 3], 45.0),
     ([1, 5, 20, 3], 1.0), ([1, 5, 20, 3], 20.0), ([1, 5, 20, 3], 2000.0)],
)  # fmt: skip
def test_density_is_that_of_the_dense_covariance(observation, counts, time):
    noise = Noise(NOISE.sd, jnp.asarray(time), NOISE.white, NOISE.heat)
    mask = jnp.ones(30, dtype=bool).at[20:24].set(False)
    gapped = sampled(observation, counts, is_observed=mask)
    residual = jnp.asarray(np.random.default_rng(0).normal(size=mask.size))
    exact = log_normal(np.asarray(residual)[np.asarray(mask)], covariance(gapped, noise))
    assert float(log_density(residual, noise, gapped)) == pytest.approx(exact, rel=1e-10)


@pytest.mark.parametrize(("num", "num_moments"), [(1, 0), (3, 8), (16, 2), (0, 4)])
def test_density_with_heat_is_that_of_the_dense_covariance(observation, num, num_moments):
    rng = np.random.default_rng(num)
    seen = jnp.asarray(rng.uniform(size=30) < 0.9)
    heat = jnp.asarray(100.0 * rng.standard_normal((30, num)))
    moments = jnp.asarray(rng.standard_normal((30, num_moments)))
    heated = sampled(observation, [5], is_observed=seen, heat=heat, moments=moments)
    residual = jnp.asarray(rng.normal(size=30))
    dense = covariance(heated, NOISE)
    exact = log_normal(np.asarray(residual)[np.asarray(seen)], dense)
    assert float(log_density(residual, NOISE, heated)) == pytest.approx(exact, rel=1e-9)
    # a linear map that makes the covariance the unit matrix
    columns = whiten(jnp.eye(30), NOISE, heated)[0]
    kept = np.asarray(columns)[np.ix_(seen, seen)]
    np.testing.assert_allclose(kept @ dense @ kept.T, np.eye(kept.shape[0]), atol=1e-9)


@pytest.mark.parametrize("num", [1, 3, 30])
def test_variance_of_a_mean_is_that_of_the_dense_covariance(observation, num):
    many = sampled(observation, [50], known_variance=jnp.zeros(30))
    exact = covariance(many, NOISE)[:num, :num].mean()
    found = variance_of_mean(NOISE, float(observation.block_s), num)
    assert found == pytest.approx(exact, rel=2e-4)
    assert float(NOISE.total()) ** 2 == pytest.approx(variance_of_mean(NOISE, 20.0, 1), rel=1e-12)


@pytest.mark.parametrize("counts", [[1], [3], [40]])
def test_drawn_noise_has_the_stated_covariance(observation, counts):
    heat = jnp.asarray(50.0 * np.random.default_rng(3).standard_normal((30, 4)))
    moments = jnp.asarray(0.2 * np.random.default_rng(4).standard_normal((30, 2)))
    observation = sampled(observation, counts, heat=heat, moments=moments)
    errors = np.asarray(draw(jax.random.key(0), NOISE, observation, (4000,)))
    exact = covariance(observation, NOISE)
    sample = np.cov(errors.T)
    # the sd of a sampled covariance of 4000 draws is about 2 % of the variance; 5 of them
    assert np.max(np.abs(sample - exact)) < 0.1 * exact[0, 0]


def test_drawn_noise_whitens_to_white(observation):
    errors = draw(jax.random.key(1), NOISE, observation)
    white = np.asarray(whiten(errors, NOISE, observation)[0])
    assert ljung_box(white) > 1e-3
    assert low_frequency_excess([white], [20.0])[1] is False
    drifting = white + 1.0 * np.sin(np.arange(white.size) / 30.0)
    # a test of four minutes, off for its first half: the same is seen
    short = white[:48] + np.where(np.arange(48) < 24, 1.5, -1.5)
    assert low_frequency_excess([short], [5.0])[1] is True
    assert low_frequency_excess([white[:48]], [5.0])[1] is False
    assert low_frequency_excess([drifting], [20.0])[1] is True
    assert ljung_box(drifting) < 1e-3


def observed(fitted):
    """The one test of a fit, without the blocks that lengthen it."""
    return fitted.problem.tests[0].observation(fitted.problem.heat[0])


def test_a_lengthened_test_has_the_density_of_the_test_alone(fitted):
    """The march goes on, and what is read there does not count: not in any row of two sensors."""
    problem, noise_z = fitted.problem, fitted.noise_z
    test, alone, longer = problem.tests[0], observed(fitted), problem.data.tests[0]
    assert longer.measured.size > test.measured.size  # 180 blocks are 192
    rows = test.lengthened(fitted.jacobian[0])
    assert not np.any(rows[test.measured.size :])
    np.testing.assert_array_equal(test.own(rows), fitted.jacobian[0])
    noise = from_scores(noise_z)
    expected = log_density(fitted.residual[0], noise, alone)
    found = log_density(test.lengthened(fitted.residual[0]), noise, longer)
    assert float(found) == pytest.approx(float(expected), rel=1e-12)
    values = problem.data.priors.values(problem.structure.form, jnp.asarray(fitted.z), 0)
    means = problem.model.block_means(values, alone)
    found = test.own(problem.model.block_means(values, longer))
    np.testing.assert_allclose(found[:-1], means[:-1], rtol=0.0, atol=1e-12)
    assert found[-1] == pytest.approx(
        float(means[-1]), abs=1e-3
    )  # an early reading looks past the end


def test_restricted_likelihood_integrates_the_parameters_out(fitted):
    """Against the dense Gaussian marginal: residual ~ N(J z, V + J J')."""
    problem = fitted.problem
    residual, jacobian = fitted.residual[0], fitted.jacobian[0]
    noise_z = jnp.asarray([0.1, -0.3, 0.2, 0.4])
    found = []
    for shift in (0.0, 0.4):
        scores = noise_z + shift
        value = restricted_log_likelihood(
            problem.readings, scores, fitted.z, *map(problem.lengthened, (residual, jacobian))
        )
        from heatrun.model.noise import from_scores

        V = covariance(observed(fitted), from_scores(scores))
        centred = residual - jacobian @ fitted.z  # at z = 0 of the linear model
        exact = log_normal(centred, V + jacobian @ jacobian.T)
        exact -= 0.5 * float(jnp.sum(scores**2))
        found.append(float(value) - exact)
    assert found[0] == pytest.approx(found[1], abs=1e-6)  # equal up to one constant


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
    dense = covariance(observed(posterior.fit), noise)
    z = jnp.asarray(vector[: problem.num_parameters])
    seen = jax.jit(lambda z: residuals(problem.structure, problem.data, z)[0])
    residual = problem.own(seen(z))
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
        np.asarray(value, dtype=float).reshape(posterior.flat.shape[0], -1).sum(axis=1)
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
    reliable = np.flatnonzero(np.asarray(loo.pareto_k) < 0.5)
    assert reliable.size >= 12
    for index in reliable[[4, -4]]:
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
        within = logsumexp(seen[:, index]) - np.log(seen.shape[0])
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


C_W, C_S, R_W, R_S = 700.0, 15000.0, 0.145, 0.116


def reading(node, course, edges):
    """Block means of the winding for heat in a node, integrated as written down in the thesis."""

    def slope(t, T):
        heat = np.interp(t, edges, course)
        flow = (T[0] - T[1]) / R_W
        in_winding, in_stator = (heat, 0.0) if node == "winding" else (0.0, heat)
        return [(in_winding - flow) / C_W, (in_stator + flow - T[1] / R_S) / C_S]

    fine = np.linspace(edges[0], edges[-1], 20 * (edges.size - 1) + 1)
    T = solve_ivp(slope, (fine[0], fine[-1]), [0.0, 0.0], t_eval=fine, rtol=1e-9, atol=1e-9,
                  max_step=5.0).y[0]  # fmt: skip
    return np.array([np.trapezoid(T[i : i + 21]) / 20 for i in range(0, fine.size - 1, 20)])


def test_responses_are_those_of_an_integrated_network():
    edges = 20.0 * np.arange(91)
    course = np.random.default_rng(0).standard_normal((91, 1))
    found = block_responses(second_order(C_W, C_S, R_W, R_S), ["winding"], course, 20.0)
    assert set(found) == {"winding", "stator"}
    for node, means in found.items():
        exact = reading(node, course[:, 0], edges)
        np.testing.assert_allclose(means[:, 0], exact, atol=2e-4 * np.max(np.abs(exact)))


@pytest.mark.parametrize("said", [Adequacy(), Adequacy(unmodelled_heat=0.003, heat_time_s=600.0)])
def test_columns_have_the_variance_of_drawn_heat(motor, blocks, said):
    """Heat drawn as a Gauss-Markov process step by step, through the integrated network."""
    values = {"Ceq_w": C_W, "Ceq_sr": C_S, "Req_w": R_W, "Req_sr": R_S, "Rs0": 0.006}
    columns = heat_columns(Model.of("second", replace(motor, adequacy=said)), values, blocks)
    rng = np.random.default_rng(1)
    wider = said.unmodelled_heat / Adequacy().unmodelled_heat
    loss = wider * float(np.mean(np.asarray(blocks.inputs.losses)))
    edges = blocks.block_s * np.arange(blocks.measured.size + 1)
    decay = np.exp(-blocks.block_s / said.heat_time_s)
    network, num = second_order(C_W, C_S, R_W, R_S), 150
    drawn = np.zeros((blocks.measured.size, num))
    for node in ("winding", "stator"):
        heat = [rng.standard_normal(num)]
        for shocks in rng.standard_normal((edges.size - 1, num)):
            heat.append(decay * heat[-1] + np.sqrt(1.0 - decay**2) * shocks)
        course = loss * np.array(heat)
        drawn += block_responses(network, ["winding"], course, blocks.block_s)[node]
    late = slice(blocks.measured.size // 3, None)
    sampled = np.mean(np.square(drawn[late]))
    stated = np.sum(columns**2, axis=1)[late].mean()
    # 150 records of some four independent stretches each: a sd of 6 %; 4 of them
    assert abs(sampled / stated - 1.0) < 0.24
