"""What a posterior and its predictions show of a model that does not suit the tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...bench.record import Finding
from ...motor import HEAT_LIMITS
from ..bodies import BodyCourse
from ..posterior import Posterior
from ..predict import Prediction
from .held_heat import distance, is_overruled
from .prior_checks import prior_findings

LEAST_COVERAGE = 0.85
"""Share of held-out readings inside the 95 % band below which the model counts as off [1]."""

BODY_K, BODY_SHARE = 2.0, 0.1
"""Root mean square error of a measured body [K], and as a share of its span [1], up to which it
counts as one with its node: a point is no mean of a body."""


def fit_findings(posterior: Posterior, predictions: Sequence[Prediction]) -> list[Finding]:
    """Return findings on the tests, held out or not, and on estimates that priors do not expect.

    Args:
        posterior: Draws of a calibrated network.
        predictions: Of all tests.
    """
    there = [p for p in predictions if p.is_there]
    tests = [_held_out(p) if p.is_held_out else _fitted(p) for p in there]
    bodies = [_body(p, body) for p in there for body in p.bodies]
    found = [each for each in (_overruled(posterior), *tests, *bodies) if each is not None]
    return [*found, *prior_findings(posterior)]


def _overruled(posterior: Posterior) -> Finding | None:
    """Return the finding that unmodelled heat keeps the network from tests that it could follow."""
    fit = posterior.fit
    if not is_overruled(fit):
        return None
    rmse, reached = distance(fit)
    usual = fit.problem.model.adequacy.unmodelled_heat
    less = max(0.5 * usual * reached / rmse, HEAT_LIMITS[0])
    return Finding(
        id="heat_overrules_tests",
        severity="warning",
        message=f"the network runs {rmse:.1f} K (RMSE of all readings) from the tests that it was "
        f"fitted to, where plain least squares reaches {reached:.1f} K: what it misses goes as "
        "unmodelled heat, and the parameters follow the quick changes alone.",
        where=fit.problem.label,
        remedy=f"If the parameters are to give back these tests, allow less unmodelled heat: "
        f"unmodelled_heat = {less:.1g} under [adequacy] in the motor file (now {usual:.2g}). A "
        "network with more nodes may do without.",
        values={"rmse_K": rmse, "rmse_white_K": reached, "unmodelled_heat": less},
    )


def _body(prediction: Prediction, body: BodyCourse) -> Finding | None:
    """Return the finding that a measured body is not where the model puts its node."""
    rmse = float(np.sqrt(np.mean(body.error**2)))
    span = float(np.nanmax(body.measured) - np.nanmin(body.measured))
    is_covered = body.coverage_95() >= LEAST_COVERAGE
    if is_covered or rmse <= max(BODY_K, BODY_SHARE * span):
        return None
    name, words = prediction.test.name, prediction.model.words
    said = "was fitted" if body.is_fitted else "took no part in the fit"
    return Finding(
        id="body_disagrees",
        severity="warning",
        message=f"{body.channel}, which {said}, runs {rmse:.1f} K (root mean square, largest "
        f"{np.max(np.abs(body.error)):.1f} K) from the {body.node} of the {words}: only "
        f"{100.0 * body.coverage_95():.0f} % of its readings lie in the 95 % band.",
        where=name,
        remedy=f"A network in which {body.channel} has a node of its own may suit the machine: "
        "give it with --model FILE.toml. Or the sensor sits elsewhere: check the mapping.",
        test=name,
        values={"rmse_K": rmse, "coverage_95": body.coverage_95()},
    )


def _held_out(prediction: Prediction) -> Finding | None:
    coverage = prediction.coverage_95()
    if not coverage < LEAST_COVERAGE:
        return None
    name = prediction.test.name
    return Finding(
        id="holdout_outside_band",
        severity="warning",
        message=f"{name} (holdout): only {100.0 * coverage:.0f} % of the readings lie in the 95 % "
        f"band of the {prediction.model.words} (RMSE {prediction.rmse_K:.2f} K, largest error "
        f"{prediction.largest_K:.1f} K): the model does not carry over to this test.",
        where=name,
        remedy="Do not use these parameters for such loads. Compare both records with `heatrun "
        "check`, search for the missing effect with `heatrun discover`, or calibrate on both.",
        test=name,
        values={"coverage_95": coverage, "rmse_K": prediction.rmse_K},
    )


def _fitted(prediction: Prediction) -> Finding | None:
    """Return the finding that the draws do not give back a test that the network was fitted to."""
    coverage = prediction.coverage_95()
    if not coverage < LEAST_COVERAGE:
        return None
    name = prediction.test.name
    return Finding(
        id="calibration_outside_band",
        severity="warning",
        message=f"{name} (calibration): only {100.0 * coverage:.0f} % of the readings that the "
        f"{prediction.model.words} was fitted to lie in its own 95 % band (RMSE "
        f"{prediction.rmse_K:.2f} K): the parameters do not stand for this test.",
        where=name,
        remedy="Do not use these parameters. The network or the noise does not suit the test: "
        "search for the missing effect with `heatrun discover`, or calibrate without --quick.",
        test=name,
        values={"coverage_95": coverage, "rmse_K": prediction.rmse_K},
    )
