"""What a posterior and its predictions show of a model that does not suit the tests.

Nor may the tests suit one another. A machine is mounted anew, a coolant is set by hand, a duct is
moved: capacities and resistances then differ a little from test to test, and a joint fit that does
not know it is too sure. With a change of each parameter in each test, of one standard deviation s
of its logarithm, the restricted likelihood says how large s is; where it is above chance, the
changes become parameters.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.special import erfc

from ..fit.fit import fit
from ..fit.fit_result import Fit
from ..fit.restricted import estimate_noise, log_evidence
from ..model.bodies import BodyCourse
from ..model.model_parameters import changing
from ..model.parameters import Slot
from ..model.problem import Problem
from ..record.motor import HEAT_LIMITS, Adequacy
from ..record.record import Finding
from .posterior import Posterior
from .predict import Prediction

BEYOND = 2.0
"""Standard deviations of its prior that an estimate may be from the centre [1]."""

CHANCE = 0.02
"""Share of calibrations in which instruments as good as declared may raise the finding [1]. All
findings together may do so in 0.05, of which `missing_effect` takes 0.01."""


def prior_findings(posterior: Posterior) -> list[Finding]:
    """Return findings on the network's parameters and the instruments' errors."""
    values = posterior.values()
    scores = [
        (slot, slot.parameter.score(values[slot.name]))
        for slot in posterior.fit.slots
        if slot.parameter.role in ("instrument", "network", "resistance")
    ]
    informed = [
        1.0 - float(np.var(draws)) for slot, draws in scores if slot.parameter.role == "instrument"
    ]
    found = []
    for slot, draws in scores:
        median, score = float(np.median(values[slot.name])), float(np.median(draws))
        if abs(score) <= BEYOND:
            continue
        if slot.parameter.role != "instrument":
            found.append(_conflict(posterior, slot, median, score))
        elif (p := instruments_p(score, informed)) < CHANCE:
            found.append(_beyond(posterior, slot, median, score, p))
    return found


def instruments_p(score: float, informed: Sequence[float]) -> float:
    """Return the chance that any of several errors of instruments lies so far from its centre.

    Where the prior holds, the estimate of an error is spread about the centre by what the tests
    take off the prior's variance: an error that they leave open stays at the centre.

    Args:
        score: Distance from the centre [prior standard deviations].
        informed: Of each error, share of the prior's variance that the tests take off [1].
    """
    spread = np.sqrt(2.0 * np.clip(informed, 1e-6, 1.0))
    return float(min(1.0, np.sum(erfc(abs(score) / spread))))


def _conflict(posterior: Posterior, slot: Slot, median: float, score: float) -> Finding:
    """Return the finding that the tests and a prior of the network contradict each other."""
    parameter = slot.parameter
    low, high = parameter.prior_interval_95()
    unit = parameter.unit
    return Finding(
        id="prior_conflict",
        severity="warning",
        message=f"the tests put {slot.name} ({parameter.meaning}) at {median:.3g} {unit}, its "
        f"prior at {low:.3g} to {high:.3g} {unit} ({parameter.basis}): {abs(score):.1f} standard "
        "deviations apart. The interval is drawn towards the prior.",
        where=posterior.fit.problem.label,
        remedy="Check the units of current, losses and temperatures. If the machine is such, state "
        f"a wider prior with [parameters.{parameter.name}] in the motor file; if it is not, the "
        "network does not suit it.",
        values={slot.name: median, "prior_sd": score},
    )


def _beyond(posterior: Posterior, slot: Slot, median: float, score: float, p: float) -> Finding:
    """Return the finding that an instrument's error is larger than its prior makes likely."""
    parameter = slot.parameter
    low, high = parameter.prior_interval_95()
    return Finding(
        id="instrument_beyond_prior",
        severity="warning",
        message=f"the fit puts {slot.name} ({parameter.meaning}) at {median:.3g} "
        f"{parameter.unit}, {abs(score):.1f} prior standard deviations from what is "
        f"expected ({low:.3g} to {high:.3g} {parameter.unit}): it may stand for an effect "
        "that the network misses, and the other parameters are then off too.",
        where=posterior.fit.problem.label,
        remedy=f"Check the instrument. If such an error is possible, widen its prior with "
        f"[parameters.{parameter.name}] in the motor file; if not, search with `heatrun "
        "discover`.",
        values={slot.name: median, "prior_sd": score, "familywise_p": p},
    )


LEAST_COVERAGE = 0.85
"""Share of held-out readings inside the 95 % band below which the model counts as off [1]."""

BODY_K, BODY_SHARE = 2.0, 0.1
"""Root mean square error of a measured body [K], and as a share of its span [1], up to which it
counts as one with its node: a point is no mean of a body."""


def fit_findings(posterior: Posterior, predictions: Sequence[Prediction]) -> list[Finding]:
    """Return findings on the tests, held out or not, and on estimates that priors do not expect."""
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


OVERRULED, OVERRULED_K = 3.0, 0.5
"""Times that a fit may be farther from its tests than least squares with white noise [1], and how
far it must be at all [K]: of 62 simulated machines with mild causes one was beyond."""

FOLLOWS = 1.5
"""Times that distance at which a network counts as following its tests again [1]."""

HELD = "heat_held_down"
"""Id of the finding."""

LESS = 10.0**-0.5
"""Unmodelled heat of each further fit over that of the one before [1]."""


def distance(found: Fit) -> tuple[float, float]:
    """Return how far a fit is from its tests, and how far least squares is (RMSE) [K]."""
    reached = found.stats.get("rmse_white_K", math.nan)
    return found.problem.rmse_K(np.concatenate(found.residual)), reached


def is_overruled(found: Fit, times: float = OVERRULED) -> bool:
    """Return whether unmodelled heat keeps a network so many times as far from tests as it could
    follow them.
    """
    rmse, reached = distance(found)
    return rmse > max(times * reached, OVERRULED_K)


def holding_heat(
    found: Fit, *, refit: Callable[[Problem], Fit] | None = None, seed: int = 0
) -> Fit:
    """Return the fit, or one with so much less unmodelled heat that the network follows its tests.

    Heat that a network misses may be as slow as what it has to explain. Where it misses much, such
    as a body measured far from its node, all that is slow goes as heat, and the parameters follow
    the quick changes alone: such a network may run ten kelvin from tests to which least squares
    brings it within two.

    Where none follows, it is the nearest of those that were tried. What a motor file states under
    `[adequacy]` stays as it is.

    Args:
        found: The fit.
        refit: Fits the problem with less heat; by default `fit`.
        seed: As `fit`.
    """
    problem = found.problem
    usual = problem.model.adequacy
    if not is_overruled(found) or problem.motor.adequacy != Adequacy():
        return found
    held, adequacy, nearest = found, usual, found
    while is_overruled(held, FOLLOWS) and adequacy.unmodelled_heat > HEAT_LIMITS[0]:
        least = max(LESS * adequacy.unmodelled_heat, HEAT_LIMITS[0])
        adequacy = replace(adequacy, unmodelled_heat=least)
        model = replace(problem.model, adequacy=adequacy)
        if refit is None:
            held = fit(Problem.of(model, problem.motor, problem.tests), seed=seed)
        else:
            held = refit(replace(problem, model=model))
        nearest = min(nearest, held, key=lambda each: distance(each)[0])
    if nearest is found:  # a search may end elsewhere, however little heat there is
        return found
    return replace(nearest, findings=(*nearest.findings, _finding(found, nearest)))


def _finding(before: Fit, held: Fit) -> Finding:
    usual, less = (each.problem.model.adequacy.unmodelled_heat for each in (before, held))
    (rmse_before, reached), (rmse, _) = distance(before), distance(held)
    return Finding(
        id=HELD,
        severity="warning",
        message=f"the network misses so much that with the usual unmodelled heat ({usual:.2g} of "
        f"the mean loss) it would run {rmse_before:.1f} K (RMSE of all readings) from the tests, "
        f"where plain least squares reaches {reached:.1f} K. Held to {less:.1g}, it runs "
        f"{rmse:.1f} K from them. The 95 % intervals do not allow for what it misses.",
        where=held.problem.label,
        remedy="A network with more nodes, or with the missing effect (`heatrun discover`), may do "
        "without. Check where measured bodies are placed under [sensors].",
        values={
            "rmse_K": rmse,
            "rmse_before_K": rmse_before,
            "rmse_white_K": reached,
            "unmodelled_heat": less,
        },
    )


SIZES = (0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64)
"""Standard deviations of the changes that are tried [1]."""

NONE = 1e-4
"""Stands for no change at all, so that both sides are computed alike [1]."""

CLEAR = 5.0
"""Log likelihood ratio from which on tests count as different [nat]: the largest of a size that
is zero in truth is above it in one of a thousand calibrations (half a chi-squared of one degree
above 10)."""


class Scatter(NamedTuple):
    """How much the parameters change from test to test."""

    size: float  # Standard deviation of the logarithm [1].
    gain: float  # Log likelihood ratio against none [nat].


def test_to_test(found: Fit) -> Scatter:
    """Return the changes from test to test that fit the residuals best.

    Around the fit the model is linear in the logarithms of its parameters. The noise is estimated
    anew for each size, for it has swallowed what the tests do not have in common.
    """
    problem = found.problem
    residual, jacobian = np.concatenate(found.residual), np.concatenate(found.jacobian)
    names = [parameter.name for parameter in changing(problem.model, problem.motor)]
    places = [i for i, slot in enumerate(found.slots) if slot.name in names]
    if not places:
        return Scatter(0.0, 0.0)
    per_log = 1.0 / np.array([found.slots[place].parameter.sd for place in places])
    apart = np.asarray(block_diag(*[rows[:, places] * per_log for rows in found.jacobian]))
    z = np.concatenate([found.z, np.zeros(apart.shape[1])])

    def likelihood(size: float) -> float:
        linear = z, residual, np.concatenate([jacobian, size * apart], axis=1)
        noise_z = estimate_noise(problem, *linear)
        return log_evidence(problem, noise_z, *linear)

    without = likelihood(NONE)
    gains = {size: likelihood(size) - without for size in SIZES[1::2]}
    if max(gains.values()) > 0.0:
        gains |= {size: likelihood(size) - without for size in SIZES[::2]}
    best = max(gains, key=lambda size: gains[size])
    return Scatter(best, gains[best])


def fit_with_changes(found: Fit, *, beyond: float = -np.inf, seed: int = 0) -> Fit:
    """Return the fit with changes from test to test, where the tests show them; else as it is.

    Args:
        found: A fit.
        beyond: Log Bayes factor of the best network with an effect, which may be what tells the
            tests apart [nat].
        seed: As `fit`.
    """
    problem = found.problem
    if len(problem.tests) < 2 or problem.model.change_sd:
        return found
    scatter = test_to_test(found)
    if scatter.gain < max(CLEAR, beyond):
        return found
    model = replace(problem.model, change_sd=scatter.size)
    again = fit(Problem.of(model, problem.motor, problem.tests), seed=seed)
    stats = {**again.stats, "test_to_test_gain": scatter.gain}
    held = [finding for finding in found.findings if finding.id == HELD]
    return replace(again, stats=stats, findings=(*again.findings, *held))


def changes_finding(posterior: Posterior) -> Finding | None:
    """Return the finding that tests disagree; None where they do not."""
    problem = posterior.fit.problem
    size = problem.model.change_sd
    if not size:
        return None
    values = posterior.values()
    changes = {
        slot.name: float(np.median(values[slot.name]))
        for slot in posterior.fit.slots
        if slot.parameter.role == "change"
    }
    largest = sorted(changes, key=lambda name: -abs(changes[name]))[:3]
    said = ", ".join(
        f"{name.replace('_change[', ' in ').rstrip(']')} {100.0 * np.expm1(changes[name]):+.0f} %"
        for name in largest
    )
    return Finding(
        id="tests_disagree",
        severity="warning",
        message=f"the tests ask for different parameters of the {problem.model.words}, by some "
        f"{100.0 * size:.0f} % from test to test (log likelihood ratio "
        f"{posterior.fit.stats['test_to_test_gain']:.0f}). Largest: {said}. The 95 % intervals "
        "and the bands of other tests allow for such changes.",
        where=problem.label,
        remedy="Compare mounting, cooling and clocks of the tests. Calibrate the odd one out by "
        "itself, or search with `heatrun discover` for an effect that tells them apart.",
        values={"change_sd": size, **changes},
    )
