from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from heatrun.fit.fit import ljung_box, low_frequency_excess
from heatrun.fit.restricted import restricted_log_likelihood
from heatrun.model.noise import Noise, draw, log_density, variance_of_mean, whiten


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


@pytest.mark.parametrize("counts", [[1], [2], [10], [50], [1, 5, 20, 3]])
@pytest.mark.parametrize("time", [1.0, 20.0, 45.0, 2000.0])
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


def test_columns_are_whitened_alike(observation):
    values = jnp.asarray(np.random.default_rng(1).normal(size=(observation.measured.size, 3)))
    together, _ = whiten(values, NOISE, observation)
    apart = [whiten(values[:, i], NOISE, observation)[0] for i in range(3)]
    np.testing.assert_allclose(together, np.stack(apart, axis=1), rtol=1e-12)


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


def test_restricted_likelihood_integrates_the_parameters_out(fitted):
    """Against the dense Gaussian marginal: residual ~ N(J z, V + J J')."""
    problem = fitted.problem
    residual, jacobian = fitted.residual[0], fitted.jacobian[0]
    noise_z = jnp.asarray([0.1, -0.3, 0.2, 0.4])
    found = []
    for shift in (0.0, 0.4):
        scores = noise_z + shift
        value = restricted_log_likelihood(
            problem.data, scores, jnp.asarray(fitted.z), jnp.asarray(residual),
            jnp.asarray(jacobian),
        )  # fmt: skip
        from heatrun.model.noise import from_scores

        V = covariance(problem.data.tests[0], from_scores(scores))
        centred = residual - jacobian @ fitted.z  # at z = 0 of the linear model
        exact = log_normal(centred, V + jacobian @ jacobian.T)
        exact -= 0.5 * float(jnp.sum(scores**2))
        found.append(float(value) - exact)
    assert found[0] == pytest.approx(found[1], abs=1e-6)  # equal up to one constant
