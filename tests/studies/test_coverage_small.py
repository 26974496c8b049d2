"""The coverage study in small: intervals hold the truth as often as they say."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

sys.path.insert(0, str(Path(__file__).parent))

NUM = 16
SEED = 2_000
NETWORK = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")
LEVELS = (0.5, 0.9)

FALSE_ALARM = 1e-3
"""Chance that honest intervals fail, over four parameters and two levels."""


@pytest.fixture(scope="module")
def ranks():
    """Shares of the posterior below the truth, by method, shape (record, parameter)."""
    from coverage_cases import CELLS, Cell, make_case, of_covariance, truth
    from coverage_cases import ranks as ranks_of

    from heatrun.bench.record import Record
    from heatrun.bench.reduction import reduce
    from heatrun.inference.fitting.fit import fit
    from heatrun.inference.model import Model
    from heatrun.inference.posterior import weighted_draws
    from heatrun.inference.problem import Problem

    usual = CELLS["prior draws"]
    cell = Cell(usual.errors, {}, knows_resistance=False, from_prior=True, prior_test_s=1800.0)
    found = {"laplace": [], "quick": []}
    for index in range(NUM):
        case = make_case(cell, SEED, index)
        blocks = reduce(Record("short", case.calibration.channels), case.motor)
        problem = Problem.of(Model.of("second", case.motor), case.motor, [blocks])
        fitted = fit(problem, num_starts=2)
        for method, draws in (
            ("laplace", of_covariance(fitted)),
            ("quick", weighted_draws(fitted).values()),
        ):
            row = ranks_of(draws, truth(case))
            found[method].append([row[name] for name in NETWORK])
    return {method: np.array(rows) for method, rows in found.items()}


def is_honest(ranks):
    """Whether the number of records inside is what independent records would give."""
    tail = FALSE_ALARM / (2 * len(NETWORK) * len(LEVELS))
    for level in LEVELS:
        inside = np.sum(np.abs(ranks - 0.5) <= 0.5 * level, axis=0)
        low, high = binom.ppf(tail, NUM, level), binom.isf(tail, NUM, level)
        if np.any(inside < low) or np.any(inside > high):
            return False
    return True


@pytest.mark.parametrize("method", ["laplace", "quick"])
def test_intervals_hold_the_truth_as_often_as_they_say(ranks, method):
    assert is_honest(ranks[method]), np.sort(ranks[method], axis=0)


def test_intervals_of_a_third_of_the_width_would_be_found_out(ranks):
    """That is the width if a 10 Hz record's samples counted as independent, and better."""
    from scipy.stats import norm

    too_sure = norm.cdf(3.0 * norm.ppf(ranks["quick"]))
    assert not is_honest(too_sure)
