"""What is said of two networks, by evidence, error and log score."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from heatrun.posterior.comparison import verdict
from heatrun.posterior.predict import ScoreDifference
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
