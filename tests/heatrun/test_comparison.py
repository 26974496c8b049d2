"""What is said of two networks, by evidence, error and log score."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from heatrun.inference.comparison import verdict
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
