"""Networks compared by evidence and by scores."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import norm

from heatrun.posterior.comparison import verdict
from heatrun.posterior.predict import (
    ScoreDifference,
    block_scores,
    score_difference,
    standard_error,
)
from heatrun.results import FitResult, from_json

STORED = Path(__file__).parents[1] / "stored" / "fit-1.json"


@pytest.fixture(scope="module")
def models():
    return from_json(STORED.read_bytes(), FitResult, "fit.json", "run").models


def with_held_out(models, rows):
    """Both networks with one held-out test each, of a given error [K] and log score [nat]."""
    result = {}
    for (name, model), (rmse, score) in zip(models.items(), rows, strict=True):
        row = replace(model.residuals[0], role="holdout", rmse_K=rmse, log_score=score)
        result[name] = replace(model, residuals=(model.residuals[0], row))
    return result


def test_a_network_that_is_better_in_both_is_said_to_be_better(models):
    said = verdict(with_held_out(models, ((8.4, -3.9), (0.3, -0.1)))).sentence
    assert "The second order predicts the held-out tests better: RMSE (second order 0.30 K" in said
    assert "first order 8.40 K" in said


def test_a_better_score_with_a_larger_error_is_not_said_to_be_better(models):
    """A wide band around a large error scores better than a narrow one around a small error."""
    said = verdict(with_held_out(models, ((8.4, -3.9), (4.0, -6.0)))).sentence
    assert "predicts the held-out tests better" not in said
    assert "the second order has the lower RMSE (second order 4.00 K, first order 8.40 K)" in said
    assert "the first order has the better mean log score" in said


def test_within_two_standard_errors_of_the_score_nothing_is_said_to_be_better(models):
    rows = with_held_out(models, ((0.40, -0.9), (0.38, -0.8)))
    unsure = verdict(rows, ScoreDifference(0.1, 0.08))
    assert "predicts the held-out tests better is not decided" in unsure.sentence
    assert "difference +0.1, standard error 0.08" in unsure.sentence
    assert unsure.log_score_difference_se == 0.08
    sure = verdict(rows, ScoreDifference(0.1, 0.04)).sentence
    assert "The second order predicts the held-out tests better" in sure
    assert "difference +0.1, standard error 0.04" in sure


def test_a_difference_of_the_score_that_is_not_decided_outweighs_none_of_the_errors(models):
    rows = with_held_out(models, ((8.4, -3.9), (4.0, -6.0)))
    said = verdict(rows, ScoreDifference(-2.1, 1.5)).sentence
    assert "not decided" in said
    assert "has the better mean log score" not in said


def autoregression(phi: float, num: int, seed: int) -> np.ndarray:
    """A stationary series of unit variance, after a run-in of 2000 values."""
    rng = np.random.default_rng(seed)
    shocks = np.sqrt(1.0 - phi**2) * rng.standard_normal(num + 2000)
    return np.asarray(lfilter([1.0], [1.0, -phi], shocks))[2000:]


def true_error(phi: float, num: int) -> float:
    """Exact standard deviation of the mean: sum of all covariances phi^|i - j| over num^2."""
    lag = np.arange(1, num)
    return float(np.sqrt((num + 2.0 * np.sum((num - lag) * phi**lag)) / num**2))


@pytest.mark.parametrize("phi", [0.0, 0.6, 0.9])
def test_two_standard_errors_hold_the_mean_of_a_correlated_series(phi):
    num, trials = 270, 400  # 90 minutes of blocks of 20 s
    series = [autoregression(phi, num, seed) for seed in range(trials)]
    errors = np.array([standard_error(x) for x in series])
    assert np.median(errors) == pytest.approx(true_error(phi, num), rel=0.15)
    held = np.mean(np.abs([x.mean() for x in series]) < 2.0 * errors)
    # 95.4 % for a normal with known error; an estimated one of 20 effective values: 93 %; the
    # counts of 400 trials have a standard deviation of 1.2 %
    assert held > 0.90
    if phi == 0.9:  # as if the blocks were independent, half of the means would lie outside
        naive = [x.std() / np.sqrt(num) for x in series]
        assert np.mean(np.abs([x.mean() for x in series]) < 2.0 * np.array(naive)) < 0.55


def test_a_level_that_lasts_as_long_as_the_test_has_no_small_error():
    walk = np.cumsum(np.random.default_rng(3).standard_normal(200))
    assert 0.5 * walk.std() < standard_error(walk) < 1.5 * walk.std()


def test_few_or_missing_values_have_no_standard_error():
    assert standard_error(np.arange(9.0)) is None
    assert standard_error(np.array([np.inf] * 20)) is None
    assert standard_error(np.ones(20)) == 0.0


def predicted(error: np.ndarray, sd: float) -> Any:
    seen = np.ones(error.size, dtype=bool)
    seen[5] = False
    residual = np.where(seen, error, np.nan)
    test = SimpleNamespace(is_observed=seen)
    sds = np.full(error.size, sd)
    return SimpleNamespace(test=test, residual=residual, sd=sds, is_there=True)


def test_a_test_that_one_network_could_not_predict_does_not_count():
    error = np.random.default_rng(4).standard_normal(60)
    there, lost = predicted(error, 1.0), predicted(error, 1.0)
    lost.is_there = False
    known = score_difference([there], [there], ["holdout"])
    assert score_difference([there, lost], [there, there], ["holdout", "holdout"]) == known
    assert score_difference([lost], [there], ["holdout"]) is None


def test_the_difference_is_taken_block_by_block():
    """What both networks get wrong alike cancels: the error is far below that of either score."""
    common = autoregression(0.9, 270, 7)
    one, two = predicted(common, 1.0), predicted(common + 0.01, 1.0)
    found = score_difference([two, one], [one, two], ["calibration", "holdout"])
    assert found is not None
    scores = norm.logpdf(np.delete(common, 5)), norm.logpdf(np.delete(common + 0.01, 5))
    assert found.difference == pytest.approx(np.mean(scores[1] - scores[0]))
    alone = standard_error(block_scores(one))
    assert alone is not None
    # the scores differ by 0.01 times the error that both make, a known autoregression
    assert found.standard_error == pytest.approx(0.01 * true_error(0.9, 269), rel=0.4)
    assert found.standard_error < 0.1 * alone
    assert score_difference([one], [two], ["calibration"]) is None


def test_within_two_standard_errors_nothing_is_decided():
    assert not ScoreDifference(0.39, 0.2).is_decided
    assert ScoreDifference(-0.41, 0.2).is_decided
