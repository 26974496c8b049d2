"""The population of a type against quadrature, published figures and simulated machines."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from heatrun.errors import InputError
from heatrun_fleet.population.gathered import Evidence
from heatrun_fleet.population.law import (
    Hyperprior,
    log_marginal,
    num_scores,
    unpack,
)
from heatrun_fleet.population.sampling import (
    Data,
    _many,
    _under,
    given_population,
    next_machine,
    sample_population,
    tolerance_limits,
)

# D. B. Rubin, Estimation in parallel randomized experiments, Journal of Educational Statistics 6
# (1981) 377-401: effects of coaching in eight schools and their standard errors
EFFECT = np.array([28.0, 8.0, -3.0, 7.0, -1.0, 1.0, 18.0, 12.0])
ERROR = np.array([15.0, 10.0, 16.0, 11.0, 9.0, 11.0, 10.0, 18.0])
NAMES = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")


def of_readings(readings, errors, names=("x",)):
    """Evidence of machines whose parameters were read with Gaussian errors."""
    precision = np.linalg.inv(errors)
    return Evidence(
        names, np.einsum("mij,mj->mi", precision, readings), precision, np.zeros(len(readings))
    )


@pytest.fixture(scope="module")
def schools():
    hyper = Hyperprior(np.zeros(1), np.full(1, 5.0), np.ones(1), np.full(1, 5.0), False)
    evidence = of_readings(EFFECT[:, None], (ERROR**2)[:, None, None])
    return sample_population(evidence, hyper, seed=3)


@pytest.fixture(scope="module")
def exact():
    """The same posterior on a grid: mean of the schools normal with 5, their spread half-Cauchy."""
    mean, tau = np.meshgrid(np.linspace(-20.0, 30.0, 501), np.linspace(0.005, 60.0, 3000))
    log = norm.logpdf(mean, 0.0, 5.0) - np.log1p((tau / 5.0) ** 2)
    sd = np.sqrt(tau[..., None] ** 2 + ERROR**2)
    log += norm.logpdf(EFFECT, mean[..., None], sd).sum(axis=-1)
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    pull = tau[..., None] ** 2 / (tau[..., None] ** 2 + ERROR**2)
    own = mean[..., None] + pull * (EFFECT - mean[..., None])
    return {
        "mean": float(np.sum(weight * mean)), "tau": float(np.sum(weight * tau)),
        "mean_sd": float(np.sqrt(np.sum(weight * mean**2) - np.sum(weight * mean) ** 2)),
        "schools": np.einsum("ij,ijk->k", weight, own),
    }  # fmt: skip


def test_eight_schools(schools, exact):
    """Against the published reference posterior too: means 4.4 and 3.6 of mean and spread."""
    assert schools.is_converged
    mean, tau = np.asarray(schools.laws.mean)[:, 0], np.asarray(schools.laws.sd)[:, 0]
    assert mean.mean() == pytest.approx(exact["mean"], abs=0.35)
    assert mean.std() == pytest.approx(exact["mean_sd"], rel=0.1)
    assert tau.mean() == pytest.approx(exact["tau"], abs=0.45)
    assert exact["mean"] == pytest.approx(4.4, abs=0.1)
    assert exact["tau"] == pytest.approx(3.6, abs=0.1)
    machines = given_population(schools)
    np.testing.assert_allclose(machines.mean[:, 0], exact["schools"], atol=0.7)


def simulated(num, seed, *, outliers=0, effect=0.0):
    """Machines that differ by a few per cent; every third has a short test, blind for one sum."""
    rng = np.random.default_rng(seed)
    mean = np.log([700.0, 15000.0, 0.15, 0.11])
    sd = np.array([0.03, 0.05, 0.06, 0.04])
    correlation = np.eye(4)
    correlation[0, 2] = correlation[2, 0] = -0.5
    supplier = (np.arange(num) % 2) - 0.5
    true = mean + rng.multivariate_normal(np.zeros(4), correlation * np.outer(sd, sd), num)
    true[:, 3] += effect * supplier
    true[:outliers, 2] += 0.6
    prior = np.diag([1.3, 1.5, 1.8, 1.4]) ** 2
    prior_mean = mean + 0.3
    blind = np.array([0.0, 1.0, 0.0, -1.0]) / np.sqrt(2.0)
    posterior = []
    for machine in range(num):
        basis = np.linalg.qr(rng.standard_normal((4, 4)))[0]
        error = (basis * rng.uniform(0.01, 0.03, 4) ** 2) @ basis.T
        information = np.linalg.inv(error)
        if machine % 3 == 0:
            away = np.eye(4) - np.outer(blind, blind)
            information = away @ information @ away
        covariance = np.linalg.inv(information + np.linalg.inv(prior))
        read = rng.multivariate_normal(true[machine], error)
        pulled = information @ read + np.linalg.solve(prior, prior_mean)
        posterior.append((covariance @ pulled, covariance))
    means, covariances = map(np.stack, zip(*posterior, strict=True))
    return (
        Evidence.of_posteriors(NAMES, means, covariances, np.tile(prior_mean, (num, 1)),
                               np.tile(prior, (num, 1, 1))),
        true, supplier[:, None], Hyperprior(mean + 0.5, np.full(4, 2.0), np.full(4, 0.3),
                                            np.full(4, 0.1)),
        (mean, sd),
    )  # fmt: skip


def test_the_prior_of_each_calibration_is_divided_out():
    evidence, *_ = simulated(9, 4)
    assert np.all(evidence.clipped == 0.0)
    assert np.linalg.eigvalsh(evidence.precision[0]).min() == pytest.approx(0.0, abs=1e-4)
    assert np.linalg.eigvalsh(evidence.precision[1]).min() > 1e3


def test_a_posterior_wider_than_its_prior_is_told():
    prior, mean = np.eye(2)[None], np.zeros((1, 2))
    wide = np.diag([2.0, 0.01])[None]
    evidence = Evidence.of_posteriors(("a", "b"), mean + 1.0, wide, mean, prior)
    assert evidence.clipped[0] == pytest.approx(0.5)
    np.testing.assert_allclose(evidence.precision[0], np.diag([0.0, 99.0]), atol=1e-9)
    np.testing.assert_allclose(evidence.information[0], [0.0, 100.0], atol=1e-9)


def test_a_fit_without_a_covariance_is_refused():
    eye = np.eye(2)[None]
    with pytest.raises(InputError, match="machines 0"):
        Evidence.of_posteriors(("a", "b"), np.zeros((1, 2)), eye * np.nan, np.zeros((1, 2)), eye)


@pytest.fixture(scope="module")
def fleet():
    evidence, true, supplier, hyper, law = simulated(120, 8, outliers=4, effect=0.08)
    return sample_population(evidence, hyper, supplier, seed=1), true, law


def test_mean_spread_and_supplier_are_found(fleet):
    population, _, (mean, sd) = fleet
    assert population.is_converged
    laws = population.laws
    for found, true in ((laws.mean, mean), (laws.sd, sd)):
        low, high = np.quantile(np.asarray(found), [0.002, 0.998], axis=0)
        assert np.all((low < true) & (true < high))
    effect = np.asarray(laws.effects)[:, 0, 3]
    assert effect.mean() - 3.0 * effect.std() < 0.08 < effect.mean() + 3.0 * effect.std()
    assert effect.mean() > 3.0 * effect.std()
    assert np.asarray(laws.correlation)[:, 0, 2].mean() < -0.2


def test_machines_that_do_not_fit_are_named_with_what_is_different(fleet):
    population, _, _ = fleet
    machines = given_population(population)
    assert np.all(machines.outlier[:4] > 0.9)
    assert np.mean(machines.outlier[4:] > 0.5) <= 0.02
    assert np.all(np.argmax(np.abs(machines.distance[:4]), axis=1) == NAMES.index("Req_w"))


def test_short_tests_borrow_from_the_others(fleet):
    """What a short test leaves open for the slow capacity is what the type leaves open."""
    population, true, (_, sd) = fleet
    machines = given_population(population)
    short = np.arange(6, 120, 3)
    z = (machines.mean - true) / np.sqrt(np.einsum("mii->mi", machines.covariance))
    assert 0.8 < np.sqrt(np.mean(z**2)) < 1.2
    assert np.sqrt(np.mean((machines.mean - true)[short, 1] ** 2)) < 1.2 * sd[1]


def test_limits_of_the_data_sheet_hold_the_share_that_they_say():
    """Fleets of 15 machines: in about 95 of 100, 95 % of the type lie within."""
    mean, sd, hold = np.zeros(1), 0.05, []
    hyper = Hyperprior(mean, np.ones(1), np.ones(1), np.full(1, 0.1), False)
    for seed in range(60):
        rng = np.random.default_rng(seed)
        error = np.full((15, 1, 1), 0.01**2)
        read = 0.3 + sd * rng.standard_normal((15, 1)) + 0.01 * rng.standard_normal((15, 1))
        limits = tolerance_limits(sample_population(of_readings(read, error), hyper, seed=seed))
        low, high = limits[:, 0]
        hold.append(norm.cdf((high - 0.3) / sd) - norm.cdf((low - 0.3) / sd) >= 0.95)
    assert 0.85 <= np.mean(hold) <= 1.0


def test_the_next_machine_is_what_a_new_one_turns_out_to_be(fleet):
    population, true, (mean, sd) = fleet
    centre, covariance = next_machine(population)
    # wider than the type by the outliers and by what is left open
    assert np.all(np.sqrt(np.diag(covariance)) > sd * 0.95)
    law = multivariate_normal(centre, covariance)
    assert np.all(np.abs(centre - mean) < 0.03)
    assert np.mean(law.logpdf(true[4:])) > np.mean(
        multivariate_normal(centre, 9.0 * covariance).logpdf(true[4:])
    )


def test_nothing_compiled_waits_for_a_library_of_linear_algebra():
    """Batches of its factorisations wait for one another for ever on two cores."""
    evidence, _, supplier, hyper, _ = simulated(6, 4)
    data = Data.of(evidence, supplier)
    rows = np.zeros((2, num_scores(4, 1)))
    law = jax.eval_shape(jax.vmap(lambda z: unpack(z, hyper, 1)[0]), rows)
    first = jax.tree.map(lambda a: jax.ShapeDtypeStruct(a.shape[1:], a.dtype), law)
    for compiled in (
        jax.jit(partial(_many, hyper=hyper)).lower(data, rows=rows),
        jax.jit(partial(_under, *data, has_outliers=True)).lower(first),
    ):
        text = compiled.as_text()
        assert not any(word in text for word in ("lapack", "cholesky", "triangular_solve"))


def test_places_without_a_machine_weigh_nothing():
    evidence, _, supplier, hyper, _ = simulated(6, 4)
    bare = Data(*map(jnp.asarray, (supplier, evidence.information, evidence.precision)))
    filled = Data.of(evidence, supplier)
    assert len(filled.design) > len(bare.design)
    rows = 0.5 * np.random.default_rng(2).standard_normal((8, num_scores(4, 1)))
    found = [_many(data, hyper, jnp.asarray(rows)) for data in (bare, filled)]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-12)


def test_a_law_wider_than_rounding_can_tell_has_no_density():
    """Its precision would be noise, compiled another one than not."""
    precision = np.diag([4e4, 4e4, 4e4, 28.0])
    information = precision @ np.array([-1.6, 5.3, -3.9, -6.3])
    factor = np.tril(np.full((4, 4), 0.02))
    wide = factor.copy()
    wide[3] = [-1.2e7, -1.9e7, -4.1e6, 9.7e6]
    given = [jnp.asarray(each) for each in (np.zeros(4), information, precision)]
    for density in (log_marginal, jax.jit(log_marginal)):
        at, h, L = given
        assert density(at, jnp.asarray(wide), h, L) == -np.inf
        assert np.isfinite(density(at, jnp.asarray(factor), h, L))
