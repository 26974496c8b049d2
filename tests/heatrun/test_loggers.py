"""Tests from unlike loggers: each has its own noise, in the fit and in what it predicts."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from heatrun.fit.fit import fit
from heatrun.fit.restricted import estimate_loggers
from heatrun.model.loggers import scale_of
from heatrun.model.model import Model
from heatrun.model.noise import Noise, draw
from heatrun.model.problem import Problem
from heatrun.posterior.posterior import weighted_draws
from heatrun.posterior.predict import predict
from heatrun.record.reduction import reduce

QUIET = {"drift_sd_K": 0.1, "white_sd_K": 0.05, "resolution_K": 0.1}
NOISY = {"drift_sd_K": 0.8, "white_sd_K": 0.4, "resolution_K": 0.5}


@pytest.fixture(scope="module")
def tests(bench, generator, motor):
    """A calibration test and a held-out test of each logger."""
    profiles = generator.duty(2700.0), generator.staircase(2700.0)
    made = {
        f"{kind} {index}": bench(profile, seed + index, f"{kind} {index}", **instruments)
        for kind, seed, instruments in (("quiet", 41, QUIET), ("noisy", 51, NOISY))
        for index, profile in enumerate(profiles)
    }
    return {name: reduce(record, motor) for name, record in made.items()}


def test_the_restricted_likelihood_tells_the_noise_of_loggers_apart(tests, motor):
    """Residuals drawn with noise of two levels, and no parameter that could move them."""
    fitted = [tests["quiet 0"], tests["noisy 0"]]
    problem = Problem.of(Model.of("second", motor), motor, fitted)
    noise = Noise(*map(jnp.asarray, (0.1, 30.0, 0.05, 0.0)))
    drawn = [
        draw(jax.random.key(index), noise.scaled(factor), test.observation())
        for index, (factor, test) in enumerate(zip((1.0, 4.0), fitted, strict=True))
    ]
    residual = np.concatenate(drawn)
    nothing = np.zeros((residual.size, 1))
    scales = estimate_loggers(problem, np.zeros(1), residual, nothing)
    ratio = scale_of(scales, fitted[1].loggers[0]) / scale_of(scales, fitted[0].loggers[0])
    # of some 130 block means each, correlated over one or two: 10 % of the ratio; three of these
    assert 2.8 < ratio < 5.6


@pytest.fixture(scope="module")
def together(tests, motor):
    fitted = [tests["quiet 0"], tests["noisy 0"]]
    return fit(Problem.of(Model.of("second", motor), motor, fitted))


@pytest.mark.slow
def test_noise_of_each_logger_is_told_apart(together, tests):
    ratio = scale_of(together.problem.loggers, tests["noisy 0"].loggers[0])
    ratio /= scale_of(together.problem.loggers, tests["quiet 0"].loggers[0])
    assert 5.0 < ratio < 12.0  # 8 in both parts of the noise


@pytest.mark.slow
def test_the_band_of_a_held_out_test_is_that_of_its_logger(together, tests):
    draws = weighted_draws(together)
    bands = {name: predict(draws, tests[name]) for name in ("quiet 1", "noisy 1")}
    for found in bands.values():
        assert found.coverage_95() > 0.88
    assert np.median(bands["noisy 1"].sd) > 2.0 * np.median(bands["quiet 1"].sd)


@pytest.mark.slow
def test_a_noisy_test_does_not_hide_a_quiet_one(together, tests, motor):
    alone = fit(Problem.of(Model.of("second", motor), motor, [tests["quiet 0"]]))
    assert not alone.problem.loggers
    for name in ("Ceq_sr", "Req_w"):
        place = alone.problem.parameters.index(name)
        other = together.problem.parameters.index(name)
        widths = [np.sqrt(found.covariance[at, at])
                  for found, at in ((alone, place), (together, other))]  # fmt: skip
        assert widths[1] < 1.05 * widths[0]


@pytest.mark.slow
def test_an_unknown_logger_counts_as_the_noisiest(together, tests, blocks):
    assert blocks.loggers[0] not in together.problem.loggers
    assert scale_of(together.problem.loggers, blocks.loggers[0]) == max(
        together.problem.loggers.values()
    )
    assert scale_of({}, blocks.loggers[0]) == 1.0
