"""Parameters that do not give back the test that they were fitted to are told of, and why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heatrun.posterior.fit_checks import fit_findings
from heatrun.posterior.posterior import weighted_draws
from heatrun.posterior.predict import predict


def told(draws, id="calibration_outside_band"):
    found = fit_findings(draws, [predict(draws, draws.fit.problem.tests[0])])
    return [each for each in found if each.id == id]


def test_a_sound_fit_says_nothing(fitted):
    assert not told(weighted_draws(fitted))


@pytest.mark.parametrize("off", [-8.0, 8.0])
def test_draws_elsewhere_than_the_fit_are_a_finding(fitted, off):
    draws = weighted_draws(fitted)
    place = fitted.problem.parameters.index("Req_w")
    moved = draws.vectors.copy()
    moved[..., place] += off * np.sqrt(fitted.covariance[place, place])
    (finding,) = told(replace(draws, vectors=moved))
    assert finding.severity == "warning"
    assert finding.where == fitted.problem.tests[0].name
    assert finding.values["coverage_95"] < 0.85
    assert "own 95 % band" in finding.message


@pytest.mark.parametrize(("off_K", "is_told"), [(0.0, False), (0.4, False), (2.0, True)])
def test_heat_that_keeps_a_network_from_its_tests_is_a_finding(fitted, off_K, is_told):
    away = tuple(rows + off_K for rows in fitted.residual)
    found = told(weighted_draws(replace(fitted, residual=away)), "heat_overrules_tests")
    assert bool(found) == is_told
    for finding in found:
        reached, rmse = fitted.stats["rmse_white_K"], finding.values["rmse_K"]
        assert finding.values["unmodelled_heat"] == pytest.approx(0.0015 * 0.5 * reached / rmse)
        assert "unmodelled_heat = " in finding.remedy
