"""Two networks on the same records: errors, scores, and what it means in words."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from msgspec import UNSET

from ..fit.fit import ljung_box
from ..results.model import (
    BodyRow,
    Comparison,
    FittedModel,
    NetworkVerdict,
    Peak,
    ResidualRow,
    Threshold,
)
from ..results.values import Role, known, number
from .predict import Prediction, ScoreDifference, block_scores, standard_error

LIMITS_K = (1.0, 2.0, 5.0)
"""Errors that an engineer asks about [K]."""

DECISIVE = 5.0
"""Log Bayes factor from which on an order is called for [nat]; odds of 150 to 1."""


def residual_row(prediction: Prediction, role: Role) -> ResidualRow:
    """Return the error figures of one prediction, as they stand in `fit.json`."""
    error = prediction.residual[prediction.test.is_observed]
    return ResidualRow(
        test=prediction.test.name,
        role=role,
        rmse_K=float(np.sqrt(np.mean(error**2))),
        mae_K=float(np.mean(np.abs(error))),
        max_K=float(np.max(np.abs(error))),
        end_K=float(np.mean(error[-max(1, error.size // 50) :])),
        whiteness_p=ljung_box(prediction.innovations()),
        coverage_95=prediction.coverage_95(),
        log_score=prediction.log_score(),
        log_score_se=standard_error(block_scores(prediction)),
    )


def body_rows(prediction: Prediction, role: Role) -> list[BodyRow]:
    """Return the error figures of the measured bodies of one prediction."""
    return [
        BodyRow(
            test=prediction.test.name,
            role=role,
            body=body.channel,
            node=body.node,
            fitted=body.is_fitted,
            rmse_K=float(np.sqrt(np.mean(body.error**2))),
            mean_K=float(np.mean(body.error)),
            max_K=float(np.max(np.abs(body.error))),
            coverage_95=body.coverage_95(),
        )
        for body in prediction.bodies
    ]


def good_until(prediction: Prediction, limit_K: float) -> float | None:
    """Return the time from which on a prediction errs by more than a limit [s], None if never."""
    beyond = np.flatnonzero(np.abs(np.nan_to_num(prediction.residual)) > limit_K)
    return None if beyond.size == 0 else float(prediction.test.time[beyond[0]])


def compare(
    first: Sequence[Prediction], second: Sequence[Prediction], roles: Sequence[Role]
) -> Comparison:
    """Return the comparison of two networks over the same tests, with sentences.

    Args:
        first: Predictions of the network with fewer nodes, one per test.
        second: Those of the other one, in the same order.
        roles: `"calibration"` or `"holdout"`, one per test.
    """
    words, thresholds, peaks = [], [], []
    for one, two, role in zip(first, second, roles, strict=True):
        if not (one.is_there and two.is_there):
            continue
        name = one.test.name
        ends = []
        for limit in LIMITS_K:
            until = good_until(one, limit)
            thresholds.append(
                Threshold(
                    test=name, limit_K=limit, until_s=until, second_until_s=good_until(two, limit)
                )
            )
            ends.append(f"within {limit:g} K {_until(until)}")
        rows = residual_row(one, role), residual_row(two, role)
        words.append(
            f"{name} ({role}): {one.model.title}: RMSE {rows[0].rmse_K:.2f} K, maximum error "
            f"{rows[0].max_K:.1f} K ({', '.join(ends)}); {two.model.title}: RMSE "
            f"{rows[1].rmse_K:.2f} K, maximum error {rows[1].max_K:.1f} K."
        )
        top = int(np.nanargmax(one.test.measured))
        peak = Peak(
            test=name,
            time_s=float(one.test.time[top]),
            measured_degC=float(one.test.measured[top]),
            first_degC=float(one.median[top]),
            second_degC=float(two.median[top]),
        )
        peaks.append(peak)
        words.append(
            f"{name}: error at the measured peak of {peak.measured_degC:.1f} °C: "
            f"{one.model.title} {peak.first_degC - peak.measured_degC:+.1f} K, "
            f"{two.model.title} "
            f"{peak.second_degC - peak.measured_degC:+.1f} K."
        )
    return Comparison(words=tuple(words), thresholds=tuple(thresholds), peak=tuple(peaks))


def verdict(
    models: Mapping[str, FittedModel], scores: ScoreDifference | None = None
) -> NetworkVerdict:
    """Return which of two networks the data favour, from the evidence and the held-out scores.

    Args:
        models: The entries of `fit.json` by name, the network with fewer nodes first.
        scores: Difference of their held-out scores; None where its standard error is not known.
    """
    names = list(models)
    titles = {name: model.title for name, model in models.items()}
    if len(names) != 2:
        fitted = " and ".join(titles.values())
        return NetworkVerdict(
            order="undecided",
            sentence=f"Only the {fitted} was calibrated: there is no comparison."
            if len(names) == 1
            else f"Calibrated: {fitted}. Two networks are compared at a time.",
            log_bayes_factor=None,
        )
    small, large = names
    factor = number(models[large].evidence.log_evidence) - number(
        models[small].evidence.log_evidence
    )
    held = _held_out(models[small], models[large], scores)
    bodies = (known(models[name].bodies) or () for name in names)
    fitted = [sorted({row.body for row in rows if row.fitted}) for rows in bodies]
    if fitted[0] != fitted[1]:
        return _by_held_out(models, fitted, scores, held)
    if math.isnan(factor):
        return NetworkVerdict(
            order="undecided",
            sentence=f"The networks cannot be compared: the evidence of one is not known.{held}",
            log_bayes_factor=None,
        )
    if factor > DECISIVE:
        name, text = large, f"The data favour the {titles[large]}"
    elif factor < -DECISIVE:
        name, text = small, f"The data favour the {titles[small]}"
    else:
        name, text = "undecided", f"The data do not decide between {' and '.join(titles.values())}"
    return NetworkVerdict(
        order=name,
        sentence=f"{text} (log Bayes factor of {large} to {small}: {factor:+.0f}; beyond "
        f"±{DECISIVE:g} it decides).{held}",
        log_bayes_factor=factor,
        log_score_difference=UNSET if scores is None else scores.difference,
        log_score_difference_se=UNSET if scores is None else scores.standard_error,
    )


def _by_held_out(
    models: Mapping[str, FittedModel],
    fitted: Sequence[Sequence[str]],
    scores: ScoreDifference | None,
    held: str,
) -> NetworkVerdict:
    """Return the verdict on networks that were not fitted to the same readings."""
    names = list(models)
    has = [
        f"the {model.title} to {', '.join(['the winding', *bodies])}"
        for model, bodies in zip(models.values(), fitted, strict=True)
    ]
    order = "undecided"
    if scores is not None and scores.is_decided:
        order = names[1] if scores.difference > 0.0 else names[0]
    return NetworkVerdict(
        order=order,
        sentence="The evidence of the networks cannot be compared, for they were fitted to other "
        f"readings: {' and '.join(has)}.{held or ' Hold a test out to see which predicts better.'}",
        log_bayes_factor=None,
        log_score_difference=UNSET if scores is None else scores.difference,
        log_score_difference_se=UNSET if scores is None else scores.standard_error,
    )


def _held_out(small: FittedModel, large: FittedModel, scored: ScoreDifference | None) -> str:
    """Return which network predicts the held-out tests better, by error and by log score."""
    pair = small, large
    rows = [[row for row in model.residuals if row.role == "holdout"] for model in pair]
    if not all(rows):
        return ""
    errors = [float(np.sqrt(np.mean([row.rmse_K**2 for row in of]))) for of in rows]
    scores = [float(np.mean([number(row.log_score) for row in of])) for of in rows]
    closer = pair[int(np.argmin(errors))]
    likelier = pair[int(np.argmax(scores))]
    by_error = f"RMSE ({large.title} {errors[1]:.2f} K, {small.title} {errors[0]:.2f} K)"
    sure = (
        ""
        if scored is None
        else f"; difference {scored.difference:+.2g}, standard error {scored.standard_error:.2g}"
    )
    by_score = (
        f"mean log score per block ({large.title} {scores[1]:.2f}, {small.title} "
        f"{scores[0]:.2f}{sure})"
    )
    if scored is not None and not scored.is_decided:
        return (
            " Which network predicts the held-out tests better is not decided, the difference of "
            f"the log scores being within two standard errors: {by_error}, {by_score}."
        )
    if closer is likelier:
        return f" The {closer.title} predicts the held-out tests better: {by_error}, {by_score}."
    return (
        f" On the held-out tests the {closer.title} has the lower {by_error}; the "
        f"{likelier.title} has the better {by_score}."
    )


def _until(until: float | None) -> str:
    return "throughout" if until is None else f"until {until / 60:.1f} min"
