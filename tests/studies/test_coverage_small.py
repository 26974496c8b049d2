"""The coverage study in small: intervals hold the truth as often as they say."""

import numpy as np
import pytest
from scipy.stats import binom

NUM = 16
SEED = 2_000
TEST_S = 1800.0
NETWORK = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")
LEVELS = (0.5, 0.9)

FALSE_ALARM = 1e-3
"""Chance that honest intervals fail, over four parameters and two levels."""


@pytest.fixture(scope="module")
def cases():
    import coverage_cases
    from coverage_cases import CELLS, Cell, make_case

    from heatrun.fit.fit import fit
    from heatrun.model.model import Model
    from heatrun.model.problem import Problem
    from heatrun.record.record import Record
    from heatrun.record.reduction import reduce

    usual = CELLS["prior draws"]
    cell = Cell(usual.errors, {}, knows_resistance=False, from_prior=True, prior_test_s=TEST_S)
    run_test = coverage_cases.run_test

    def run_first(machine, kind, duration_s, *others):
        """The test to predict, which is longer, is not needed here."""
        return run_test(machine, kind, duration_s, *others) if duration_s == TEST_S else None

    found = []
    for index in range(NUM):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(coverage_cases, "run_test", run_first)
            case = make_case(cell, SEED, index)
        blocks = reduce(Record("short", case.calibration.channels), case.motor)
        problem = Problem.of(Model.of("second", case.motor), case.motor, [blocks])
        found.append((case, fit(problem, num_starts=2)))
    return found


def ranks(cases, draws):
    """Shares of the posterior below the truth, shape (record, parameter)."""
    from coverage_cases import ranks as ranks_of
    from coverage_cases import truth

    rows = [ranks_of(draws(fitted), truth(case)) for case, fitted in cases]
    return np.array([[row[name] for name in NETWORK] for row in rows])


@pytest.fixture(scope="module")
def of_normal_law(cases):
    from coverage_cases import of_covariance

    return ranks(cases, of_covariance)


@pytest.fixture(scope="module")
def of_weighted_draws(cases):
    from heatrun.posterior.posterior import weighted_draws

    return ranks(cases, lambda fitted: weighted_draws(fitted).values())


def is_honest(ranks):
    """Whether the number of records inside is what independent records would give."""
    tail = FALSE_ALARM / (2 * len(NETWORK) * len(LEVELS))
    for level in LEVELS:
        inside = np.sum(np.abs(ranks - 0.5) <= 0.5 * level, axis=0)
        low, high = binom.ppf(tail, NUM, level), binom.isf(tail, NUM, level)
        if np.any(inside < low) or np.any(inside > high):
            return False
    return True


METHODS = ["of_normal_law", pytest.param("of_weighted_draws", marks=pytest.mark.slow)]
"""Of 16 records, weighted draws take three times as long as all else."""


@pytest.mark.parametrize("method", METHODS)
def test_intervals_hold_the_truth_as_often_as_they_say(request, method):
    found = request.getfixturevalue(method)
    assert is_honest(found), np.sort(found, axis=0)


@pytest.mark.parametrize("method", METHODS)
def test_intervals_of_a_third_of_the_width_would_be_found_out(request, method):
    """That is the width if a 10 Hz record's samples counted as independent, and better."""
    from scipy.stats import norm

    too_sure = norm.cdf(3.0 * norm.ppf(request.getfixturevalue(method)))
    assert not is_honest(too_sure)
