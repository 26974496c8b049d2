"""What an effect must show before it enters the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ...inference.effect_parameters import amplitudes
from ...io.quantities import quantity as printed
from ...io.quantities import rounded
from ..screening.engine import Engine, Refit
from ..screening.library import Candidate
from ..screening.screen import VISIBLE_K, Score

WORTH_A_REFIT = 3.0
"""Log Bayes factor of the screening from which on a candidate is refitted [nat]."""

BETTER_SHARE, BETTER_K = 0.10, 0.05
"""By how much the error on tests left out must fall: of itself [1], and in kelvin."""

RELEVANT_K, RELEVANT_NOISE, RELEVANT_SHARE = VISIBLE_K, 0.5, 0.15
"""Least gap that an effect must close: in kelvin, in parts of the noise of a block mean [1], and
of the gap that the effects before it have closed [1], whose laws are no exact copies of the
machine's either."""

SLACK = 0.15
"""An amplitude may lie outside of its physical range by two standard deviations, and by this share
of the range at most [1]: the law that carries it is not the machine's own."""

SEPARATED = 3.0
"""Standard deviations that an amplitude must lie from its null [1], by the profile of its
likelihood."""

NORMAL_95 = 1.96
"""Half of a 95 % interval in standard deviations [1]."""


@dataclass(frozen=True)
class Rival:
    """A candidate, refitted with everything else.

    Attributes:
        candidate: The candidate.
        score: How it fared in the screening.
        refit: The joint fit.
        delta_log_evidence: Over the model without it [nat].
        rmse_K: Of the calibration tests with it [K].
        gap_K: What it closes of the gap, the root of the difference of mean squares [K].
        left_out_K: Root mean square error on parts left out, with it [K].
        left_out_without_K: And without it [K].
        drop: By how much it lowers the sum of squares of residuals and scores [1].
        least_K: Gap that it must close to matter [K].
        values: Its parameters [their units].
        sd: Their standard deviations [their units].
        is_physical: Whether its parameters are physical and its amplitude significant.
        reason: Why it is rejected; empty if it is not.
        held_out_K: Errors on each held-out test without and with it, where that was looked at [K].
        amplitude_sd: Standard deviations that its amplitudes are judged by, as
            `effect_values.amplitude_sd` [their units]; those of `sd` where it names none.
    """

    candidate: Candidate
    score: Score
    refit: Refit
    delta_log_evidence: float
    rmse_K: float
    gap_K: float
    left_out_K: float
    left_out_without_K: float
    drop: float
    least_K: float
    values: dict[str, float]
    sd: dict[str, float]
    is_physical: bool = True
    reason: str = ""
    held_out_K: tuple[tuple[float, float], ...] = ()
    amplitude_sd: Mapping[str, float] = field(default_factory=dict)


def gap(engine: Engine, before: Refit, after: Refit) -> float:
    """Return what a model closes of the gap: the root of the difference of mean squares [K]."""
    fall = engine.rms_K(before.residual) ** 2 - engine.rms_K(after.residual) ** 2
    return float(np.sqrt(max(fall, 0.0)))


def least_gap(present: Refit, closed_K: float) -> float:
    """Return the gap that an effect must close to matter [K].

    Args:
        present: Fit of the model without it.
        closed_K: What the effects before it have closed [K].
    """
    return max(RELEVANT_K, RELEVANT_NOISE * float(present.noise.total()), RELEVANT_SHARE * closed_K)


def judged(rival: Rival) -> Rival:
    """Return the rival with the reason why it is rejected, if it is."""
    unsound = refusal(
        rival.candidate, rival.values, rival.sd, rival.drop, amplitude_sd=rival.amplitude_sd
    )
    return replace(rival, is_physical=not unsound, reason=_reason(rival, unsound))


def _reason(rival: Rival, unsound: str) -> str:
    """Return why a candidate is rejected, empty if it is not."""
    if rival.delta_log_evidence < WORTH_A_REFIT:
        return f"the data do not favour it (log Bayes factor {rival.delta_log_evidence:+.1f})"
    if unsound:
        return unsound
    if rival.gap_K < rival.least_K:
        return (
            f"it closes {rival.gap_K:.2f} K of the gap; less than {rival.least_K:.2f} K is within "
            "what lumping, instruments and noise leave"
        )
    fall = rival.left_out_without_K - rival.left_out_K
    if fall < BETTER_K or fall < BETTER_SHARE * rival.left_out_without_K:
        return (
            f"it does not pass cross-validation (RMSE {rival.left_out_without_K:.2f} K "
            f"without it, {rival.left_out_K:.2f} K with it)"
        )
    return ""


def refusal(
    candidate: Candidate,
    values: Mapping[str, float],
    sd: Mapping[str, float],
    drop: float,
    *,
    amplitude_sd: Mapping[str, float] | None = None,
) -> str:
    """Return why an effect cannot be what was found, empty if it can.

    Args:
        candidate: The effect.
        values: Its parameters [their units].
        sd: Their standard deviations [their units].
        drop: By how much the effect lowers the sum of squares of residuals and scores [1].
        amplitude_sd: As in `Rival`.
    """
    card = candidate.kind.card
    for name, quantity in card.parameters.items():
        value = values[name]
        if quantity.null is None:
            continue
        reach = quantity.high - quantity.low
        slack = min(max(0.02 * reach, 2.0 * sd[name]), SLACK * reach)
        low, high = min(quantity.low, quantity.null), max(quantity.high, quantity.null)
        if not low - slack <= value <= high + slack:
            return (
                f"{name} = {printed(rounded(value), quantity.unit)} is not physical "
                f"(expected {low:g} to {high:g})"
            )
    # The profile of the amplitude, not its standard deviation: where capacity and time constant of
    # a body go together, neither has a small one, and yet without the body the fit is far worse.
    if drop < SEPARATED**2:
        return "its amplitude is not significantly different from zero"
    return holds_null(candidate, values, {**sd, **(amplitude_sd or {})})


def holds_null(
    candidate: Candidate, values: Mapping[str, float], amplitude_sd: Mapping[str, float]
) -> str:
    """Return why an effect may as well be absent, empty if it may not.

    A better fit does not show that: a refit may have moved all else and left the effect where it
    vanishes.

    Args:
        candidate: The effect.
        values: Its parameters [their units].
        amplitude_sd: Standard deviations of its amplitudes [their units].
    """
    told = []
    for name in amplitudes(candidate.kind):
        quantity = candidate.kind.card.parameters[name]
        assert quantity.null is not None
        half = NORMAL_95 * amplitude_sd[name]
        if abs(values[name] - quantity.null) > half:
            return ""
        low, high = (printed(rounded(values[name] + side * half), quantity.unit)
                     for side in (-1.0, 1.0))  # fmt: skip
        told.append(f"{name} from {low} to {high} holds {quantity.null:g}")
    return f"its 95 % interval holds no effect at all ({', '.join(told)})"
