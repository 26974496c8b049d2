"""Parameters that do not give back the test that they were fitted to are told of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heatrun.inference.fitting.fit_checks import fit_findings
from heatrun.inference.posterior import weighted_draws
from heatrun.inference.predict import predict


def told(draws):
    found = fit_findings(draws, [predict(draws, draws.fit.problem.tests[0])])
    return [each for each in found if each.id == "calibration_outside_band"]


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
