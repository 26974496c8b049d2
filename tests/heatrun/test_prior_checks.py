"""Errors of instruments that lie beyond their priors are told, and those of chance are not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from heatrun.model.parameters import Parameter, Slot
from heatrun.posterior.fit_checks import CHANCE, prior_findings

NUM_TESTS = 10
TIMING = Parameter(
    name="load_timing", unit="s", meaning="load later", role="instrument", transform="linear",
    centre=0.0, sd=0.29, basis="half a sample", per_test=True,
)  # fmt: skip


def told(estimates, sds):
    """Return the findings on estimates and standard deviations [prior standard deviations]."""
    slots = tuple(
        Slot(TIMING, number, f"load_timing[test_{number}]") for number in range(len(estimates))
    )
    unit = np.sqrt(3.0) * np.linspace(-1.0, 1.0, 2001)  # as good as of unit variance
    values = {
        slot.name: TIMING.sd * (estimate + sd * unit)[None]
        for slot, estimate, sd in zip(slots, estimates, sds, strict=True)
    }
    problem = SimpleNamespace(label="both tests")
    posterior = SimpleNamespace(
        fit=SimpleNamespace(slots=slots, problem=problem), values=lambda: values
    )
    return prior_findings(posterior)  # pyright: ignore[reportArgumentType]


def test_many_instruments_as_declared_are_told_of_no_more_often_than_one():
    """Two of their standard deviations are passed by one of ten in a third of all calibrations."""
    rng = np.random.default_rng(4)
    estimates = np.sqrt(0.99) * rng.standard_normal((2000, NUM_TESTS))
    raised = np.mean([bool(told(each, np.full(NUM_TESTS, 0.1))) for each in estimates])
    assert 0.6 * CHANCE < raised < 1.3 * CHANCE
    assert np.mean(np.any(np.abs(estimates) > 2.0, axis=1)) > 0.3


def test_an_error_that_no_chance_explains_is_told_alone():
    estimates = np.zeros(NUM_TESTS)
    estimates[3] = -3.6
    (finding,) = told(estimates, np.full(NUM_TESTS, 0.1))
    assert finding.id == "instrument_beyond_prior"
    assert "load_timing[test_3]" in finding.message
    assert "3.6 prior standard deviations" in finding.message
    assert finding.values["familywise_p"] == pytest.approx(0.0032, rel=0.1)


def test_an_instrument_alone_may_be_as_far_off_as_chance_takes_it():
    assert not told([2.25], [0.05])
    assert told([2.4], [0.05])


def test_what_the_tests_hardly_inform_counts_little():
    """An estimate that the prior holds at its centre is not there by chance when it is not."""
    estimates, known, hardly = [2.5, *np.zeros(9)], 0.1, np.sqrt(0.98)
    assert told(estimates, [known, *np.full(9, hardly)])
    assert not told(estimates, np.full(10, known))
